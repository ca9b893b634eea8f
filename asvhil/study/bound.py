"""The physical bound: how well any controller could keep a station in a steady wind, by periodic optimal control.

Across the wind no boat with two fixed motors can stand still; the best it can do is a limit cycle. The bound is the
least penalty score ps = e_d + s_d + |e_h| + s_h (m, degrees) over all periodic motions of the model, without noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from asvhil.dynamics.integrate import advance
from asvhil.dynamics.protocol import Dynamics
from asvhil.types import record

Array = NDArray[np.float64]

INTERVALS = 60
PERIODS_S = (4.0, 30.0)  # bounds of the free period
STARTS_S = (5.5, 8.0, 11.5, 15.0)
SWINGS_RAD = (0.06, 0.18)
SMOOTH = 1e-6  # under the roots: the score has corners at zero


@record
class Orbit:
    """A periodic motion about the station: its score, its period, and rows of (x, y, psi, u, v, r, motors ...)."""

    penalty_score: float
    period_s: float
    distance_m: tuple[float, float]  # mean, standard deviation
    heading_deg: tuple[float, float]
    states: Array
    inputs: Array


def bound(
    model: Dynamics,
    wind_mps: float,
    toward_rad: float,
    on_start: Callable[[int, int], None] = lambda done, of: None,
) -> Orbit:
    """The best orbit found from several starts. `toward_rad` is from the station's heading. RuntimeError if none."""
    solver, lower, upper, size = _problem(model, wind_mps, toward_rad)
    guesses = [(period, swing) for period in STARTS_S for swing in SWINGS_RAD]
    best: Orbit | None = None
    for number, (period_s, swing_rad) in enumerate(guesses):
        on_start(number, len(guesses))
        found = solver(
            x0=_guess(model, size, wind_mps, toward_rad, period_s, swing_rad), lbx=lower, ubx=upper, lbg=0.0, ubg=0.0
        )
        if not solver.stats()["success"]:
            continue
        orbit = _orbit(np.array(found["x"]).ravel(), size)
        if best is None or orbit.penalty_score < best.penalty_score:
            best = orbit
    if best is None:
        raise RuntimeError(f"no periodic motion was found in a wind of {wind_mps:g} m/s")
    return best


def _problem(model: Dynamics, wind_mps: float, toward_rad: float) -> tuple[ca.Function, Array, Array, int]:
    """Multiple shooting over one period: (solver, lower and upper bounds of the variables, state size)."""
    size = 6 + model.n_motor
    s, a, period = ca.SX.sym("s", size), ca.SX.sym("a", 2), ca.SX.sym("period")
    wind = ca.DM([wind_mps * math.cos(toward_rad), wind_mps * math.sin(toward_rad)])
    after = advance(model, s, a, ca.SX(wind), ca.SX.zeros(3), period / INTERVALS, 1)
    step = ca.Function("step", [s, a, period], [after])
    states, inputs = ca.SX.sym("states", size, INTERVALS), ca.SX.sym("inputs", 2, INTERVALS)
    closed = ca.horzcat(states[:, 1:], states[:, :1])  # the last interval ends where the first one starts
    gaps = ca.vec(step.map(INTERVALS)(states, inputs, ca.repmat(period, 1, INTERVALS)) - closed)
    distance = ca.sqrt(states[0, :] ** 2 + states[1, :] ** 2 + SMOOTH)
    heading_deg = states[2, :] * (180.0 / math.pi)
    objective = _mean(distance) + _deviation(distance) + ca.sqrt(_mean(heading_deg) ** 2 + SMOOTH)
    objective += _deviation(heading_deg)
    variables = ca.vertcat(ca.vec(states), ca.vec(inputs), period)
    ipopt = {"max_iter": 800, "tol": 1e-6, "print_level": 0, "sb": "yes"}
    options: dict[str, Any] = {"ipopt": ipopt, "print_time": False}
    solver = ca.nlpsol("bound", "ipopt", {"x": variables, "f": objective, "g": gaps}, options)
    lower = np.full(variables.shape[0], -np.inf)
    upper = np.full(variables.shape[0], np.inf)
    first_input = size * INTERVALS
    lower[first_input:-1], upper[first_input:-1] = model.input_lower, model.input_upper
    lower[-1], upper[-1] = PERIODS_S
    return solver, lower, upper, size


def _guess(model: Dynamics, size: int, wind_mps: float, toward_rad: float, period_s: float, swing_rad: float) -> Array:
    """A swing of the heading with thrust ahead and astern in phase with it."""
    phase = 2.0 * math.pi * np.arange(INTERVALS) / INTERVALS
    side = -math.copysign(1.0, math.sin(toward_rad))  # the side force wanted is against the wind
    states = np.zeros((INTERVALS, size))
    states[:, 2] = side * swing_rad * np.sin(phase)
    states[:, 5] = side * swing_rad * 2.0 * math.pi / period_s * np.cos(phase)
    thrust = 0.3 * np.sin(phase)
    thrust = np.clip(thrust, model.input_lower, model.input_upper)
    states[:, 0] = -0.05 * wind_mps * np.sin(phase)
    if model.n_motor >= 2:
        states[:, 6] = states[:, 7] = thrust
    return np.concatenate([states.ravel(), np.repeat(thrust, 2), [period_s]])


def _orbit(variables: Array, size: int) -> Orbit:
    states = variables[: size * INTERVALS].reshape(INTERVALS, size)
    distance = np.hypot(states[:, 0], states[:, 1])
    heading_deg = np.degrees(states[:, 2])
    parts = float(distance.mean()), float(distance.std()), float(heading_deg.mean()), float(heading_deg.std())
    return Orbit(
        penalty_score=parts[0] + parts[1] + abs(parts[2]) + parts[3],
        period_s=float(variables[-1]),
        distance_m=parts[:2],
        heading_deg=parts[2:],
        states=states,
        inputs=variables[size * INTERVALS : -1].reshape(INTERVALS, 2),
    )


def _mean(row: Any) -> Any:
    return ca.sum2(row) / INTERVALS


def _deviation(row: Any) -> Any:
    return ca.sqrt(_mean((row - _mean(row)) ** 2) + SMOOTH)
