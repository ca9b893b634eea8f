"""The motion monitor step by step, with a bank in the place of its filters that tells what it was asked."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from asvhil.config import load_config
from asvhil.dynamics.arrays import Array
from asvhil.motion import monitor as monitor_module
from asvhil.motion.filter import BankNoise
from asvhil.motion.hypotheses import FAULTY, SOUND
from asvhil.motion.monitor import MotionMonitor
from asvhil.supervisor.reasons import Explanation, Reason
from asvhil.types import ApparentWind, GroundVelocity, Heading, YawRate

CONFIG = load_config("sitl")
COUNT = len(SOUND) + len(FAULTY)
MS = 1_000_000


class ToldBank:
    """Keeps its calls; its likelihoods are those of `log`, its squared innovations those of `squares`."""

    def __init__(self, hypotheses: Any, vessel: Any, noise: BankNoise) -> None:
        self.made = (hypotheses, vessel, noise)
        self.calls: list[tuple[Any, ...]] = []
        self.log: Array = np.zeros(COUNT)
        self.squares: Array = np.full(COUNT, 0.75)  # of three readings, as between calm water and chop
        self.current_ned = (0.7, -0.2)

    def reset(self, velocity_ned: tuple[float, float], yaw_rate: float) -> None:
        self.calls.append(("reset", velocity_ned, yaw_rate))

    def restart(self, which: Array, like: int) -> None:
        self.calls.append(("restart", which.tolist(), like))

    def lag(self, command: tuple[float, float], dt_s: float) -> None:
        self.calls.append(("lag", command, round(dt_s, 9)))

    def predict(self, dt_s: float, heading_rad: float, wind_ned: tuple[float, float] | None) -> None:
        self.calls.append(("predict", round(dt_s, 9), heading_rad, wind_ned))

    def correct(self, velocity_ned: tuple[float, float] | None, yaw_rate: float | None) -> tuple[Array, Array]:
        self.calls.append(("correct", velocity_ned, yaw_rate))
        return self.log, self.squares


class Steps:
    """A monitor with that bank, in steps of 0.2 s, with a fresh heading, yaw rate and velocity in each."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *, with_rate: bool = True) -> None:
        monkeypatch.setattr(monitor_module, "Bank", ToldBank)
        self.monitor = MotionMonitor(CONFIG.supervisor.motion, CONFIG.estimator.ekf, CONFIG.vehicle.vessel)
        self.bank: Any = self.monitor._bank
        self.t_ns, self.psi_rad, self.with_rate = 5_000 * MS, 0.0, with_rate

    def measure(self, r_radps: float = 0.0, vn_mps: float = 0.3) -> None:
        self.monitor.on_measurement(Heading(t_ns=self.t_ns, psi_rad=self.psi_rad))
        self.monitor.on_measurement(GroundVelocity(t_ns=self.t_ns, vn_mps=vn_mps, ve_mps=-0.4))
        if self.with_rate:
            self.monitor.on_measurement(YawRate(t_ns=self.t_ns, r_radps=r_radps))

    def step(self, ms: int = 200, r_radps: float = 0.0, **given: Any) -> Explanation | None:
        self.t_ns += ms * MS
        self.measure(r_radps)
        return self.tick(**given)

    def tick(self, **given: Any) -> Explanation | None:
        return self.monitor.step(self.t_ns, (0.5, -0.5), (2.0, 1.0), **given)

    def named(self, name: str) -> list[tuple[Any, ...]]:
        return [call[1:] for call in self.bank.calls if call[0] == name]

    def favour(self, fault: int, log: float) -> None:
        self.bank.log[:] = 0.0
        self.bank.log[len(SOUND) + fault] = log

    @property
    def sums(self) -> Array:
        return self.monitor._evidence.sums


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> Steps:
    return Steps(monkeypatch)


def test_the_bank_has_all_hypotheses_and_more_than_the_noise_of_the_sensors(steps: Steps) -> None:
    hypotheses, vessel, noise = steps.bank.made
    ekf = CONFIG.estimator.ekf
    assert hypotheses == SOUND + FAULTY and vessel is CONFIG.vehicle.vessel
    assert noise.velocity_std_mps == 1.3 * ekf.velocity_std_mps
    assert noise.yaw_rate_std_radps == 2.0 * ekf.yaw_rate_std_radps
    assert len(steps.sums) == len(FAULTY)


