"""The motion monitor on a simulated hull: each fault by its name and soon, and nothing on a sound boat."""

from __future__ import annotations

import pytest

from asvhil.config import MotionConfig
from asvhil.motion.evidence import Evidence
from asvhil.motion.hypotheses import FAULTY, SOUND
from asvhil.motion.monitor import FaultVerdict, Suspicion, leader_of
from asvhil.simplant.boat.vessel import Vessel
from asvhil.study.safety_cases import heavy
from asvhil.supervisor.reasons import Reason, describe
from asvhil.types import GroundVelocity, Heading
from tests.support.motion_boat import MotionBoat

PORT, STARBOARD = "port-motor-reversed", "starboard-motor-reversed"
WRONG: dict[str, tuple[tuple[str, ...], float, Reason, str]] = {
    "both reversed": ((PORT, STARBOARD), 0.0, Reason.MOTORS_REVERSED, "both motors are reversed"),
    "port reversed": ((PORT,), 0.0, Reason.MOTOR_REVERSED, "the port motor is reversed"),
    "starboard reversed": ((STARBOARD,), 0.0, Reason.MOTOR_REVERSED, "the starboard motor is reversed"),
    "swapped": (("motors-swapped",), 0.0, Reason.MOTORS_SWAPPED, "swapped"),
    "port dead": (("port-motor",), 0.0, Reason.MOTOR_DEAD, "the port motor gave no thrust"),
    "starboard dead": (("starboard-motor",), 0.0, Reason.MOTOR_DEAD, "the starboard motor gave no thrust"),
    "both dead": (("port-motor", "starboard-motor"), 0.0, Reason.NO_THRUST, "does not move"),
    "compass 180": ((), 180.0, Reason.HEADING_OFF, "off by about 180 degrees (or the motors"),
    "compass 90": ((), 90.0, Reason.HEADING_OFF, "off by about 90 degrees clockwise"),
    "compass -90": ((), -90.0, Reason.HEADING_OFF, "off by about 90 degrees counter-clockwise"),
    "compass 45": ((), 45.0, Reason.HEADING_OFF, "off by about 45 degrees clockwise"),
    "compass -45": ((), -45.0, Reason.HEADING_OFF, "off by about 45 degrees counter-clockwise"),
}


@pytest.mark.parametrize("base", ["sitl", "sitl-bream"])
@pytest.mark.parametrize("fault", list(WRONG))
def test_each_fault_is_named_within_15_s_of_thrust(base: str, fault: str) -> None:
    faults, compass_deg, reason, words = WRONG[fault]
    boat = MotionBoat(base, faults=faults, compass_deg=compass_deg)
    found = boat.run(15.0)
    assert found is not None and found.reason is reason and words in describe(found)


@pytest.mark.parametrize("base", ["sitl", "sitl-bream", "sitl-blueboat"])
@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in (2, 3))])
def test_nothing_is_found_on_a_sound_boat(base: str, seed: int) -> None:
    assert MotionBoat(base, seed=seed).run(120.0) is None


@pytest.mark.parametrize("compass_deg", [12.0, -12.0])
def test_a_compass_that_is_a_little_off_is_sound(compass_deg: float) -> None:
    assert MotionBoat(compass_deg=compass_deg).run(120.0) is None


def test_a_boat_with_much_aboard_is_sound_and_known_for_it() -> None:
    boat = MotionBoat()
    hull = heavy(boat.config.vehicle.vessel)
    laden = boat.config.vehicle.vessel.model_copy(update=hull)
    boat.vessel = Vessel(laden, boat.config.vehicle.pwm, 0.01, (0.0, 0.0, 0.5), (0.0, 0.0))
    assert boat.run(30.0) is None
    evidence = boat.monitor._evidence
    assert SOUND[evidence.best_sound].load == 0.4 and evidence._weights[evidence.best_sound] > 0.9
    assert boat.run(30.0) is None and evidence.sums.max() < 2.0


def test_two_faults_at_once_and_no_others_are_less_likely_beforehand() -> None:
    twice = [h for h in FAULTY if h.log_prior]
    assert [h.log_prior for h in twice] == [-2.0] * 3
    assert {(h.source, h.share) for h in twice} == {((1, 0), (-1.0, 1.0)), ((1, 0), (1.0, -1.0)), ((0, 1), (0.0, 0.0))}


def test_a_motor_that_was_never_told_to_give_thrust_is_not_called_dead() -> None:
    """The port motor is dead, and the starboard one has nothing to do: both dead would explain as much."""
    boat = MotionBoat(faults=("port-motor",))
    boat.run(9.0, lambda t_s: (-1.0 if t_s < 4.0 else -0.6, 0.0))
    found = boat.run(9.0, lambda t_s: (-0.6, 0.0)) or boat.monitor.likely
    assert found is not None and found.reason is Reason.MOTOR_DEAD


