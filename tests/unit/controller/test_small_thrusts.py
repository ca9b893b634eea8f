"""Small thrusts of a model whose input is thrust: each sign of one is a jump across the motor's dead band."""

import math

import pytest

from asvhil.config import MpcConfig
from asvhil.controller.station_mpc import StationMpc
from asvhil.types import Control
from tests.support.mpc_bench import MODEL, ORIGIN, TanhModel, estimate


def after(least_thrust: float, *wanted: float) -> list[float]:
    """The commands of the port motor for the thrusts wanted, one solution after the other."""
    controller = StationMpc(MODEL, MpcConfig(least_thrust=least_thrust), 0.2)
    commands = []
    for thrust in wanted:
        inputs = ((thrust, 0.0),) * controller.config.stages
        controller.follow(Control(command=(0.0, 0.0), ok=True, iterations=1, cost=0.0, plan=(), inputs=inputs))
        commands.append(MODEL.command_of_input(controller._input)[0])
    return commands


def test_a_motor_at_rest_stays_there_and_one_that_turns_stops_before_it_turns_the_other_way() -> None:
    up, small, other_way, back, slowly = after(0.05, 0.2, 0.02, -0.02, 0.04, -0.06)
    assert up > small > 0.0  # as slow as it is wanted, the way it turns already
    assert other_way == back == 0.0
    assert slowly < 0.0
    assert all(command != 0.0 for command in after(0.0, 0.2, 0.02, -0.02, 0.04, -0.06))


def test_a_thrust_that_is_wanted_for_long_grows_until_the_motor_starts() -> None:
    """A boat that is held half a metre astern of its station: each plan goes on from what the last one wanted."""
    at = estimate((-0.5, 0.0, 0.0, 0, 0, 0, 0, 0))
    controller = StationMpc(MODEL, MpcConfig(least_thrust=0.05, thrust_slew=60.0, offset_m=(1.0, 2.0)), 0.2)
    tries = [controller.step(at, None, ORIGIN) for _ in range(8)]
    assert tries[0].command == (0.0, 0.0) and tries[0].inputs[0][0] > 0.0
    assert min(tries[-1].command) > 0.0 and tries[-1].inputs[0][0] >= 0.05


@pytest.mark.parametrize("slew", [0.0, 60.0])
def test_along_the_weather_a_change_of_thrust_has_its_own_least_price(slew: float) -> None:
    at = estimate((0.0, 0.0, math.radians(1.0), 0, 0, 0, 0, 0))
    config = MpcConfig(least_thrust=0.0, thrust_slew=slew)
    first = StationMpc(MODEL, config, 0.2).step(at, None, ORIGIN).inputs[0]
    free = StationMpc(MODEL, MpcConfig(least_thrust=0.0, thrust_slew=0.0), 0.2).step(at, None, ORIGIN).inputs[0]
    assert (abs(first[0]) < 0.8 * abs(free[0])) == (slew > 0.0)


def test_a_model_of_the_command_has_the_dead_band_in_it_and_is_left_alone() -> None:
    at = estimate((0.0, 0.0, math.radians(0.1), 0, 0, 0))
    plain, other = (
        StationMpc(TanhModel(), MpcConfig(least_thrust=least, thrust_slew=slew), 0.2).step(at, None, ORIGIN)
        for least, slew in ((0.0, 0.0), (0.5, 300.0))
    )
    assert plain == other and all(plain.command)
