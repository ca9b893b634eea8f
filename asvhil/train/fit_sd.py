"""Fits the parameters of the simplified dynamics by their simulation error: bounded Levenberg-Marquardt. No torch."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from asvhil.dynamics.arrays import Array
from asvhil.dynamics.fitted_sd import PARAMETERS, FittedSd
from asvhil.dynamics.integrate import integrate
from asvhil.dynamics.lagnet import SKIP_FACTORS
from asvhil.dynamics.nnsem import Scaling
from asvhil.train.records import Dataset
from asvhil.train.windows import Windows, check, scaling_of

LARGEST_SET = 600  # windows: more change the fit less than noise does
LOWER = np.array([1e-4, 1e-4, 0.2, 0.0, *[0.0] * 9])
UPPER = np.array([10.0, 10.0, 20.0, 10.0, *[20.0] * 6, 0.5, 0.5, 0.5])
START = np.array([0.3, 0.2, 1.5, 0.2, 0.2, 0.2, 0.3, 0.3, 0.5, 0.5, 1e-3, 1e-3, 1e-3])
TOLERANCE = 1e-7
DRIFT_S, LEAD_S, DRIFTS = 20.0, 1.6, 100  # spans with the motors off, after motors have stopped; how many it takes
WIND = tuple(PARAMETERS.index(name) for name in ("wind_surge", "wind_sway", "wind_yaw"))
SD_ITERATIONS = 60  # at most; a dozen usually do


def fit_sd(
    dataset: Dataset,
    *,
    window: int = 20,
    iterations: int = SD_ITERATIONS,
    progress: Callable[[int, float], None] | None = None,
) -> tuple[Array, list[float]]:
    """Parameters (13) that minimise the squared error of `window`-step simulations in scaled velocities, and the costs.

    The wind's parameters are those of a fit to spans with the motors off alone, where the data have enough of them
    (`DRIFTS`): among manoeuvres they make up for the thrust, which is linear here and not in truth. Such a span is
    `DRIFT_S` long, so that the noise of its first velocity, which looks like drag, counts for little.

    ModelError where the data are not suitable.
    """
    check(dataset)
    scaling = scaling_of(dataset, symmetric=True)
    held = _drift_parameters(dataset, scaling, iterations, progress)
    windows = Windows(dataset.segments, scaling, window, 0)
    return _fit(windows, windows.starts, scaling.half, dataset.dt_s, held, iterations, progress)


def _drift_parameters(
    dataset: Dataset, scaling: Scaling, iterations: int, progress: Callable[[int, float], None] | None
) -> dict[int, float]:
    """The wind's parameters by their place, from spans with the motors off; none where there are too few."""
    steps, lead = round(DRIFT_S / dataset.dt_s), round(LEAD_S / dataset.dt_s)
    if all(len(part.t_s) <= steps + lead for part in dataset.segments):
        return {}
    windows = Windows(dataset.segments, scaling, steps, lead)
    starts = windows.starts[windows.off]
    if len(starts) < DRIFTS:
        return {}
    parameters, _ = _fit(windows, starts, scaling.half, dataset.dt_s, {}, iterations, progress)
    return {place: float(parameters[place]) for place in WIND}


