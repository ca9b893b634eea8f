"""Monitoring of the vessel model in use: one-step and horizon prediction errors while the boat is controlled."""

from __future__ import annotations

import functools
import math
from collections import deque
from collections.abc import Callable

import casadi as ca
import numpy as np

from asvhil.config import MonitorConfig
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.buffers import bind, fastest
from asvhil.dynamics.integrate import integrate, motion_derivative, substeps
from asvhil.dynamics.ordered import total
from asvhil.dynamics.protocol import Dynamics
from asvhil.dynamics.remembered import by_model
from asvhil.estimator.prediction import REMEMBERED
from asvhil.types import Estimate, PredictionError, Wind

NU = slice(3, 6)

Triple = tuple[float, float, float]
STILL: Triple = (0.0, 0.0, 0.0)


class ModelMonitor:
    """Rolls the model out in open loop from a past estimate, under the inputs that were sent, to the present one.

    The disturbance estimate is left out, so the errors are those of the model alone. They are root mean squares over a
    sliding window, so that a single bad estimate raises no flag. A steady push that the model cannot know, as a
    current, is no error of the model: what the disturbance of four seconds ago explains is taken for right.
    """

    def __init__(self, config: MonitorConfig, model: Dynamics, period_s: float) -> None:
        self._config = config
        size = 6 + model.n_motor
        self._steps = max(1, round(config.horizon_s / period_s))
        self._max_gap_ns = round(1.5e9 * period_s)
        self._past: deque[Estimate] = deque(maxlen=self._steps)
        # Inputs and winds from each of these states on, the newest last; and one push for all of them.
        self._inputs, self._winds = np.zeros(2 * self._steps), np.zeros(2 * self._steps)
        self._push = np.zeros(3 * self._steps)
        self._state, self._after = np.zeros(size), np.zeros(size)
        newest = [self._inputs[-2:], self._winds[-2:], self._push[-3:]]
        count = substeps(period_s, model.max_step_s)
        one_step, roll_out = _functions(_serialized_rate(model), period_s, count, model.euler, self._steps)
        self._advance = bind(one_step, [self._state, *newest], [self._after])
        self._roll_out = bind(roll_out, [self._state, self._inputs, self._winds, self._push], [self._after])
        self._window = _Window(max(1, round(config.window_s / period_s)))
        self._pushes: deque[Triple] = deque(maxlen=2 * self._steps)
        self.unexplained = STILL  # of the errors at the horizon, what the disturbance does not explain

    @property
    def push_mps2(self) -> float:
        """The mean of the disturbance over twice the horizon: a current stays, errors of the model come and go."""
        count = max(len(self._pushes), 1)
        north, east = (total([push[axis] for push in self._pushes]) / count for axis in range(2))
        return math.hypot(north, east)

    def reset(self) -> None:
        """Forget everything, after a time in which others had the motors: the inputs are not known."""
        self._past.clear()
        self._pushes.clear()

    def step(self, estimate: Estimate, model_input: tuple[float, float], wind: Wind | None) -> PredictionError | None:
        """Add the state of a control tick and the input from then on: the errors, once the horizon is filled."""
        if self._past and estimate.t_ns - self._past[-1].t_ns > self._max_gap_ns:
            self.reset()
        errors = None
        if len(self._past) == self._steps:
            first = self._past[0]
            errors = (
                *self._prediction_error(self._past[-1], self._advance, estimate),
                *self._prediction_error(first, self._roll_out, estimate),
                *self._prediction_error(first, self._roll_out, estimate, first.disturbance),
            )
        self._past.append(estimate)
        _append(self._inputs, model_input)
        _append(self._winds, (0.0, 0.0) if wind is None else (wind.vn_mps, wind.ve_mps))
        if errors is None:
            return None
        one_step, horizon, pushed = self._window.rms(errors)
        self._pushes.append(estimate.disturbance)
        # The lesser of both; NaN where the model diverges.
        u, v, r = (b if b < a else a for a, b in zip(horizon, pushed, strict=True))
        self.unexplained = u, v, r
        limits = (self._config.max_u_mps, self._config.max_v_mps, self._config.max_r_radps)
        # NaN compares false, so a model that diverges is not ok.
        ok = not self._window.full or all(error <= limit for error, limit in zip((u, v, r), limits, strict=True))
        return PredictionError(one_step=one_step, horizon=horizon, horizon_s=self._config.horizon_s, ok=ok)

    def _prediction_error(
        self, start: Estimate, predict: Callable[[], None], now: Estimate, push: Triple = STILL
    ) -> Triple:
        """Predicted less estimated (u, v, r), of a prediction from a state on, under a push (m/s^2, rad/s^2)."""
        self._push.reshape(-1, 3)[:] = push
        self._state[:] = (
            start.n_m,
            start.e_m,
            start.psi_rad,
            start.u_mps,
            start.v_mps,
            start.r_radps,
            *start.motor,
        )
        predict()
        u, v, r = self._after[NU].tolist()
        return u - now.u_mps, v - now.v_mps, r - now.r_radps


@by_model
def _serialized_rate(model: Dynamics) -> str:
    """A model's rate (state, input, wind, push) -> s_dot, remembered as that of `prediction.py`."""
    s, a = ca.SX.sym("s", 6 + model.n_motor), ca.SX.sym("a", 2)
    wind, push = ca.SX.sym("wind", 2), ca.SX.sym("d", 3)
    rate = ca.Function("rate", [s, a, wind, push], [motion_derivative(model, s, a, wind, push)])
    serialized: str = rate.serialize()
    return serialized


@functools.lru_cache(maxsize=REMEMBERED)
def _functions(
    serialized: str, period_s: float, count: int, euler: bool, steps: int
) -> tuple[ca.Function, ca.Function]:
    """(state, input, wind, push) -> state by a model's rate, one step and several; remembered as in `prediction.py`."""
    rate = ca.Function.deserialize(serialized)
    s, held = ca.SX.sym("s", rate.size1_in(0)), [ca.SX.sym("a", 2), ca.SX.sym("wind", 2), ca.SX.sym("d", 3)]
    after = integrate(lambda x: rate(x, *held), s, period_s, count, euler)
    one_step = ca.Function("monitor", [s, *held], [after], {"cse": True})
    return fastest(one_step), fastest(one_step.fold(steps))


def _append(pairs: Array, newest: tuple[float, float]) -> None:
    """Drop the oldest of the pairs, and add one."""
    pairs[:-2] = pairs[2:]
    pairs[-2:] = newest


class _Window:
    """Squared errors over the last control ticks, summed anew each time: a running sum would drift."""

    def __init__(self, length: int) -> None:
        self._squares: Array = np.zeros((length, 9))  # the newest last
        self._count = 0

    @property
    def full(self) -> bool:
        return self._count == len(self._squares)

    def rms(self, errors: tuple[float, ...]) -> tuple[Triple, Triple, Triple]:
        """Add errors of (u, v, r): one step ahead, and a horizon ahead without and with a push. Root mean squares."""
        squares = self._squares
        self._count = min(self._count + 1, len(squares))
        squares[:-1] = squares[1:]
        squares[-1] = [error * error for error in errors]
        # Row by row, in their order (`ordered.product`).
        totals: list[float] = np.add.reduce(squares[-self._count :], axis=0).tolist()
        a, b, c, d, e, f, g, h, i = (math.sqrt(of_one / self._count) for of_one in totals)
        return (a, b, c), (d, e, f), (g, h, i)
