"""How the motors are given back: with or without neutral before, how often it is said, and what it is called."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from asvhil.config import SupervisorConfig
from asvhil.supervisor.decision import Decision
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.supervisor.situation import StationSticks
from asvhil.supervisor.supervisor import NAMED_LATER_NS, RELEASE_REPEATS
from asvhil.types import FrontseatStatus, Phase, Radio
from tests.support.supervisor_bench import ESTIMATE, SupervisorBench, status

S_MS = 1_000
STRANGER = explain(Reason.TWO_VEHICLES, system=1)
NOTHING, RELEASE, NEUTRAL, BOTH = (False, False), (False, True), (True, False), (True, True)


def holding(told: dict[str, Any] | None = None, **config: object) -> SupervisorBench:
    bench = SupervisorBench(SupervisorConfig.model_validate(config))
    bench.status = status(**told or {})
    assert bench.hold() is None
    bench.drive()
    if told:
        bench.status = status(rc_us=(1600, 1500, 1400, 1500), **told)
    return bench


def said(decision: Decision) -> tuple[bool, bool]:
    """(neutral, release)."""
    assert not decision.drive and decision.phase is Phase.STANDBY
    return decision.neutral, decision.release


def ends(bench: SupervisorBench, spoil: dict[str, Any]) -> list[tuple[bool, bool]]:
    """What is said in the tick of the end, and in those after it."""
    for name, value in spoil.items():
        setattr(bench, name, value)
    return [said(bench.step()) for _ in range(8)]


ENDS: dict[str, tuple[dict[str, Any], bool]] = {  # and whether neutral goes before the release
    "pilot's stick": ({"status": status(rc_us=(1600, 1700, 1400, 1500))}, False),
    "another has the sticks": ({"status": status(rc_us=(1600, 1500, 1900, 1500))}, False),
    "station's stick": (
        {"station_sticks": (StationSticks(t_ns=0, sender=(255, 190), channels=((1, 1700),)),)},
        True,
    ),
    "transmitter": ({"status": status(rc_us=(1600, 1500, 1400, 1500), radio=Radio.LOST)}, True),
    "outputs": ({"fault": explain(Reason.OUTPUTS_DIFFER)}, True),
    "motion": ({"motion": explain(Reason.DRIFTED_OFF, metres=9.0)}, True),
    "stranger": ({"stranger": STRANGER}, True),
}


@pytest.mark.parametrize("name", ENDS)
def test_a_release_is_said_three_times_and_neutral_with_it_but_to_a_pilot(name: str) -> None:
    spoil, neutral_first = ENDS[name]
    expected = BOTH if neutral_first else RELEASE
    assert ends(holding(), spoil) == [expected] * RELEASE_REPEATS + [NOTHING] * (8 - RELEASE_REPEATS)


@pytest.mark.parametrize("name", ENDS)
def test_what_ends_a_hold_comes_before_what_would_have_it_wait(name: str) -> None:
    """The estimate is lost in the same tick, for which the hold alone would go on with neutral motors."""
    spoil, neutral_first = ENDS[name]
    assert ends(holding(), {**spoil, "estimate": None})[0] == (BOTH if neutral_first else RELEASE)


@pytest.mark.parametrize("name", ["outputs", "pilot's stick"])
def test_where_the_last_override_stands_neutral_goes_alone_for_two_ticks_before_the_release(name: str) -> None:
    spoil, _ = ENDS[name]
    if "status" in spoil:
        spoil = {"status": replace(spoil["status"], keeps_override=True)}
    assert ends(holding({"keeps_override": True}), spoil) == [NEUTRAL] * 2 + [BOTH] * 3 + [NOTHING] * 3


def test_a_new_hold_ends_the_release_of_the_last() -> None:
    bench = holding()
    assert said(bench.release()) == BOTH
    assert bench.hold() is None
    assert all(bench.step().drive and not bench.step().release for _ in range(5))


def test_while_the_link_is_lost_the_motors_are_neutral_for_the_whole_time_and_then_released() -> None:
    bench = holding(failsafe_neutral_s=2.0)
    bench.age_s = 3.0
    for _ in range(40):
        decision = bench.step()
        assert (decision.phase, decision.neutral, decision.release) == (Phase.FAILSAFE, True, False)
        assert not decision.link_ok
    assert [said(bench.step()) for _ in range(4)] == [BOTH] * 3 + [NOTHING]


def test_a_failure_that_passes_is_called_holding_again_and_the_next_has_its_whole_time() -> None:
    bench = holding()
    for _ in range(3):
        bench.estimate = replace(ESTIMATE, valid=False)
        assert all(bench.step().phase is Phase.FAILSAFE for _ in range(40))
        bench.estimate = ESTIMATE
        decision = bench.step()
        assert decision.drive and decision.why == explain(Reason.HOLDING) and decision.link_ok and decision.control_ok


def test_the_attempt_to_take_the_mode_ends_in_neutral_where_something_fails() -> None:
    bench = SupervisorBench(SupervisorConfig(take_mode=True))
    bench.status = status(mode="GUIDED")
    decision = bench.step(50)
    assert decision.why == explain(Reason.WAITING_FOR_HOLD) and decision.control_ok is True
    assert bench.hold() is None
    decision = bench.step()
    assert decision.why == explain(Reason.TAKING_MODE, mode="MANUAL") and decision.station is None
    assert ends(bench, {"estimate": None}) == [BOTH] * 3 + [NOTHING] * 5


# --- sticks that do not follow before they ever did -----------------------------------------------------------------

NEVER_SEEN = explain(Reason.OVERRIDES_IGNORED)


def test_sticks_that_never_showed_our_commands_are_told_as_what_that_means() -> None:
    bench = holding()
    bench.unverified = NEVER_SEEN
    bench.status = status(rc_us=(1600, 1500, 1900, 1500))
    decision = bench.step()
    assert decision.why == NEVER_SEEN and said(decision) == BOTH
    bench.status = status()
    assert bench.hold() == explain(Reason.PILOT_FIRST)


def test_a_stick_that_is_moved_at_first_is_the_pilots_whatever_was_seen() -> None:
    bench = SupervisorBench()
    bench.unverified = NEVER_SEEN
    assert bench.hold() is None and bench.step().drive
    bench.status = status(rc_us=(1500, 1500, 1900, 1500))
    decision = bench.step()
    assert decision.why.reason is Reason.STICK_MOVED and said(decision) == RELEASE


# --- mode, arming and the link --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("heartbeat_s", "heard_s", "why"),
    [
        (2.5, None, None),
        (2.6, None, Reason.NO_HEARTBEAT),
        (2.5, 2.5, None),
        (0.1, 2.6, Reason.NO_HEARTBEAT),
        (2.6, 0.1, Reason.MODE_UNKNOWN),
        (None, 0.1, Reason.MODE_UNKNOWN),
    ],
)
def test_a_hold_begins_while_the_autopilot_and_its_mode_are_heard(
    heartbeat_s: float | None, heard_s: float | None, why: Reason | None
) -> None:
    bench = SupervisorBench()
    bench.age_s, bench.heard_age_s = heartbeat_s, heard_s
    assert bench.hold() == (None if why is None else explain(why))


@pytest.mark.parametrize(("heartbeat_s", "heard_s"), [(5.1, 0.1), (None, 0.1), (0.1, 2.6)])
def test_it_goes_on_while_other_messages_come_and_the_mode_is_not_too_old(
    heartbeat_s: float | None, heard_s: float
) -> None:
    bench = holding()
    bench.age_s, bench.heard_age_s = 5.0, 2.5
    assert bench.step().drive and bench.step().link_ok
    bench.age_s, bench.heard_age_s = heartbeat_s, heard_s
    decision = bench.step()
    lost = Reason.HEARTBEAT_LOST if heard_s > 2.5 else Reason.MODE_UNKNOWN
    assert decision.neutral and not decision.drive and decision.why == explain(lost)


def test_a_hold_that_would_fail_at_once_is_neutral_from_its_first_tick() -> None:
    bench = SupervisorBench(SupervisorConfig(mode_timeout_s=1.0))
    bench.age_s = 2.0
    assert bench.hold() is None
    decisions = [bench.step() for _ in range(41)]
    assert all(d.neutral and not d.drive for d in decisions) and decisions[-1].phase is Phase.STANDBY


def test_a_watched_stick_that_our_commands_would_hide_is_a_refusal() -> None:
    bench = SupervisorBench(SupervisorConfig(stick_channels=(2, 3)))
    assert bench.hold() == explain(Reason.STICK_HIDDEN, channel=3)


def test_motors_that_would_not_follow_are_a_refusal() -> None:
    bench = SupervisorBench()
    bench.fault = explain(Reason.OUTPUTS_SWAPPED)
    assert bench.hold() == bench.fault


# --- a second vehicle, known for one only after it has ended the hold -----------------------------------------------


def ended_by_its_heartbeat() -> SupervisorBench:
    bench = holding()
    bench.status = status(armed=False)
    assert bench.step().why == explain(Reason.DISARMED)
    return bench


def after(bench: SupervisorBench, ms: float, stranger: Explanation | None = STRANGER) -> Explanation:
    bench.stranger = stranger
    return bench.step(round(ms)).why


def test_the_end_of_a_hold_is_named_after_the_stranger_that_is_known_soon_after() -> None:
    limit_ms = NAMED_LATER_NS / 1e6
    assert after(ended_by_its_heartbeat(), limit_ms) == STRANGER
    assert after(ended_by_its_heartbeat(), limit_ms + 1) == explain(Reason.DISARMED)
    bench = ended_by_its_heartbeat()
    assert after(bench, 50, None) == explain(Reason.DISARMED)
    assert after(bench, 50) == STRANGER
    other = explain(Reason.NOT_A_BOAT, kind="plane")
    assert after(bench, 50, other) == STRANGER, "once"
    assert after(bench, 50, None) == STRANGER


def test_what_did_not_end_a_hold_unasked_keeps_its_name() -> None:
    waiting = SupervisorBench()
    assert after(waiting, 50) == explain(Reason.WAITING_FOR_HOLD), "there was none"
    released = holding()
    released.release()
    assert after(released, 50) == explain(Reason.RELEASED), "the operator ended it"
    attempt = SupervisorBench(SupervisorConfig(take_mode=True))
    attempt.status = status(mode="GUIDED")
    assert attempt.hold() is None
    attempt.status = status(armed=False)
    attempt.step()
    assert after(attempt, 50).reason is Reason.NOT_ARMED, "it had not begun"


def test_a_release_after_the_end_is_the_last_word() -> None:
    bench = ended_by_its_heartbeat()
    bench.status = status()
    bench.step(2 * S_MS)
    assert bench.hold() is None and bench.release().why.reason is Reason.RELEASED
    assert after(bench, 50) == explain(Reason.RELEASED)


# --- an autopilot that has disarmed by itself, known only after that has ended the hold ----------------------------


def itself(why: str) -> FrontseatStatus:
    return status(armed=False, disarmed_itself=why)


@pytest.mark.parametrize(
    ("first", "limit_ms"),
    [
        *((Reason.OUTPUT_STUCK, 2000), (Reason.OUTPUTS_DIFFER, 2000)),
        *((Reason.HEARTBEAT_LOST, 10000), (Reason.OVERRIDE_NOT_FOLLOWED, 10000)),
    ],
)
def test_the_end_of_a_hold_is_named_after_what_the_autopilot_tells_soon_after(first: Reason, limit_ms: int) -> None:
    for late_ms, named in ((limit_ms, True), (limit_ms + 1, False)):
        bench = holding()
        bench.fault = explain(first)
        assert bench.step().why == explain(first)
        bench.fault, bench.status = None, itself("reboot")
        why = bench.step(late_ms).why
        assert why == (explain(Reason.AUTOPILOT_REBOOTED) if named else explain(first))


@pytest.mark.parametrize("first", [Reason.ESTIMATE_STALE, Reason.STICKS_UNSEEN, Reason.OUTPUT_STUCK])
@pytest.mark.parametrize("acts", ["mode", "arms anew", "releases", "nobody", "boots into another mode"])
def test_a_reboot_after_a_person_has_acted_did_not_end_the_hold(first: Reason, acts: str) -> None:
    bench = holding()
    bench.fault = explain(first)
    assert bench.step().why == explain(first)
    bench.fault = None
    match acts:
        case "mode":
            bench.status = status(mode="AUTO")
        case "arms anew":
            bench.status = status(armed=False)
            bench.step()
            bench.status = status()
        case "releases":
            bench.release()
        case "boots into another mode":  # its heartbeat may come before its clock
            bench.status = status(armed=False, mode="HOLD")
    bench.step()
    bench.status = itself("reboot")
    boot = acts in ("nobody", "boots into another mode")
    assert bench.step().why == explain(Reason.AUTOPILOT_REBOOTED if boot else first)


def test_who_had_the_boat_before_keeps_the_word() -> None:
    bench = holding()
    bench.status = status(mode="HOLD")
    assert bench.step().why == explain(Reason.MODE_CHANGED, mode="HOLD")
    bench.status = itself("failsafe")
    assert bench.step().why == explain(Reason.MODE_CHANGED, mode="HOLD")


def test_an_autopilot_that_disarms_by_itself_is_left_at_neutral() -> None:
    bench = holding()
    bench.status = itself("failsafe")
    decision = bench.step()
    assert decision.why == explain(Reason.AUTOPILOT_DISARMED, why="failsafe")
    assert decision.phase is Phase.STANDBY and decision.neutral and not decision.drive
