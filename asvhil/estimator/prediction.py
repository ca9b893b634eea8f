"""Process model and expected specific force, as CasADi functions on plain buffers.

Velocity is predicted from the model's acceleration f and the measured one z together. With model error and
accelerometer noise white, of spectral densities q_m and q_a, the best of both is f + k (z - f), k = q_m / (q_m + q_a):
the accelerometer's residual e = z - f is correlated with the process noise, and is fed back with the gain k (Simon,
Optimal State Estimation, 2006, section 7.1). Between samples e is held, so that a change of thrust acts at once.
"""

from __future__ import annotations

import functools
from typing import Any

import casadi as ca
import numpy as np

from asvhil.dynamics.arrays import Array
from asvhil.dynamics.buffers import bind, fastest
from asvhil.dynamics.integrate import motion_derivative
from asvhil.dynamics.ordered import symmetric
from asvhil.dynamics.protocol import Dynamics
from asvhil.dynamics.remembered import by_model
from asvhil.estimator.covariance import Correction, compared
from asvhil.estimator.states import A_X, A_Y, B_E, B_N, D_N, D_R, MOVING, SIZE, R, U, V

MAX_STEP_S = 0.1
REMEMBERED = 8  # sets of functions


class MotionModel:
    """Three functions, each with its buffers: fill those of the arguments, call it, and read the others.

    `predict` is one midpoint step: `x_after`, `motor_after` and `p_after` (SIZE, SIZE). `compare_specific_force` is
    the comparison of a reading of the inertial sensor, `force` (2, m/s^2), with what is expected of it,
    `expected_force`; it fills `correction`. `evaluate_acceleration` is (u, v, r) dot by the model and the disturbance:
    `acceleration`. Arguments are `x` (SIZE), `motor`, `p` (SIZE, SIZE), `input` (2), `wind` (2, NED) and `arm` (2, m,
    body axes: where the inertial sensor is), and of a step also `residual` (2, m/s^2).

    `noise_rate`: variance per second of each state. `most`: see `Correction`.
    """

    def __init__(self, model: Dynamics, bias_time_s: float, noise_rate: Array, most: Array) -> None:
        size = SIZE + model.n_motor
        state, after = np.zeros(size), np.zeros(size)
        self.x, self.motor, self.x_after, self.motor_after = state[:SIZE], state[SIZE:], after[:SIZE], after[SIZE:]
        self.input, self.wind, self.arm, self.residual = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
        self._gain, self._dt, self._follows_bias = np.zeros(1), np.zeros(1), np.zeros(1)
        self.p_flat, p_after = np.zeros(SIZE * SIZE), np.zeros(SIZE * SIZE)
        self.p: Array = self.p_flat.reshape(SIZE, SIZE)
        self.p_after: Array = p_after.reshape(SIZE, SIZE)
        self.force, self.expected_force = np.zeros(2), np.zeros(2)
        self.correction = Correction(2, self.x, self.p_flat, most)

        step, force, accelerate = _functions(_serialized_rate(model, bias_time_s))
        arrays = [state, self.input, self.wind, self.arm]
        of_step = [self.residual, self._gain, self._dt, self.p_flat, noise_rate, self._follows_bias]
        self._step = bind(step, [*arrays, *of_step], [after, p_after])
        self.compare_specific_force = self.correction.compares(force, [*arrays, self.force], self.expected_force)
        self.acceleration = np.zeros(3)
        self.evaluate_acceleration = bind(accelerate, arrays[:3], [self.acceleration])

    def predict(self, dt_s: float, gain: float, *, follows_bias: bool) -> None:
        """The state and the covariance after a step of dt_s, with the residual fed back by the gain.

        `follows_bias`: whether the receiver's slow error walks.
        """
        self._dt[0] = dt_s
        self._gain[0] = gain
        self._follows_bias[0] = follows_bias
        self._step()


@by_model
def _serialized_rate(model: Dynamics, bias_time_s: float) -> str:
    """A model's rate (x, a, wind) -> x_dot, remembered by the model: it is the same object for each run of a boat."""
    x, a, wind = ca.SX.sym("x", SIZE + model.n_motor), ca.SX.sym("a", 2), ca.SX.sym("w", 2)
    rate = ca.Function("rate", [x, a, wind], [_model_rate(model, bias_time_s, x, a, wind)])
    serialized: str = rate.serialize()
    return serialized


