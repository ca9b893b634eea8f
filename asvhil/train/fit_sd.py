"""Fits the parameters of the simplified dynamics by their simulation error: bounded Levenberg-Marquardt. No torch."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from asvhil.dynamics.arrays import Array
from asvhil.dynamics.buffers import bind
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
LOAD_S = 4.0  # windows that the wind loads are found in
DRIFTS, MOST_DRIFTS, MOST_OTHERS = 100, 1200, 2000  # windows with the motors off: needed, and taken; and of the others
# The thrust of a command c is c + q1 (c|c| - c) + q2 (c^3 - c) + q3 (c^5 - c) + q4 c^2 + q5 c^4, and acts in shares s1
# and s2 one and two steps later: what a fit with linear thrust would ascribe to drag, and so to the wind.
CURVE, SHARES = 5, 2
CURVED_LOWER = np.array([*[-20.0] * CURVE, *[0.0] * SHARES])
CURVED_UPPER = np.array([*[20.0] * CURVE, *[1.0] * SHARES])
CURVED_START = np.array([*[0.0] * CURVE, 0.3, 0.1])
WIND = tuple(PARAMETERS.index(name) for name in ("wind_surge", "wind_sway", "wind_yaw"))
LEAST_DAMPING = 1e-12  # parameters that the data cannot tell apart make the equations singular without any
SD_ITERATIONS = 60  # at most; a dozen usually do


def fit_sd(
    dataset: Dataset,
    *,
    window: int = 20,
    iterations: int = SD_ITERATIONS,
    progress: Callable[[int, float], None] | None = None,
) -> tuple[Array, list[float]]:
    """Parameters (13) that minimise the squared error of `window`-step simulations in scaled velocities, and the costs.

    The wind's parameters are `wind_loads`, where the data have enough drifts for them: here they would make up for the
    thrust, which is linear and in truth is not.

    ModelError where the data are not suitable.
    """
    check(dataset)
    scaling = scaling_of(dataset, symmetric=True)
    loads = wind_loads(dataset, iterations, progress)
    held = {} if loads is None else dict(zip(WIND, loads.tolist(), strict=True))
    windows = Windows(dataset.segments, scaling, window, 0)
    starts = windows.starts[:: max(1, len(windows.starts) // LARGEST_SET)]
    return _fit(windows, starts, scaling.half, dataset.dt_s, held, False, iterations, progress)


def wind_loads(
    dataset: Dataset, iterations: int = SD_ITERATIONS, progress: Callable[[int, float], None] | None = None
) -> Array | None:
    """SD's wind parameters (3); None where the data have too few windows with the motors off.

    A boat that drifts shows the ratio of wind load and drag, one that manoeuvres its drag, if its thrust is known. So
    thrust curve, delay, drag and wind load are fitted together, to drifts and manoeuvres, and the first velocity of
    each window as well: taken as measured, its noise would look like drag, and for a boat that drifts, more drag is as
    much more wind load. Smoothing would look like less of both, so the velocities are those that were measured.
    """
    scaling = scaling_of(dataset, symmetric=True)
    steps = round(LOAD_S / dataset.dt_s)
    if all(len(part.t_s) <= steps for part in dataset.segments):
        return None
    raw = (part if part.measured is None else dataclasses.replace(part, nu=part.measured) for part in dataset.segments)
    windows = Windows(tuple(raw), scaling, steps, 0)
    drifts, others = windows.starts[windows.off], windows.starts[~windows.off]
    if len(drifts) < DRIFTS or not len(others):
        return None
    starts = np.sort(np.concatenate([_spread(drifts, MOST_DRIFTS), _spread(others, MOST_OTHERS)]))
    parameters, _ = _fit(windows, starts, scaling.half, dataset.dt_s, {}, True, iterations, progress)
    loads: Array = parameters[list(WIND)]
    return loads


def _spread(starts: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """At most so many of them, evenly."""
    chosen: NDArray[np.int64] = starts[np.linspace(0, len(starts) - 1, min(most, len(starts))).astype(np.int64)]
    return chosen


def load_rates(loads: Array, wind: Array) -> Array:
    """SD's (u_dot, v_dot, r_dot) (..., 3) of a boat at rest with its motors off, in winds (..., 2; m/s)."""
    parameters = np.zeros(len(PARAMETERS))
    parameters[PARAMETERS.index("mass_ratio")] = 1.0
    parameters[list(WIND)] = loads
    still = np.zeros((*wind.shape[:-1], 3))
    rates: Array = FittedSd(parameters.tolist(), 1.0).derivative(still, np.zeros_like(wind), wind)
    return rates


