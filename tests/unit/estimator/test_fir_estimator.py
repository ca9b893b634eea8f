"""The paper's FIR fusion and the raw readings, by cases worked out by hand; and closed loops on either."""

import math
from pathlib import Path

import numpy as np
import pytest

from asvhil.backseat.build import build_estimator, build_wind
from asvhil.config import Config, FirConfig, load_config
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.estimator.ekf import Ekf
from asvhil.estimator.fir_estimator import FirFilter, FirFusion, HeldSensors
from asvhil.geo import LocalFrame
from asvhil.logs.replay import replay
from asvhil.simplant.lockstep import Lockstep
from asvhil.sitl import run_lockstep
from asvhil.types import (
    ApparentWind,
    Estimate,
    GroundVelocity,
    Heading,
    Measurement,
    Phase,
    Position,
    SpecificForce,
    YawRate,
)

CONFIG = load_config("sitl")
MODEL = SimplifiedDynamics(CONFIG.vehicle.vessel)
ORIGIN = LocalFrame(lat_deg=40.4, lon_deg=-86.9)
MS = 1_000_000


def heading(t_ms: int, degrees: float, r_radps: float | None = None) -> list[Measurement]:
    found: list[Measurement] = [Heading(t_ns=t_ms * MS, psi_rad=math.radians(degrees))]
    return found if r_radps is None else [*found, YawRate(t_ns=t_ms * MS, r_radps=r_radps)]


def fix(t_ms: int, n: float = 0.0, e: float = 0.0, vn: float = 0.0, ve: float = 0.0) -> list[Measurement]:
    lat, lon = ORIGIN.to_geodetic(n, e)
    position = Position(t_ns=t_ms * MS, lat_deg=lat, lon_deg=lon, h_acc_m=0.1)
    return [position, GroundVelocity(t_ns=t_ms * MS, vn_mps=vn, ve_mps=ve)]


def force(t_ms: int, ax: float, ay: float = 0.0) -> list[Measurement]:
    return [SpecificForce(t_ns=t_ms * MS, ax_mps2=ax, ay_mps2=ay)]


def raw() -> HeldSensors:
    return HeldSensors(CONFIG.estimator.ekf, MODEL)


def fir(taps: int = 1, fusion_time_s: float = 1.0) -> FirFusion:
    return FirFusion(CONFIG.estimator.ekf, FirConfig(taps=taps, fusion_time_s=fusion_time_s), MODEL)


def begun(estimator: HeldSensors, degrees: float = 0.0, vn: float = 0.0, ve: float = 0.0) -> HeldSensors:
    estimator.on_measurements(heading(0, degrees))
    estimator.on_measurements(fix(0, vn=vn, ve=ve))
    return estimator


def at(estimator: HeldSensors, t_ms: int) -> Estimate:
    estimate = estimator.estimate(t_ms * MS)
    assert estimate is not None
    return estimate


def test_three_taps_weigh_by_the_hamming_window() -> None:
    """Hamming of 3 is (0.08, 1, 0.08); their sum 1.16."""
    filter_ = FirFilter(3)
    assert filter_.step(0.0) == 0.0
    assert [filter_.step(x) for x in (1.16, 0.0, 0.0, 0.0)] == pytest.approx([0.08, 1.0, 0.08, 0.0])


def test_the_filter_follows_the_mean_and_begins_at_its_first_sample() -> None:
    filter_ = FirFilter(9)
    assert [filter_.step(5.0) for _ in range(20)] == pytest.approx([5.0] * 20)
    assert FirFilter(1).step(3.0) == 3.0


def test_the_filter_takes_out_noise() -> None:
    rng, filter_ = np.random.default_rng(1), FirFilter(9)
    out = np.array([filter_.step(float(x)) for x in rng.normal(size=4000)])[20:]
    window = np.hamming(9) / np.hamming(9).sum()
    assert out.std() == pytest.approx(math.sqrt(float(window @ window)), rel=0.06)  # 0.39 of the noise


def test_constant_acceleration_is_integrated_in_the_direction_of_the_bow() -> None:
    """Heading east, 0.2 m/s^2 along the bow for 2 s after the first reading: 0.4 m/s east, which is surge."""
    estimator = begun(fir(), 90.0)
    for t_ms in range(0, 2001, 50):
        estimator.on_measurements(force(t_ms, 0.2))
    estimate = at(estimator, 2000)
    assert (estimate.u_mps, estimate.v_mps) == pytest.approx((0.4, 0.0), abs=1e-12)
    estimator.on_measurements(heading(2000, 0.0))  # the same motion seen by a boat that points north: all of it sway
    assert (at(estimator, 2000).u_mps, at(estimator, 2000).v_mps) == pytest.approx((0.0, 0.4), abs=1e-12)


def test_the_trapezoidal_rule_between_two_accelerations() -> None:
    """0 then 1 m/s^2, 0.1 s apart: 0.05 m/s; a gap beyond 0.5 s adds nothing."""
    estimator = begun(fir())
    estimator.on_measurements(force(0, 0.0))
    estimator.on_measurements(force(100, 1.0))
    assert at(estimator, 100).u_mps == pytest.approx(0.05)
    estimator.on_measurements(force(700, 1.0))
    assert at(estimator, 700).u_mps == pytest.approx(0.05)


def test_a_fix_pulls_the_velocity_by_its_share() -> None:
    """T = 1 s and 0.2 s between fixes: 1 - exp(-0.2) = 0.18127 of the difference."""
    estimator = begun(fir(), vn=1.0)
    estimator.on_measurements(fix(200, vn=2.0))
    assert at(estimator, 200).u_mps == pytest.approx(1.18127, abs=1e-5)