def test_a_boat_in_a_current_is_sound() -> None:
    boat = MotionBoat(current=(0.8, -0.5))
    assert boat.run(120.0) is None
    assert boat.monitor.current_ned == pytest.approx((0.8, -0.5), abs=0.3)


def judged(judge: FaultVerdict | Suspicion, *steps: tuple[list[float], list[float]], **given: bool) -> list[str]:
    """The codes of what is found, after each step of 0.2 s with these sums and names."""
    evidence, found = Evidence(1, [0.0] * len(FAULTY)), []
    for number, (sums, names) in enumerate(steps):
        evidence.sums[: len(sums)], evidence.names[: len(names)] = sums, names
        if isinstance(judge, Suspicion):
            judge.step(0.2, evidence, leader_of(evidence))
            fault = judge.fault
        else:
            fault = judge.step(1_000_000_000 + number * 200_000_000, evidence, leader_of(evidence), **given)
        found.append("" if fault is None else str(fault.reason))
    return found


NOTHING: tuple[list[float], list[float]] = ([0.0, 0.0], [0.0, 0.0])


def test_a_verdict_needs_enough_evidence_and_a_lead_or_patience() -> None:
    def verdict() -> FaultVerdict:
        return FaultVerdict(MotionConfig(evidence=10.0, lead=3.0, lead_s=0.4))

    clear, close = ([10.0, 4.0], [10.0, 7.0]), ([10.0, 10.0], [10.0, 12.9])
    assert judged(verdict(), clear) == ["motors-reversed"]
    assert judged(verdict(), ([9.9], [50.0])) == [""]
    assert judged(verdict(), ([10.0, 10.0], [13.0, 10.0])) == ["motors-reversed"], "a lead of just as much"
    assert judged(verdict(), close, close, close) == ["", "", "motor-reversed"]
    assert judged(verdict(), close, close, NOTHING, close, close) == [""] * 5, "it waits anew"
    assert judged(verdict(), clear, ([9.9], [9.9])) == ["motors-reversed", ""]


def test_what_explains_far_better_needs_half_of_the_evidence() -> None:
    verdict = FaultVerdict(MotionConfig(evidence=10.0, lead=3.0, lead_s=0.4))
    assert judged(verdict, ([5.0, 5.0], [10.0, 80.0])) == ["motor-reversed"]
    assert judged(verdict, ([5.0, 4.9], [10.0, 80.0])) == [""], "of the fault that does"
    assert judged(verdict, ([5.0, 5.0], [10.0, 79.9])) == [""]


def test_once_a_hold_goes_on_for_long_half_as_much_evidence_more_is_asked_for() -> None:
    verdict = FaultVerdict(MotionConfig(evidence=10.0, lead=3.0, lead_s=0.4))
    assert judged(verdict, ([14.9, 4.0], [40.0, 7.0]), late=True) == [""]
    assert judged(verdict, ([15.0, 4.0], [40.0, 7.0]), late=True) == ["motors-reversed"]
    assert judged(verdict, ([7.4], [120.0]), late=True) == [""]
    assert judged(verdict, ([7.5], [120.0]), late=True) == ["motors-reversed"]


def test_a_suspicion_needs_some_evidence_and_a_lead_of_one_fault_for_long() -> None:
    def suspicion() -> Suspicion:
        return Suspicion(MotionConfig(early_evidence=5.0, lead=3.0, early_lasts_s=0.4))

    one, other = ([5.0, 1.0], [5.0, 2.0]), ([1.0, 5.0], [2.0, 5.0])
    assert judged(suspicion(), one, one, one, one) == ["", "", "motors-reversed", "motors-reversed"]
    assert judged(suspicion(), one, one, other, other, other) == ["", "", "", "", "motor-reversed"]
    assert judged(suspicion(), *[([5.0, 5.0], [13.0, 10.0])] * 3) == ["", "", "motors-reversed"], "of just as much"
    weak, gone = ([9.0, 0.0], [4.9, 0.0]), ([9.0, 0.0], [3.7, 0.0])
    assert judged(suspicion(), weak, weak, weak, weak) == [""] * 4
    assert judged(suspicion(), one, one, gone, one, one) == [""] * 5, "it begins anew"
    cleared = suspicion()
    assert judged(cleared, one, one, one, NOTHING) == ["", "", "motors-reversed", ""]
    assert judged(cleared, one, one)[-1] == ""


def test_a_suspicion_outlasts_evidence_that_sinks_a_little() -> None:
    kept, less = ([1.0, 0.0], [3.75, 0.0]), ([1.0, 0.0], [5.0, 0.0])
    suspicion = Suspicion(MotionConfig(early_evidence=5.0, lead=3.0, early_lasts_s=0.4))
    assert judged(suspicion, less, kept, kept, kept) == ["", "", "motors-reversed", "motors-reversed"]


