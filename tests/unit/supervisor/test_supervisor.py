"""Engagement and fail-safes: who may take the motors, and everything that gives them back."""

import math
from dataclasses import replace
from typing import Any

import pytest

from asvhil.config import StationConfig, SupervisorConfig
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.supervisor.situation import MotorPulses
from asvhil.types import FrontseatStatus, HoldCommand, MoveCommand, Phase, Radio, ReleaseCommand, Station
from tests.support.supervisor_bench import ESTIMATE, FRAME, STICKS, SupervisorBench, status

MS = 1_000_000
SLOW = explain(Reason.STREAM_SLOW, message="ATTITUDE", wanted="20")


def test_nothing_is_sent_before_a_command() -> None:
    decision = SupervisorBench().step()
    assert decision.phase is Phase.STANDBY
    assert not (decision.drive or decision.neutral or decision.release or decision.prepare)


def test_hold_here_and_hold_there() -> None:
    bench = SupervisorBench()
    assert bench.hold() is None
    decision = bench.step()
    assert decision.drive and decision.phase is Phase.HOLD
    assert decision.station is not None and (decision.station.n_m, decision.station.psi_rad) == (1.0, 0.5)
    lat, lon = FRAME.to_geodetic(30.0, -40.0)
    assert bench.hold(lat_deg=lat, lon_deg=lon, psi_rad=-1.0) is None
    station = bench.step().station
    assert station is not None and (station.n_m, station.e_m) == pytest.approx((30.0, -40.0), abs=1e-6)
    assert station.psi_rad == -1.0


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        ({"status": None}, explain(Reason.NO_HEARTBEAT)),
        ({"age_s": None}, explain(Reason.NO_HEARTBEAT)),
        ({"age_s": 3.0}, explain(Reason.NO_HEARTBEAT)),
        ({"status": status(armed=False)}, explain(Reason.NOT_ARMED, hint="")),
        (
            {"status": status(armed=False, arming_fault="Radio failsafe on")},
            explain(Reason.NOT_ARMED, hint="Radio failsafe on"),
        ),
        ({"status": status(mode="HOLD")}, explain(Reason.WRONG_MODE, mode="HOLD", needed="MANUAL")),
        ({"estimate": None}, explain(Reason.NO_ESTIMATE)),
        ({"estimate": replace(ESTIMATE, valid=False)}, explain(Reason.NO_ESTIMATE)),
        ({"estimate": replace(ESTIMATE, n_m=24_000.0, e_m=0.0)}, explain(Reason.FAR_FROM_ORIGIN, distance_km=24.0)),
        ({"status": status(rc_us=(), radio=Radio.HEARD)}, explain(Reason.STICKS_UNSEEN)),
        ({"slow": SLOW}, SLOW),
        ({"slow": SLOW, "estimate": None}, explain(Reason.NO_ESTIMATE)),
    ],
)
def test_hold_is_refused_with_the_reason(spoil: dict[str, object], why: Explanation) -> None:
    bench = SupervisorBench()
    for name, value in spoil.items():
        setattr(bench, name, value)
    assert bench.hold() == why
    assert bench.step().phase is Phase.STANDBY


def test_a_stream_that_becomes_slow_in_a_hold_ends_nothing_by_itself() -> None:
    bench = SupervisorBench()
    assert bench.hold() is None
    bench.slow = SLOW
    assert bench.drive().phase is Phase.HOLD


@pytest.mark.parametrize(
    ("off_m", "within_m", "reason"),
    [
        (98.0, 0.0, None),
        (102.0, 0.0, Reason.STATION_UNCONFIRMED),
        (1100.0, 0.0, Reason.STATION_UNCONFIRMED),
        (1100.0, 1000.0, Reason.STATION_UNCONFIRMED),
        (1100.0, 1200.0, None),
        (98.0, 10.0, None),  # it never narrows what the config lets pass
        (2100.0, 9000.0, Reason.STATION_TOO_FAR),
        (102.0, math.nan, Reason.STATION_UNCONFIRMED),
    ],
)
def test_a_station_far_off_needs_its_distance_named(off_m: float, within_m: float, reason: Reason | None) -> None:
    lat, lon = FRAME.to_geodetic(ESTIMATE.n_m + off_m, ESTIMATE.e_m)
    refusal = SupervisorBench().hold(lat_deg=lat, lon_deg=lon, within_m=within_m)
    assert (None if refusal is None else refusal.reason) is reason
    if reason is Reason.STATION_UNCONFIRMED:
        assert refusal is not None and dict(refusal.detail)["metres"] == pytest.approx(off_m, abs=0.1)