def _fit(
    windows: Windows,
    starts: NDArray[np.int64],
    half: Array,
    dt_s: float,
    held: Mapping[int, float],
    iterations: int,
    progress: Callable[[int, float], None] | None,
) -> tuple[Array, list[float]]:
    """Bounded Levenberg-Marquardt over windows from these rows; parameters that are held keep their values."""
    window = windows.steps
    starts = starts[:: max(1, len(starts) // LARGEST_SET)]
    rows = starts[:, None] + np.arange(window + 1)[None, :]
    nu, command, wind = (part[rows] for part in (windows.nu, windows.command, windows.wind))
    residuals = _residuals(half, window, dt_s).map(len(starts))
    columns = [part.reshape(len(starts), -1).T for part in (nu, command * half[3:5], wind * half[5:])]

    def evaluate(parameters: Array) -> tuple[Array, Array]:
        error, jacobian = residuals(np.tile(parameters[:, None], len(starts)), *columns)
        return np.asarray(error).T.ravel(), np.asarray(jacobian).T.reshape(-1, len(PARAMETERS))

    parameters, damping = START.copy(), 1e-2
    parameters[list(held)] = list(held.values())
    fixed = np.isin(np.arange(len(PARAMETERS)), list(held))
    error, jacobian = evaluate(parameters)
    costs = [float(error @ error) / error.size]
    for iteration in range(iterations):
        normal, slope = jacobian.T @ jacobian, jacobian.T @ error
        # A parameter that is held, or stopped by its bound, takes no part in the step.
        free = ~(fixed | ((parameters <= LOWER) & (slope > 0.0)) | ((parameters >= UPPER) & (slope < 0.0)))
        scale = np.diag(np.maximum(np.diag(normal), 1e-9 * np.diag(normal).max()))
        step = np.zeros(len(parameters))
        part = np.ix_(free, free)
        step[free] = -np.linalg.solve(normal[part] + damping * scale[part], slope[free])
        trial = np.clip(parameters + step, LOWER, UPPER)
        trial_error, trial_jacobian = evaluate(trial)
        cost = float(trial_error @ trial_error) / error.size
        if np.isfinite(cost) and cost < costs[-1]:
            done = costs[-1] - cost < TOLERANCE * costs[-1]
            parameters, error, jacobian, damping = trial, trial_error, trial_jacobian, 0.3 * damping
            costs.append(cost)
        else:
            done, damping = damping > 1e8, 10.0 * damping
        if progress is not None:
            progress(iteration + 1, costs[-1])
        if done:
            break
    return parameters, costs


def skip_of_sd(parameters: Array, scaling: Scaling) -> Array:
    """The skip terms (16, 3) of LagNet that equal a fitted SD in still air, thrust being linear; in wind nearly.

    Products of the wind and the boat's own velocity, which SD's relative wind has, are left out.
    """
    p = dict(zip(PARAMETERS, parameters.tolist(), strict=True))
    u, v, r, port, starboard, wind_u, wind_v = range(7)
    rates: tuple[dict[tuple[int, ...], float], ...] = (  # of nu_dot, by the factors of a product, all in their units
        {
            (port,): p["thrust_surge"],
            (starboard,): p["thrust_surge"],
            (v, r): p["mass_ratio"],
            (u,): -p["drag_u"],
            (u, u): -p["drag_uu"] - p["wind_surge"],
            (wind_u, wind_u): p["wind_surge"],
        },
        {
            (r, u): -1.0 / p["mass_ratio"],
            (v,): -p["drag_v"],
            (v, v): -p["drag_vv"] - p["wind_sway"],
            (wind_v, wind_v): p["wind_sway"],
        },
        {
            (port,): p["thrust_yaw"],
            (starboard,): -p["thrust_yaw"],
            (r,): -p["drag_r"],
            (r, r): -p["drag_rr"],
            (u, v): -p["munk_yaw"] - p["wind_yaw"],
            (wind_u, wind_v): -p["wind_yaw"],
        },
    )
    skip = np.zeros((len(SKIP_FACTORS), 3))
    for axis, terms in enumerate(rates):
        for factors, rate in terms.items():
            skip[SKIP_FACTORS.index(factors), axis] = rate * scaling.half[list(factors)].prod() / scaling.half[axis]
    return skip


def _residuals(half: Array, window: int, dt_s: float) -> ca.Function:
    """(parameters, nu, commands, winds of one window) to its errors (3 window) and their Jacobian, row by row."""
    p = ca.SX.sym("p", len(PARAMETERS))
    nu, command = ca.SX.sym("nu", 3 * (window + 1)), ca.SX.sym("a", 2 * (window + 1))
    wind = ca.SX.sym("w", 2 * (window + 1))
    model = FittedSd(p, dt_s)
    scale = ca.DM(half[:3])
    y, a, w = ca.SX.sym("y", 3), ca.SX.sym("c", 2), ca.SX.sym("air", 2)
    after = integrate(lambda x: model.derivative(x, a, w), y * scale, dt_s, 1, model.euler) / scale
    tangent = ca.Function("tangent", [y, p, a, w], [after, ca.jacobian(after, y), ca.jacobian(after, p)], {"cse": True})
    x, sensitivity, errors, blocks = nu[:3], ca.SX(3, len(PARAMETERS)), [], []
    for k in range(window):
        x, dx, dp = tangent(x, p, command[2 * k : 2 * k + 2], wind[2 * k : 2 * k + 2])
        sensitivity = dx @ sensitivity + dp
        errors.append(x - nu[3 * k + 3 : 3 * k + 6])
        blocks.append(ca.vec(ca.densify(sensitivity).T))
    return ca.Function("residuals", [p, nu, command, wind], [ca.vertcat(*errors), ca.vertcat(*blocks)], {"cse": True})
