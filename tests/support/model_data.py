"""A small seeded data set: manoeuvres of the simulated boat with the errors of its sensors."""

from __future__ import annotations

import math

import numpy as np

from asvhil.config import PwmConfig, SensorsConfig, VesselConfig, WeatherConfig, WindConfig, load_config
from asvhil.simplant.boat.sensors import Anemometer
from asvhil.simplant.boat.vessel import Vessel
from asvhil.simplant.boat.weather import Weather
from asvhil.train.dataset import Dataset, Segment

DT_S = 0.2
STEP_S = 0.02
VELOCITY_STD_MPS, YAW_RATE_STD_RADPS, HEADING_STD_RAD = 0.05, 0.005, math.radians(0.25)
WIND_FILTER_S = 2.0


def wamv() -> VesselConfig:
    return load_config("sitl").vehicle.vessel


def manoeuvres(rng: np.random.Generator, count: int) -> np.ndarray:
    """Commands (count, 2) at 5 Hz: straights, circles, zigzags, random steps and sticks pushed in coarse levels."""
    rows: list[tuple[float, float]] = []
    while len(rows) < count:
        kind = rng.integers(5)
        level = float(rng.choice([-1.0, -0.8, -0.6, -0.4, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0]))
        if kind == 0:
            rows += [(level, level)] * int(rng.integers(25, 75))
        elif kind == 1:
            other = float(rng.uniform(-1.0, 1.0))
            rows += [(level, other) if rng.random() < 0.5 else (other, level)] * int(rng.integers(25, 75))
        elif kind == 2:
            turn, half = float(rng.uniform(0.15, 0.6)), int(rng.integers(8, 25))
            for k in range(int(rng.integers(4, 8))):
                side = turn if k % 2 else -turn
                rows += [(level + side, level - side)] * half
        else:
            spread = 1.0 if kind == 3 else 0.6
            for _ in range(int(rng.integers(5, 15))):
                pair = rng.uniform(-spread, spread, 2).tolist()
                rows += [(pair[0], pair[1])] * int(rng.integers(3, 15))
    return np.clip(np.array(rows[:count]), -1.0, 1.0)


def drive(seed: int, duration_s: float, wind_mps: float, *, noisy: bool = True) -> tuple[Segment, Segment]:
    """One stretch as (measured, true): the same commands, seen through the sensors and as they were."""
    rng = np.random.default_rng(seed)
    weather_seed, vane_seed = np.random.SeedSequence(seed).spawn(2)
    toward_deg = float(rng.uniform(0.0, 360.0))
    weather = Weather(WeatherConfig(wind=WindConfig(speed_mps=wind_mps, toward_deg=toward_deg)), STEP_S, weather_seed)
    vessel = Vessel(wamv(), PwmConfig(), STEP_S, (0.0, 0.0, float(rng.uniform(-3.0, 3.0))))
    vane = Anemometer(SensorsConfig().anemometer, vane_seed)
    count = round(duration_s / DT_S)
    commands = manoeuvres(rng, count)
    nu, wind, psi = np.zeros((count, 3)), np.zeros((count, 2)), np.zeros(count)
    seen_nu, seen_wind, seen_psi = np.zeros((count, 3)), np.zeros((count, 2)), np.zeros(count)
    air_ned: np.ndarray | None = None
    for k, (port, starboard) in enumerate(commands):
        nu[k] = (*vessel.ground_velocity_body(), vessel.r_radps)
        psi[k] = vessel.psi_rad
        wind[k] = _rotation(psi[k]).T @ [weather.wind_n_mps, weather.wind_e_mps]
        seen_nu[k] = nu[k] + rng.normal(size=3) * [VELOCITY_STD_MPS, VELOCITY_STD_MPS, YAW_RATE_STD_RADPS]
        seen_psi[k] = psi[k] + HEADING_STD_RAD * rng.normal()
        speed_mps, from_deg = vane.sample(vessel, weather.wind_n_mps, weather.wind_e_mps)
        from_rad = math.radians(from_deg)
        apparent = -speed_mps * np.array([math.cos(from_rad), math.sin(from_rad)])
        air = _rotation(seen_psi[k]) @ (apparent + seen_nu[k, :2])
        air_ned = air if air_ned is None else air_ned + (1.0 - math.exp(-DT_S / WIND_FILTER_S)) * (air - air_ned)
        seen_wind[k] = _rotation(seen_psi[k]).T @ air_ned
        vessel.drive((round(1500 + 400 * port), round(1500 + 400 * starboard)))
        for _ in range(round(DT_S / STEP_S)):
            vessel.step(weather.wind_n_mps, weather.wind_e_mps)
            weather.advance()
    t_s = DT_S * np.arange(count)
    truth = Segment(t_s=t_s, nu=nu, command=commands, wind=wind, psi=psi)
    seen = Segment(t_s=t_s, nu=seen_nu, command=commands, wind=seen_wind, psi=seen_psi)
    return (seen if noisy else truth), truth


def training_set(seed: int, duration_s: float = 600.0, winds_mps: tuple[float, ...] = (3.0, 4.0, 5.0, 6.0)) -> Dataset:
    """Measured stretches of equal length, one for each mean wind."""
    each_s = duration_s / len(winds_mps)
    segments = tuple(drive(1000 * seed + i, each_s, wind)[0] for i, wind in enumerate(winds_mps))
    return Dataset(dt_s=DT_S, segments=segments, source_hash=f"simulated-{seed}")


def _rotation(psi_rad: float) -> np.ndarray:
    c, s = math.cos(psi_rad), math.sin(psi_rad)
    return np.array([[c, -s], [s, c]])