def test_a_station_is_moved_as_far_as_the_hold_was_told_to_go() -> None:
    lat, lon = FRAME.to_geodetic(300.0, 0.0)
    bench = SupervisorBench()
    bench.hold()
    refusal = bench.move(lat_deg=lat, lon_deg=lon)
    assert refusal is not None and refusal.reason is Reason.STATION_UNCONFIRMED
    bench.hold(within_m=400.0)
    assert bench.move(lat_deg=lat, lon_deg=lon) is None
    bench.hold()
    assert bench.move(lat_deg=lat, lon_deg=lon) is not None


def test_a_station_in_another_county_is_refused() -> None:
    lat, lon = FRAME.to_geodetic(3000.0, 0.0)
    refusal = SupervisorBench().hold(lat_deg=lat, lon_deg=lon)
    assert refusal is not None and refusal.reason is Reason.STATION_TOO_FAR
    assert dict(refusal.detail)["distance_km"] == pytest.approx(3.0, abs=0.01)


@pytest.mark.parametrize(
    ("act", "why"),
    [
        (status(armed=False), explain(Reason.DISARMED)),
        (status(mode="HOLD"), explain(Reason.MODE_CHANGED, mode="HOLD")),
        (status(rc_us=(1600, 1600, 1400, 1500)), explain(Reason.STICK_MOVED, channel=2)),
        (status(rc_us=(1600, 1500, 1400, 1430)), explain(Reason.STICK_MOVED, channel=4)),
        (status(rc_us=(1500, 1500, 1500, 1500)), explain(Reason.OVERRIDE_NOT_FOLLOWED, channel=1)),
        (status(rc_us=(1600, 1500, 1900, 1500)), explain(Reason.OVERRIDE_NOT_FOLLOWED, channel=3)),
    ],
)
def test_the_pilot_gets_the_motors_in_the_same_tick_and_keeps_them(act: FrontseatStatus, why: Explanation) -> None:
    bench = SupervisorBench()
    bench.hold()
    assert bench.drive().drive
    bench.status = act
    decision = bench.step()
    assert decision.phase is Phase.STANDBY and decision.why == why
    assert decision.release and not decision.drive and not decision.neutral
    bench.status = status()
    for _ in range(100):  # all well again: still not ours without a new command
        decision = bench.step()
        assert not decision.drive and not decision.neutral
    assert not decision.release  # said three times, then silence
    assert bench.hold() is None and bench.step().drive


def test_a_ground_station_that_falls_silent_ends_the_hold_and_refuses_the_next() -> None:
    bench = SupervisorBench()
    bench.station_age_s = 0.5
    assert bench.hold() is None
    bench.drive()
    bench.station_age_s = 5.0
    assert bench.step().phase is Phase.HOLD
    bench.station_age_s = 5.1
    decision = bench.step()
    lost = explain(Reason.STATION_LOST, seconds=5.0)
    assert decision.phase is Phase.STANDBY and decision.why == lost and decision.neutral and decision.release
    assert bench.hold() == lost
    bench.station_age_s = 0.2
    assert bench.step().phase is Phase.STANDBY and bench.hold() is None


@pytest.mark.parametrize(
    ("timeout_s", "age_s", "told"),
    [(None, 60.0, {}), (5.0, None, {}), (5.0, 60.0, {"radio": Radio.HEARD}), (90.0, 60.0, {})],
    ids=["not watched", "never heard", "a transmitter is there", "longer"],
)
def test_what_is_no_loss_of_the_ground_station(timeout_s: float | None, age_s: float | None, told: Any) -> None:
    bench = SupervisorBench(SupervisorConfig(ground_station_timeout_s=timeout_s))
    bench.station_age_s = age_s
    bench.status = status(**told)
    assert bench.hold() is None and bench.step().phase is Phase.HOLD


def test_a_transmitter_that_the_autopilot_ignores_is_none() -> None:
    bench = SupervisorBench()
    bench.status = status(radio=Radio.HEARD, receiver_ignored=True)
    assert bench.hold() is None
    bench.station_age_s = 6.0
    assert bench.step().why.reason is Reason.STATION_LOST


