"""Backstepping against its equations by hand, and what the classical laws share: steering, wind and frames."""

import dataclasses
import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from asvhil.config import BacksteppingConfig, SteeringConfig
from asvhil.controller.backstepping import Backstepping
from asvhil.controller.classical import Steering, TrackingState
from asvhil.geo import wrap_rad
from asvhil.types import Station
from tests.support.classical_boat import ORIGIN, VESSEL, air, boat, forces
from tests.support.classical_loop import distance_after

STEERING = SteeringConfig(error_max_m=20.0, radius_m=5.0, lean_max_deg=10.0, lean_from_m=1.0, lean_fade_n=20.0)
CONFIG = BacksteppingConfig(
    lambda_per_s=(0.5, 0.5, 1.0), kd=(40.0, 40.0, 50.0), kp=(10.0, 10.0, 20.0), steering=STEERING
)


def controller(**changes) -> Backstepping:
    return Backstepping(VESSEL, CONFIG.model_copy(update=changes))


def steered(**changes) -> dict[str, SteeringConfig]:
    return {"steering": STEERING.model_copy(update=changes)}


# --- the law -----------------------------------------------------------------------------------------------


def test_two_metres_ahead_at_rest():
    # eta_r_dot = -0.5 * 2 = -1: D1 gives 10 * -1. s = 1: Kd gives -40. Kp gives -10 * 2.
    motion = TrackingState(t_ns=0, error=(2.0, 0.0, 0.0), rate=(0.0, 0.0, 0.0), nu=(0.0, 0.0, 0.0), psi_rad=0.0)
    assert controller().law(motion) == pytest.approx((-70.0, 0.0, 0.0))


def test_a_moving_turning_boat_across_the_station():
    # Heading 90 deg: x_dot = -v = -0.5, y_dot = u = 1.
    # eta_r_dot = (-0.5, -1, -0.3) -> R^T: (-1, 0.5, -0.3);  eta_r_ddot = (0.25, -0.5, -0.2) -> R^T: (-0.5, -0.25, -0.2)
    # Rdot^T eta_r_dot = r (v_r, -u_r, 0) = (0.1, 0.2, 0);  so nu_r_dot = (-0.4, -0.05, -0.2)
    # M1: (-40, -7.5, -40);  D1: (-10, 10, -9)
    # C1: (-m_v v r_r, m_u u r_r, m_v v u_r - m_u u v_r) = (22.5, -30, -75 - 50)
    # s = (0, 2, 0.5): Kd s = (0, 80, 25);  Kp e = (10, 20, 6);  R^T (10, 100, 31) = (100, -10, 31)
    motion = TrackingState(
        t_ns=0, error=(1.0, 2.0, 0.3), rate=(-0.5, 1.0, 0.2), nu=(1.0, 0.5, 0.2), psi_rad=math.radians(90.0)
    )
    assert controller().law(motion) == pytest.approx((-27.5 - 100.0, -27.5 + 10.0, -174.0 - 31.0))


def test_the_law_reaches_the_motors():
    # As in the first case: X = -70, N = 0, -35 N each: -0.1 - 0.9 * 0.35.
    control = controller().step(boat(n_m=2.0), None, ORIGIN)
    assert control.ok and control.command == pytest.approx((-0.415, -0.415))


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


def test_saturated_far_off_it_gives_full_thrust_and_still_turns():
    far = controller(**steered(error_max_m=500.0)).step(boat(n_m=-200.0, psi_deg=5.0), None, ORIGIN)
    assert max(far.command) == 1.0 and far.command[0] < far.command[1]


def test_the_error_is_shortened_and_keeps_its_direction():
    near, far = (controller(**steered(error_max_m=3.0)) for _ in range(2))
    # Both are steered towards the station from the south-west with the bow on it.
    a = near.step(boat(n_m=-6.0, e_m=-6.0, psi_deg=45.0), None, ORIGIN).command
    b = far.step(boat(n_m=-60.0, e_m=-60.0, psi_deg=45.0), None, ORIGIN).command
    assert a == pytest.approx(b)
    # 3 m at 10 * 0.5 + 40 * 0.5 + 10 = 35 N/m
    assert forces(a) == pytest.approx((105.0, 0.0), abs=1e-6)


