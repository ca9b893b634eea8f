"""The filter against motion that is known: consistency, gates, recovery, determinism."""

import math

import numpy as np
import pytest

from asvhil.config import load_config
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.estimator.ekf import Ekf
from asvhil.geo import LocalFrame
from asvhil.types import Attitude, Estimate, GnssFix

CONFIG = load_config("sitl")
ORIGIN = LocalFrame(lat_deg=40.4, lon_deg=-86.9)
S = 1_000_000_000


def make() -> Ekf:
    return Ekf(CONFIG.estimator.ekf, SimplifiedDynamics(CONFIG.vehicle.vessel))


def fix(t_ns: int, n: float, e: float, vn: float = 0.0, ve: float = 0.0) -> GnssFix:
    lat, lon = ORIGIN.to_geodetic(n, e)
    return GnssFix(t_ns=t_ns, lat_deg=lat, lon_deg=lon, vn_mps=vn, ve_mps=ve, h_acc_m=0.1)


def started(t_ns: int = 0, psi: float = 0.0) -> Ekf:
    ekf = make()
    ekf.on_attitude(Attitude(t_ns=t_ns, psi_rad=psi, r_radps=0.0))
    ekf.on_gnss(fix(t_ns, 0.0, 0.0))
    return ekf


def now(ekf: Ekf, t_ns: int) -> Estimate:
    estimate = ekf.estimate(t_ns)
    assert estimate is not None
    return estimate


def test_nothing_before_position_and_heading() -> None:
    ekf = make()
    ekf.on_gnss(fix(0, 0.0, 0.0))
    assert ekf.estimate(0) is None
    ekf.on_attitude(Attitude(t_ns=0, psi_rad=1.0, r_radps=0.0))
    assert ekf.estimate(0) is None
    ekf.on_gnss(fix(S // 10, 0.0, 0.0))
    assert now(ekf, S // 10).psi_rad == pytest.approx(1.0) and ekf.started


def drive(
    ekf: Ekf, seconds: float, rng: np.random.Generator, *, speed: float, psi: float, start_s: float = 0.0
) -> None:
    """A straight line at constant speed with sensor noise: attitude at 20 Hz, fixes at 10 Hz."""
    for tick in range(1, round(seconds * 20) + 1):
        t_s = start_s + tick / 20
        t_ns = round(t_s * S)
        ekf.on_attitude(
            Attitude(t_ns=t_ns, psi_rad=psi + rng.normal(0, math.radians(0.25)), r_radps=rng.normal(0, 0.009))
        )
        if tick % 2 == 0:
            n, e = speed * t_s * math.cos(psi), speed * t_s * math.sin(psi)
            vn, ve = speed * math.cos(psi) + rng.normal(0, 0.05), speed * math.sin(psi) + rng.normal(0, 0.05)
            ekf.on_gnss(fix(t_ns, n + rng.normal(0, 0.07), e + rng.normal(0, 0.07), vn, ve))


def test_it_finds_a_straight_line_through_noise_and_knows_how_well() -> None:
    psi = math.radians(170.0)
    ekf = started(psi=psi)
    rng = np.random.default_rng(1)
    drive(ekf, 40.0, rng, speed=1.0, psi=psi)
    estimate = now(ekf, 40 * S)
    assert estimate.valid
    assert math.hypot(estimate.n_m - 40 * math.cos(psi), estimate.e_m - 40 * math.sin(psi)) < 0.15
    assert estimate.u_mps == pytest.approx(1.0, abs=0.05) and estimate.v_mps == pytest.approx(0.0, abs=0.05)
    assert estimate.psi_rad == pytest.approx(psi, abs=math.radians(0.4))
    assert all(0.0 < std < limit for std, limit in zip(estimate.std, (0.2, 0.2, 0.01, 0.1, 0.1, 0.02), strict=True))


def test_an_unmodelled_push_becomes_the_disturbance() -> None:
    # A hull that is pulled along at 0.5 m/s with its motors off must be pushed: drag of 43.8 N on 279.95 kg.
    ekf = started()
    drive(ekf, 120.0, np.random.default_rng(2), speed=0.5, psi=0.0)
    expected = (51.3 * 0.5 + 72.4 * 0.25) / (254.5 + 25.45)
    assert now(ekf, 120 * S).disturbance[0] == pytest.approx(expected, abs=0.04)


@pytest.mark.parametrize("jump_m", [20.0, -200.0])
def test_a_short_jump_is_gated_and_a_lasting_one_is_believed(jump_m: float) -> None:
    ekf = started()
    rng = np.random.default_rng(3)
    drive(ekf, 10.0, rng, speed=0.0, psi=0.0)
    before = now(ekf, 10 * S)
    for tick in range(1, 11):
        ekf.on_gnss(fix(10 * S + tick * S // 10, jump_m, 0.0))
        ekf.on_attitude(Attitude(t_ns=10 * S + tick * S // 10, psi_rad=0.0, r_radps=0.0))
    after = now(ekf, 11 * S)
    assert abs(after.n_m - before.n_m) < 0.3 and ekf.rejected["gnss"] == 10
    for tick in range(11, 60):
        ekf.on_gnss(fix(10 * S + tick * S // 10, jump_m, 0.0))
        ekf.on_attitude(Attitude(t_ns=10 * S + tick * S // 10, psi_rad=0.0, r_radps=0.0))
    assert now(ekf, 16 * S).n_m == pytest.approx(jump_m, abs=0.5) and ekf.resets == 1


def test_it_is_not_valid_while_a_sensor_is_silent() -> None:
    ekf = started()
    drive(ekf, 5.0, np.random.default_rng(4), speed=0.0, psi=0.0)
    assert now(ekf, 5 * S).valid
    for tick in range(1, 30):
        ekf.on_attitude(Attitude(t_ns=5 * S + tick * S // 20, psi_rad=0.0, r_radps=0.0))
    assert not now(ekf, 5 * S + 29 * S // 20).valid


def test_heading_across_south_does_not_swing_round() -> None:
    ekf = started(psi=math.pi - 0.01)
    for tick in range(1, 40):
        psi = math.pi - 0.01 + 0.001 * tick
        ekf.on_attitude(Attitude(t_ns=tick * S // 20, psi_rad=(psi + math.pi) % (2 * math.pi) - math.pi, r_radps=0.02))
    assert abs(now(ekf, 2 * S).psi_rad) == pytest.approx(math.pi - 0.029, abs=0.005) and ekf.rejected["attitude"] == 0


def test_numbers_that_are_none_late_frames_and_gaps_do_no_harm() -> None:
    ekf = started()
    ekf.on_gnss(fix(S, math.nan, 0.0))
    ekf.on_attitude(Attitude(t_ns=S, psi_rad=math.nan, r_radps=0.0))
    ekf.on_attitude(Attitude(t_ns=S, psi_rad=0.0, r_radps=0.0))
    ekf.on_attitude(Attitude(t_ns=S // 2, psi_rad=0.0, r_radps=0.0))  # from the past
    ekf.predict(100_000 * S)
    assert all(map(math.isfinite, (now(ekf, 100_000 * S).n_m, *now(ekf, 100_000 * S).std)))


def test_two_filters_agree_to_the_last_bit() -> None:
    def run() -> Estimate:
        ekf = started()
        ekf.set_forcing((0.3, -0.2), (2.0, 1.0))
        drive(ekf, 20.0, np.random.default_rng(5), speed=0.3, psi=0.5)
        return now(ekf, 20 * S)

    assert run() == run()
