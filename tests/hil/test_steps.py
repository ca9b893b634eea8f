"""Steps whose length changes on the way: an autopilot may ask for another rate at any time."""

from __future__ import annotations

import numpy as np
import pytest

from asvhil.config import WavesConfig, load_config
from asvhil.simplant.boat.noise import NormalSource, OrnsteinUhlenbeck
from asvhil.simplant.boat.waves import Waves
from asvhil.simplant.plant import Plant
from tests.support.hil_clients import FixedOutputs


def test_gusts_keep_their_spread_and_correlation_time() -> None:
    process = OrnsteinUhlenbeck(2.0, 1.0, 0.5, NormalSource(np.random.SeedSequence(3)))
    for step_s in (0.1, 0.02):
        process.set_step(step_s)
        values = np.array([process.advance() for _ in range(round(1500.0 / step_s))])
        assert values.std() == pytest.approx(2.0, rel=0.1)
        lag = round(1.0 / step_s)
        assert np.corrcoef(values[:-lag], values[lag:])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.08)


def test_waves_keep_their_motion_and_its_spread() -> None:
    waves = Waves(WavesConfig(orbital_std_mps=0.07, peak_hz=1.0), 0.0, 0.01, np.random.SeedSequence(1))
    for step_s in (0.02, 0.005):
        before = waves.n_m, waves.vn_mps
        waves.set_step(step_s)
        waves.advance()
        assert waves.n_m == pytest.approx(before[0] + step_s * before[1], abs=2e-4)
        velocity = []
        for _ in range(round(200.0 / step_s)):
            waves.advance()
            velocity.append(waves.vn_mps)
        assert np.std(velocity) == pytest.approx(0.07, rel=0.2)


def test_the_sensors_are_read_on_the_new_grid() -> None:
    plant = Plant(load_config("sitl"), 0)
    plant.advance(1_000_000_000)
    plant.set_step(0.004, 250.0)
    readings = []
    for _ in range(100):
        plant.step()
        readings.append(plant.navigation.ax_mps2)
    assert plant.t_ns == 1_400_000_000
    assert len(set(readings)) == 100


def test_a_step_takes_what_the_autopilot_says_when_it_begins() -> None:
    config = load_config("sitl", ("plant.weather.wind.speed_mps=0",))
    plant = Plant(config, 0, autopilot := FixedOutputs())
    plant.step()
    autopilot.outputs_us = (1900, 1900)
    plant.step()
    assert plant.truth.outputs_us == (1900, 1900)
    assert plant.truth.thrust_n[0] > 5.0