# --- wind --------------------------------------------------------------------------------------------------


def test_the_wind_load_is_taken_off():
    # Wind of 3 m/s north and 3 m/s east on a boat at rest that points north: X 4.5, N -2 * 0.25 * 9 = -4.5.
    assert forces(controller().step(boat(), air(3.0, 3.0), ORIGIN).command) == pytest.approx((-4.5, 4.5))
    # At 0.5 m/s ahead the air of 3.5 m/s comes at 3 m/s too: X 4.5 on top of M1 0.5 * 0.5 * 100 and Kd 40 * 0.5.
    moving = boat(nu=(0.5, 0.0, 0.0))
    assert forces(controller().step(moving, air(3.5, 0.0), ORIGIN).command) == pytest.approx((-49.5, 0.0))


def test_the_wind_can_be_switched_off_or_be_unknown():
    assert controller(wind_feedforward=False).step(boat(), air(6.0, 2.0), ORIGIN).command == (0.0, 0.0)
    assert controller().step(boat(), None, ORIGIN).command == (0.0, 0.0)


# --- steering ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("at", "reference_deg"),
    [
        ((-10.0, 0.0, 0.0), 0.0),  # ahead, bow first
        ((10.0, 0.0, 0.0), 0.0),  # astern, stern first
        ((0.0, -10.0, 10.0), 90.0),  # the station lies to starboard; the bow is nearer
        ((0.0, -10.0, -10.0), -90.0),  # and here the stern
        ((-3.0, -3.0, 70.0), 0.0),  # within the radius the station's heading
    ],
)
def test_the_heading_reference(at, reference_deg):
    x_m, y_m, psi_deg = at
    got_rad = Steering(STEERING).reference_rad(x_m, y_m, math.radians(psi_deg))
    assert math.degrees(wrap_rad(got_rad - math.radians(reference_deg))) == pytest.approx(0.0, abs=1e-9)


def test_steering_has_hysteresis_in_distance_and_in_the_end_that_leads():
    steering = Steering(STEERING)
    seen = []
    for x_m in (-4.0, -6.0, -3.0, -2.4, -4.0):
        steering.reference_rad(x_m, 0.0, 0.0)
        seen.append(steering.away)
    assert seen == [False, True, True, False, False]
    ends = []
    for psi_deg in (80.0, 110.0, 125.0, 80.0, 50.0):  # off the bearing to the station, which is 0
        ends.append(round(math.degrees(wrap_rad(steering.reference_rad(-8.0, 0.0, math.radians(psi_deg))))))
    assert [abs(end) for end in ends] == [0, 0, 180, 180, 0]


@pytest.mark.parametrize(
    ("y_m", "surge_n", "sway_n", "lean_deg"),
    [
        (2.0, -20.0, -20.0, 10.0),  # atan(400 / 800) is 27 deg, bounded; astern with the bow to starboard goes to port
        (2.0, 20.0, -20.0, -10.0),
        (-3.0, -20.0, 4.0, math.degrees(math.atan(-80.0 / 800.0))),
        (1.5, 20.0, -20.0, -5.0),  # half way into it
        (1.0, 20.0, -20.0, 0.0),
        (2.0, 0.0, -20.0, 0.0),
    ],
)
def test_the_lean_by_hand(y_m, surge_n, sway_n, lean_deg):
    assert math.degrees(Steering(STEERING).lean_rad(y_m, 0.0, surge_n, sway_n)) == pytest.approx(lean_deg)


def test_the_lean_turns_the_boat_so_that_its_thrust_carries_it_back():
    # 1 m ahead and 3 m to starboard: thrust astern, and the bow to starboard.
    x_n, n_nm = forces(controller().step(boat(n_m=1.0, e_m=3.0), None, ORIGIN).command)
    assert x_n < 0.0 < n_nm
    without = controller(**steered(lean_max_deg=0.0)).step(boat(n_m=1.0, e_m=3.0), None, ORIGIN)
    assert forces(without.command)[1] == pytest.approx(0.0, abs=1e-9)


