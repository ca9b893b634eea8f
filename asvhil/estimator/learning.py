"""Learning on station: factors of the vessel model's thrusts and responses, by how the held boat answers its motors.

The change of velocity over a window is compared with the integral of the model's acceleration, and what is left over is
regressed on what each factor would have changed: integral regression, since a single tick is too noisy. A Kalman filter
has the factors as random walks, which is to forget, beside a disturbance of its own that takes what lasts: so factors
follow from what changes with the motors alone, and the estimator's disturbance is not taken for a weak one.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

import casadi as ca
import numpy as np

from asvhil.config import LearningConfig
from asvhil.dynamics import ordered
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.buffers import bind, fastest
from asvhil.dynamics.corrected import COUNT, CorrectedModel
from asvhil.dynamics.remembered import by_model
from asvhil.estimator.learned_words import HELD_STD, RAN_OFF
from asvhil.types import Estimate, Learned, Wind

AXES = 3
SIZE = COUNT + AXES  # factors less 1, then the disturbance (north, east, yaw)
WINDOW_S = 1.0
LONGEST_GAP_S = 0.25  # between ticks: the input in between is not known
SETTLE_S = 3.0  # after a doubt
STD = (0.04, 0.04, 0.012)  # of what is left over in a window at least: m/s, m/s, rad/s
NOISE_GAIN = 0.02  # of a window, on how much is left over
# Motors that seem to give more than the model's by this share, on the mean, while a response has been at its bound for
# so long (s), are none: the pose is wrong, as with a compass that is turned. Weak ones may be, as of another boat's.
STRONGER = 0.1
BOUND_S = 2.0
APPLIED_AFTER_S = 15.0  # of learning: what runs off does so before, and has done nothing then
# The model has no current: in one its drag and the disturbance are wrong together, and thrusts and responses trade off
# against each other with small standard deviations. After so long (s) a mean disturbance (m/s^2, time constant) beyond
# this tells of one: it was at most 0.012 with the WAM-V without a current, also with weak motors once these were found,
# and 0.037 in 0.15 m/s.
PUSHED_S, PUSHED_MPS2, PUSH_TIME_S = 60.0, 0.03, 30.0
GATE2 = 12.0  # squared innovation over its variance, beyond which a window is none of the model's


class Learner:
    """`step` once in each tick, after the motors are known; `factors` are those less 1 that the model is to have."""

    def __init__(
        self,
        config: LearningConfig,
        model: CorrectedModel,
        period_s: float,
        lag_s: float,
        correct: Callable[[tuple[float, ...]], None],
    ) -> None:
        """`lag_s`: how late the motors act where the model does not know it. `correct` gets each factor less 1."""
        self._config = config
        self._n_own = model.n_motor - COUNT
        self._x, self._psi, self._a, self._wind = np.zeros(AXES + model.n_motor), np.zeros(1), np.zeros(2), np.zeros(2)
        self._rate, self._slope = np.zeros(AXES), np.zeros(AXES * SIZE)
        self._run = bind(_function(model), [self._x, self._psi, self._a, self._wind], [self._rate, self._slope])
        self._late: deque[tuple[float, float]] = deque(maxlen=round(lag_s / period_s) + 1)
        disturbance_walks = [config.disturbance_walk_mps2] * 2 + [config.disturbance_yaw_walk_radps2]
        self._q = np.array([config.walk] * COUNT + disturbance_walks) ** 2
        self._most = config.prior_std**2
        self._p: Array
        self._m: Array
        self._noise = np.array(STD) ** 2
        self._begin: Estimate | None = None
        self._last: Estimate | None = None
        self._sum_rate, self._sum_slope = np.zeros(AXES), np.zeros(AXES * SIZE)
        self._good_ns = 0  # since when there has been no doubt
        self._learned_s = 0.0
        self._bound_s = 0.0  # for how long a response has been at its bound
        self._forget()
        self._ran_off = False
        self._set_factors = correct
        correct(self.applied)

    def _forget(self) -> None:
        """Begin anew with the factors that the config has."""
        self._p = np.diag([self._most] * COUNT + [0.05**2, 0.05**2, 0.03**2])
        self._m = np.zeros(SIZE)
        self._m[:COUNT] = np.array(self._config.start) - 1.0
        self._learned_s = self._bound_s = 0.0
        self._push_mps2 = [0.0, 0.0]  # mean disturbance, north and east
        self._ran_off = True

    @property
    def applied(self) -> tuple[float, ...]:
        """Each factor less 1 that corrects the model: at first as the config has it."""
        known = self._learned_s >= APPLIED_AFTER_S
        factors = self.factors if known else tuple(factor - 1.0 for factor in self._config.start)
        return factors if self._config.responses else (*factors[:2], *[0.0] * (COUNT - 2))

    @property
    def factors(self) -> tuple[float, ...]:
        """Each factor less 1."""
        return tuple(self._m[:COUNT].tolist())

    def step(
        self, estimate: Estimate | None, model_input: tuple[float, float], wind: Wind | None, doubt: str
    ) -> Learned:
        """What is known now. `model_input` and `wind` are those from now on; `doubt`: why nothing is to be learned.

        Where the responses run off to their bounds, all that was learned is dropped, and nothing more is learned until
        `rest` is called.
        """
        doubt = doubt or (RAN_OFF if self._ran_off else "")
        if estimate is not None:
            self._follow(estimate, model_input, wind, doubt)
        std = tuple(math.sqrt(v) for v in self._p.diagonal()[:COUNT].tolist())
        std = (HELD_STD,) * COUNT if self._is_pushed() else std
        factors = tuple(1.0 + part for part in self.factors)
        return Learned(factors=factors, std=std, learned_s=self._learned_s, frozen=doubt)

    def _is_pushed(self) -> bool:
        """Whether something that the model does not know pushes for long: the factors are then of that as well."""
        return self._learned_s >= PUSHED_S and math.hypot(*self._push_mps2) > PUSHED_MPS2

    def rest(self) -> None:
        """No station is held: what ran off may be tried again in the next hold."""
        self._ran_off = False

    def _follow(self, estimate: Estimate, model_input: tuple[float, float], wind: Wind | None, doubt: str) -> None:
        last = self._last
        gap_s = 0.0 if last is None else (estimate.t_ns - last.t_ns) * 1e-9
        if doubt or last is None or gap_s > LONGEST_GAP_S:
            if doubt:
                self._good_ns = estimate.t_ns
            self._begin = None
        elif self._begin is not None:
            self._run()
            self._sum_rate += gap_s * self._rate
            self._sum_slope += gap_s * self._slope
            span_s = (estimate.t_ns - self._begin.t_ns) * 1e-9
            if span_s >= WINDOW_S - 0.5 * gap_s:
                if self._config.adapt:
                    self._correct(self._begin, estimate, span_s)
                self._begin = None
        if self._begin is None and (estimate.t_ns - self._good_ns) * 1e-9 >= SETTLE_S and not doubt:
            self._begin = estimate
            self._sum_rate[:] = self._sum_slope[:] = 0.0
        self._last = estimate
        self._late.append(model_input)
        self._x[:] = (estimate.u_mps, estimate.v_mps, estimate.r_radps, *estimate.motor[: self._n_own], *self.factors)
        self._psi[0] = estimate.psi_rad
        self._a[:] = self._late[0]
        self._wind[:] = (0.0, 0.0) if wind is None else (wind.vn_mps, wind.ve_mps)

    def _correct(self, begin: Estimate, end: Estimate, span_s: float) -> None:
        """Correct factors and disturbance by a window's changes of velocity, one axis after the other."""
        self._learned_s += span_s
        share = span_s / min(self._learned_s, PUSH_TIME_S)  # a mean at first, then a low-pass
        for axis in (0, 1):
            self._push_mps2[axis] += share * (end.disturbance[axis] - self._push_mps2[axis])
        moved = np.array([end.u_mps - begin.u_mps, end.v_mps - begin.v_mps, end.r_radps - begin.r_radps])
        h = self._sum_slope.reshape(AXES, SIZE, order="F")
        left = moved - self._sum_rate - ordered.product(h[:, COUNT:], self._m[COUNT:])
        if not math.isfinite(ordered.total(left.tolist())) or not np.isfinite(h).all():
            return
        p = self._p + np.diag(self._q * span_s)
        before = self._m.copy()
        m = self._m.copy()
        for i in range(AXES):
            row = h[i]
            ph = ordered.product(p, row)
            s = float(ordered.product(row[None, :], ph)[0]) + float(self._noise[i])
            off = float(left[i]) - float(ordered.product(row[None, :], m - before)[0])
            self._noise[i] += NOISE_GAIN * (min(off * off, GATE2 * s) - self._noise[i])
            self._noise[i] = max(float(self._noise[i]), STD[i] ** 2)
            if off * off > GATE2 * s:
                continue
            gain = ph / s
            m = m + gain * off
            p = p - gain[:, None] * ph[None, :]
        low, high = self._config.least - 1.0, self._config.most - 1.0
        m[:COUNT] = np.minimum(np.maximum(m[:COUNT], low), high)
        # Without excitation the random walk would make them ever less known, and the first noise after it would count.
        shrink = np.sqrt(np.minimum(1.0, self._most / np.maximum(p.diagonal()[:COUNT], 1e-12)))
        scale = np.concatenate([shrink, np.ones(AXES)])
        self._p = p * scale[:, None] * scale[None, :]
        self._m = m
        at_bound = m[0] + m[1] > 2.0 * STRONGER and any(part in (low, high) for part in m[2:COUNT].tolist())
        self._bound_s = self._bound_s + span_s if at_bound else 0.0
        if self._bound_s >= BOUND_S:
            self._forget()
        self._set_factors(self.applied)


@by_model
def _function(model: CorrectedModel) -> ca.Function:
    """(nu, motors and factors, heading, input, wind) -> the model's nu_dot, and its slope by factors and disturbance.

    Remembered by the model, as those of `prediction.py`.
    """
    x, psi = ca.SX.sym("x", AXES + model.n_motor), ca.SX.sym("psi")
    a, wind = ca.SX.sym("a", 2), ca.SX.sym("w", 2)
    c, s = ca.cos(psi), ca.sin(psi)
    body = ca.vertcat(c * wind[0] + s * wind[1], -s * wind[0] + c * wind[1])
    rate = model.derivative(x, a, body)[:AXES]
    turn = ca.vertcat(ca.horzcat(c, s, 0), ca.horzcat(-s, c, 0), ca.horzcat(0, 0, 1))
    slope = ca.densify(ca.horzcat(ca.jacobian(rate, x[AXES + model.n_motor - COUNT :]), turn))
    return fastest(ca.Function("learning", [x, psi, a, wind], [rate, ca.vec(slope)], {"cse": True}))
