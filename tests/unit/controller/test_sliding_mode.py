"""Sliding mode against its equations by hand: surface, boundary layer, reference, integral and its anti-windup."""

import dataclasses
import math

import pytest

from asvhil.config import SlidingModeConfig, SteeringConfig
from asvhil.controller.classical import TrackingState
from asvhil.controller.sliding_mode import SlidingMode
from asvhil.types import Station
from tests.support.classical_boat import ORIGIN, VESSEL, air, boat, forces
from tests.support.classical_loop import distance_after

STEERING = SteeringConfig(error_max_m=20.0, radius_m=8.0, lean_max_deg=0.0)
CONFIG = SlidingModeConfig(
    lambda_per_s=(0.5, 0.5, 1.0),
    bound=(60.0, 60.0, 80.0),
    layer=(2.0, 2.0, 4.0),
    integral_max=(3.0, 3.0, 0.5),
    steering=STEERING,
)


def controller(**changes) -> SlidingMode:
    return SlidingMode(VESSEL, CONFIG.model_copy(update=changes))


def at_rest(x_m: float, y_m: float = 0.0, psi_error_rad: float = 0.0, psi_rad: float = 0.0) -> TrackingState:
    error = (x_m, y_m, psi_error_rad)
    return TrackingState(t_ns=0, error=error, rate=(0.0, 0.0, 0.0), nu=(0.0, 0.0, 0.0), psi_rad=psi_rad)


def held(keeper: SlidingMode, seconds: float, **pose) -> SlidingMode:
    """After as many calls at 5 Hz with the boat held in one place."""
    for k in range(round(5 * seconds) + 1):
        keeper.step(boat(**pose, t_s=0.2 * k), None, ORIGIN)
    return keeper


def test_within_the_boundary_layer():
    # s = 2 * 0.5 * 0.5 = 0.5, a quarter of the layer: 15 N.  eta_r_dot = -0.5, eta_r_ddot = -0.25 * 0.5 = -0.125:
    # M1 -12.5 N, D1 -5 N. With eta_s in their place, as the paper prints it, -15 N would be all.
    assert controller().law(at_rest(0.5)) == pytest.approx((-12.5 - 5.0 - 15.0, 0.0, 0.0))


def test_beyond_the_boundary_layer_with_an_integral():
    # s = 2 + 0.25 * 4 = 3, sat(1.5) = 1: 60 N.  eta_r_dot = -2 - 1 = -3, eta_r_ddot = -0.5: M1 -50 N, D1 -30 N.
    keeper = controller()
    keeper.integral = (4.0, 0.0, 0.0)
    assert keeper.surface(at_rest(2.0)) == pytest.approx((3.0, 0.0, 0.0))
    assert keeper.law(at_rest(2.0)) == pytest.approx((-140.0, 0.0, 0.0))


def test_a_moving_turning_boat_across_the_station():
    # Heading 90 deg, nu = (1, 0.5, 0.2): rate (-0.5, 1, 0.2). Integral (2, -2, 0.1).
    # s = (-0.5 + 1 + 0.5, 1 + 2 - 0.5, 0.2 + 0.6 + 0.1) = (1, 2.5, 0.9): push (30, 60, 18) -> R^T: (60, -30, 18)
    # eta_r_dot = -(1 + 0.5, 2 - 0.5, 0.6 + 0.1) = (-1.5, -1.5, -0.7) -> R^T: (-1.5, 1.5, -0.7)
    # eta_r_ddot = -(2 L rate + L^2 e) = -(-0.5 + 0.25, 1 + 0.5, 0.4 + 0.3) = (0.25, -1.5, -0.7) -> (-1.5, -0.25, -0.7)
    # Rdot^T eta_r_dot = 0.2 (1.5, 1.5, 0) = (0.3, 0.3, 0);  nu_r_dot = (-1.2, 0.05, -0.7): M1 (-120, 7.5, -140)
    # C1: (-150 * 0.5 * -0.7, 100 * -0.7, 75 * -1.5 - 100 * 1.5) = (52.5, -70, -262.5);  D1: (-15, 30, -21)
    keeper = controller()
    keeper.integral = (2.0, -2.0, 0.1)
    motion = TrackingState(
        t_ns=0, error=(1.0, 2.0, 0.3), rate=(-0.5, 1.0, 0.2), nu=(1.0, 0.5, 0.2), psi_rad=math.radians(90.0)
    )
    assert keeper.law(motion) == pytest.approx((-82.5 - 60.0, -32.5 + 30.0, -423.5 - 18.0))


@pytest.mark.parametrize(
    ("at", "surge", "yaw"),
    [
        (boat(n_m=2.0), -1, 0),
        (boat(n_m=-2.0), 1, 0),
        (boat(psi_deg=20.0), 0, -1),
        (boat(psi_deg=-20.0), 0, 1),
        (boat(nu=(0.5, 0.0, 0.0)), -1, 0),
        (boat(nu=(0.0, 0.0, 0.3)), 0, -1),
    ],
)
def test_signs(at, surge, yaw):
    x_n, n_nm = forces(controller().step(at, None, ORIGIN).command)
    assert (x_n > 1.0) - (x_n < -1.0) == surge and (n_nm > 1.0) - (n_nm < -1.0) == yaw