# --- frames, memory, bad input -----------------------------------------------------------------------------


@settings(max_examples=25, deadline=None)
@given(
    n_m=st.floats(-500, 500),
    e_m=st.floats(-500, 500),
    turn_rad=st.floats(-7, 7),
    at=st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(-80, 80)),
)
def test_nothing_depends_on_where_the_station_is_or_points(n_m, e_m, turn_rad, at):
    x_m, y_m, psi_deg = at
    # At its radius, and with the station exactly abeam, the steering is a matter of the last bit.
    assume(abs(math.hypot(x_m, y_m) - STEERING.radius_m) > 1e-6)
    assume(abs(math.cos(math.atan2(y_m, x_m) - math.radians(psi_deg))) > 1e-6)
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    plain = controller().step(boat(x_m, y_m, psi_deg, (0.4, -0.1, 0.1)), air(2.0, 1.0), ORIGIN)
    moved = controller().step(
        boat(n_m + c * x_m - s * y_m, e_m + s * x_m + c * y_m, psi_deg + math.degrees(turn_rad), (0.4, -0.1, 0.1)),
        air(2.0 * c - 1.0 * s, 2.0 * s + 1.0 * c),
        Station(n_m=n_m, e_m=e_m, psi_rad=turn_rad),
    )
    assert forces(moved.command) == pytest.approx(forces(plain.command), abs=1e-4)


def test_the_heading_error_goes_the_short_way():
    station = Station(n_m=0.0, e_m=0.0, psi_rad=math.radians(179.0))
    n_nm = forces(controller().step(boat(psi_deg=-179.0), None, station).command)[1]  # 2 deg too far clockwise
    assert n_nm == pytest.approx(-math.radians(2.0) * (30.0 + 50.0 + 20.0))
    turned = controller().step(boat(psi_deg=-179.0 + 720.0), None, station).command
    assert forces(turned)[1] == pytest.approx(n_nm)


def test_reset_and_a_new_station_forget_the_steering():
    at = boat(n_m=-3.0, e_m=-2.0)
    fresh = controller().step(at, None, ORIGIN)
    used = controller()
    used.step(boat(n_m=-9.0), None, ORIGIN)
    assert used.step(at, None, ORIGIN) != fresh  # still on its way
    used.reset()
    assert used.step(at, None, ORIGIN) == fresh
    moved = Station(n_m=5.0, e_m=0.0, psi_rad=0.0)
    used.new_station()
    used.step(boat(n_m=-9.0), None, moved)
    used.new_station()
    assert used.step(at, None, ORIGIN) == fresh


def test_the_same_calls_give_the_same_bits():
    def run():
        keeper = controller()
        return [
            keeper.step(boat(-8.0 + 0.7 * k, 2.0 - 0.2 * k, 3.0 * k, (0.3, 0.1, 0.05)), air(3.0, 1.0), ORIGIN)
            for k in range(12)
        ]

    assert run() == run()


@pytest.mark.parametrize("field", ["n_m", "e_m", "psi_rad", "u_mps", "v_mps", "r_radps"])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_not_finite_is_not_ok(field, value):
    keeper = controller()
    control = keeper.step(dataclasses.replace(boat(n_m=1.0), **{field: value}), None, ORIGIN)
    assert (control.ok, control.command) == (False, (0.0, 0.0))
    assert keeper.step(boat(n_m=1.0), None, ORIGIN) == controller().step(boat(n_m=1.0), None, ORIGIN)


def test_a_wind_that_is_not_finite_is_not_ok():
    assert not controller().step(boat(), air(math.nan, 0.0), ORIGIN).ok


def test_along_the_wind_it_keeps_the_station():
    assert distance_after("backstepping", 60.0) < 2.0
