"""ILOS guidance by hand and in closed loop: the law, its integral, the speed law, and the inversion to the motors."""

import math

import numpy as np
import pytest

from asvhil.config import ProcedureConfig, load_config
from asvhil.controller.dubins import Dubins, shortest
from asvhil.controller.ilos import Guidance, Helm, Ilos, approach_speed
from asvhil.dynamics.integrate import advance
from asvhil.dynamics.rigid_body import RigidBody, SimplifiedDynamics, ThrustCurve
from asvhil.types import Estimate, Wind

VESSEL = load_config("sitl").vehicle.vessel
MODEL = SimplifiedDynamics(VESSEL)
CONFIG = ProcedureConfig()
NORTH = Dubins(begin=(0.0, 0.0, 0.0), word="LSL", radius_m=8.0, pieces_m=(0.0, 1000.0, 0.0))
CIRCLE = Dubins(begin=(0.0, 0.0, 0.0), word="RSR", radius_m=8.0, pieces_m=(50.0, 0.0, 0.0))


def estimate(n_m=0.0, e_m=0.0, psi_rad=0.0, u_mps=0.0, v_mps=0.0, r_radps=0.0, disturbance=(0.0, 0.0, 0.0)) -> Estimate:
    return Estimate(
        t_ns=0,
        n_m=n_m,
        e_m=e_m,
        psi_rad=psi_rad,
        u_mps=u_mps,
        v_mps=v_mps,
        r_radps=r_radps,
        motor=(0.0, 0.0),
        std=(0.1,) * 6,
        disturbance=disturbance,
        valid=True,
    )


def air(vn_mps: float, ve_mps: float) -> Wind:
    return Wind(t_ns=0, vn_mps=vn_mps, ve_mps=ve_mps, std_mps=0.0, valid=True)


# --- guidance ------------------------------------------------------------------------------------------------


def test_to_starboard_of_the_path_it_steers_to_port_by_the_look_ahead():
    guidance = Ilos(CONFIG).step(NORTH, estimate(n_m=5.0, e_m=CONFIG.lookahead_m, u_mps=1.0), 0.0)
    assert guidance.cross_m == pytest.approx(CONFIG.lookahead_m)
    assert guidance.along_m == pytest.approx(5.0)
    assert guidance.psi_rad == pytest.approx(-math.pi / 4)
    assert guidance.r_radps == 0.0


def test_a_drift_to_starboard_is_held_up_against():
    guidance = Ilos(CONFIG).step(NORTH, estimate(u_mps=1.0, v_mps=0.2), 0.0)
    assert guidance.psi_rad == pytest.approx(-math.atan(0.2))


def test_the_yaw_rate_of_a_turn_is_known_beforehand():
    """On the circle u / R; a metre inside of it the foot on the path is faster than the boat: u / (R - 1)."""
    assert Ilos(CONFIG).step(CIRCLE, estimate(u_mps=1.6), 0.0).r_radps == pytest.approx(0.2)
    assert Ilos(CONFIG).step(CIRCLE, estimate(e_m=1.0, u_mps=1.4), 0.0).r_radps == pytest.approx(0.2)


def test_the_integral_follows_its_equation_and_its_bound():
    ilos = Ilos(CONFIG)
    ilos.step(NORTH, estimate(e_m=2.0, psi_rad=-0.2, u_mps=1.0), 0.5)
    assert ilos.integral_s == pytest.approx(0.5 * 8.0 * 2.0 / (2.0**2 + 8.0**2))
    for _ in range(10_000):
        ilos.step(NORTH, estimate(e_m=2.0, psi_rad=-0.6, u_mps=1.0), 0.5)
    assert ilos.integral_s == pytest.approx(CONFIG.integral_max_m / CONFIG.integral_gain)


def test_far_off_and_off_course_the_integral_hardly_grows():
    """The windup that a plain integral has: 60 s at 100 m off would be 6000 m s."""
    ilos = Ilos(CONFIG)
    for _ in range(300):
        ilos.step(NORTH, estimate(e_m=100.0, psi_rad=-math.pi / 2, u_mps=1.0), 0.2)
    assert 0.0 < ilos.integral_s < 5.0
    ilos.begin()
    ilos.step(NORTH, estimate(e_m=2.0, psi_rad=2.0, u_mps=1.0), 0.2)
    assert ilos.integral_s == 0.0


@pytest.mark.parametrize("gain", [0.5, 0.0])
def test_the_integral_takes_out_a_drift_that_no_estimate_shows(gain):
    """A boat that turns at once and is carried 0.25 m/s to the east unseen: with the integral, onto the path."""
    ilos = Ilos(CONFIG.model_copy(update={"integral_gain": gain}))
    n_m, e_m, psi_rad = 0.0, 3.0, 0.0
    for _ in range(1500):
        psi_rad = ilos.step(NORTH, estimate(n_m=n_m, e_m=e_m, psi_rad=psi_rad, u_mps=1.0), 0.2).psi_rad
        n_m, e_m = n_m + 0.2 * math.cos(psi_rad), e_m + 0.2 * (math.sin(psi_rad) + 0.25)
    assert abs(e_m) < 0.02 if gain else e_m == pytest.approx(8.0 * math.tan(math.asin(0.25)), abs=0.02)


