"""Where sensors are and what they are wrong by: lever arms, biases of accelerometer and gyro; a wind lost and found."""

import math

import numpy as np
import pytest

from asvhil.config import load_config
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.estimator.ekf import Ekf
from asvhil.estimator.states import A_X, A_Y, G_R
from asvhil.geo import LocalFrame
from asvhil.types import Estimate, GroundVelocity, Heading, Position, SpecificForce, YawRate

CONFIG = load_config("sitl")
ORIGIN = LocalFrame(lat_deg=40.4, lon_deg=-86.9)
S = 1_000_000_000


def spin(ekf: Ekf, seconds: float, rate: float, *, antenna: tuple[float, float] = (0.0, 0.0),
         imu: tuple[float, float] = (0.0, 0.0), bias: tuple[float, float, float] = (0.0, 0.0, 0.0),
         told: bool = True) -> Estimate:  # fmt: skip
    """A boat that its motors turn on the spot about its origin; `told`: the filter knows where the sensors are."""
    vessel = CONFIG.vehicle.vessel
    moment_nm = (vessel.yaw_drag_nm_per_radps + vessel.yaw_drag_nm_per_radps2 * rate) * rate
    thrust = moment_nm / (2.0 * vessel.motor_arm_m * vessel.thrust_curve[-1][1])
    rng = np.random.default_rng(6)
    for tick in range(round(seconds * 20) + 1):
        t_s = tick / 20
        t_ns, psi = round(t_s * S), rate * t_s
        c, s = math.cos(psi), math.sin(psi)
        heading = Heading(t_ns=t_ns, psi_rad=psi + rng.normal(0, 0.004))
        ekf.on_measurements([heading, YawRate(t_ns=t_ns, r_radps=rate + bias[2])])
        # Centripetal: towards the origin from where the accelerometer is.
        ax, ay = -(rate**2) * imu[0] + bias[0], -(rate**2) * imu[1] + bias[1]
        noise = rng.normal(0, 0.02, 2)
        arm = imu if told else (0.0, 0.0)
        ekf.on_measurements([SpecificForce(t_ns=t_ns, ax_mps2=ax + noise[0], ay_mps2=ay + noise[1], arm_m=arm)])
        if tick % 4 == 0:
            n, e = c * antenna[0] - s * antenna[1], s * antenna[0] + c * antenna[1]
            lat, lon = ORIGIN.to_geodetic(n, e)
            arm = antenna if told else (0.0, 0.0)
            position = Position(t_ns=t_ns, lat_deg=lat, lon_deg=lon, arm_m=arm)
            ekf.on_measurements([position, GroundVelocity(t_ns=t_ns, vn_mps=-rate * e, ve_mps=rate * n, arm_m=arm)])
        ekf.set_forcing((thrust, -thrust), (0.0, 0.0))
    found = ekf.estimate(round(seconds * S))
    assert found is not None and ekf.frame is not None
    return found


def make() -> Ekf:
    return Ekf(CONFIG.estimator, SimplifiedDynamics(CONFIG.vehicle.vessel))


@pytest.mark.parametrize("told", [True, False])
def test_an_antenna_at_the_bow_moves_and_the_boat_that_spins_does_not(told: bool) -> None:
    found = spin(make(), 20.0, 0.2, antenna=(1.5, 0.4), told=told)
    speed = math.hypot(found.u_mps, found.v_mps)
    if told:
        assert speed < 0.02 and math.hypot(found.n_m + 1.5, found.e_m + 0.4) < 0.1  # the frame begins at the antenna
    else:
        assert speed > 0.2


@pytest.mark.parametrize("told", [True, False])
def test_an_accelerometer_off_the_origin_measures_the_turn_and_its_bias_stays(told: bool) -> None:
    ekf = make()
    spin(ekf, 60.0, 0.25, imu=(-2.0, 0.5), told=told)
    assert ekf.state is not None
    bias = ekf.state.x[[A_X, A_Y]]
    expected = (0.0, 0.0) if told else (0.125, -0.031)
    assert bias.tolist() == pytest.approx(expected, abs=0.015)


def test_biases_of_accelerometer_and_gyro_are_found() -> None:
    ekf = make()
    spin(ekf, 120.0, 0.1, bias=(0.05, -0.03, 0.002))
    assert ekf.state is not None
    assert ekf.state.x[[A_X, A_Y]].tolist() == pytest.approx([0.05, -0.03], abs=0.01)
    assert ekf.state.x[G_R] == pytest.approx(0.002, abs=0.0007)


def test_a_wind_that_is_lost_and_found_again_leaves_the_prediction_as_it_was() -> None:
    ekf = make()
    ekf.on_measurements([Heading(t_ns=0, psi_rad=0.4), YawRate(t_ns=0, r_radps=0.0)])
    position = Position(t_ns=0, lat_deg=40.4, lon_deg=-86.9)
    ekf.on_measurements([position, GroundVelocity(t_ns=0, vn_mps=0.0, ve_mps=0.0)])
    ekf.set_forcing((0.1, 0.1), (5.0, 2.0))
    ekf.predict(S)
    assert ekf.state is not None
    before = ekf.state.x.copy()
    ekf.set_forcing((0.1, 0.1), None)
    assert ekf.state.x[6:9] == pytest.approx([0.046, 0.011, 0.0], abs=0.02) and ekf.state.x[6] > 0.02
    assert ekf.state.x[:6] == pytest.approx(before[:6])
    ekf.set_forcing((0.1, 0.1), (5.0, 2.0))
    assert ekf.state.x == pytest.approx(before, abs=1e-12)
