"""Wave motion against the theory of its spectrum, and the boat that rides on it: one consistent motion, or none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asvhil.config import WavesConfig, load_config
from asvhil.errors import ConfigError
from asvhil.simplant.boat.vessel import Vessel
from asvhil.simplant.boat.waves import Waves
from asvhil.simplant.boat.weather import Weather
from asvhil.simplant.plant import Plant
from tests.support.simplant_boat import CALM, Boat, of

CHOP = (
    "plant.weather.waves.orbital_std_mps=0.07",
    "plant.weather.waves.yaw_std_radps=0.02",
    "plant.weather.waves.spreading=1.0",
)
CONFIG = load_config("sitl")
FIELDS = ("n_m", "e_m", "psi_rad", "vn_mps", "ve_mps", "r_radps", "an_mps2", "ae_mps2")


def sea(step_s: float = 0.1, seed: int = 1, wind_deg: float = 0.0, **config: float) -> Waves:
    chosen = {"orbital_std_mps": 0.07, "yaw_std_radps": 0.02, "spreading": 1.0} | config
    return Waves(WavesConfig(**chosen), wind_deg, step_s, np.random.SeedSequence(seed))


def record(waves: Waves, steps: int) -> np.ndarray:
    """(steps, 8) of what FIELDS names."""
    rows = np.empty((steps, len(FIELDS)))
    for row in rows:
        waves.advance()
        row[:] = [getattr(waves, name) for name in FIELDS]
    return rows


def spectrum(frequency_hz: np.ndarray, peak_hz: float, damping: float) -> np.ndarray:
    """|h(jw)|^4 of h(s) = s / (s^2 + 2 zeta w0 s + w0^2), not scaled."""
    s = 2j * math.pi * frequency_hz
    peak = math.tau * peak_hz
    return np.abs(s / (s * s + 2.0 * damping * peak * s + peak * peak)) ** 4


def test_the_motion_has_the_configured_spread_and_no_mean() -> None:
    rows = record(sea(), 80_000)  # 8000 s: the spread is known to 2 %
    assert rows[:, 3:6].std(axis=0) == pytest.approx([0.07, 0.07, 0.02], rel=0.05)
    assert np.abs(rows[:, :6].mean(axis=0)).max() < 0.003
    # By hand, both filters in series: var(a) / var(v) = w0^2 (1 + 4 zeta^2), var(v) / var(x) = w0^2.
    peak = math.tau * 0.3
    assert rows[:, 0].std() / rows[:, 3].std() * peak == pytest.approx(1.0, rel=0.05)
    assert rows[:, 6].std() / rows[:, 3].std() / peak == pytest.approx(math.sqrt(1.0 + 4.0 * 0.15**2), rel=0.05)
    assert np.abs(np.corrcoef(rows[:, 3:6].T) - np.eye(3)).max() < 0.06


@pytest.mark.parametrize(("peak_hz", "damping"), [(0.3, 0.15), (0.8, 0.4)])
def test_the_spectrum_is_that_of_the_shaping_filters(peak_hz: float, damping: float) -> None:
    step_s, length = 0.1, 512
    rows = record(sea(step_s, peak_hz=peak_hz, damping=damping), length * 200)
    window = np.hanning(length)
    found = (np.abs(np.fft.rfft(rows[:, 3].reshape(-1, length) * window, axis=1)) ** 2).mean(axis=0)
    frequency_hz = np.fft.rfftfreq(length, step_s)
    wanted = spectrum(frequency_hz, peak_hz, damping)
    near = (frequency_hz > 0.5 * peak_hz) & (frequency_hz < 2.0 * peak_hz)
    assert frequency_hz[np.argmax(found)] == pytest.approx(peak_hz, abs=0.06 * peak_hz + 0.01)
    ratio = found[near] / found[near].sum() / (wanted[near] / wanted[near].sum())
    assert ratio.min() > 0.6 and ratio.max() < 1.6
    assert found[frequency_hz < 0.1 * peak_hz].max() < 0.01 * found.max()  # waves carry nothing away


@pytest.mark.parametrize("step_s", [1e-5, 0.01, 0.05, 1.0, 30.0])
def test_any_step_keeps_the_stationary_law_and_the_correlation(step_s: float) -> None:
    # The velocity's variance after a step, and its correlation over it, against the integral of the spectrum.
    frequency_hz = np.linspace(0.0, 60.0, 1_200_001)
    density = spectrum(frequency_hz, 0.3, 0.15)
    wanted = float((density * np.cos(math.tau * frequency_hz * step_s)).sum() / density.sum())
    waves, law = sea(step_s), np.zeros((4, 4))
    transition, kick = waves.transition, waves.noise_factor @ waves.noise_factor.T
    for _ in range(60):  # the law that lasts is the sum of all kicks, here by doubling the number of steps
        law, kick, transition = kick, kick + transition @ kick @ transition.T, transition @ transition
    velocity = waves.output[1]
    assert velocity @ law @ velocity == pytest.approx(1.0, rel=1e-9)
    assert velocity @ waves.transition @ law @ velocity == pytest.approx(wanted, abs=2e-6)


def test_two_half_steps_are_a_whole_one_but_for_the_noise() -> None:
    whole, half = sea(2.0), sea(1.0)
    transition = half.transition @ half.transition
    covariance = half.noise_factor @ half.noise_factor.T
    assert np.allclose(whole.transition, transition, atol=1e-13)
    wanted = half.transition @ covariance @ half.transition.T + covariance
    assert np.allclose(whole.noise_factor @ whole.noise_factor.T, wanted, atol=1e-13)


def test_position_is_the_integral_of_velocity_and_velocity_that_of_acceleration() -> None:
    rows = record(sea(0.005), 4000)
    # The acceleration is as rough as Brownian motion, so the trapezoidal rule does worse on it.
    for low, high, tolerance in (([0, 1, 2], [3, 4, 5], 1e-5), ([3, 4], [6, 7], 2e-3)):
        integral = np.cumsum(0.0025 * (rows[1:, high] + rows[:-1, high]), axis=0)
        assert np.abs(rows[1:, low] - rows[0, low] - integral).max() < tolerance


def test_the_noise_depends_on_the_seed() -> None:
    assert np.array_equal(record(sea(seed=3), 1200), record(sea(seed=3), 1200))
    assert not np.array_equal(record(sea(seed=3), 50), record(sea(seed=4), 50))


def test_numbers_drawn_for_one_step_length_are_not_used_for_another() -> None:
    waves = sea(0.01)
    record(waves, 100)
    waves.set_step(0.1)
    assert record(waves, 50_000)[:, 3].std() == pytest.approx(0.07, rel=0.1)


@pytest.mark.parametrize(
    ("config", "wind_deg", "north", "east"),
    [
        ({"spreading": 0.0}, 90.0, 0.0, 0.07),  # long crests go with the wind
        ({"spreading": 0.0, "toward_deg": 180.0}, 90.0, 0.07, 0.0),
        ({"spreading": 0.5, "toward_deg": 0.0}, 90.0, 0.07, 0.035),
        ({"spreading": 0.0, "toward_deg": 30.0}, 0.0, 0.07 * math.cos(math.pi / 6), 0.035),
    ],
)
def test_waves_go_with_the_wind_or_their_own_way(
    config: dict[str, float], wind_deg: float, north: float, east: float
) -> None:
    rows = record(sea(wind_deg=wind_deg, **config), 60_000)
    assert rows[:, 3:5].std(axis=0) == pytest.approx([north, east], rel=0.06, abs=1e-12)


# --- the boat ----------------------------------------------------------------------------------------------------


def vessel(step_s: float = 0.01, waves: Waves | None = None, heading_deg: float = 40.0) -> Vessel:
    boat = CONFIG.vehicle
    return Vessel(boat.vessel, boat.pwm, step_s, (3.0, -2.0, math.radians(heading_deg)), (0.2, -0.1), waves)


def state(boat: Vessel) -> list[float]:
    names = ("n_m", "e_m", "psi_rad", "u_mps", "v_mps", "r_radps", "ax_mps2", "ay_mps2")
    return [getattr(boat, name) for name in names]


def track(boat: Vessel, steps: int) -> np.ndarray:
    """(steps, 8) n, e, psi, ground velocity north and east, r, ax, ay under changing thrust."""
    rows = np.empty((steps, 8))
    for k, row in enumerate(rows):
        boat.drive((1800, 1500) if k // 700 % 2 else (1550, 1900))
        boat.step(3.0, -2.0)
        row[:] = [
            boat.n_m,
            boat.e_m,
            boat.psi_rad,
            *boat.ground_velocity_ned(),
            boat.r_radps,
            boat.ax_mps2,
            boat.ay_mps2,
        ]
    return rows


def test_the_boat_moves_as_without_waves_plus_the_waves() -> None:
    waves, calm, rough = sea(0.01, seed=5), track(vessel(), 3000), track(vessel(waves=sea(0.01, seed=5)), 3000)
    alone = record(waves, 3000)
    assert np.allclose(rough[:, :6], calm[:, :6] + alone[:, :6], atol=1e-12)


def test_the_sum_is_one_motion() -> None:
    # Pose from velocities, and velocities from the accelerometer turned to north and east, by the trapezoidal rule.
    rows = track(vessel(0.005, sea(0.005, seed=5)), 4000)
    c, s = np.cos(rows[:, 2]), np.sin(rows[:, 2])
    felt = np.stack([c * rows[:, 6] - s * rows[:, 7], s * rows[:, 6] + c * rows[:, 7]], axis=1)
    travelled = np.cumsum(0.0025 * (rows[1:, 3:6] + rows[:-1, 3:6]), axis=0)
    gained = np.cumsum(0.0025 * (felt[1:] + felt[:-1]), axis=0)
    assert np.abs(rows[1:, :3] - rows[0, :3] - travelled).max() < 1e-4
    assert np.abs(rows[1:, 3:5] - rows[0, 3:5] - gained).max() < 2e-3


def test_body_velocity_is_that_over_ground_turned_by_the_true_heading() -> None:
    boat = vessel(waves=sea(0.01))
    track(boat, 500)
    (vn, ve), (u, v) = boat.ground_velocity_ned(), boat.ground_velocity_body()
    c, s = math.cos(boat.psi_rad), math.sin(boat.psi_rad)
    assert (u, v) == pytest.approx((c * vn + s * ve, c * ve - s * vn), abs=1e-12)


def test_a_boat_at_rest_shows_the_waves_from_the_start() -> None:
    waves = sea(0.01)
    n_m, vn_mps = waves.n_m, waves.vn_mps
    boat = vessel(waves=waves)
    assert boat.n_m == 3.0 + n_m
    assert boat.ground_velocity_ned()[0] == pytest.approx(0.2 + vn_mps, abs=1e-15)
    assert state(boat)[6] != 0.0


# --- the plant ---------------------------------------------------------------------------------------------------


def test_without_waves_nothing_changes() -> None:
    # Values of the program before there were waves: 20 s from power-on with the shipped config, motors off.
    plain, off = Plant(CONFIG, 0), Plant(load_config("sitl", ("plant.weather.waves.spreading=0.1",)), 0)
    assert plain.advance(20_000_000_000) == off.advance(20_000_000_000)
    assert plain.truth == off.truth
    assert Weather(CONFIG.plant.weather, 0.01, np.random.SeedSequence(1)).waves is None
    found = [getattr(plain.truth, name) for name in ("n_m", "e_m", "psi_rad", "wind_n_mps", "wind_e_mps")]
    before = [-12.7277189581028, -2.99933673569565, 0.00116919059879761, 3.36450221088128, 0.0289599107430131]
    assert found == pytest.approx(before, rel=1e-12)


def test_waves_reach_the_sensors_and_the_truth_alike() -> None:
    boat = Boat(*CHOP)
    boat.ready()
    assert boat.interval(30, 50_000) == boat.interval(33, 50_000) == 0
    assert boat.interval(108, 50_000) == 0
    log = boat.run(30.0)
    truth, seen = of(log, "SIM_STATE"), of(log, "GLOBAL_POSITION_INT")
    speeds = np.array([(m.vn, m.ve, m.zgyro, m.xacc) for m in truth])
    assert speeds.std(axis=0) == pytest.approx([0.07, 0.07, 0.02, 0.13], rel=0.6)
    assert np.std([m.vx for m in seen]) == pytest.approx(100.0 * speeds[:, 0].std(), rel=0.1)
    assert np.std([m.yawspeed for m in of(log, "ATTITUDE")]) == pytest.approx(speeds[:, 2].std(), rel=0.1)


def test_waves_leave_wind_and_sensor_noise_as_they_are() -> None:
    calm, rough = Plant(CONFIG, 0), Plant(load_config("sitl", CHOP), 0)
    for plant in (calm, rough):
        plant.advance(20_000_000_000)
    assert (calm.truth.wind_n_mps, calm.truth.wind_e_mps) == (rough.truth.wind_n_mps, rough.truth.wind_e_mps)
    assert calm.truth.u_mps != rough.truth.u_mps


@settings(max_examples=25, deadline=None)
@given(st.floats(0.0, 5.0), st.floats(0.0, 1.0), st.floats(0.02, 5.0), st.floats(0.01, 0.99), st.floats(0.001, 0.05))
def test_every_sea_that_the_config_allows_is_finite(
    orbital: float, yaw: float, peak_hz: float, damping: float, step_s: float
) -> None:
    waves = sea(step_s, orbital_std_mps=orbital, yaw_std_radps=yaw, peak_hz=peak_hz, damping=damping)
    rows = record(waves, 20)
    assert np.isfinite(rows).all()
    assert np.abs(rows[:, 3:6]).max() <= 8.0 * max(orbital, yaw)


@pytest.mark.parametrize(
    "override",
    ["orbital_std_mps=-0.1", "peak_hz=0", "damping=1.0", "spreading=1.5", "orbital=0.07", "yaw_std_radps=.nan"],
)
def test_a_sea_that_cannot_be_is_refused_in_one_line(override: str) -> None:
    with pytest.raises(ConfigError) as refused:
        load_config("sitl", (*CALM, f"plant.weather.waves.{override}"))
    message = str(refused.value)
    assert f"plant.weather.waves.{override.partition('=')[0]}" in message and "\n" not in message
