"""Gusts against the theory of the Ornstein-Uhlenbeck process, and wind and current geometry."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from asvhil.config import CurrentConfig, WeatherConfig, WindConfig, WindSpreadConfig
from asvhil.logs.metrics import wind_figures
from asvhil.simplant.boat.noise import NormalSource, OrnsteinUhlenbeck
from asvhil.simplant.boat.weather import Weather


def weather(seed: int = 1, step_s: float = 0.1, **wind: Any) -> Weather:
    config = WeatherConfig(wind=WindConfig(**wind), current=CurrentConfig(speed_mps=0.5, toward_deg=90.0))
    return Weather(config, step_s, np.random.SeedSequence(seed))


def winds(air: Weather, steps: int) -> np.ndarray:
    rows = []
    for _ in range(steps):
        air.advance()
        rows.append((air.wind_n_mps, air.wind_e_mps))
    return np.array(rows)


def test_gusts_have_the_configured_spread_mean_and_correlation_time() -> None:
    air = weather(speed_mps=4.0, toward_deg=0.0, gust_along=0.2, gust_across=0.1, gust_time_s=2.0)
    seen = winds(air, 100_000)  # 5000 correlation times: the spread is known to 1 %
    assert seen.mean(axis=0) == pytest.approx([4.0, 0.0], abs=0.05)
    assert seen.std(axis=0) == pytest.approx([0.8, 0.4], rel=0.05)
    for column in (seen - seen.mean(axis=0)).T:
        assert np.mean(column[20:] * column[:-20]) / column.var() == pytest.approx(math.exp(-1.0), abs=0.05)
    assert np.corrcoef(seen.T)[0, 1] == pytest.approx(0.0, abs=0.05)


def test_the_process_starts_in_its_stationary_law_and_stays_there_whatever_the_step() -> None:
    for step_s in (0.01, 5.0):
        ends = []
        for seed in range(2000):
            process = OrnsteinUhlenbeck(2.0, 1.0, step_s, NormalSource(np.random.SeedSequence(seed)))
            first = process.value
            ends.append((first, process.advance()))
        assert np.std(ends, axis=0) == pytest.approx([2.0, 2.0], rel=0.06)
        assert np.corrcoef(np.transpose(ends))[0, 1] == pytest.approx(math.exp(-step_s), abs=0.06)


def test_mean_wind_blows_toward_its_direction_and_gusts_along_it_keep_that_direction() -> None:
    air = weather(speed_mps=5.0, toward_deg=90.0, gust_along=0.2, gust_across=0.0)
    seen = winds(air, 100)
    assert np.abs(seen[:, 0]).max() < 1e-9
    assert seen[:, 1].min() > 0.0 and seen[:, 1].std() > 0.0


def test_a_wind_without_gusts_is_constant() -> None:
    seen = winds(weather(speed_mps=3.0, toward_deg=180.0, gust_along=0.0, gust_across=0.0), 10)
    assert np.allclose(seen, [-3.0, 0.0])


def test_a_wind_given_by_its_spread_has_that_of_speed_and_direction() -> None:
    """The speed's spread may exceed its mean, as in a calm with squalls, and it never blows backwards."""
    spread = WindSpreadConfig(speed_mps=1.07, toward_deg=36.62)
    seen = winds(weather(speed_mps=0.88, toward_deg=95.0, gust_time_s=1.0, spread=spread), 400_000)
    speed = np.hypot(*seen.T)
    found = wind_figures(np.column_stack([speed, speed, np.arctan2(seen[:, 1], seen[:, 0])]))
    assert found is not None and speed.min() > 0.0
    assert found["speed_mps"] == {"mean": pytest.approx(0.88, rel=0.03), "std": pytest.approx(1.07, rel=0.1)}
    assert found["toward_deg"] == {"mean": pytest.approx(95.0, abs=1.0), "std": pytest.approx(36.62, abs=0.8)}


def test_another_mean_wind_keeps_its_spread() -> None:
    air = weather(speed_mps=2.0, spread=WindSpreadConfig(toward_deg=10.0))
    assert np.hypot(*winds(air, 5).T) == pytest.approx([2.0] * 5)
    air.set_wind(4.0, 180.0)
    turned = winds(air, 2000)
    assert np.hypot(*turned.T) == pytest.approx([4.0] * 2000) and turned[:, 0].max() < 0.0


def test_the_current_flows_toward_its_direction() -> None:
    air = weather()
    assert (air.current_n_mps, air.current_e_mps) == pytest.approx((0.0, 0.5))


def test_seeds_decide_and_components_have_seeds_of_their_own() -> None:
    assert np.array_equal(winds(weather(seed=7), 50), winds(weather(seed=7), 50))
    assert not np.array_equal(winds(weather(seed=7), 50), winds(weather(seed=8), 50))
    calm_across = winds(weather(seed=7, gust_across=0.0), 50)
    assert np.array_equal(calm_across[:, 0], winds(weather(seed=7, gust_across=0.1), 50)[:, 0])


def test_numbers_do_not_repeat_from_block_to_block() -> None:
    source = NormalSource(np.random.SeedSequence(3))
    values = [source.next() for _ in range(2000)]
    assert len(set(values)) == 2000
    assert np.std(values) == pytest.approx(1.0, abs=0.06)
