"""Asking the autopilot for a mode: for how long, and what is given back."""

from __future__ import annotations

from asvhil.supervisor.mode_request import ModeRequest
from asvhil.supervisor.reasons import Reason, explain

S = 1_000_000_000
T_NS = 1_000 * S


def request() -> ModeRequest:
    return ModeRequest("MANUAL", 3.0)


def test_nothing_is_asked_for_before_the_mode_is_taken_or_given_back() -> None:
    mode = request()
    assert mode.advance(T_NS, "HOLD") is None and mode.advance(T_NS, None) is None
    mode.give_back(T_NS)
    assert mode.advance(T_NS, "MANUAL") is None, "nothing was changed"


def test_the_mode_is_asked_for_until_just_the_timeout() -> None:
    mode = request()
    mode.take(T_NS, "HOLD")
    assert mode.advance(T_NS, "HOLD") == "MANUAL"
    assert mode.failure(T_NS + 3 * S - 1, "HOLD") is None
    assert mode.failure(T_NS + 3 * S, "HOLD") == explain(Reason.MODE_NOT_ENTERED, mode="MANUAL")
    assert mode.failure(T_NS, "LOITER") == explain(Reason.MODE_CHANGED, mode="LOITER")
    assert mode.failure(T_NS, "INITIALISING") is None and mode.failure(T_NS, "MANUAL") is None


def test_what_stood_before_is_asked_for_until_it_stands_or_just_the_timeout() -> None:
    for after_ns, reported, asked in (
        (0, "MANUAL", "HOLD"),
        (3 * S - 1, "MANUAL", "HOLD"),
        (3 * S, "MANUAL", None),
        (0, "HOLD", None),
        (0, "LOITER", None),
        (0, None, None),
    ):
        mode = request()
        mode.take(T_NS - 9 * S, "HOLD")
        mode.taken()
        mode.give_back(T_NS)
        assert mode.advance(T_NS + after_ns, reported) == asked
        if asked is None:
            assert mode.advance(T_NS, "MANUAL") is None, "once for all"


def test_a_mode_that_nobody_chose_is_not_given_back() -> None:
    for stood in ("INITIALISING", "MANUAL"):
        mode = request()
        mode.take(T_NS, stood)
        mode.taken()
        mode.give_back(T_NS)
        assert mode.advance(T_NS, "MANUAL") is None