def test_the_echo_of_a_command_that_stood_while_we_stalled_is_not_the_pilot() -> None:
    """A stall of 1.5 s as seen on a real ArduRover: a report 0.9 s late shows the command before the only later one."""
    bench = SupervisorBench()
    bench.hold()
    bench.drive(pulses=(1630, 1400))
    bench.step(500)
    bench.sent = MotorPulses(t_ns=bench.t_ns, us=(1539, 1400))
    assert bench.step(900).drive
    bench.status = status(rc_us=(1630, 1500, 1400, *STICKS[3:]), rc_ns=bench.t_ns)
    assert bench.step().drive
    bench.status = status(rc_us=(1700, 1500, 1400, *STICKS[3:]), rc_ns=bench.t_ns)
    assert bench.step().why == explain(Reason.OVERRIDE_NOT_FOLLOWED, channel=1)


def test_small_stick_noise_and_our_own_echo_are_not_the_pilot() -> None:
    bench = SupervisorBench()
    bench.hold()
    bench.drive(pulses=(1700, 1300))
    bench.status = status(rc_us=(1699, 1530, 1302, 1480))
    assert bench.step().drive


def test_sticks_that_are_no_longer_told_mean_neutral_and_then_release() -> None:
    bench = SupervisorBench()
    bench.status = status(rc_ns=MS, radio=Radio.HEARD)
    assert bench.hold() is None
    while bench.t_ns < 3_000 * MS:
        assert bench.step().phase is Phase.HOLD
    decision = bench.step()
    assert decision.phase is Phase.FAILSAFE and decision.neutral and decision.why == explain(Reason.STICKS_UNSEEN)
    for radio, rc_ns in ((Radio.HEARD, bench.t_ns), (Radio.ABSENT, MS)):
        told = SupervisorBench()
        told.t_ns = bench.t_ns
        told.status = status(rc_ns=rc_ns, radio=radio)
        assert told.hold() is None, "seen, or nobody's"
    for _ in range(50):
        decision = bench.step()
    assert decision.phase is Phase.STANDBY and decision.why == explain(Reason.STICKS_UNSEEN)


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        ({"age_s": 3.0}, Reason.HEARTBEAT_LOST),
        ({"estimate": replace(ESTIMATE, valid=False)}, Reason.ESTIMATE_STALE),
        ({"estimate": None}, Reason.ESTIMATE_STALE),
    ],
)
def test_a_failing_input_means_neutral_then_release(spoil: dict[str, object], why: Reason) -> None:
    bench = SupervisorBench()
    bench.hold()
    bench.drive()
    for name, value in spoil.items():
        setattr(bench, name, value)
    decision = bench.step()
    assert decision.phase is Phase.FAILSAFE and decision.neutral and not decision.drive
    assert decision.why.reason is why
    for _ in range(50):
        decision = bench.step()
    assert decision.phase is Phase.STANDBY and not decision.drive and decision.why.reason is why
    bench.age_s, bench.estimate = 0.1, ESTIMATE
    assert not bench.step().drive


def test_what_the_estimate_lacks_first_is_told_until_the_end() -> None:
    bench = SupervisorBench()
    bench.hold()
    bench.drive()
    bench.estimate, bench.lacks = replace(ESTIMATE, valid=False), "compass rejected, though heard"
    reasons = [describe(bench.step().why)]
    bench.lacks = "compass silent"
    reasons += [describe(bench.step().why) for _ in range(50)]
    assert set(reasons) == {"position or heading is stale (compass rejected, though heard)"}


def test_a_short_failure_is_ridden_out_with_neutral_motors() -> None:
    bench = SupervisorBench()
    bench.hold()
    bench.drive()
    bench.estimate = replace(ESTIMATE, valid=False)
    assert bench.step().neutral
    bench.estimate = ESTIMATE
    assert bench.step().drive


def test_a_failed_controller_means_neutral_until_it_finds_a_solution() -> None:
    bench = SupervisorBench()
    bench.hold()
    bench.drive()
    bench.control_ok = False
    decision = bench.step()
    assert decision.neutral and not decision.control_ok
    assert bench.step().neutral  # the latest solution counts until there is another
    bench.control_ok = True
    assert bench.step().drive
    bench.control_ok = False
    for _ in range(60):
        decision = bench.step()
    assert decision.phase is Phase.STANDBY and decision.why.reason is Reason.NO_SOLUTION
    assert bench.hold() is None and bench.step().drive  # what failed before a hold does not count in it


