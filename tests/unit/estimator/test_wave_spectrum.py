"""The peak and the size of waves, from sines and from motion that the motors cause."""

from __future__ import annotations

import math

import numpy as np
import pytest

from asvhil.estimator.wave_spectrum import FREQUENCIES_HZ, WaveSpectrum

STEP_S = 0.2
ARM_M = 1.9


def after(
    frequency_hz: float, left_over: tuple[float, float, float], pushed: float = 0.0, span_s: float = 150.0
) -> WaveSpectrum:
    """The spectrum after a sine; the motors push ahead with an amplitude (m/s^2) at the same frequency."""
    spectrum = WaveSpectrum(STEP_S, ARM_M)
    for number in range(round(span_s / STEP_S)):
        sine = math.sin(math.tau * frequency_hz * number * STEP_S)
        cosine = math.cos(math.tau * frequency_hz * number * STEP_S)
        spectrum.step(sine * np.array(left_over), np.array([pushed * cosine, 0.0, 0.0]))
    return spectrum


@pytest.mark.parametrize("frequency_hz", [0.14, 0.21, 0.3, 0.45, 0.7, 1.1])
def test_the_peak_is_near_the_frequency(frequency_hz: float) -> None:
    spectrum = after(frequency_hz, (0.0, 0.1, 0.0))
    assert abs(math.log(FREQUENCIES_HZ[spectrum.peak] / frequency_hz)) < 0.12  # they are 0.18 apart


def test_size_is_the_root_mean_square() -> None:
    spectrum = after(float(FREQUENCIES_HZ[5]), (0.1, 0.1, 0.04), span_s=300.0)
    velocity_mps, yaw_radps = spectrum.std
    assert velocity_mps == pytest.approx(0.1 / math.sqrt(2.0), rel=0.05)
    assert yaw_radps == pytest.approx(0.04 / math.sqrt(2.0), rel=0.05)
    assert spectrum.level_mps == pytest.approx(math.hypot(0.1, 0.1, 0.04 * ARM_M) / math.sqrt(2.0), rel=0.05)


def test_nothing_is_no_wave() -> None:
    assert after(0.3, (0.0, 0.0, 0.0)).level_mps == 0.0


def test_what_motors_of_a_wrong_model_cause_is_no_wave_ahead_and_is_one_sideways() -> None:
    """The model is off by a quarter: the velocity left over is a quarter of that of the motors."""
    omega = math.tau * float(FREQUENCIES_HZ[5])
    velocity_mps = 0.4
    ahead = after(omega / math.tau, (0.25 * velocity_mps, 0.0, 0.0), pushed=velocity_mps * omega)
    sideways = after(omega / math.tau, (0.0, 0.25 * velocity_mps, 0.0), pushed=velocity_mps * omega)
    assert ahead.level_mps < 0.02  # below what counts as waves
    assert sideways.level_mps > 0.06


def test_the_peak_moves_once_another_is_clearly_higher() -> None:
    spectrum = after(0.3, (0.0, 0.1, 0.0))
    before = spectrum.peak
    for number in range(round(120.0 / STEP_S)):
        spectrum.step(np.array([0.0, 0.1 * math.sin(math.tau * 0.7 * number * STEP_S), 0.0]), np.zeros(3))
    assert spectrum.peak > before + 3
