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
    (`DRIFTS`): among manoeuvres they make up for the thrust, which is linear here and not in truth.

    ModelError where the data are not suitable.
    """
    check(dataset)
    scaling = scaling_of(dataset, symmetric=True)
    loads = drift_loads(dataset, iterations, progress)
    held = {} if loads is None else dict(zip(WIND, loads.tolist(), strict=True))
    windows = Windows(dataset.segments, scaling, window, 0)
    return _fit(windows, windows.starts, scaling.half, dataset.dt_s, held, False, iterations, progress)


def drift_loads(
    dataset: Dataset, iterations: int = SD_ITERATIONS, progress: Callable[[int, float], None] | None = None
) -> Array | None:
    """SD's wind parameters (3) from spans with the motors off, `DRIFT_S` long; None where there are too few.

    The first velocity of each span is fitted as well. Taken as measured, its noise would look like drag, and for a
    boat that drifts, more drag is as much more wind load.
    """
    scaling = scaling_of(dataset, symmetric=True)
    steps, lead = round(DRIFT_S / dataset.dt_s), round(LEAD_S / dataset.dt_s)
    if all(len(part.t_s) <= steps + lead for part in dataset.segments):
        return None
    windows = Windows(dataset.segments, scaling, steps, lead)
    starts = windows.starts[windows.off]
    if len(starts) < DRIFTS:
        return None
    parameters, _ = _fit(windows, starts, scaling.half, dataset.dt_s, {}, True, iterations, progress)
    loads: Array = parameters[list(WIND)]
    return loads


def load_rates(loads: Array, wind: Array) -> Array:
    """SD's (u_dot, v_dot, r_dot) (..., 3) of a boat at rest with its motors off, in winds (..., 2; m/s)."""
    parameters = np.zeros(len(PARAMETERS))
    parameters[PARAMETERS.index("mass_ratio")] = 1.0
    parameters[list(WIND)] = loads
    still = np.zeros((*wind.shape[:-1], 3))
    rates: Array = FittedSd(parameters.tolist(), 1.0).derivative(still, np.zeros_like(wind), wind)
    return rates


def _fit(
    windows: Windows,
    starts: NDArray[np.int64],
    half: Array,
    dt_s: float,
    held: Mapping[int, float],
    free_starts: bool,
    iterations: int,
    progress: Callable[[int, float], None] | None,
) -> tuple[Array, list[float]]:
    """Bounded Levenberg-Marquardt over windows from these rows; parameters that are held keep their values.

    With `free_starts` the first velocity of each window is unknown as well, and its measurement one of the errors.
    """
    window = windows.steps
    starts = starts[:: max(1, len(starts) // LARGEST_SET)]
    rows = starts[:, None] + np.arange(window + 1)[None, :]
    nu, command, wind = (part[rows] for part in (windows.nu, windows.command, windows.wind))
    residuals = _residuals(half, window, dt_s).map(len(starts))
    columns = [part.reshape(len(starts), -1).T for part in (nu, command * half[3:5], wind * half[5:])]

    def evaluate(parameters: Array, shift: Array) -> tuple[Array, Array]:
        """Errors (W, 3 window) from starts that are moved by shift (W, 3), and their Jacobians (W, 3 window, 16)."""
        moved = columns[0].copy()
        moved[:3] += shift.T
        error, jacobian = residuals(np.tile(parameters[:, None], len(starts)), moved, *columns[1:])
        return np.asarray(error).T, np.asarray(jacobian).T.reshape(len(starts), 3 * window, -1)

    def cost_of(error: Array, shift: Array) -> float:
        return float((error * error).sum() + (shift * shift).sum()) / error.size

    parameters, damping = START.copy(), 1e-2
    parameters[list(held)] = list(held.values())
    fixed = np.isin(np.arange(len(PARAMETERS)), list(held))
    shift = np.zeros((len(starts), 3))
    error, jacobian = evaluate(parameters, shift)
    costs = [cost_of(error, shift)]
    for iteration in range(iterations):
        by_parameters, by_start = jacobian[..., : len(PARAMETERS)], jacobian[..., len(PARAMETERS) :]
        flat = by_parameters.reshape(-1, len(PARAMETERS))
        normal: Array = flat.T @ flat
        slope: Array = flat.T @ error.ravel()
        follow: Array = np.zeros((len(starts), 3, len(PARAMETERS)))
        settle: Array = np.zeros((len(starts), 3))
        if free_starts:  # the best starts for any parameters are eliminated from the normal equations
            mixed = by_start.mT @ by_parameters
            pull = (by_start.mT @ error[..., None])[..., 0] + shift
            own = by_start.mT @ by_start + np.eye(3)
            follow = np.asarray(np.linalg.solve(own, mixed), dtype=np.float64)
            settle = np.asarray(np.linalg.solve(own, pull[..., None]), dtype=np.float64)[..., 0]
            normal = normal - (mixed.mT @ follow).sum(0)
            slope = slope - (mixed.mT @ settle[..., None]).sum(0)[:, 0]
        # A parameter that is held, or stopped by its bound, takes no part in the step.
        free = ~(fixed | ((parameters <= LOWER) & (slope > 0.0)) | ((parameters >= UPPER) & (slope < 0.0)))
        scale = np.diag(np.maximum(np.diag(normal), 1e-9 * np.diag(normal).max()))
        step = np.zeros(len(parameters))
        part = np.ix_(free, free)
        step[free] = -np.linalg.solve(normal[part] + damping * scale[part], slope[free])
        trial = np.clip(parameters + step, LOWER, UPPER)
        trial_shift = shift - settle - follow @ (trial - parameters)
        trial_error, trial_jacobian = evaluate(trial, trial_shift)
        cost = cost_of(trial_error, trial_shift)
        if np.isfinite(cost) and cost < costs[-1]:
            done = costs[-1] - cost < TOLERANCE * costs[-1]
            parameters, shift, error, jacobian = trial, trial_shift, trial_error, trial_jacobian
            damping *= 0.3
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
    """(parameters, nu, commands, winds of one window) to its errors (3 window) and their Jacobian, row by row.

    The Jacobian's columns are those of the parameters, then of the first velocity.
    """
    p = ca.SX.sym("p", len(PARAMETERS))
    nu, command = ca.SX.sym("nu", 3 * (window + 1)), ca.SX.sym("a", 2 * (window + 1))
    wind = ca.SX.sym("w", 2 * (window + 1))
    model = FittedSd(p, dt_s)
    scale = ca.DM(half[:3])
    y, a, w = ca.SX.sym("y", 3), ca.SX.sym("c", 2), ca.SX.sym("air", 2)
    after = integrate(lambda x: model.derivative(x, a, w), y * scale, dt_s, 1, model.euler) / scale
    tangent = ca.Function("tangent", [y, p, a, w], [after, ca.jacobian(after, y), ca.jacobian(after, p)], {"cse": True})
    start = ca.horzcat(ca.SX(3, len(PARAMETERS)), ca.SX.eye(3))
    x, sensitivity, errors, blocks = nu[:3], start, [], []
    for k in range(window):
        x, dx, dp = tangent(x, p, command[2 * k : 2 * k + 2], wind[2 * k : 2 * k + 2])
        sensitivity = dx @ sensitivity + ca.horzcat(dp, ca.SX(3, 3))
        errors.append(x - nu[3 * k + 3 : 3 * k + 6])
        blocks.append(ca.vec(ca.densify(sensitivity).T))
    return ca.Function("residuals", [p, nu, command, wind], [ca.vertcat(*errors), ca.vertcat(*blocks)], {"cse": True})