def test_release_is_always_granted_neutral_first() -> None:
    bench = SupervisorBench()
    bench.hold()
    bench.drive()
    decision = bench.release()
    assert decision.answers == (None,) and decision.why.reason is Reason.RELEASED
    assert decision.neutral and decision.release and decision.phase is Phase.STANDBY


def test_auto_asks_for_mode_and_arming_once_and_never_after_the_pilot() -> None:
    station = StationConfig(lat_deg=40.0, lon_deg=-86.0, heading_deg=90.0)
    bench = SupervisorBench(SupervisorConfig(engage="auto", station=station))
    bench.status = status(ready=False)
    assert bench.step().phase is Phase.STANDBY
    bench.status = status(armed=False, mode="HOLD")
    decision = bench.step()
    assert decision.prepare and decision.neutral and decision.phase is Phase.PREPARE
    bench.status = status()
    decision = bench.step()
    assert decision.drive and decision.station is not None
    assert decision.station.psi_rad == pytest.approx(math.pi / 2)
    bench.status = status(armed=False)
    assert bench.step().release
    for _ in range(40):
        decision = bench.step()
    assert not (decision.prepare or decision.neutral or decision.drive)


# --- the autopilot's mode ------------------------------------------------------------------------------------------


def taking() -> SupervisorBench:
    bench = SupervisorBench(SupervisorConfig(take_mode=True))
    bench.status = status(mode="GUIDED")
    assert bench.hold() is None
    return bench


def test_another_mode_is_a_refusal_unless_it_may_be_taken() -> None:
    bench = SupervisorBench()
    bench.status = status(mode="GUIDED")
    assert bench.hold() == explain(Reason.WRONG_MODE, mode="GUIDED", needed="MANUAL")
    decision = taking().step()
    assert (decision.phase, decision.ask_mode, decision.prepare) == (Phase.PREPARE, "MANUAL", False)
    assert decision.neutral and not decision.drive and decision.station is None


def test_the_mode_that_was_taken_is_given_back_after_a_release() -> None:
    bench = taking()
    bench.step()
    bench.status = status()
    decision = bench.step()
    assert decision.phase is Phase.HOLD and decision.ask_mode is None and decision.station is not None
    bench.drive()
    assert (decision := bench.release()).ask_mode == "GUIDED" and decision.release and decision.neutral
    bench.step()
    bench.status = status(mode="GUIDED")
    assert bench.step().ask_mode is None
    bench.status = status()  # somebody's later choice
    assert bench.step().ask_mode is None


def test_a_mode_that_the_pilot_chooses_stands() -> None:
    bench = taking()
    bench.step()
    bench.status = status()
    bench.drive()
    bench.status = status(mode="HOLD")
    decision = bench.step()
    assert decision.phase is Phase.STANDBY and decision.ask_mode is None
    assert bench.release().ask_mode is None
    bench = taking()
    bench.step()
    bench.status = status(mode="LOITER")  # neither what stood nor what was asked for
    assert (decision := bench.step()).phase is Phase.STANDBY and decision.ask_mode is None


def test_nothing_is_given_back_after_a_failure() -> None:
    bench = taking()
    bench.step()
    bench.status = status()
    bench.drive()
    bench.estimate = replace(ESTIMATE, valid=False)
    asked = [bench.step().ask_mode for _ in range(100)]
    assert asked == [None] * 100 and bench.step().phase is Phase.STANDBY


def test_a_mode_that_is_not_entered_ends_the_attempt() -> None:
    bench = taking()
    decisions = [bench.step() for _ in range(70)]
    assert decisions[55].ask_mode == "MANUAL" and decisions[-1].phase is Phase.STANDBY
    assert any(d.release for d in decisions)
    assert decisions[-1].why == explain(Reason.MODE_NOT_ENTERED, mode="MANUAL")
    bench = taking()
    bench.step()
    bench.status = status(mode="GUIDED", armed=False)
    assert bench.step().why.reason is Reason.NOT_ARMED


