"""Fixed-step integration of a vessel model, and the equations of motion of pose, velocity and motors.

For NumPy, CasADi and torch arrays, so that controller, estimator, training and studies share one integrator.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from asvhil.dynamics.arrays import namespace_of
from asvhil.dynamics.protocol import Dynamics


def substeps(step_s: float, max_step_s: float) -> int:
    """Number of equal substeps, each at most max_step_s long, of a step; at least 1."""
    return max(1, math.ceil(step_s / max_step_s - 1e-9))


def integrate(derivative: Callable[[Any], Any], x: Any, step_s: Any, count: int, euler: bool) -> Any:
    """x after step_s in `count` equal substeps of forward Euler, or of the explicit midpoint rule (second order)."""
    h = step_s / count
    for _ in range(count):
        slope = derivative(x)
        x = x + h * (slope if euler else derivative(x + 0.5 * h * slope))
    return x


def motion_derivative(model: Dynamics, s: Any, a: Any, wind: Any, disturbance: Any) -> Any:
    """s_dot of s = (x, y, psi, u, v, r, motors ...): R(psi) nu (Fossen 2011, eq. 2.26), and the model's x_dot.

    `a` (2) is the model's input, `wind` (2, m/s) the true wind, and `disturbance` (3; m/s^2, m/s^2, rad/s^2) the
    acceleration that the model misses. Wind and disturbance are in the earth-fixed frame of x, y and psi.
    """
    xp = namespace_of(s)
    psi, u, v, r = (xp.component(s, i) for i in (2, 3, 4, 5))
    cos, sin = (np.cos, np.sin) if isinstance(s, np.ndarray) else _trigonometry_of(s)
    c, n = cos(psi), sin(psi)
    w_x, w_y = xp.component(wind, 0), xp.component(wind, 1)
    d_x, d_y, d_r = (xp.component(disturbance, i) for i in range(3))
    body_wind = xp.stack([c * w_x + n * w_y, -n * w_x + c * w_y])
    x_dot = model.derivative(xp.stack([xp.component(s, i) for i in range(3, 6 + model.n_motor)]), a, body_wind)
    return xp.stack(
        [
            c * u - n * v,
            n * u + c * v,
            r,
            xp.component(x_dot, 0) + c * d_x + n * d_y,
            xp.component(x_dot, 1) - n * d_x + c * d_y,
            xp.component(x_dot, 2) + d_r,
            *(xp.component(x_dot, 3 + i) for i in range(model.n_motor)),
        ]
    )


def advance(model: Dynamics, s: Any, a: Any, wind: Any, disturbance: Any, step_s: Any, count: int) -> Any:
    """The state s of `motion_derivative` after step_s in `count` substeps of the model's integrator, inputs held."""
    return integrate(lambda x: motion_derivative(model, x, a, wind, disturbance), s, step_s, count, model.euler)


def _trigonometry_of(x: Any) -> tuple[Callable[[Any], Any], Callable[[Any], Any]]:
    if isinstance(x, ca.SX | ca.MX | ca.DM):
        return ca.cos, ca.sin
    return (lambda y: y.cos()), (lambda y: y.sin())
