"""Steady-state Kalman gains of the wave filter, by peak frequency and by how large the waves are.

One axis (north, east or yaw) has seven states: position, velocity and disturbance of the low-frequency motion, then the
four of the shaping filter. Position and velocity are measured with waves; what the model says of the acceleration is a
known input (Fossen 2011, sec. 13.2, with the velocity measured as well).
"""

from __future__ import annotations

import functools
import math

import numpy as np

from asvhil.dynamics import shaping
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.ordered import product, solve

STATES = 3 + shaping.ORDER
WAVE_POSITION, WAVE_VELOCITY = 3 + shaping.POSITION, 3 + shaping.VELOCITY
DOUBLINGS = 40  # at most; some 15 are needed


def transition(peak_radps: float, damping: float, step_s: float) -> Array:
    """F (7, 7) of one step."""
    f = np.eye(STATES)
    f[0, 1] = f[1, 2] = step_s
    f[0, 2] = 0.5 * step_s * step_s
    f[3:, 3:] = shaping.transition(shaping.shaping_dynamics(damping), peak_radps * step_s)
    return f


def measurement(peak_radps: float) -> Array:
    """H (2, 7): position and velocity with waves."""
    h = np.zeros((2, STATES))
    h[0, 0] = h[1, 1] = h[1, WAVE_VELOCITY] = 1.0
    h[0, WAVE_POSITION] = 1.0 / peak_radps
    return h


@functools.lru_cache(maxsize=512)
def gain(
    peak_radps: float,
    damping: float,
    step_s: float,
    wave_std: float,
    velocity_walk: float,
    disturbance_walk: float,
    measured_std: tuple[float, float],
) -> Array:
    """K (7, 2), which is not to be changed. `wave_std` is of the waves' velocity; walks are per sqrt(s).

    `measured_std` are those of position and velocity. The Riccati equation is solved by doubling (Anderson and Moore,
    Optimal Filtering, 1979, sec. 6.7).
    """
    a = shaping.shaping_dynamics(damping)
    unit = wave_std / math.sqrt(shaping.stationary_covariance(a)[shaping.VELOCITY, shaping.VELOCITY])
    factor = unit * shaping.noise_factor(a, peak_radps * step_s)
    q = np.zeros((STATES, STATES))
    q[0, 0] = 1e-6 * step_s  # keeps the position's variance above zero
    q[1, 1], q[2, 2] = velocity_walk**2 * step_s, disturbance_walk**2 * step_s
    q[3:, 3:] = product(factor, factor.T)
    h, r = measurement(peak_radps), np.diag(np.square(measured_std))
    p = _riccati(transition(peak_radps, damping, step_s), h, q, r)
    hp = product(h, p)
    k: Array = solve(product(hp, h.T) + r, hp).T
    k.flags.writeable = False
    return k


def _riccati(f: Array, h: Array, q: Array, r: Array) -> Array:
    """P of P = F (P - P H' (H P H' + R)^-1 H P) F' + Q."""
    a, g, p = f.T, product(h.T, solve(r, h)), q
    for _ in range(DOUBLINGS):
        w = solve(np.eye(len(p)) + product(g, p), np.hstack([a, g]))
        w_a, w_g = w[:, : len(p)], w[:, len(p) :]
        step = product(product(a.T, p), w_a)
        g = g + product(product(a, w_g), a.T)
        a, p = product(a, w_a), p + 0.5 * (step + step.T)
        g = 0.5 * (g + g.T)
        if np.abs(step).max() <= 1e-13 * np.abs(p).max():
            break
    return p
