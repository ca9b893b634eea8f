"""What the pilot does comes before a hold command that was sent before its sender could know of it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from asvhil.config import StationConfig, SupervisorConfig
from asvhil.supervisor.decision import Decision, Request
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.supervisor.situation import MotorPulses, StationSticks
from asvhil.types import FrontseatStatus, HoldCommand, MoveCommand, NeutralCommand, Phase, Radio, ReleaseCommand
from tests.support.supervisor_bench import ESTIMATE, FRAME, SupervisorBench, status

PILOT_FIRST = explain(Reason.PILOT_FIRST)
NOT_ARMED = explain(Reason.NOT_ARMED, hint="")


def station_moves(bench: SupervisorBench, channel: int = 1, us: int = 1700) -> None:
    sticks = StationSticks(t_ns=bench.t_ns, sender=(255, 190), channels=((channel, us),))
    bench.station_sticks = (sticks,)


def holding(**config: object) -> SupervisorBench:
    bench = SupervisorBench(SupervisorConfig.model_validate(config))
    assert bench.hold() is None
    bench.drive()
    return bench


def taking_mode() -> SupervisorBench:
    bench = SupervisorBench(SupervisorConfig(take_mode=True))
    bench.status = status(mode="GUIDED")
    assert bench.hold() is None and bench.step().neutral
    return bench


def asks(bench: SupervisorBench, ms: int = 50) -> Decision:
    return bench.step(ms, HoldCommand(t_ns=bench.t_ns))


def stood_by(decision: Decision, why: Explanation, answer: Explanation) -> bool:
    said = (decision.phase, decision.why, decision.answers, decision.begun, decision.drive, decision.ask_mode)
    return said == (Phase.STANDBY, why, (answer,), False, False, None)


ACTS: dict[str, tuple[FrontseatStatus, Explanation]] = {
    "mode": (status(mode="HOLD"), explain(Reason.MODE_CHANGED, mode="HOLD")),
    "stick": (status(rc_us=(1600, 1700, 1400, 1500)), explain(Reason.STICK_MOVED, channel=2)),
    "override": (status(rc_us=(1600, 1500, 1900, 1500)), explain(Reason.OVERRIDE_NOT_FOLLOWED, channel=3)),
}


@pytest.mark.parametrize("act", ACTS)
def test_a_hold_command_of_the_very_tick_in_which_the_pilot_acts_is_refused(act: str) -> None:
    """As the new hold would take his stick for one at rest, and ask for another mode than his."""
    bench = holding(take_mode=True)
    bench.status, why = ACTS[act]
    assert stood_by(asks(bench), why, PILOT_FIRST)
    bench.status = status()
    assert bench.step(999).phase is Phase.STANDBY and bench.hold() == PILOT_FIRST
    bench.step(1)
    assert bench.hold() is None


PASSING = {
    "disarmed": (status(armed=False), explain(Reason.DISARMED)),
    "mode": ACTS["mode"],
    "stick": ACTS["stick"],
}


@pytest.mark.parametrize("held", [True, False], ids=["held", "stopped"])
@pytest.mark.parametrize("act", PASSING)
def test_what_the_pilot_does_and_takes_back_before_the_next_tick_counts(act: str, held: bool) -> None:
    """A late link hands on at once what has come in two seconds."""
    bench = holding()
    if not held:
        bench.step(50, NeutralCommand(t_ns=bench.t_ns))
    passed, why = PASSING[act]
    bench.passed = (bench.status or status(), passed)
    decision = bench.step()
    assert (decision.phase, decision.why) == (Phase.STANDBY, why)
    assert bench.step(1000).phase is Phase.STANDBY and bench.hold() is None


def test_what_was_before_the_hold_in_the_very_tick_does_not_count() -> None:
    bench = SupervisorBench()
    bench.passed = (status(mode="HOLD"), status(armed=False))
    assert bench.hold() is None and bench.step().phase is Phase.HOLD
    bench.passed = (status(),)
    assert bench.step().phase is Phase.HOLD


def test_so_is_one_in_which_a_ground_stations_stick_is_moved() -> None:
    bench = holding()
    station_moves(bench)
    why = explain(Reason.STATION_STICK, channel=1, station="255/190")
    decision = asks(bench)
    assert stood_by(decision, why, PILOT_FIRST) and decision.neutral and decision.release


def test_disarming_is_not_answered_with_neutral_to_arm_again() -> None:
    bench = holding()
    bench.status = status(armed=False, radio=Radio.ABSENT)
    assert stood_by(asks(bench), explain(Reason.DISARMED), NOT_ARMED)
    assert asks(bench, 900).phase is Phase.STANDBY
    decision = asks(bench, 100)
    assert decision.phase is Phase.PREPARE and decision.why == explain(Reason.SENDING_NEUTRAL)


def test_where_there_is_another_reason_to_refuse_that_one_is_told() -> None:
    bench = holding()
    bench.status = status(mode="HOLD")
    bench.step()
    assert bench.hold() == explain(Reason.WRONG_MODE, mode="HOLD", needed="MANUAL")


def test_a_mode_that_the_pilot_chooses_while_another_is_asked_for_stands() -> None:
    bench = taking_mode()
    bench.status = status(mode="LOITER")
    assert stood_by(asks(bench), explain(Reason.MODE_CHANGED, mode="LOITER"), PILOT_FIRST)
    assert bench.step(999).ask_mode is None and bench.hold() == PILOT_FIRST
    bench.step(1)
    assert bench.hold() is None and bench.step().ask_mode == "MANUAL"


def test_a_ground_stations_stick_ends_the_attempt_to_take_the_mode() -> None:
    bench = taking_mode()
    station_moves(bench)
    decision = asks(bench)
    assert stood_by(decision, explain(Reason.STATION_STICK, channel=1, station="255/190"), PILOT_FIRST)
    assert decision.release and not decision.neutral


def test_a_mode_that_is_not_entered_is_nobodys_choice() -> None:
    bench = taking_mode()
    assert bench.step(4000).why == explain(Reason.MODE_NOT_ENTERED, mode="MANUAL")
    assert bench.hold() is None


def test_neutral_for_arming_is_not_sent_anew_against_sticks_that_have_just_taken_the_boat() -> None:
    bench = SupervisorBench()
    bench.status = replace(status(armed=False, radio=Radio.ABSENT, rc_us=(0,) * 8), sticks_us=(0, 0))
    assert bench.hold() is not None and bench.step().neutral
    station_moves(bench)
    decision = asks(bench)
    assert decision.phase is Phase.STANDBY and decision.why.reason is Reason.STATION_STICK
    bench = SupervisorBench()
    bench.status = status(armed=False, radio=Radio.ABSENT)
    bench.hold()
    for _ in range(40):
        assert bench.step().neutral
        bench.sent = MotorPulses(t_ns=bench.t_ns, us=(1500, 1500))
    bench.status = status(armed=False, radio=Radio.ABSENT, rc_us=(1700, 1500, 1500, 1500))
    assert stood_by(asks(bench), explain(Reason.OVERRIDE_NOT_FOLLOWED, channel=1), NOT_ARMED)
    assert asks(bench).phase is Phase.STANDBY


def test_a_script_that_let_go_by_the_pilots_act_puts_him_first() -> None:
    bench = holding()
    bench.fault = explain(Reason.SCRIPT_LET_GO, hint="mode")
    decision = bench.step()
    assert decision.why.reason is Reason.SCRIPT_LET_GO and decision.neutral and decision.release
    bench.fault = None
    assert bench.hold() == PILOT_FIRST
    bench = holding()
    bench.fault = explain(Reason.OUTPUTS_DIFFER)
    assert bench.step().why.reason is Reason.OUTPUTS_DIFFER
    assert bench.hold() == explain(Reason.OUTPUTS_DIFFER)
    bench.fault = None
    assert bench.hold() is None, "a fault is no act of the pilot"


def test_a_station_is_not_moved_by_a_boat_that_does_not_know_where_it_is() -> None:
    bench = holding()
    bench.estimate = replace(ESTIMATE, valid=False)
    before = bench.step().station
    for estimate, frame in ((None, bench.frame), (ESTIMATE, None)):
        bench.estimate, bench.frame = estimate, frame
        decision = bench.step(50, MoveCommand(t_ns=bench.t_ns, n_m=5.0))
        assert decision.answers == (explain(Reason.NO_STATION_HELD),) and decision.station == before


NOT_BY_SETPOINT = explain(Reason.NOT_BY_SETPOINT)
ENDS: dict[str, FrontseatStatus | Request | None] = {
    "mode": status(mode="HOLD"),
    "stick": status(rc_us=(1600, 1700, 1400, 1500)),
    "disarmed": status(armed=False),
    "release": ReleaseCommand(t_ns=1),
    "neutral": NeutralCommand(t_ns=1),
    "no heartbeat": None,
}


def set_point(bench: SupervisorBench) -> Explanation | None:
    """The answer to the first set-point after a gap."""
    return bench.step(0, HoldCommand(t_ns=bench.t_ns, by_setpoint=True)).answers[0]


@pytest.mark.parametrize("end", ENDS)
def test_once_a_hold_has_ended_no_set_point_takes_the_boat_back(end: str) -> None:
    """A stream that was silent for a while has lost its radio link, maybe, while the pilot steers."""
    bench, act = holding(), ENDS[end]
    before = bench.status
    if isinstance(act, ReleaseCommand | NeutralCommand):
        bench.step(50, act)
    else:
        bench.status, bench.age_s = act or before, 0.0 if act else 5.0
        for _ in range(100):
            bench.step()
    bench.status, bench.age_s = before, 0.0
    phase = bench.step(5000).phase
    assert phase is (Phase.PREPARE if end == "neutral" else Phase.STANDBY)
    assert set_point(bench) == NOT_BY_SETPOINT and bench.step().phase is phase
    assert set_point(bench) == NOT_BY_SETPOINT, "nor the one after the next gap"
    assert bench.hold() is None and bench.step().phase is Phase.HOLD
    assert set_point(bench) is None, "the command has taken it, and set-points may go on"


def test_a_release_that_finds_nothing_to_release_is_a_word_all_the_same() -> None:
    bench = SupervisorBench()
    bench.release()
    assert set_point(bench) == NOT_BY_SETPOINT


def test_the_first_set_point_takes_the_boat_but_not_after_one_was_refused() -> None:
    """What the pilot arms later he may have armed to steer himself."""
    bench = SupervisorBench()
    assert set_point(bench) is None and bench.step().phase is Phase.HOLD
    bench = SupervisorBench()
    armed, bench.status = bench.status, status(armed=False)
    assert set_point(bench) == NOT_ARMED
    bench.status = armed
    bench.step(5000)
    assert set_point(bench) == NOT_BY_SETPOINT and bench.step().phase is Phase.STANDBY


@pytest.mark.parametrize("channel", [1, 3])
def test_the_first_set_point_takes_no_boat_that_is_steered(channel: int) -> None:
    """A daemon that is started anew while a stream goes on does not know that the pilot has taken the boat."""
    bench = SupervisorBench()
    rests = bench.status
    sticks = [1500, 1500, 1500, 1500, 1800, 0, 0, 0]
    sticks[channel - 1] = 1700
    bench.status = status(rc_us=tuple(sticks))
    assert set_point(bench) == explain(Reason.PILOT_STEERS, channel=channel) and bench.step().phase is Phase.STANDBY
    bench.status = rests
    assert set_point(bench) == NOT_BY_SETPOINT, "nor while its sticks come by their centre"
    bench.status = status(rc_us=tuple(sticks))
    assert bench.hold() is None, "a command is a decision"


def test_the_first_set_point_takes_no_boat_that_a_ground_station_steers() -> None:
    bench = SupervisorBench()
    station_moves(bench)
    refusal = set_point(bench)
    assert refusal is not None and refusal.reason is Reason.STATION_STICK and bench.step().phase is Phase.STANDBY


def test_the_first_set_point_takes_a_boat_whose_sticks_nobody_knows() -> None:
    for rc_us in ((), (0,) * 8, (1490, 1100, 1510, 1900, 1000, 0, 0, 0)):
        bench = SupervisorBench()
        bench.status = status(rc_us=rc_us)
        assert set_point(bench) is None


def test_a_set_point_that_is_refused_in_a_hold_locks_out_none_after_it() -> None:
    """They come more than a stream's pause apart, each as a hold of its own, and one is too far off."""
    bench = holding()
    for n_m, is_taken in ((3.0, True), (5000.0, False), (4.0, True), (5.0, True)):
        lat_deg, lon_deg = FRAME.to_geodetic(n_m, 0.0)
        answer = bench.step(4000, HoldCommand(t_ns=bench.t_ns, lat_deg=lat_deg, lon_deg=lon_deg, by_setpoint=True))
        assert (answer.answers == (None,)) is is_taken and answer.phase is Phase.HOLD
    bench.release()
    assert set_point(bench) == NOT_BY_SETPOINT


def test_a_hold_that_has_begun_by_itself_may_be_moved_by_set_points() -> None:
    at = StationConfig(lat_deg=40.0, lon_deg=-86.0, heading_deg=0.0)
    bench = SupervisorBench(SupervisorConfig(engage="auto", station=at))
    armed, bench.status = bench.status, status(armed=False)
    assert set_point(bench) == NOT_ARMED
    bench.status = armed
    assert bench.step().phase is Phase.HOLD
    bench.step(5000)
    assert set_point(bench) is None and bench.step().phase is Phase.HOLD