def test_the_first_step_and_one_after_a_gap_start_the_bank(steps: Steps) -> None:
    assert steps.monitor.current_ned == (0.0, 0.0) and steps.monitor.likely is None
    assert steps.step(r_radps=0.1) is None
    assert steps.bank.calls == [("reset", (0.3, -0.4), 0.1)]
    assert steps.monitor.current_ned == (0.7, -0.2)
    steps.step(1000)
    assert len(steps.named("reset")) == 1 and len(steps.named("predict")) == 1
    steps.step(1001)
    assert len(steps.named("reset")) == 2 and len(steps.named("predict")) == 1


def test_a_step_back_in_time_starts_the_bank(steps: Steps) -> None:
    steps.step()
    steps.step(-1)
    assert len(steps.named("reset")) == 2 and not steps.named("predict") and not steps.named("lag")


def test_a_start_without_a_gyro_has_no_yaw_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = Steps(monkeypatch, with_rate=False)
    steps.step()
    steps.step()
    assert steps.named("reset") == [((0.3, -0.4), 0.0)]
    assert steps.named("correct") == [((0.3, -0.4), None)]


def test_what_came_before_the_start_is_no_reading_after_it(steps: Steps) -> None:
    steps.step()
    steps.t_ns += 200 * MS
    steps.tick()
    assert steps.named("correct") == [(None, None)]


@pytest.mark.parametrize("missing", [Heading, GroundVelocity])
def test_without_heading_or_velocity_the_bank_is_not_asked(steps: Steps, missing: type) -> None:
    for kind in (Heading(t_ns=0, psi_rad=0.0), GroundVelocity(t_ns=0, vn_mps=0.0, ve_mps=0.0)):
        if not isinstance(kind, missing):
            steps.monitor.on_measurement(kind)
    assert steps.monitor.step(1, (0.0, 0.0), None) is None and steps.bank.calls == []


def test_a_heading_is_used_for_a_second(steps: Steps) -> None:
    steps.step()
    heard_ns = steps.t_ns
    steps.t_ns = heard_ns + 1000 * MS
    steps.tick()
    assert len(steps.named("predict")) == 1
    steps.monitor._suspicion.fault = FAULTY[0].fault
    assert steps.monitor.likely is not None
    steps.t_ns = heard_ns + 1000 * MS + 1
    assert steps.tick() is None
    assert len(steps.named("lag")) == 1 and steps.monitor.likely is None


def test_thrust_lags_in_each_tick_and_the_bank_steps_after_200_ms(steps: Steps) -> None:
    steps.step()
    for ms in (50, 50, 50, 49):
        steps.step(ms)
    assert steps.named("lag") == [((0.5, -0.5), 0.05)] * 3 + [((0.5, -0.5), 0.049)]
    assert steps.named("predict") == [(0.199, 0.0, (2.0, 1.0))]
    steps.step(198)
    assert len(steps.named("predict")) == 1
    steps.step(2)
    assert steps.named("predict")[1] == (0.2, 0.0, (2.0, 1.0))


def test_a_reading_counts_once_and_not_of_a_sensor_that_ails(steps: Steps) -> None:
    steps.step()
    steps.step(r_radps=0.2)
    steps.t_ns += 200 * MS
    steps.tick()
    steps.step(r_radps=0.3, ailing=frozenset({GroundVelocity}))
    steps.step(r_radps=0.4, ailing=frozenset({YawRate}))
    velocity = (0.3, -0.4)
    assert steps.named("correct") == [(velocity, 0.2), (None, None), (None, 0.3), (velocity, None)]


def test_other_measurements_are_none_of_its_business(steps: Steps) -> None:
    steps.step()
    steps.monitor.on_measurement(ApparentWind(t_ns=steps.t_ns, speed_mps=1.0, from_rad=0.0))
    assert steps.monitor._fresh == set()


