"""Engagement and fail-safes: who may take the motors, and everything that gives them back."""

import math
from dataclasses import replace

import pytest

from asvhil.config import PwmConfig, StationConfig, SupervisorConfig
from asvhil.geo import LocalFrame
from asvhil.supervisor.situation import Situation
from asvhil.supervisor.supervisor import Decision, Supervisor
from asvhil.types import Estimate, FrontseatStatus, HoldCommand, Phase, ReleaseCommand

MS = 1_000_000
FRAME = LocalFrame(lat_deg=40.0, lon_deg=-86.0)
STICKS = (1500, 1500, 1500, 1500, 1800, 0, 0, 0)


def status(**changes: object) -> FrontseatStatus:
    base = FrontseatStatus(t_ns=0, armed=True, mode="MANUAL", ready=True, rc_us=STICKS, outputs_us=(1500, 0, 1500))
    return replace(base, **changes)  # type: ignore[arg-type]


ESTIMATE = Estimate(
    t_ns=0, n_m=1.0, e_m=2.0, psi_rad=0.5, u_mps=0.0, v_mps=0.0, r_radps=0.0,
    motor=(0.0, 0.0), std=(0.1,) * 6, disturbance=(0.0, 0.0, 0.0), valid=True,
)  # fmt: skip


class Bench:
    """A supervisor with good news everywhere, and knobs to spoil one thing at a time."""

    def __init__(self, config: SupervisorConfig | None = None) -> None:
        self.supervisor = Supervisor(config or SupervisorConfig(), PwmConfig())
        self.t_ns = 0
        self.status: FrontseatStatus | None = status()
        self.age_s: float | None = 0.1
        self.estimate: Estimate | None = ESTIMATE

    def known(self) -> Situation:
        return Situation(
            t_ns=self.t_ns, status=self.status, heartbeat_age_s=self.age_s, estimate=self.estimate, frame=FRAME
        )

    def hold(self, **fields: float) -> str | None:
        command = HoldCommand(t_ns=self.t_ns, **fields)
        return self.supervisor.on_hold(command, self.known())

    def step(self, ms: int = 50) -> Decision:
        self.t_ns += ms * MS
        return self.supervisor.step(self.known())

    def drive(self, seconds: float = 2.0, pulses: tuple[int, int] = (1600, 1400)) -> Decision:
        """Hold with the echo of the override on the motor channels, as an autopilot shows it."""
        for _ in range(round(seconds * 20)):
            decision = self.step()
            self.supervisor.note_sent(self.t_ns, pulses)
            self.status = status(rc_us=(pulses[0], 1500, pulses[1], *STICKS[3:]))
        return decision


def test_nothing_is_sent_before_a_command() -> None:
    decision = Bench().step()
    assert decision.phase is Phase.STANDBY
    assert not (decision.drive or decision.neutral or decision.release or decision.prepare)


def test_hold_here_and_hold_there() -> None:
    bench = Bench()
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
    ("spoil", "words"),
    [
        ({"status": None}, "no heartbeat"),
        ({"age_s": None}, "no heartbeat"),
        ({"age_s": 3.0}, "no heartbeat"),
        ({"status": status(armed=False)}, "not armed"),
        ({"status": status(mode="HOLD")}, "mode is HOLD, MANUAL is needed"),
        ({"estimate": None}, "no valid position"),
        ({"estimate": replace(ESTIMATE, valid=False)}, "no valid position"),
    ],
)
def test_hold_is_refused_with_the_reason(spoil: dict[str, object], words: str) -> None:
    bench = Bench()
    for name, value in spoil.items():
        setattr(bench, name, value)
    refusal = bench.hold()
    assert refusal is not None and words in refusal
    assert bench.step().phase is Phase.STANDBY


def test_a_station_in_another_county_is_refused() -> None:
    lat, lon = FRAME.to_geodetic(3000.0, 0.0)
    assert "km away" in (Bench().hold(lat_deg=lat, lon_deg=lon) or "")


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (status(armed=False), "disarmed"),
        (status(mode="HOLD"), "mode changed to HOLD"),
        (status(rc_us=(1600, 1600, 1400, 1500)), "stick of channel 2 moved"),
        (status(rc_us=(1600, 1500, 1400, 1430)), "stick of channel 4 moved"),
        (status(rc_us=(1500, 1500, 1500, 1500)), "channel 1 does not follow the override"),
        (status(rc_us=(1600, 1500, 1900, 1500)), "channel 3 does not follow the override"),
    ],
)
def test_the_pilot_gets_the_motors_in_the_same_tick_and_keeps_them(act: FrontseatStatus, words: str) -> None:
    bench = Bench()
    bench.hold()
    assert bench.drive().drive
    bench.status = act
    decision = bench.step()
    assert decision.phase is Phase.STANDBY and words in decision.reason
    assert decision.release and not decision.drive and not decision.neutral
    bench.status = status()
    for _ in range(100):  # all well again: still not ours without a new command
        decision = bench.step()
        assert not decision.drive and not decision.neutral
    assert not decision.release  # said three times, then silence
    assert bench.hold() is None and bench.step().drive


