"""Slow errors: of a fused velocity, which must not change the position; and of a receiver's position."""

import math

import numpy as np
import pytest

from asvhil.config import load_config
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.estimator.ekf import Ekf
from asvhil.estimator.states import B_E, B_N, DEVIATION
from asvhil.geo import LocalFrame
from asvhil.types import GroundVelocity, Heading, Position, YawRate

ORIGIN = LocalFrame(lat_deg=40.4, lon_deg=-86.9)
S = 1_000_000_000
BIAS = "estimator.ekf.position_bias_std_m=1"


def at_rest(
    ekf: Ekf, from_s: int, to_s: int, *, velocity: tuple[float, float] = (0.0, 0.0), fused: bool = False,
    position: tuple[float, float] = (0.0, 0.0), heading_deg: float = 0.0,
) -> tuple[float, float]:  # fmt: skip
    """A boat at rest at the origin, fixes at 5 Hz; where the filter has it (m, NED) at the end."""
    rng = np.random.default_rng(from_s)
    for tick in range(from_s * 5, to_s * 5):
        t_ns = tick * S // 5
        psi = math.radians(heading_deg + rng.normal(0.0, 0.25))
        ekf.on_measurements([Heading(t_ns=t_ns, psi_rad=psi), YawRate(t_ns=t_ns, r_radps=rng.normal(0.0, 0.005))])
        lat, lon = ORIGIN.to_geodetic(*(position + rng.normal(0.0, 0.03, 2)))
        vn, ve = velocity + rng.normal(0.0, 0.02, 2)
        fix = Position(t_ns=t_ns, lat_deg=lat, lon_deg=lon)
        ekf.on_measurements([fix, GroundVelocity(t_ns=t_ns, vn_mps=vn, ve_mps=ve, fused=fused)])
    found = ekf.estimate(to_s * S)
    assert found is not None and ekf.frame is not None
    n, e = ekf.frame.to_ned(ORIGIN.lat_deg, ORIGIN.lon_deg)
    return found.n_m - n, found.e_m - e


def make(*overrides: str) -> Ekf:
    config = load_config("sitl", (BIAS, *overrides))
    return Ekf(config.estimator, SimplifiedDynamics(config.vehicle.vessel))


@pytest.mark.parametrize("velocity", [(0.015, 0.0), (-0.02, 0.01), (0.0, -0.015)])
def test_a_fused_velocity_does_not_move_the_estimate_off_the_fused_position(velocity: tuple[float, float]) -> None:
    assert math.hypot(*at_rest(make(), 0, 240, velocity=velocity, fused=True)) < 0.3
    # As one that is independent, it does.
    assert math.hypot(*at_rest(make(), 0, 240, velocity=velocity)) > 1.0


def test_with_a_fused_velocity_an_estimated_bias_decays() -> None:
    ekf = make()
    at_rest(ekf, 0, 60)
    assert math.hypot(*at_rest(ekf, 60, 70, position=(0.6, 0.0))) < 0.15
    assert ekf.state is not None and ekf.state.x[B_N] > 0.4
    n, _ = at_rest(ekf, 70, 430, position=(0.6, 0.0), fused=True)
    assert n == pytest.approx(0.6, abs=0.1) and abs(ekf.state.x[B_N]) < 0.1


def test_a_slow_error_of_a_metre_does_not_move_the_estimate_with_it() -> None:
    ekf, worst = make(), 0.0
    for k in range(48):
        slow = (math.sin(k / 9.0), 0.7 * math.sin(k / 14.0))
        worst = max(worst, math.hypot(*at_rest(ekf, 5 * k, 5 * k + 5, position=slow)))
    assert worst < 0.35


@pytest.mark.parametrize(("jump", "followed"), [(2.7, False), (8.0, True)])
def test_a_filter_that_has_just_started_follows_a_jump_that_no_slow_error_makes(jump: float, followed: bool) -> None:
    ekf = make()
    at_rest(ekf, 0, 3)
    n, _ = at_rest(ekf, 3, 20, position=(jump, 0.0))
    assert ekf.resets == 1
    assert n == pytest.approx(jump if followed else 0.0, abs=0.4)
    assert ekf.state is not None and abs(ekf.state.x[[B_N, B_E]]).max() < 3.0


def test_a_fused_velocity_does_not_change_the_compass_deviation() -> None:
    compass = "estimator.ekf.compass={std_deg: 1, walk_deg: 0.02}"
    for fused in (True, False):
        ekf = make(compass)
        at_rest(ekf, 0, 60, velocity=(0.5, 0.02), fused=fused)
        assert ekf.state is not None
        assert bool(ekf.state.x[DEVIATION].any()) is not fused
