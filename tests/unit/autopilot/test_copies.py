"""Copies of frames by a second way, and states that are older than one that was taken in."""

from __future__ import annotations

from typing import Any

import pytest

from asvhil.autopilot.copies import KEPT, KEPT_NS, ONE_BOAT_NS, Copies
from asvhil.io.mavlink.frames import dialect

MS = 1_000_000


def attitude(boot_ms: int) -> Any:
    return dialect.MAVLink_attitude_message(boot_ms, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


def test_one_way_has_no_copies() -> None:
    copies = Copies()
    assert not any(copies.is_copy(k * MS, "a", b"same") for k in range(20))


def test_what_another_peer_brings_again_is_a_copy_for_some_seconds() -> None:
    copies = Copies()
    assert not copies.is_copy(0, "a", b"x") and not copies.is_copy(0, "a", b"y")
    assert copies.is_copy(1400 * MS, "b", b"x"), "also of before the second way was heard"
    assert copies.is_copy(KEPT_NS - 1, "b", b"y") and not copies.is_copy(KEPT_NS + 1, "b", b"x")
    assert not copies.is_copy(KEPT_NS + 2, "b", b"z") and copies.is_copy(KEPT_NS + 3, "a", b"z"), "by either of them"
    assert not copies.is_copy(KEPT_NS + 4, "b", b"z"), "a way may repeat itself"


def test_it_remembers_no_more_than_a_few_seconds_of_frames() -> None:
    copies = Copies()
    copies.is_copy(0, "a", b"first")
    copies.is_copy(0, "b", b"second")
    for k in range(2 * KEPT):
        copies.is_copy(k, "a", b"%d" % k)
    assert len(copies._taken) <= KEPT and not copies.is_copy(2 * KEPT, "b", b"5")


def ways(copies: Copies, t_ns: int = 0) -> Copies:
    """Two peers of which it has shown that they pass on the same."""
    assert not copies.is_copy(t_ns, "a", b"same") and copies.is_copy(t_ns, "b", b"same")
    return copies


def test_a_state_that_is_older_than_that_of_another_way_is_no_news() -> None:
    """As where the way that is first loses a frame, and the late one brings it."""
    copies = ways(Copies())
    assert not copies.is_older(0, "a", attitude(9000), new_clock=False)
    assert copies.is_older(1, "b", attitude(7600), new_clock=False)
    assert not copies.is_older(2, "b", attitude(9000), new_clock=False)
    assert not copies.is_older(3, "b", attitude(7600), new_clock=False), "its own clock has gone back: it booted anew"
    assert not copies.is_older(4, "a", attitude(7500), new_clock=True)
    assert not copies.is_older(5, "a", dialect.MAVLink_ekf_status_report_message(1, 0, 0, 0, 0, 0), new_clock=False)


def test_outputs_and_fixes_are_dated_in_microseconds() -> None:
    copies = ways(Copies())
    new, old = (dialect.MAVLink_servo_output_raw_message(us, 0, *range(1501, 1509)) for us in (5_000_000, 3_600_000))
    wrapped = dialect.MAVLink_servo_output_raw_message(100, 0, *range(1501, 1509))
    assert not copies.is_older(0, "a", new, new_clock=False) and copies.is_older(1, "b", old, new_clock=False)
    last = dialect.MAVLink_servo_output_raw_message(2**32 - 1, 0, *range(1501, 1509))
    assert not copies.is_older(2, "a", last, new_clock=False)
    assert not copies.is_older(3, "b", wrapped, new_clock=False), "the counter has begun anew"


@pytest.mark.parametrize("since_ns", [None, ONE_BOAT_NS + 1])
def test_of_two_boats_with_one_number_the_younger_clock_is_not_late(since_ns: int | None) -> None:
    copies = Copies() if since_ns is None else ways(Copies())
    t_ns = since_ns or 0
    assert not copies.is_older(t_ns, "a", attitude(9000), new_clock=False)
    assert not copies.is_older(t_ns + 1, "b", attitude(7600), new_clock=False)