def test_small_stick_noise_and_our_own_echo_are_not_the_pilot() -> None:
    bench = Bench()
    bench.hold()
    bench.drive(pulses=(1700, 1300))
    bench.status = status(rc_us=(1690, 1530, 1320, 1480))
    assert bench.step().drive


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        ({"age_s": 3.0}, "heartbeat lost"),
        ({"estimate": replace(ESTIMATE, valid=False)}, "stale"),
        ({"estimate": None}, "stale"),
    ],
)
def test_a_failing_input_means_neutral_then_release(spoil: dict[str, object], words: str) -> None:
    bench = Bench()
    bench.hold()
    bench.drive()
    for name, value in spoil.items():
        setattr(bench, name, value)
    decision = bench.step()
    assert decision.phase is Phase.FAILSAFE and decision.neutral and not decision.drive and words in decision.reason
    for _ in range(50):
        decision = bench.step()
    assert decision.phase is Phase.STANDBY and not decision.drive
    bench.age_s, bench.estimate = 0.1, ESTIMATE
    assert not bench.step().drive


def test_a_short_failure_is_ridden_out_with_neutral_motors() -> None:
    bench = Bench()
    bench.hold()
    bench.drive()
    bench.estimate = replace(ESTIMATE, valid=False)
    assert bench.step().neutral
    bench.estimate = ESTIMATE
    assert bench.step().drive


def test_a_failed_controller_means_neutral_until_it_finds_a_solution() -> None:
    bench = Bench()
    bench.hold()
    bench.drive()
    bench.supervisor.note_control(False)
    assert bench.step().neutral and not bench.supervisor.control_ok
    bench.supervisor.note_control(True)
    assert bench.step().drive
    bench.supervisor.note_control(False)
    for _ in range(60):
        decision = bench.step()
    assert decision.phase is Phase.STANDBY and "no solution" in decision.reason


def test_release_is_always_granted_neutral_first() -> None:
    bench = Bench()
    bench.hold()
    bench.drive()
    bench.supervisor.on_release(ReleaseCommand(t_ns=bench.t_ns, reason="released by the operator"))
    decision = bench.step()
    assert decision.neutral and decision.release and decision.phase is Phase.STANDBY


def test_auto_asks_for_mode_and_arming_once_and_never_after_the_pilot() -> None:
    station = StationConfig(lat_deg=40.0, lon_deg=-86.0, heading_deg=90.0)
    bench = Bench(SupervisorConfig(engage="auto", station=station))
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


def taking() -> Bench:
    bench = Bench(SupervisorConfig(take_mode=True))
    bench.status = status(mode="GUIDED")
    assert bench.hold() is None
    return bench


def test_another_mode_is_a_refusal_unless_it_may_be_taken() -> None:
    bench = Bench()
    bench.status = status(mode="GUIDED")
    assert bench.hold() == "mode is GUIDED, MANUAL is needed"
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
    bench.supervisor.on_release(ReleaseCommand(t_ns=bench.t_ns, reason="released by the operator"))
    assert (decision := bench.step()).ask_mode == "GUIDED" and decision.release and decision.neutral
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
    bench.supervisor.on_release(ReleaseCommand(t_ns=bench.t_ns, reason="released by the operator"))
    assert bench.step().ask_mode is None
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
    assert any(d.release for d in decisions) and "does not enter MANUAL" in decisions[-1].reason
    bench = taking()
    bench.step()
    bench.status = status(mode="GUIDED", armed=False)
    assert bench.step().reason == "vehicle is not armed"


def test_a_mode_that_stood_already_is_not_touched() -> None:
    bench = Bench(SupervisorConfig(take_mode=True))
    assert bench.hold() is None
    bench.drive()
    bench.supervisor.on_release(ReleaseCommand(t_ns=bench.t_ns, reason="released by the operator"))
    assert bench.step().ask_mode is None


def test_a_station_is_moved_only_where_one_is_held() -> None:
    bench = Bench()
    assert "no station is held" in (bench.hold(lat_deg=40.0, lon_deg=-86.0, move_only=True) or "")
    assert bench.step().phase is Phase.STANDBY
    assert bench.hold() is None
    lat, lon = FRAME.to_geodetic(30.0, -40.0)
    assert bench.hold(lat_deg=lat, lon_deg=lon, move_only=True) is None
    station = bench.step().station
    assert station is not None and station.n_m == pytest.approx(30.0) and station.psi_rad == 0.5
    assert "km away" in (bench.hold(lat_deg=41.0, lon_deg=lon, move_only=True) or "")
    assert bench.step().station == station