def test_where_a_path_crosses_itself_the_foot_stays_on_its_branch():
    """North, three quarters of a circle to starboard, then west across the first leg at 12 m north."""
    path = Dubins(begin=(0.0, 0.0, 0.0), word="SRS", radius_m=8.0, pieces_m=(20.0, 12.0 * math.pi, 30.0))
    ilos = Ilos(CONFIG)
    for n_m in (6.0, 12.0):
        guidance = ilos.step(path, estimate(n_m=n_m, e_m=-0.5, u_mps=1.0), 0.2)
        assert (guidance.along_m, guidance.cross_m) == pytest.approx((n_m, -0.5))


# --- speed ---------------------------------------------------------------------------------------------------


def test_the_speed_falls_to_the_hand_over():
    config = ProcedureConfig(speed_mps=1.5, handover_speed_mps=0.8, slow_down_mps2=0.05)
    assert approach_speed(config, 60.0, 0.0) == 1.5
    assert approach_speed(config, 21.0, 0.0) == pytest.approx(math.sqrt(0.64 + 0.6))
    assert approach_speed(config, 15.0, 0.0) == pytest.approx(0.8)
    assert approach_speed(config, 7.5, 0.0) == pytest.approx(0.4)
    assert approach_speed(config, 60.0, math.pi / 3) == pytest.approx(0.75)
    assert approach_speed(config, 60.0, -2.0) == 0.0


# --- the two motors ----------------------------------------------------------------------------------------------


def steer(psi_rad: float, r_radps: float = 0.0) -> Guidance:
    return Guidance(psi_rad=psi_rad, r_radps=r_radps, along_m=0.0, cross_m=0.0)


def test_a_head_wind_is_met_by_its_load():
    """6 m/s from ahead on a boat at rest: 0.5 * 36 = 18 N, 9 N a motor, which the thrust curve has at 0.3."""
    command = Helm(CONFIG, VESSEL).command(estimate(), air(-6.0, 0.0), steer(0.0), 0.0)
    assert command == pytest.approx((0.3, 0.3))
    assert Helm(CONFIG, VESSEL).command(estimate(), None, steer(0.0), 0.0) == (0.0, 0.0)


def test_the_motors_give_the_commanded_acceleration():
    """In any state, wind and disturbance: u_dot = (u_d - u) / T_u and r_dot = (r_d - r) / T_r."""
    body, curve = RigidBody(VESSEL), ThrustCurve(VESSEL.thrust_curve)
    u, v, r, wind, push = 1.2, -0.15, 0.08, (3.0, -4.0), (0.02, -0.03, 0.01)
    psi = 0.7
    state = estimate(psi_rad=psi, u_mps=u, v_mps=v, r_radps=r, disturbance=push)
    command = Helm(CONFIG, VESSEL).command(state, air(*wind), steer(psi + 0.1, 0.05), 1.3)
    c, s = math.cos(psi), math.sin(psi)
    x_n, n_nm = body.motor_forces(*(curve.thrust_n(part) for part in command))
    loads = body.wind_forces(c * wind[0] + s * wind[1] - u, c * wind[1] - s * wind[0] - v)
    u_dot, _, r_dot = body.acceleration(u, v, r, x_n + loads[0], loads[1], n_nm + loads[2])
    assert u_dot + c * push[0] + s * push[1] == pytest.approx((1.3 - u) / CONFIG.surge_time_s, abs=1e-6)
    wanted = 0.05 + 0.1 / CONFIG.heading_time_s
    assert r_dot + push[2] == pytest.approx((wanted - r) / CONFIG.yaw_rate_time_s, abs=1e-6)


@pytest.mark.parametrize("toward_deg", [0.0, 90.0, 200.0])
def test_a_boat_in_six_metres_of_wind_stays_on_its_path(toward_deg):
    """The rigid body with motor lag from rest, 60 m off: never 2 m off the path, half a metre on its last straight."""
    wind = np.array([6.0 * math.cos(math.radians(toward_deg)), 6.0 * math.sin(math.radians(toward_deg))])
    path = shortest((0.0, 0.0, 2.5), (60.0, 0.0, 0.0), CONFIG.turn_radius_m)
    ilos, helm = Ilos(CONFIG), Helm(CONFIG, VESSEL)
    s = np.array([0.0, 0.0, 2.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    errors, along_m = [], 0.0
    for _ in range(500):
        now = estimate(*s[:6].tolist())
        guidance = ilos.step(path, now, 0.2)
        along_m = guidance.along_m
        if along_m > path.length_m - 1.0:
            break
        errors.append((along_m, abs(guidance.cross_m)))
        a = np.array(MODEL.input_of_command(helm.command(now, air(*wind), guidance, CONFIG.speed_mps)))
        s = advance(MODEL, s, a, wind, np.zeros(3), 0.2, 4)
    assert along_m > path.length_m - 1.0
    assert max(error for _, error in errors) < 2.0
    assert max(error for at_m, error in errors if at_m > path.length_m - 10.0) < 0.5
    assert s[3] == pytest.approx(CONFIG.speed_mps, abs=0.1)
