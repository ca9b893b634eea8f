"""Motors of the simulated boat that fall short of their thrust curve."""

from __future__ import annotations

import pytest

from asvhil.config import PlantMotorsConfig, load_config
from asvhil.simplant.boat.imperfect_motors import ImperfectMotors
from asvhil.simplant.boat.vessel import Vessel

STEP_S = 0.01
FULL_N = 200.0


def driven(motors: ImperfectMotors, steady_n: tuple[float, float], seconds: float) -> list[tuple[float, float]]:
    return [motors.demands_n(steady_n, (0.0, 0.0), STEP_S) for _ in range(round(seconds / STEP_S))]


def test_each_motor_has_a_strength_of_its_own() -> None:
    motors = ImperfectMotors(PlantMotorsConfig(port_thrust=0.8, starboard_thrust=1.1), FULL_N)
    assert motors.demands_n((100.0, 100.0), (0.0, 0.0), STEP_S) == pytest.approx((80.0, 110.0))


def test_a_motor_gives_nothing_for_a_while_before_it_turns_the_other_way() -> None:
    motors = ImperfectMotors(PlantMotorsConfig(reversal_dead_time_s=0.3), FULL_N)
    assert set(driven(motors, (50.0, 50.0), 1.0)) == {(50.0, 50.0)}, "it starts at once"
    after = driven(motors, (-50.0, 50.0), 0.5)
    assert sum(port == 0.0 for port, _ in after) == pytest.approx(30, abs=1)
    assert {starboard for _, starboard in after} == {50.0} and after[-1] == (-50.0, 50.0)
    # At neutral a motor keeps the way that it last turned.
    driven(motors, (0.0, 0.0), 1.0)
    assert driven(motors, (-50.0, 50.0), 0.1)[0] == (-50.0, 50.0)
    assert driven(motors, (50.0, 50.0), 0.1)[-1] == (0.0, 50.0)


def test_the_battery_sags_under_load_and_with_time_and_never_to_nothing() -> None:
    motors = ImperfectMotors(PlantMotorsConfig(sag_at_full_thrust=0.2), FULL_N)
    assert motors.demands_n((200.0, 200.0), (200.0, 200.0), STEP_S) == pytest.approx((160.0, 160.0))
    assert motors.demands_n((200.0, 200.0), (200.0, 0.0), STEP_S) == pytest.approx((180.0, 180.0))
    motors = ImperfectMotors(PlantMotorsConfig(sag_per_hour=0.5), FULL_N)
    assert motors.demands_n((100.0, 100.0), (0.0, 0.0), 1800.0) == pytest.approx((75.0, 75.0))
    assert motors.demands_n((100.0, 100.0), (0.0, 0.0), 36000.0) == pytest.approx((20.0, 20.0))


def test_the_boat_swims_with_them() -> None:
    config = load_config("sitl")

    def turn_of(imperfect: PlantMotorsConfig | None) -> float:
        boat = Vessel(config.plant_vessel, config.vehicle.pwm, STEP_S, (0.0, 0.0, 0.0), imperfect=imperfect)
        boat.drive((1800, 1800))
        for _ in range(500):
            boat.step(0.0, 0.0)
        return boat.psi_rad

    assert turn_of(None) == turn_of(PlantMotorsConfig()) == 0.0
    assert turn_of(PlantMotorsConfig(port_thrust=0.8)) < -0.1, "a weak port motor turns the bow to port"
