"""Steady-state gains of the wave filter: the Riccati equation, its error dynamics, and the frequencies they part."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from asvhil.dynamics import shaping
from asvhil.estimator import wave_gain
from asvhil.estimator.wave_gain import STATES, WAVE_VELOCITY

STEP_S, DAMPING = 0.05, 0.2
WALKS = (0.015, 0.002)
STD = (0.03, 0.01)


def gain_of(peak_hz: float, wave_std: float) -> np.ndarray:
    return wave_gain.gain(math.tau * peak_hz, DAMPING, STEP_S, wave_std, *WALKS, STD)


@pytest.mark.parametrize("peak_hz", [0.12, 0.3, 1.2])
@pytest.mark.parametrize("wave_std", [0.01, 0.3])
def test_the_gain_is_that_of_the_kalman_filter_once_it_has_settled(peak_hz: float, wave_std: float) -> None:
    omega = math.tau * peak_hz
    f, h, r = wave_gain.transition(omega, DAMPING, STEP_S), wave_gain.measurement(omega), np.diag(np.square(STD))
    a = shaping.shaping_dynamics(DAMPING)
    unit = wave_std / math.sqrt(shaping.stationary_covariance(a)[3, 3])
    factor = unit * shaping.noise_factor(a, omega * STEP_S)
    q = np.diag([1e-6 * STEP_S, WALKS[0] ** 2 * STEP_S, WALKS[1] ** 2 * STEP_S, 0.0, 0.0, 0.0, 0.0])
    q[3:, 3:] = factor @ factor.T
    p, settled = np.eye(STATES), False
    while not settled:
        before = p
        p = f @ p @ f.T + q
        k = np.linalg.solve(h @ p @ h.T + r, h @ p).T
        keep = np.eye(STATES) - k @ h
        p = keep @ p @ keep.T + k @ r @ k.T
        settled = np.allclose(p, before, rtol=1e-11, atol=1e-16)
    assert gain_of(peak_hz, wave_std) == pytest.approx(k, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("peak_hz", [0.12, 0.3, 1.2])
def test_errors_die_away(peak_hz: float) -> None:
    omega = math.tau * peak_hz
    f, h = wave_gain.transition(omega, DAMPING, STEP_S), wave_gain.measurement(omega)
    assert np.abs(np.linalg.eigvals(f - gain_of(peak_hz, 0.1) @ h @ f)).max() < 1.0


def response(frequency_hz: float, output: int) -> float:
    """Gain from a measured motion (pose and velocity of one sine) to an estimated velocity, at the peak of 0.3 Hz."""
    omega = math.tau * 0.3
    f, h, k = wave_gain.transition(omega, DAMPING, STEP_S), wave_gain.measurement(omega), gain_of(0.3, 0.1)
    s = 1j * math.tau * frequency_hz
    z = cmath.exp(s * STEP_S)
    loop = z * np.eye(STATES) - (np.eye(STATES) - k @ h) @ f
    state = np.linalg.solve(loop, z * k @ np.array([1.0 / s, 1.0]))
    return abs(complex(state[output]))


def test_the_peak_goes_to_the_waves_and_slow_motion_does_not() -> None:
    assert response(0.3, WAVE_VELOCITY) == pytest.approx(1.0, abs=0.1)
    assert response(0.3, 1) < 0.15
    assert response(0.01, 1) == pytest.approx(1.0, abs=0.05)
    assert response(0.01, WAVE_VELOCITY) < 0.05
