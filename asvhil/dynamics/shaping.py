"""Shaping filter of first-order wave motion: what simulated waves are made by, and what the wave filter assumes.

The velocity of the wave motion is white noise through two of Fossen's filters in series,
h(s) = s / (s^2 + 2 zeta w0 s + w0^2) (Fossen 2011, sec. 8.2.6). Through a single one its derivative, which
accelerometers measure, would hold white noise without bound; through two, the position is stationary, the velocity is
its derivative, and the acceleration is finite. The spectrum peaks at w0 either way.

All is in the time unit 1 / w0: a step has the length w0 dt, the *phase*, and the position is w0 times that in metres.
"""

from __future__ import annotations

import math

import numpy as np

from asvhil.dynamics.arrays import Array
from asvhil.dynamics.ordered import product, solve, total

ORDER = 4
POSITION, VELOCITY = 2, 3  # the states that are the output
NODES = 10  # of the quadrature over up to PANEL_RAD of the wave's phase: exact to the last bits
PANEL_RAD = 0.5


def shaping_dynamics(damping: float) -> Array:
    """A (4, 4) of x' = A x + b w for the two filters in series; w drives x[1], the output is x[2], x[3]."""
    return np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-1.0, -2.0 * damping, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [0.0, 1.0, -1.0, -2.0 * damping],
        ]
    )


def stationary_covariance(a: Array) -> Array:
    """P (4, 4) of A P + P A' + b b' = 0."""
    b = np.eye(ORDER)[:, 1:2]
    lyapunov = np.kron(a, np.eye(ORDER)) + np.kron(np.eye(ORDER), a)
    p = solve(lyapunov, -(b * b.T).ravel()).reshape(ORDER, ORDER)
    return np.asarray(0.5 * (p + p.T), dtype=np.float64)


def transition(a: Array, phase: float) -> Array:
    """exp(A phase) (4, 4): its Taylor series, scaled and squared."""
    matrix = a * phase
    halvings = max(0, math.ceil(math.log2(max(math.hypot(*matrix.ravel().tolist()), 1e-300)) + 1.0))
    scaled = matrix / 2.0**halvings
    power = term = np.eye(len(matrix))
    for k in range(1, 20):
        term = product(term, scaled) / k
        power = power + term
    for _ in range(halvings):
        power = product(power, power)
    return power


def noise_factor(a: Array, phase: float) -> Array:
    """Lower triangular L (4, 4) with L L' = Q, the integral of exp(A s) b b' exp(A' s) over a step.

    Over a short step the entries of Q go down to the seventh power of it, where a Cholesky factorisation would fail: so
    the factor is found from that of a quadrature sum, without forming Q, and doubled to the length of the step.
    """
    doublings = max(0, math.ceil(math.log2(phase / PANEL_RAD)))
    panel = phase / 2.0**doublings
    columns = [
        math.sqrt(0.5 * panel * weight) * transition(a, 0.5 * panel * (1.0 + node))[:, 1]
        for node, weight in (_gauss_legendre(i) for i in range(NODES))
    ]
    factor = _lower(np.array(columns).T)
    for k in range(doublings):  # Q(2 s) = Q(s) + exp(A s) Q(s) exp(A' s)
        factor = _lower(np.hstack([product(transition(a, panel * 2.0**k), factor), factor]))
    return factor


def _gauss_legendre(i: int) -> tuple[float, float]:
    """Node i of the quadrature over [-1, 1] and its weight, by Newton's method on the Legendre polynomial."""
    node = -math.cos(math.pi * (i + 0.75) / (NODES + 0.5))
    slope = 1.0
    for _ in range(6):
        last, value = 1.0, node
        for k in range(2, NODES + 1):
            last, value = value, ((2 * k - 1) * node * value - (k - 1) * last) / k
        slope = NODES * (node * value - last) / (node * node - 1.0)
        node -= value / slope
    return node, 2.0 / ((1.0 - node * node) * slope * slope)


def _lower(columns: Array) -> Array:
    """The lower triangular L, its diagonal positive, with L L' = columns columns'."""
    rows = columns.copy()
    count = len(rows)
    lower = np.zeros((count, count))
    for i in range(count):  # Gram-Schmidt, one row after the other (the modified form, which keeps its accuracy)
        lower[i, i] = math.sqrt(total((rows[i] * rows[i]).tolist()))
        rows[i] /= lower[i, i]
        for k in range(i + 1, count):
            lower[k, i] = total((rows[k] * rows[i]).tolist())
            rows[k] -= lower[k, i] * rows[i]
    return lower
