"""The filter on measurements that hold only a part: position, velocity, heading or yaw rate alone, of any sensor."""

import math

import numpy as np
import pytest

from asvhil.config import load_config
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.estimator.ekf import Ekf
from asvhil.estimator.measurement_model import corrections
from asvhil.estimator.wind import WindFilter
from asvhil.geo import LocalFrame
from asvhil.types import (
    BowWind,
    Estimate,
    GroundVelocity,
    Heading,
    Measurement,
    Position,
    SpecificForce,
    TrueWind,
    YawRate,
)

NAN = math.nan
CONFIG = load_config("sitl")
ORIGIN = LocalFrame(lat_deg=40.0, lon_deg=-86.0)
S = 1_000_000_000


def filter_() -> Ekf:
    return Ekf(CONFIG.estimator, SimplifiedDynamics(CONFIG.vehicle.vessel))


def fix(t_s: float, n_m: float = NAN, e_m: float = NAN, vn: float = NAN, ve: float = NAN) -> list[Measurement]:
    t_ns = round(t_s * S)
    found: list[Measurement] = []
    if math.isfinite(n_m):
        lat_deg, lon_deg = ORIGIN.to_geodetic(n_m, e_m)
        found.append(Position(t_ns=t_ns, lat_deg=lat_deg, lon_deg=lon_deg))
    if math.isfinite(vn):
        found.append(GroundVelocity(t_ns=t_ns, vn_mps=vn, ve_mps=ve))
    return found


def attitude(t_s: float, psi: float = NAN, r: float = NAN) -> list[Measurement]:
    t_ns = round(t_s * S)
    found: list[Measurement] = []
    if math.isfinite(psi):
        found.append(Heading(t_ns=t_ns, psi_rad=psi))
    if math.isfinite(r):
        found.append(YawRate(t_ns=t_ns, r_radps=r))
    return found


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
        whole.on_measurements(attitude(t_s, psi, 0.05))
        whole.on_measurements(fix(t_s, t_s, t_s, 1.0, 1.0))
        parts.on_measurements(attitude(t_s, psi=psi))
        parts.on_measurements(attitude(t_s, r=0.05))
        parts.on_measurements(fix(t_s, t_s, t_s))
        parts.on_measurements(fix(t_s, vn=1.0, ve=1.0))
    one, four = estimate(whole, 9.9), estimate(parts, 9.9)
    assert four.valid
    for name in ("n_m", "e_m", "psi_rad", "u_mps", "v_mps", "r_radps"):
        assert getattr(four, name) == pytest.approx(getattr(one, name), abs=0.01), name
    assert np.array(four.std) == pytest.approx(np.array(one.std), rel=0.1)


def test_it_starts_with_a_compass_that_has_no_rate_and_a_receiver_that_has_no_velocity() -> None:
    ekf = filter_()
    ekf.on_measurements(attitude(0.0, r=0.5))
    ekf.on_measurements(fix(0.1, 0.0, 0.0))
    assert ekf.estimate(S // 10) is None  # no heading yet
    ekf.on_measurements(attitude(0.2, psi=1.0))
    ekf.on_measurements(fix(0.3, vn=1.0, ve=1.0))
    assert ekf.estimate(3 * S // 10) is None  # no position yet
    ekf.on_measurements(fix(0.4, 0.0, 0.0))
    found = estimate(ekf, 0.4)
    assert found.valid and (found.psi_rad, found.r_radps, found.u_mps) == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("silent", ["position", "heading"])
def test_velocity_and_rate_bridge_for_a_time_but_keep_no_estimate_alive(silent: str) -> None:
    ekf = filter_()
    ekf.on_measurements(attitude(0.0, 0.0, 0.0))
    ekf.on_measurements(fix(0.0, 0.0, 0.0, 0.0, 0.0))
    for tick in range(1, 400):
        t_s = 0.1 * tick
        ekf.on_measurements(attitude(t_s, r=0.0) if silent == "heading" and tick > 50 else attitude(t_s, 0.0, 0.0))
        ekf.on_measurements(fix(t_s, vn=0.0, ve=0.0) if silent == "position" and tick > 50 else fix(t_s, 0.0, 0.0))
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


def test_position_and_velocity_of_one_time_are_one_event_and_so_are_heading_and_yaw_rate() -> None:
    (place, velocity), (heading, rate) = fix(0.1, 0.0, 0.0, 1.0, 1.0), attitude(0.1, 0.5, 0.1)
    force = SpecificForce(t_ns=S // 10, ax_mps2=0.0, ay_mps2=0.0)
    wind = TrueWind(t_ns=S // 10, vn_mps=1.0, ve_mps=0.0)
    assert corrections([place, velocity, heading, rate, force, wind]) == [(place, velocity), (heading, rate), (force,)]
    assert corrections([velocity, place, rate, heading]) == [(velocity,), (place,), (rate,), (heading,)]
    later = fix(0.2, vn=1.0, ve=1.0)[0]
    assert corrections([place, later]) == [(place,), (later,)]


def test_a_pair_is_gated_against_one_prediction() -> None:
    """A position at the edge of its gate would pull the velocity's prediction along, were it corrected first."""
    together, apart = filter_(), filter_()
    for ekf in (together, apart):
        ekf.on_measurements(attitude(0.0, 0.0, 0.0))
        ekf.on_measurements(fix(0.0, 0.0, 0.0, 0.0, 0.0))
    place, velocity = fix(0.5, 2.0, 0.0, 0.0, 1.0)
    together.on_measurements([place, velocity])
    apart.on_measurements([place])
    apart.on_measurements([velocity])
    assert together.state is not None and apart.state is not None
    expected = together.state.tracks["velocity"].expected
    assert expected == pytest.approx((0.0, 0.0), abs=1e-6) and apart.state.tracks["velocity"].expected != expected


def test_the_deviation_that_the_decoder_takes_out_is_not_taken_out_again() -> None:
    """The filter estimates what a calibration has left, about zero."""
    config = load_config("sitl", ("estimator.ekf.compass={deviation_deg: [3, 0, 4, 0, 0], std_deg: 1}",))
    ekf = Ekf(config.estimator, SimplifiedDynamics(config.vehicle.vessel))
    for tick in range(20):
        ekf.on_measurements(attitude(0.1 * tick, 0.5, 0.0))
        ekf.on_measurements(fix(0.1 * tick, 0.0, 0.0, 0.0, 0.0))
    assert estimate(ekf, 2.0).psi_rad == pytest.approx(0.5, abs=1e-6)
