"""The filter on measurements that hold only a part: position, velocity, heading or yaw rate alone, of any sensor."""

import math

import numpy as np
import pytest

from asvhil.config import load_config
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.estimator.ekf import Ekf
from asvhil.estimator.wind import WindFilter
from asvhil.geo import LocalFrame
from asvhil.types import Attitude, BowWind, Estimate, GnssFix, TrueWind

NAN = math.nan
CONFIG = load_config("sitl")
ORIGIN = LocalFrame(lat_deg=40.0, lon_deg=-86.0)
S = 1_000_000_000


def filter_() -> Ekf:
    return Ekf(CONFIG.estimator, SimplifiedDynamics(CONFIG.vehicle.vessel))


def fix(t_s: float, n_m: float = NAN, e_m: float = NAN, vn: float = NAN, ve: float = NAN) -> GnssFix:
    lat_deg, lon_deg = ORIGIN.to_geodetic(n_m, e_m) if math.isfinite(n_m) else (NAN, NAN)
    return GnssFix(t_ns=round(t_s * S), lat_deg=lat_deg, lon_deg=lon_deg, vn_mps=vn, ve_mps=ve, h_acc_m=NAN)


def attitude(t_s: float, psi: float = NAN, r: float = NAN) -> Attitude:
    return Attitude(t_ns=round(t_s * S), psi_rad=psi, r_radps=r)


def estimate(ekf: Ekf, t_s: float) -> Estimate:
    found = ekf.estimate(round(t_s * S))
    assert found is not None
    return found


def test_four_sensors_with_a_quarter_each_are_as_good_as_one() -> None:
    """North-east at 1 m/s each way, heading 30 degrees, at a turn of 0.05 rad/s."""
    whole, parts = filter_(), filter_()
    for tick in range(100):
        t_s = 0.1 * tick
        psi = math.radians(30.0) + 0.05 * t_s
        whole.on_attitude(attitude(t_s, psi, 0.05))
        whole.on_gnss(fix(t_s, t_s, t_s, 1.0, 1.0))
        parts.on_attitude(attitude(t_s, psi=psi))
        parts.on_attitude(attitude(t_s, r=0.05))
        parts.on_gnss(fix(t_s, t_s, t_s))
        parts.on_gnss(fix(t_s, vn=1.0, ve=1.0))
    one, four = estimate(whole, 9.9), estimate(parts, 9.9)
    assert four.valid
    for name in ("n_m", "e_m", "psi_rad", "u_mps", "v_mps", "r_radps"):
        assert getattr(four, name) == pytest.approx(getattr(one, name), abs=0.01), name
    assert np.array(four.std) == pytest.approx(np.array(one.std), rel=0.1)


def test_it_starts_with_a_compass_that_has_no_rate_and_a_receiver_that_has_no_velocity() -> None:
    ekf = filter_()
    ekf.on_attitude(attitude(0.0, r=0.5))
    ekf.on_gnss(fix(0.1, 0.0, 0.0))
    assert not ekf.started  # no heading yet
    ekf.on_attitude(attitude(0.2, psi=1.0))
    ekf.on_gnss(fix(0.3, vn=1.0, ve=1.0))
    assert not ekf.started  # no position yet
    ekf.on_gnss(fix(0.4, 0.0, 0.0))
    found = estimate(ekf, 0.4)
    assert found.valid and (found.psi_rad, found.r_radps, found.u_mps) == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("silent", ["position", "heading"])
def test_velocity_and_rate_bridge_for_a_time_but_keep_no_estimate_alive(silent: str) -> None:
    ekf = filter_()
    ekf.on_attitude(attitude(0.0, 0.0, 0.0))
    ekf.on_gnss(fix(0.0, 0.0, 0.0, 0.0, 0.0))
    for tick in range(1, 400):
        t_s = 0.1 * tick
        ekf.on_attitude(attitude(t_s, r=0.0) if silent == "heading" and tick > 50 else attitude(t_s, 0.0, 0.0))
        ekf.on_gnss(fix(t_s, vn=0.0, ve=0.0) if silent == "position" and tick > 50 else fix(t_s, 0.0, 0.0))
        if tick == 300:
            assert estimate(ekf, t_s).valid
    assert not estimate(ekf, 41.0).valid


@pytest.mark.parametrize("heading_deg", [0.0, 90.0, 200.0])
def test_true_wind_from_the_bow_and_from_the_earth_agree(heading_deg: float) -> None:
    psi = math.radians(heading_deg)
    boat = Estimate(
        t_ns=0, n_m=0, e_m=0, psi_rad=psi, u_mps=2.0, v_mps=-1.0, r_radps=0, motor=(), std=(), disturbance=(0, 0, 0),
        valid=True,
    )  # fmt: skip
    bow, earth = WindFilter(CONFIG.estimator.wind), WindFilter(CONFIG.estimator.wind)
    from_rad = math.radians(120.0)  # from the south-east: blows north-west
    bow.on_bow_wind(BowWind(t_ns=0, speed_mps=4.0, from_rad=from_rad - psi), boat)
    earth.on_true_wind(TrueWind(t_ns=0, vn_mps=-4.0 * math.cos(from_rad), ve_mps=-4.0 * math.sin(from_rad)))
    one, two = bow.wind(0), earth.wind(0)
    assert one is not None and two is not None
    assert (one.vn_mps, one.ve_mps) == pytest.approx((two.vn_mps, two.ve_mps))
    assert (two.vn_mps, two.ve_mps) == pytest.approx((2.0, -2.0 * math.sqrt(3.0)))