def test_a_mode_that_stood_already_is_not_touched() -> None:
    bench = SupervisorBench(SupervisorConfig(take_mode=True))
    assert bench.hold() is None
    bench.drive()
    assert bench.release().ask_mode is None


def test_a_station_is_moved_only_where_one_is_held() -> None:
    bench = SupervisorBench()
    assert bench.move(lat_deg=40.0, lon_deg=-86.0) == explain(Reason.NO_STATION_HELD)
    assert bench.step().phase is Phase.STANDBY
    assert bench.hold() is None
    lat, lon = FRAME.to_geodetic(30.0, -40.0)
    assert bench.move(lat_deg=lat, lon_deg=lon) is None
    station = bench.step().station
    assert station is not None and station.n_m == pytest.approx(30.0) and station.psi_rad == 0.5
    refusal = bench.move(lat_deg=41.0, lon_deg=lon)
    assert refusal is not None and refusal.reason is Reason.STATION_TOO_FAR
    assert bench.step().station == station


def test_what_a_move_leaves_open_stays_as_it_is() -> None:
    bench = SupervisorBench()
    bench.hold()  # at 1 m north, 2 m east, 0.5 rad
    lat, _ = FRAME.to_geodetic(30.0, 0.0)
    moves = ({"psi_rad": 1.0}, {"n_m": 5.0}, {"e_m": -3.0}, {"lat_deg": lat})
    t_ns = bench.t_ns
    decision = bench.step(50, *(MoveCommand(t_ns=t_ns, **move) for move in moves))
    assert decision.answers == (None,) * 4 and not decision.begun
    station = decision.station
    assert station is not None and station.psi_rad == 1.0
    assert (station.n_m, station.e_m) == pytest.approx((30.0, -3.0), abs=1e-6)
    bench.move(n_m=7.0, e_m=8.0)
    assert bench.step().station == Station(n_m=7.0, e_m=8.0, psi_rad=1.0)


# --- one call ------------------------------------------------------------------------------------------------------


def test_requests_are_decided_in_turn_and_answered_in_their_tick() -> None:
    bench = SupervisorBench()
    here, release = HoldCommand(t_ns=0), ReleaseCommand(t_ns=0)
    decision = bench.step(50, MoveCommand(t_ns=0, psi_rad=1.0), here, MoveCommand(t_ns=0, psi_rad=1.0))
    assert [answer and answer.reason for answer in decision.answers] == [Reason.NO_STATION_HELD, None, None]
    assert decision.begun and decision.drive and decision.station is not None and decision.station.psi_rad == 1.0
    decision = bench.step(50, release, here)
    assert decision.answers == (None, None) and decision.drive
    decision = bench.step(50, here, release)
    assert decision.answers == (None, None) and decision.phase is Phase.STANDBY and decision.release
    assert bench.step().answers == () and not bench.step().begun


def test_the_decision_says_when_the_station_is_another_one() -> None:
    bench = SupervisorBench()
    assert not bench.step().station_changed
    decision = bench.step(50, HoldCommand(t_ns=0))
    assert decision.station_changed and decision.station is not None
    assert not bench.step().station_changed
    assert not bench.step(50, HoldCommand(t_ns=0)).station_changed  # the boat is where it was
    assert bench.step(50, MoveCommand(t_ns=0, psi_rad=1.0)).station_changed
    assert not bench.step(50, MoveCommand(t_ns=0, psi_rad=1.0)).station_changed
    bench.estimate = replace(ESTIMATE, valid=False)
    decision = bench.step()
    assert decision.phase is Phase.FAILSAFE and not decision.station_changed  # it is still held
    decision = bench.release()
    assert decision.station is None and decision.station_changed
    assert not bench.step().station_changed


@pytest.mark.parametrize("reason", [Reason.MOTORS_REVERSED, Reason.DRIFTED_OFF])
def test_a_boat_that_does_not_move_as_it_is_told_to_is_let_go_neutral_first(reason: Reason) -> None:
    bench = SupervisorBench()
    assert bench.hold() is None
    bench.drive()
    bench.motion = explain(reason, metres=9.0) if reason is Reason.DRIFTED_OFF else explain(reason)
    decision = bench.step()
    assert (decision.phase, decision.why.reason) == (Phase.STANDBY, reason)
    assert not decision.drive and decision.neutral and decision.release
    bench.motion = None
    assert bench.step().phase is Phase.STANDBY  # only a new command takes the motors again