def eased(damping: float) -> float:
    """The damping after a step that lessened the cost."""
    return max(0.3 * damping, LEAST_DAMPING)


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # a trial that runs away is not taken, as its cost says
def _fit(
    windows: Windows,
    starts: NDArray[np.int64],
    half: Array,
    dt_s: float,
    held: Mapping[int, float],
    curved: bool,
    iterations: int,
    progress: Callable[[int, float], None] | None,
) -> tuple[Array, list[float]]:
    """Bounded Levenberg-Marquardt over windows from these rows; parameters that are held keep their values.

    With `curved` the thrust's curve and delay are unknown as well, and the first velocity of each window, whose
    measurement is one of the errors.
    """
    window = windows.steps
    lower, upper, start = LOWER, UPPER, START
    if curved:
        lower, upper = np.concatenate([LOWER, CURVED_LOWER]), np.concatenate([UPPER, CURVED_UPPER])
        start = np.concatenate([START, CURVED_START])
    count = len(start)
    rows = starts[:, None] + np.arange(window + 1)[None, :]
    nu, command, wind = (part[rows] for part in (windows.nu, windows.command, windows.wind))
    residuals = _residuals(half, window, dt_s, curved).map(len(starts))
    # On buffers: out of CasADi's own matrices a Jacobian comes as a list of Python's numbers, which takes as long.
    tiled, moved = np.empty((len(starts), count)), nu.copy()
    errors = np.empty((len(starts), 3 * window))
    jacobians = np.empty((len(starts), 3 * window, count + 3))
    given = tiled, moved, command * half[3:5], wind * half[5:]
    call = bind(residuals, [part.reshape(-1) for part in given], [errors.reshape(-1), jacobians.reshape(-1)])

    def evaluate(parameters: Array, shift: Array) -> tuple[Array, Array]:
        """Errors (W, 3 window) from starts that are moved by shift (W, 3), and their Jacobians (W, 3 window, P + 3)."""
        tiled[:] = parameters
        moved[:, 0] = nu[:, 0] + shift
        call()
        return errors.copy(), jacobians.copy()

    def cost_of(error: Array, shift: Array) -> float:
        return float((error * error).sum() + (shift * shift).sum()) / error.size

    parameters, damping = start.copy(), 1e-2
    parameters[list(held)] = list(held.values())
    fixed = np.isin(np.arange(count), list(held))
    shift = np.zeros((len(starts), 3))
    error, jacobian = evaluate(parameters, shift)
    costs = [cost_of(error, shift)]
    for iteration in range(iterations):
        by_parameters, by_start = jacobian[..., :count], jacobian[..., count:]
        flat = by_parameters.reshape(-1, count)
        normal: Array = flat.T @ flat
        slope: Array = flat.T @ error.ravel()
        follow: Array = np.zeros((len(starts), 3, count))
        settle: Array = np.zeros((len(starts), 3))
        if curved:  # the best starts for any parameters are eliminated from the normal equations
            mixed = by_start.mT @ by_parameters
            pull = (by_start.mT @ error[..., None])[..., 0] + shift
            own = by_start.mT @ by_start + np.eye(3)
            follow = np.asarray(np.linalg.solve(own, mixed), dtype=np.float64)
            settle = np.asarray(np.linalg.solve(own, pull[..., None]), dtype=np.float64)[..., 0]
            normal = normal - (mixed.mT @ follow).sum(0)
            slope = slope - (mixed.mT @ settle[..., None]).sum(0)[:, 0]
        # A parameter that is held, or stopped by its bound, takes no part in the step.
        free = ~(fixed | ((parameters <= lower) & (slope > 0.0)) | ((parameters >= upper) & (slope < 0.0)))
        scale = np.diag(np.maximum(np.diag(normal), 1e-9 * np.diag(normal).max()))
        step = np.zeros(len(parameters))
        part = np.ix_(free, free)
        step[free] = -np.linalg.solve(normal[part] + damping * scale[part], slope[free])
        trial = np.clip(parameters + step, lower, upper)
        trial_shift = shift - settle - follow @ (trial - parameters)
        trial_error, trial_jacobian = evaluate(trial, trial_shift)
        cost = cost_of(trial_error, trial_shift)
        if np.isfinite(cost) and cost < costs[-1]:
            done = costs[-1] - cost < TOLERANCE * costs[-1]
            parameters, shift, error, jacobian = trial, trial_shift, trial_error, trial_jacobian
            damping = eased(damping)
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


def _residuals(half: Array, window: int, dt_s: float, curved: bool) -> ca.Function:
    """(parameters, nu, commands, winds of one window) to its errors (3 window) and their Jacobian, row by row.

    The Jacobian's columns are those of the parameters, then of the first velocity.
    """
    count = len(PARAMETERS) + (CURVE + SHARES if curved else 0)
    p = ca.SX.sym("p", count)
    nu, command = ca.SX.sym("nu", 3 * (window + 1)), ca.SX.sym("a", 2 * (window + 1))
    wind = ca.SX.sym("w", 2 * (window + 1))
    model = FittedSd(p, dt_s)
    scale = ca.DM(half[:3])
    y, c, w = ca.SX.sym("y", 3), ca.SX.sym("c", 6 if curved else 2), ca.SX.sym("air", 2)
    a = _thrust(p[len(PARAMETERS) :], c) if curved else c
    after = integrate(lambda x: model.derivative(x, a, w), y * scale, dt_s, 1, model.euler) / scale
    tangent = ca.Function("tangent", [y, p, c, w], [after, ca.jacobian(after, y), ca.jacobian(after, p)], {"cse": True})
    start = ca.horzcat(ca.SX(3, count), ca.SX.eye(3))
    x, sensitivity, errors, blocks = nu[:3], start, [], []
    for k in range(window):
        past = [max(k - back, 0) for back in range(1 + SHARES if curved else 1)]
        commands = ca.vertcat(*(command[2 * row : 2 * row + 2] for row in past))
        x, dx, dp = tangent(x, p, commands, wind[2 * k : 2 * k + 2])
        sensitivity = dx @ sensitivity + ca.horzcat(dp, ca.SX(3, 3))
        errors.append(x - nu[3 * k + 3 : 3 * k + 6])
        blocks.append(ca.vec(ca.densify(sensitivity).T))
    return ca.Function("residuals", [p, nu, command, wind], [ca.vertcat(*errors), ca.vertcat(*blocks)], {"cse": True})


def _thrust(q: Any, c: Any) -> Any:
    """What drives the boat (2) by the commands (6) of this step, the one before and the one before that."""
    size = ca.fabs(c)
    curve = c + q[0] * (c * size - c) + q[1] * (c**3 - c) + q[2] * (c**5 - c) + q[3] * c**2 + q[4] * c**4
    return (1.0 - q[5] - q[6]) * curve[:2] + q[5] * curve[2:4] + q[6] * curve[4:]