@functools.lru_cache(maxsize=REMEMBERED)
def _functions(serialized: str) -> tuple[ca.Function, ca.Function, ca.Function]:
    """The step, the specific force and the acceleration by a model's rate (x, a, wind) -> x_dot.

    Remembered by the rate, since backseats of one model are built again and again: in a replay, in each run of a study.
    """
    rate_of = ca.Function.deserialize(serialized)
    size = rate_of.size1_in(0)
    s, a, wind, arm, e = (ca.SX.sym(name, n) for name, n in (("s", size), ("a", 2), ("w", 2), ("l", 2), ("e", 2)))
    gain, dt = ca.SX.sym("k"), ca.SX.sym("dt")

    def rate_of_model(x: Any) -> Any:
        return rate_of(x, a, wind)

    def specific_force(x: Any) -> Any:
        return _specific_force(rate_of_model(x), x, arm)

    def rate(x: Any) -> Any:
        """The derivative with the residual held."""
        free = rate_of_model(x)
        return ca.vertcat(free[:U], free[U : V + 1] + gain * e, free[R:])

    middle = s + 0.5 * dt * rate(s)
    after = s + dt * rate(middle)
    # In the covariance z is given, not e, so the part of the model that the accelerometer replaces has no effect.
    z = specific_force(middle) + e
    x, z_given = ca.SX.sym("x", size), ca.SX.sym("z", 2)
    free = rate_of_model(x)
    fused = free[U : V + 1] + gain * (z_given - _specific_force(free, x, arm))
    slope = ca.jacobian(ca.vertcat(free[:U], fused, free[R:SIZE]), x[:SIZE])
    a_middle = ca.substitute(slope, ca.vertcat(x, z_given), ca.vertcat(middle, z))
    jacobian = ca.SX.eye(SIZE) + dt * a_middle
    p, noise_rate, follows_bias = ca.SX.sym("p", SIZE, SIZE), ca.SX.sym("q", SIZE), ca.SX.sym("f")
    walks = ca.vertcat(noise_rate[:B_N], follows_bias * noise_rate[B_N : B_E + 1], noise_rate[B_E + 1 :])
    added = walks * dt
    added[U : V + 1] -= gain * noise_rate[U] * dt
    covariance = symmetric(jacobian @ symmetric(p) @ jacobian.T + ca.diag(added))
    arguments = [s, a, wind, arm, e, gain, dt, p, noise_rate, follows_bias]
    step = ca.Function("ekf_step", arguments, [after, covariance], {"cse": True})

    reading, variances, expected = ca.SX.sym("y", 2), ca.SX.sym("r", 2), specific_force(s)
    slope = ca.jacobian(expected, s[:SIZE])
    results = compared(reading - expected, expected, slope, p, variances)
    force = ca.Function("ekf_specific_force", [s, a, wind, arm, reading, p, variances], results, {"cse": True})
    accelerate = ca.Function("ekf_acceleration", [s, a, wind], [rate_of_model(s)[U : R + 1]], {"cse": True})
    return fastest(step), fastest(force), accelerate


def _model_rate(model: Dynamics, bias_time_s: float, s: Any, a: Any, wind: Any) -> Any:
    """s_dot by model and disturbance alone. The receiver's slow error decays; the motor states come last."""
    moving = ca.vertcat(s[:MOVING], s[SIZE:])
    rate = motion_derivative(model, moving, a, wind, s[D_N : D_R + 1])
    decay = -s[B_N : B_E + 1] / bias_time_s
    still = ca.SX.zeros(B_N - MOVING), ca.SX.zeros(SIZE - B_E - 1)
    return ca.vertcat(rate[:MOVING], still[0], decay, still[1], rate[MOVING:])


def _specific_force(rate: Any, s: Any, arm: Any) -> Any:
    """Reading of the inertial sensor along body x and y, with its bias: nu_dot + S(r) nu, transferred to its place.

    Fossen (2011), eq. 2.7 differentiated, on the plane; level, so gravity has no part in it.
    """
    r, r_dot = s[R], rate[R]
    return ca.vertcat(
        rate[U] - r * s[V] - r_dot * arm[1] - r**2 * arm[0] + s[A_X],
        rate[V] + r * s[U] + r_dot * arm[0] - r**2 * arm[1] + s[A_Y],
    )
