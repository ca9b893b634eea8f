"""The autopilot's own LOITER: drift within the radius, drive to the circle from outside, any heading."""

import dataclasses
import math

import pytest

from asvhil.config import LoiterConfig
from asvhil.controller.loiter import Loiter
from asvhil.types import Station
from tests.support.classical_boat import ORIGIN, air, boat
from tests.support.classical_loop import distance_after

CONFIG = LoiterConfig(
    radius_m=2.0,
    speed_gain_per_s=0.5,
    speed_max_mps=1.0,
    throttle_ff_per_mps=0.25,
    throttle_p_per_mps=0.2,
    throttle_i_per_m=0.1,
    throttle_min=0.1,
    angle_p_per_s=1.0,
    rate_max_degps=30.0,
    rate_ff_s=0.4,
    rate_p_s=0.4,
)


def command(at, **changes) -> tuple[float, float]:
    control = Loiter(CONFIG.model_copy(update=changes)).step(at, None, ORIGIN)
    assert control.ok
    return control.command


@pytest.mark.parametrize(("n_m", "e_m", "psi_deg"), [(0.0, 0.0, 90.0), (1.9, 0.0, -120.0), (-1.4, 1.4, 10.0)])
def test_within_the_radius_it_drifts_with_any_heading(n_m, e_m, psi_deg):
    assert command(boat(n_m, e_m, psi_deg, (0.5, 0.2, 0.3))) == (0.0, 0.0)


def test_outside_it_drives_ahead_or_astern_whichever_is_nearer():
    # 1 m outside: 0.5 m/s wanted from rest: 0.125 + 0.1 = 0.225, past a dead band of 0.1: 0.1 + 0.9 * 0.225.
    assert command(boat(n_m=-3.0)) == pytest.approx((0.3025, 0.3025))
    assert command(boat(n_m=3.0)) == pytest.approx((-0.3025, -0.3025))
    # 40 m outside: no faster than 1 m/s: 0.1 + 0.9 * 0.45.
    assert command(boat(n_m=-42.0)) == pytest.approx((0.505, 0.505))


def test_it_turns_and_slows_down_for_the_turn():
    # The station lies 45 deg to starboard: rate 30 deg/s = 0.5236 rad/s, steering 0.8 * 0.5236 = 0.4189;
    # speed 1 * (1 - 1/4) = 0.75 m/s: 0.75 * 0.45 = 0.3375.
    port, starboard = command(boat(n_m=-30.0, e_m=-30.0))
    assert (port, starboard) == pytest.approx((0.1 + 0.9 * 0.7564, -0.1 - 0.9 * 0.0814), abs=1e-4)
    # And 45 deg to starboard of the stern: astern, the bow to starboard too.
    port, starboard = command(boat(n_m=30.0, e_m=30.0))
    assert (port, starboard) == pytest.approx((0.1 + 0.9 * 0.0814, -0.1 - 0.9 * 0.7564), abs=1e-4)


def test_the_turn_rate_is_fed_back():
    turning = boat(n_m=-30.0, e_m=-30.0, nu=(0.0, 0.0, 0.5))
    assert command(turning)[0] < command(boat(n_m=-30.0, e_m=-30.0))[0]


def test_steering_comes_first_where_a_motor_is_at_its_bound():
    port, starboard = command(boat(n_m=-30.0, e_m=-30.0), throttle_p_per_mps=5.0, rate_ff_s=1.0)
    # steering 1.4 * 0.5236 = 0.733 leaves 0.267 for the throttle.
    assert (port, starboard) == pytest.approx((1.0, -0.1 - 0.9 * 0.466), abs=1e-3)


def test_the_speed_integral_grows_waits_and_is_emptied_within_the_radius():
    loiter = Loiter(CONFIG)
    levels = [loiter.step(boat(n_m=-3.0, t_s=0.2 * k), None, ORIGIN).command[0] for k in range(4)]
    # 0.1 * 0.5 m/s * 0.2 s = 0.01 a step from the second on, times the 0.9 of the dead band's rest.
    assert levels == pytest.approx([0.3025, 0.3025, 0.3115, 0.3205])
    loiter.step(boat(t_s=0.8), None, ORIGIN)
    assert loiter.step(boat(n_m=-3.0, t_s=1.0), None, ORIGIN).command[0] == pytest.approx(0.3025)
    full = Loiter(CONFIG.model_copy(update={"throttle_p_per_mps": 5.0, "speed_gain_per_s": 1.0}))
    for k in range(20):
        assert full.step(boat(n_m=-9.0, t_s=0.2 * k), None, ORIGIN).command == (1.0, 1.0)
    # At a speed above the wanted one: 0.25 - 5 * 0.1 = -0.25, and no integral beside it.
    slow = full.step(boat(n_m=-9.0, nu=(1.1, 0.0, 0.0), t_s=4.0), None, ORIGIN).command[0]
    assert slow == pytest.approx(-0.1 - 0.9 * 0.25)


def test_neither_wind_nor_the_stations_heading_counts():
    at = boat(n_m=-6.0, e_m=1.0, psi_deg=20.0)
    turned = Station(n_m=0.0, e_m=0.0, psi_rad=1.0)
    assert Loiter(CONFIG).step(at, air(6.0, 3.0), turned) == Loiter(CONFIG).step(at, None, ORIGIN)


def test_reset_forgets_and_equal_calls_agree():
    loiter = Loiter(CONFIG)
    first = [loiter.step(boat(n_m=-5.0, psi_deg=3.0 * k, t_s=0.2 * k), None, ORIGIN) for k in range(8)]
    loiter.reset()
    again = [loiter.step(boat(n_m=-5.0, psi_deg=3.0 * k, t_s=0.2 * k), None, ORIGIN) for k in range(8)]
    assert first == again and first[0].command != first[-1].command


@pytest.mark.parametrize("field", ["n_m", "e_m", "psi_rad", "u_mps", "r_radps"])
def test_what_is_not_finite_is_not_ok(field):
    control = Loiter(CONFIG).step(dataclasses.replace(boat(n_m=-5.0), **{field: math.nan}), None, ORIGIN)
    assert (control.ok, control.command) == (False, (0.0, 0.0))


def test_along_the_wind_it_sits_near_its_radius():
    assert distance_after("loiter", 60.0, "controller.loiter.radius_m=1") < 2.5