def test_evidence_counts_while_a_station_is_held_and_all_sensors_are_well(steps: Steps) -> None:
    steps.favour(2, 1.0)
    steps.step()
    steps.step(holding=False)
    steps.step(ailing=frozenset({GroundVelocity}))
    assert not steps.sums.any()
    steps.step()
    assert steps.sums[2] == pytest.approx(0.4) and steps.sums.sum() == pytest.approx(0.4)


def test_in_waves_each_step_tells_less(steps: Steps) -> None:
    """By how much the best hypothesis is off: three readings, of which each is off by one variance."""
    steps.favour(2, 0.3)
    steps.bank.squares[:] = 30.0
    steps.bank.squares[4] = 9.0
    steps.step()
    steps.step()
    rough = 1.0 + 0.05 * (3.0 - 1.0)
    assert steps.sums[2] == pytest.approx(0.3 * rough**-4)
    steps.bank.squares[4] = 0.3
    steps.step()
    calmer = rough + 0.05 * (1.0 - rough)
    assert steps.sums[2] == pytest.approx(0.3 * (rough**-4 + calmer**-4))
    steps.favour(2, 5.0)
    before = float(steps.sums[2])
    steps.step()
    calmer += 0.05 * (1.0 - calmer)
    assert steps.sums[2] - before == pytest.approx(0.4 * calmer**-4)


@pytest.mark.parametrize(("rough", "is_told"), [(1.09, True), (1.1, False)])
def test_nothing_is_likely_where_readings_are_off_by_a_tenth_more(steps: Steps, rough: float, is_told: bool) -> None:
    steps.favour(2, 2.0)
    for _ in range(30):
        steps.step()
    assert steps.monitor.likely is not None
    steps.monitor._fit.roughness, steps.bank.squares[:] = rough, 3.0 * rough
    steps.step()
    assert (steps.monitor.likely is not None) is is_told
    steps.monitor._fit.roughness, steps.bank.squares[:] = 1.0, 3.0
    steps.step()
    assert (steps.monitor.likely is not None) is is_told, "it begins anew"


def test_a_fault_that_does_not_explain_what_is_seen_is_not_likely(steps: Steps) -> None:
    """The time in which its filter predicts badly does not count, whatever the others do."""
    steps.favour(2, 2.0)
    steps.bank.squares[len(SOUND) + 2] = 30.0
    for _ in range(40):
        steps.step()
    assert steps.monitor.likely is None
    steps.bank.squares[len(SOUND) + 2] = 0.75
    for _ in range(100):
        steps.step()
    assert steps.monitor.likely is not None


def test_in_calm_water_a_step_comes_to_tell_twice_as_much(steps: Steps) -> None:
    steps.bank.squares[:] = 0.0
    steps.step()
    assert counted_by(steps, 1) == pytest.approx(0.1)
    assert counted_by(steps, 60) == pytest.approx(0.2)
    steps.monitor.begin()
    assert counted_by(steps, 1) == pytest.approx(0.1), "of another hold it must be shown again"


@pytest.mark.parametrize("with_rate", [True, False])
def test_what_a_reading_is_off_by_is_shared_by_those_that_came(
    monkeypatch: pytest.MonkeyPatch, *, with_rate: bool
) -> None:
    """One that does not come is not one that is right."""
    steps = Steps(monkeypatch, with_rate=with_rate)
    steps.bank.squares[:] = 0.3 * (3 if with_rate else 2)
    steps.step()
    assert counted_by(steps, 60) == pytest.approx(0.1)


def counted_by(steps: Steps, count: int) -> float:
    """What the last of so many steps added to a sum, each of which tells 0.1."""
    steps.favour(2, 0.1)
    before = 0.0
    for _ in range(count):
        before = float(steps.sums[2])
        steps.step()
    return float(steps.sums[2]) - before


def test_time_without_evidence_makes_nothing_likely(steps: Steps) -> None:
    steps.favour(2, 2.0)
    for _ in range(20):
        steps.step()
    for _ in range(30):
        steps.step(ailing=frozenset({GroundVelocity}))
    assert steps.monitor.likely is None
    for _ in range(10):
        steps.step()
    assert steps.monitor.likely is not None