def test_a_biased_accelerometer_ends_near_the_fusion_time_times_its_bias() -> None:
    """0.05 m/s^2 for 0.2 s adds 0.01: before each fix of 0 m/s it is 0.01 / 0.18127 = 0.0552, after it 0.0452."""
    estimator = begun(fir())
    for t_ms in range(0, 20001, 50):
        estimator.on_measurements(force(t_ms, 0.05))
        if t_ms % 200 == 0 and t_ms:
            before = at(estimator, t_ms).u_mps
            estimator.on_measurements(fix(t_ms))
    assert before == pytest.approx(0.05517, abs=2e-5)
    assert at(estimator, 20000).u_mps == pytest.approx(0.04517, abs=2e-5)


def test_no_acceleration_before_a_velocity_is_known() -> None:
    estimator = fir()
    estimator.on_measurements(force(0, 1.0))
    estimator.on_measurements(force(100, 1.0))
    estimator.on_measurements(heading(200, 0.0))
    estimator.on_measurements(fix(200, vn=0.7))
    assert at(estimator, 200).u_mps == pytest.approx(0.7)


@pytest.mark.parametrize("make", [raw, fir])
def test_pose_is_the_last_reading(make) -> None:
    estimator = make()
    estimator.on_measurements(fix(0, 1.0, 1.0))
    assert estimator.estimate(0) is None and estimator.frame is None  # no heading yet
    estimator.on_measurements(heading(10, 350.0, 0.1))
    estimator.on_measurements(fix(20))
    estimator.on_measurements(fix(220, 3.0, -4.0))
    estimator.on_measurements(heading(300, 30.0))  # a compass: no yaw rate, the last one stays
    estimate = at(estimator, 400)
    assert (estimate.n_m, estimate.e_m, math.degrees(estimate.psi_rad)) == pytest.approx((3.0, -4.0, 30.0), abs=1e-6)
    assert estimate.r_radps == 0.1 and estimate.valid and estimate.disturbance == (0.0, 0.0, 0.0)
    assert at(estimator, 1300).valid is False  # 1 s after the last fix
    estimator.on_measurements(fix(1300, 23.0, -4.0))  # 20 m away at once: believed
    assert at(estimator, 1300).n_m == pytest.approx(23.0, abs=1e-6) and at(estimator, 1300).valid
    assert at(estimator, 1301).valid is False  # 1 s after the last heading


def test_raw_velocity_is_the_last_fix_turned_by_the_heading() -> None:
    estimator = begun(raw(), 90.0, vn=0.3, ve=1.0)
    estimator.on_measurements(force(0, 5.0))
    estimator.on_measurements(force(100, 5.0))
    assert (at(estimator, 100).u_mps, at(estimator, 100).v_mps) == pytest.approx((1.0, -0.3))
    estimator.on_measurements([GroundVelocity(t_ns=150 * MS, vn_mps=0.0, ve_mps=2.0)])
    assert at(estimator, 150).u_mps == pytest.approx(2.0)


def test_motor_states_follow_the_models_lag() -> None:
    """First order, 0.3 s: under full thrust for 0.3 s a motor reaches 1 - 1/e; the midpoint rule is off by 1e-3."""
    estimator = begun(raw())
    at(estimator, 0)
    estimator.set_forcing((1.0, 0.0), (6.0, 0.0))
    for t_ms in range(50, 301, 50):
        motor = at(estimator, t_ms).motor
    assert motor == pytest.approx((1.0 - math.exp(-1.0), 0.0), abs=2e-3)


def config(kind: str) -> Config:
    return load_config("sitl", ("plant.sensors.gnss.slow_bias_m=0", f"estimator.kind={kind}"))


@pytest.mark.parametrize(("kind", "made"), [("ekf", Ekf), ("fir", FirFusion), ("raw", HeldSensors)])
def test_the_kind_is_chosen_in_the_config(kind: str, made: type) -> None:
    assert type(build_estimator(config(kind), MODEL)) is made


@pytest.mark.parametrize("kind", ["fir", pytest.param("raw", marks=pytest.mark.thorough)])
def test_the_loop_runs_and_replays_on_it(kind: str, tmp_path: Path) -> None:
    settings = config(kind)
    run_lockstep(settings, tmp_path / "log.mcap", 12.0)
    assert replay(tmp_path / "log.mcap").mismatch is None
    loop = Lockstep(settings)
    for _ in range(240):
        _, outputs = loop.tick()
    assert outputs.phase is Phase.HOLD


@pytest.mark.parametrize(("kind", "share"), [("raw", 1.0), ("fir", 1.0), ("ekf", 0.3297)])
def test_the_wind_is_the_last_sample_where_readings_are_used_as_they_come(kind: str, share: float) -> None:
    """Bow north, 4 m/s from ahead; then 6 m/s 0.2 s later, of which the speed's low-pass takes 1 - exp(-0.2 / 0.5)."""
    boat, wind = at(begun(raw()), 0), build_wind(config(kind).estimator)
    wind.on_apparent_wind(ApparentWind(t_ns=0, speed_mps=4.0, from_rad=0.0), boat)
    wind.on_apparent_wind(ApparentWind(t_ns=200 * MS, speed_mps=6.0, from_rad=0.0), boat)
    seen = wind.wind(200 * MS)
    assert seen is not None and seen.vn_mps == pytest.approx(-4.0 - 2.0 * share, abs=1e-3)
