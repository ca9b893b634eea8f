"""Monitoring of the vessel model in use: one-step and horizon prediction errors while the boat is controlled."""

from __future__ import annotations

import math
from collections import deque

import casadi as ca
import numpy as np

from asvhil.config import MonitorConfig
from asvhil.dynamics.buffers import bind
from asvhil.dynamics.integrate import advance, substeps
from asvhil.dynamics.ordered import total
from asvhil.dynamics.protocol import Dynamics
from asvhil.types import Estimate, PredictionError, Wind

NU = slice(3, 6)


class ModelMonitor:
    """Rolls the model out in open loop from a past estimate, under the inputs that were sent, to the present one.

    The disturbance estimate is left out, so the errors are those of the model alone. They are root mean squares over a
    sliding window, so that a single bad estimate raises no flag.
    """

    def __init__(self, config: MonitorConfig, model: Dynamics, period_s: float) -> None:
        self._config = config
        size = 6 + model.n_motor
        s, a, wind = ca.SX.sym("s", size), ca.SX.sym("a", 2), ca.SX.sym("wind", 2)
        count = substeps(period_s, model.max_step_s)
        after = advance(model, s, a, wind, ca.SX.zeros(3), period_s, count)
        self._state, self._a, self._w, self._after = np.zeros(size), np.zeros(2), np.zeros(2), np.zeros(size)
        function = ca.Function("monitor", [s, a, wind], [after], {"cse": True})
        self._advance = bind(function, [self._state, self._a, self._w], [self._after])
        self._steps = max(1, round(config.horizon_s / period_s))
        self._max_gap_ns = round(1.5e9 * period_s)
        self._past: deque[tuple[Estimate, tuple[float, float], tuple[float, float]]] = deque(maxlen=self._steps)
        window = max(1, round(config.window_s / period_s))
        self._one_step = _Window(window)
        self._horizon = _Window(window)

    def reset(self) -> None:
        """Forget everything, after a time in which others had the motors: the inputs are not known."""
        self._past.clear()

    def step(self, estimate: Estimate, model_input: tuple[float, float], wind: Wind | None) -> PredictionError | None:
        """Add the state of a control tick and the input from then on: the errors, once the horizon is filled."""
        if self._past and estimate.t_ns - self._past[-1][0].t_ns > self._max_gap_ns:
            self.reset()
        wind_ned = (wind.vn_mps, wind.ve_mps) if wind is not None else (0.0, 0.0)
        past = list(self._past)
        self._past.append((estimate, model_input, wind_ned))
        if len(past) < self._steps:
            return None
        one_step = self._one_step.rms(self._prediction_error(past[-1:], estimate))
        horizon = self._horizon.rms(self._prediction_error(past[-self._steps :], estimate))
        limits = (self._config.max_u_mps, self._config.max_v_mps, self._config.max_r_radps)
        # NaN compares false, so a model that diverges is not ok.
        ok = not self._horizon.full or all(error <= limit for error, limit in zip(horizon, limits, strict=True))
        return PredictionError(one_step=one_step, horizon=horizon, horizon_s=self._config.horizon_s, ok=ok)

    def _prediction_error(
        self, rows: list[tuple[Estimate, tuple[float, float], tuple[float, float]]], now: Estimate
    ) -> tuple[float, float, float]:
        """Predicted less estimated (u, v, r) after rolling the model over rows of (state, input, wind)."""
        start = rows[0][0]
        self._after[:] = (
            start.n_m,
            start.e_m,
            start.psi_rad,
            start.u_mps,
            start.v_mps,
            start.r_radps,
            *start.motor,
        )
        for _, model_input, wind_ned in rows:
            self._state[:] = self._after
            self._a[:] = model_input
            self._w[:] = wind_ned
            self._advance()
        u, v, r = self._after[NU].tolist()
        return u - now.u_mps, v - now.v_mps, r - now.r_radps


class _Window:
    """Squared errors of (u, v, r) over the last control ticks, summed anew each time: a running sum would drift."""

    def __init__(self, length: int) -> None:
        self._length = length
        self._squares: tuple[deque[float], ...] = tuple(deque(maxlen=length) for _ in range(3))

    @property
    def full(self) -> bool:
        return len(self._squares[0]) == self._length

    def rms(self, error: tuple[float, float, float]) -> tuple[float, float, float]:
        """Add an error: the root mean squares."""
        for squares, value in zip(self._squares, error, strict=True):
            squares.append(value * value)
        u, v, r = (math.sqrt(total(squares) / len(squares)) for squares in self._squares)
        return u, v, r