def test_a_fault_without_evidence_starts_anew_like_the_best_sound_hypothesis(steps: Steps) -> None:
    steps.favour(2, 1.0)
    steps.bank.log[3] = 0.5
    steps.step()
    steps.step()
    which = [False] * len(SOUND) + [True] * len(FAULTY)
    which[len(SOUND) + 2] = False
    assert steps.named("restart") == [(which, 3)]
    steps.bank.log[len(SOUND) :] = 1.0
    steps.step()
    assert len(steps.named("restart")) == 1


def test_a_hold_begins_with_nothing_known(steps: Steps) -> None:
    steps.favour(2, 2.0)
    found = [steps.step() for _ in range(18)]  # the first one starts the bank
    assert found[:17] == [None] * 17 and found[17] is not None and found[17].reason is Reason.MOTOR_REVERSED
    steps.monitor._suspicion.fault = FAULTY[0].fault
    steps.monitor._verdict._since_ns = 1
    steps.bank.calls.clear()
    steps.monitor.begin()
    assert steps.bank.calls == [("restart", [True] * COUNT, 0)]
    assert not steps.sums.any() and steps.monitor.likely is None and steps.monitor._verdict._since_ns is None


def test_more_is_asked_for_of_a_hold_that_goes_on_for_long(steps: Steps) -> None:
    steps.favour(2, 2.0)
    found = [steps.step(late=True) for _ in range(26)]
    assert found[:25] == [None] * 25 and found[25] is not None


def test_what_lasts_is_likely_before_it_is_sure(steps: Steps) -> None:
    steps.favour(2, 1.0)
    for _ in range(6):
        steps.step()
    steps.favour(2, 0.0)
    told = []
    for _ in range(26):
        told.append(steps.monitor.likely is not None)
        assert steps.step() is None
    assert told.index(True) == 24


def counted(steps: Steps, turns: list[tuple[float, float]]) -> list[bool]:
    """Whether each step counted, whose heading was turned by that angle and whose gyro told that rate."""
    found = []
    for turned_rad, r_radps in turns:
        steps.favour(2, 0.01)
        steps.psi_rad = math.remainder(steps.psi_rad + turned_rad, 2.0 * math.pi)
        before = float(steps.sums[2])
        steps.step(r_radps=r_radps)
        found.append(float(steps.sums[2]) > before)
    return found


def test_a_heading_that_jumps_by_more_than_25_degrees_counts_again_once_that_is_forgotten(steps: Steps) -> None:
    """0.5 rad, forgotten with a time constant of 10 s, are less than 25 degrees after 1.4 s."""
    steps.psi_rad = 3.0
    steps.step()
    assert counted(steps, [(0.5, 0.0), *[(0.0, 0.0)] * 7]) == [False] * 6 + [True] * 2
    assert counted(steps, [(-0.9, 0.0)]) == [False]


def test_a_heading_that_turns_as_the_gyro_tells_has_not_jumped(steps: Steps) -> None:
    steps.step()
    assert counted(steps, [(0.3, 1.5)] * 10) == [True] * 10
    assert counted(steps, [(0.0, 0.0)] * 10) == [True] * 10
    assert counted(steps, [(0.3, -1.5)]) == [False]


def test_the_turns_of_all_ticks_of_a_step_count(steps: Steps) -> None:
    steps.step()
    steps.favour(2, 0.01)
    for ms in (50, 50, 50):
        steps.step(ms, r_radps=3.0)
    steps.psi_rad = 0.6
    steps.step(50, r_radps=3.0)
    assert steps.sums[2] > 0.0


def test_without_a_gyro_no_jump_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = Steps(monkeypatch, with_rate=False)
    steps.step()
    assert counted(steps, [(0.6, 0.0), (-0.6, 0.0)]) == [True, True]


def test_a_gap_forgets_a_jump(steps: Steps) -> None:
    steps.step()
    assert counted(steps, [(0.6, 0.0)]) == [False]
    steps.psi_rad = 1.9
    steps.step(1500)
    assert counted(steps, [(0.0, 0.0)]) == [True]