def test_a_suspicion_without_a_lead_is_told_after_twice_the_time() -> None:
    close = ([5.0, 5.0], [5.0, 2.1])
    suspicion = Suspicion(MotionConfig(early_evidence=5.0, lead=3.0, early_lasts_s=0.4))
    assert judged(suspicion, *[close] * 5) == ["", "", "", "", "motors-reversed"]


def test_in_rough_water_nothing_is_likely() -> None:
    """Readings that no hypothesis predicts, beside a fault that has its evidence already."""
    boat = MotionBoat(faults=("port-motor",))
    boat.run(15.0, lying)
    assert boat.monitor.likely is not None
    boat.shake_radps = 0.3
    boat.run(2.0, lying)
    shaken = boat.monitor.likely
    boat.shake_radps = 0.0
    assert shaken is None


def lying(t_s: float) -> tuple[float, float]:
    """As in a wind across the boat: a turn, and then the one motor full astern and the other gently, nearly still."""
    return (0.9, -1.0) if t_s < 1.0 else (-1.0, -1.0) if t_s < 2.0 else (-1.0, -0.3)


@pytest.mark.parametrize("motor", ["port", "starboard"])
def test_a_dead_motor_that_hardly_moves_the_boat_is_likely_though_not_sure(motor: str) -> None:
    boat = MotionBoat(faults=(f"{motor}-motor",))
    found = boat.run(8.5, lying)
    likely = boat.monitor.likely
    assert found is None and likely is not None and likely.reason is Reason.MOTOR_DEAD
    assert ("motor", motor) in likely.detail
    boat.monitor.begin()
    assert boat.monitor.likely is None


def test_nothing_is_likely_on_a_sound_boat_or_without_a_heading() -> None:
    boat = MotionBoat(faults=("port-motor",))
    boat.run(8.5, lying)
    assert boat.monitor.likely is not None
    boat.blind = True
    boat.run(1.5, lying, holding=False)
    assert boat.monitor.likely is None
    sound = MotionBoat()
    for _ in range(60):
        sound.run(0.5)
        assert sound.monitor.likely is None


def test_a_fault_that_comes_late_is_found_as_soon() -> None:
    boat = MotionBoat()
    assert boat.run(100.0) is None
    boat.faults = frozenset({PORT})
    found = boat.run(15.0)
    assert found is not None and found.reason is Reason.MOTOR_REVERSED and boat.found_s < 15.0


def test_without_thrust_there_is_no_evidence() -> None:
    """Whatever is wrong: a boat that drifts shows nothing of its motors."""
    boat = MotionBoat(faults=(PORT, STARBOARD), compass_deg=90.0, current=(1.0, 0.5))
    assert boat.run(60.0, lambda t_s: (0.0, 0.0)) is None


def test_before_a_hold_nothing_is_found() -> None:
    boat = MotionBoat(faults=(PORT, STARBOARD))
    assert boat.run(30.0, holding=False) is None


def test_a_sensor_that_is_silent_or_frozen_proves_nothing() -> None:
    """A receiver that repeats its velocity looks like motors that do nothing, if it is not known."""

    def ahead(t_s: float) -> tuple[float, float]:
        return (0.7, 0.7) if t_s % 8.0 < 4.0 else (-0.9, -0.9)

    boat = MotionBoat()
    boat.frozen = True
    boat.ailing = frozenset({GroundVelocity})
    assert boat.run(40.0, ahead) is None
    boat.ailing = frozenset()
    found = boat.run(20.0, ahead)
    assert found is not None and found.reason is Reason.NO_THRUST


def test_a_heading_that_jumps_for_some_seconds_proves_nothing() -> None:
    boat = MotionBoat()
    boat.run(20.0)
    boat.compass_rad = 1.05
    assert boat.run(5.0) is None
    boat.compass_rad = 0.0
    assert boat.run(60.0) is None


def test_a_heading_that_jumps_and_stays_is_found() -> None:
    boat = MotionBoat()
    boat.run(20.0)
    boat.compass_rad = 1.57
    found = boat.run(40.0)
    assert found is not None and found.reason is Reason.HEADING_OFF


def test_a_new_hold_begins_without_old_evidence() -> None:
    boat = MotionBoat(faults=(PORT, STARBOARD))
    assert boat.run(15.0) is not None
    boat.faults = frozenset()
    boat.monitor.begin()
    assert boat.run(60.0) is None


def test_without_a_heading_or_a_velocity_nothing_is_said() -> None:
    boat = MotionBoat(faults=(PORT, STARBOARD))
    monitor, kept = boat.monitor, boat.monitor.on_measurement
    monitor.on_measurement = lambda m: None if isinstance(m, Heading) else kept(m)  # type: ignore[method-assign]
    assert boat.run(30.0) is None


def test_every_faulty_hypothesis_says_what_it_means_and_no_sound_one_does() -> None:
    assert all(h.fault is None for h in SOUND)
    said = [describe(h.fault) for h in FAULTY if h.fault is not None]
    assert len(said) == len(FAULTY) == len(set(said))