def test_the_switching_part_is_bounded():
    """Far beyond the layer only the feed-forward still grows: M1 0.25 + D1 of 10 per metre."""
    keeper = controller()
    ten, eleven = keeper.law(at_rest(10.0))[0], keeper.law(at_rest(11.0))[0]
    assert eleven - ten == pytest.approx(-25.0 - 10.0)


def test_the_wind_load_is_taken_off():
    assert forces(controller().step(boat(), air(3.0, 3.0), ORIGIN).command) == pytest.approx((-4.5, 4.5))
    assert controller(wind_feedforward=False).step(boat(), air(6.0, 2.0), ORIGIN).command == (0.0, 0.0)


# --- the integral ------------------------------------------------------------------------------------------


def test_it_integrates_the_error_over_the_time_of_the_estimates():
    keeper = held(controller(), 2.0, n_m=0.5, e_m=-0.2, psi_deg=3.0)
    assert keeper.integral == pytest.approx((1.0, -0.4, math.radians(6.0)))


def test_an_unknown_wind_is_compensated_by_the_integral():
    keeper = controller()
    first = forces(keeper.step(boat(n_m=0.3), None, ORIGIN).command)[0]
    held(keeper, 5.0, n_m=0.3)
    assert forces(keeper.step(boat(n_m=0.3, t_s=5.2), None, ORIGIN).command)[0] < first - 10.0


def test_the_integral_has_an_end_and_does_not_wind_up_on_sat_or_on_saturated_motors():
    assert held(controller(), 20.0, n_m=0.4).integral[0] == 3.0
    assert held(controller(), 3.0, n_m=-4.0).integral[0] == 0.0  # s = -4 is beyond its layer of 2
    # A moment of 300 N m is all there is; the position error is small, but waits too while the motors are saturated.
    strong = controller(bound=(60.0, 60.0, 2000.0), layer=(2.0, 2.0, 4.0))
    assert held(strong, 3.0, n_m=0.4, psi_deg=100.0).integral == (0.0, 0.0, 0.0)


def test_a_full_integral_is_emptied_at_once_when_the_error_turns_even_beyond_the_layer():
    keeper = controller()
    keeper.step(boat(n_m=-4.0), None, ORIGIN)
    keeper.integral = (2.0, 0.0, 0.0)
    keeper.step(boat(n_m=-4.0, t_s=0.2), None, ORIGIN)
    assert keeper.integral[0] == pytest.approx(1.2)


def test_nothing_is_integrated_far_off_over_a_pause_or_backwards_in_time():
    assert held(controller(layer=(50.0, 50.0, 4.0)), 3.0, n_m=-9.0).integral == (0.0, 0.0, 0.0)
    keeper = controller()
    for t_s in (0.0, 5.0, 4.9):
        keeper.step(boat(n_m=0.5, t_s=t_s), None, ORIGIN)
    assert keeper.integral == (0.0, 0.0, 0.0)


def test_the_heading_error_goes_the_short_way_into_the_integral_too():
    keeper = controller()
    station = Station(n_m=0.0, e_m=0.0, psi_rad=math.radians(179.0))
    for k in range(6):
        keeper.step(boat(psi_deg=-179.0, t_s=0.2 * k), None, station)
    assert keeper.integral[2] == pytest.approx(math.radians(2.0))


# --- memory, bad input, closed loop ------------------------------------------------------------------------


def test_reset_and_a_new_station_empty_the_integral():
    at = boat(n_m=0.5, t_s=9.0)
    fresh = controller().step(at, None, ORIGIN)
    keeper = held(controller(), 3.0, n_m=0.5)
    assert keeper.step(at, None, ORIGIN) != fresh
    keeper.reset()
    assert keeper.step(at, None, ORIGIN) == fresh
    held(keeper, 3.0, n_m=0.5)
    keeper.new_station()
    keeper.step(at, None, Station(n_m=1.0, e_m=0.0, psi_rad=0.0))
    keeper.new_station()
    assert keeper.step(at, None, ORIGIN) == fresh


def test_the_same_calls_give_the_same_bits():
    def run():
        keeper = controller()
        return [
            keeper.step(boat(-6.0 + 0.5 * k, 1.0, 3.0 * k, (0.3, 0.1, 0.05), 0.2 * k), air(3.0, 1.0), ORIGIN)
            for k in range(14)
        ]

    assert run() == run()


@pytest.mark.parametrize("field", ["n_m", "e_m", "psi_rad", "u_mps", "v_mps", "r_radps"])
@pytest.mark.parametrize("value", [math.nan, -math.inf])
def test_what_is_not_finite_is_not_ok_and_leaves_no_trace(field, value):
    keeper = held(controller(), 1.0, n_m=0.5)
    before = keeper.integral
    control = keeper.step(dataclasses.replace(boat(n_m=0.5, t_s=1.2), **{field: value}), None, ORIGIN)
    assert (control.ok, control.command, keeper.integral) == (False, (0.0, 0.0), before)
    assert keeper.step(boat(n_m=0.5, t_s=1.4), None, ORIGIN).ok


def test_along_the_wind_it_keeps_the_station():
    assert distance_after("sliding-mode", 60.0) < 2.0
