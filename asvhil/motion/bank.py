"""A bank of Kalman filters, one for each hypothesis of how the boat answers its commands, evaluated together.

Each has the state (v_n, v_e, r, d_n, d_e, d_r, g, c_n, c_e): velocity over ground in NED, yaw rate, the acceleration
that nothing explains (wind, a wrong hull), the gain of the thrust, and the current. It predicts with the rigid body of
the config, the thrust that its hypothesis makes of the commands, and the heading that it makes of the compass's. The
likelihood of what is then measured tells the hypotheses apart (multiple-model estimation: Bar-Shalom, Li and
Kirubarajan 2001, ch. 11.6).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import casadi as ca
import numpy as np

from asvhil.config import VesselConfig
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.buffers import bind, fastest
from asvhil.motion.filter import CE, CN, CONDITIONS, READINGS, SIZE, VE, VN, BankNoise, G, R, correction, prediction
from asvhil.motion.hypotheses import Hypothesis

TRANSIT_S = 0.2


class Bank:
    """`predict`, then `correct` with what was measured: the logarithms of its likelihoods, one for each hypothesis.

    Both are CasADi functions of one hypothesis, mapped over all of them: a fifth of the time of NumPy's small arrays.
    """

    def __init__(self, hypotheses: Sequence[Hypothesis], vessel: VesselConfig, noise: BankNoise) -> None:
        self._commands, self._thrusts_n = np.array(vessel.thrust_curve).T
        self._lag_s = vessel.motor_lag_s
        self._noise = noise
        count = len(hypotheses)
        # Each motor's row in the thrusts of (port, starboard, port reversed, starboard reversed).
        share = np.array([h.share for h in hypotheses])
        self._row = np.array([h.source for h in hypotheses]) + 2 * (share < 0.0)
        self._share = np.abs(share)
        self._steady: tuple[tuple[float, float], Array] | None = None  # the last command, and its thrusts
        self.thrust_n: Array = np.zeros((count, 2))
        self._transit_n = 0.0  # how far the thrusts have been from what is commanded
        self.x: Array = np.zeros((count, SIZE))
        self.p: Array = np.zeros((count, SIZE, SIZE))
        self._log, self._nis = np.zeros(count), np.zeros(count)
        self._after_x, self._after_p = np.zeros_like(self.x), np.zeros_like(self.p)
        self._conditions, self._readings = np.zeros(CONDITIONS), np.zeros(READINGS)
        off_rad, load = (np.array([getattr(h, name) for h in hypotheses]) for name in ("off_rad", "load"))
        state, after = [self.x.ravel(), self.p.ravel()], [self._after_x.ravel(), self._after_p.ravel()]
        predict, correct = _for_all(vessel, noise, count)
        self._predict = bind(
            predict,
            [*state, self.thrust_n.ravel(), off_rad, load, self._conditions],
            after,
        )
        self._correct = bind(
            correct,
            [*state, self._readings],
            [*after, self._log, self._nis],
        )
        self.reset((0.0, 0.0), 0.0)

    def reset(self, velocity_ned: tuple[float, float], yaw_rate: float) -> None:
        """Start all of them at a velocity and a yaw rate, with nothing known of disturbance and gain.

        What moves may have way on, or be carried: half of the velocity is taken for a current, give or take half.
        """
        vn, ve = velocity_ned
        self.x[:] = 0.0
        self.x[:, VN], self.x[:, VE], self.x[:, R], self.x[:, G] = vn, ve, yaw_rate, 1.0
        self.x[:, CN], self.x[:, CE] = 0.5 * vn, 0.5 * ve
        self.p[:] = np.diag(self._prior())
        self.p[:, CN : CE + 1, CN : CE + 1] += 0.25 * np.outer(velocity_ned, velocity_ned)
        self.thrust_n[:] = 0.0
        self._transit_n = 0.0

    @property
    def current_ned(self) -> tuple[float, float]:
        """The current (m/s) by the first hypothesis."""
        return float(self.x[0, CN]), float(self.x[0, CE])

    @property
    def current_std_mps(self) -> float:
        """Its standard deviation, that of north or east, whichever is more."""
        return math.sqrt(max(float(self.p[0, CN, CN]), float(self.p[0, CE, CE])))

    def restart(self, which: Array, like: int) -> None:
        """Start some of them again, as if their fault began now: with the motion and disturbance of another one."""
        self.x[which] = self.x[like]
        self.p[which] = self.p[like]
        self.x[which, G] = 1.0
        self.p[which, G, :] = self.p[which, :, G] = 0.0
        self.p[which, G, G] = self._noise.gain_std**2

    def demand_n(self, command: tuple[float, float]) -> Array:
        """Steady thrusts (N) of the motors (H, 2) for commands in [-1, 1]."""
        port, starboard = command
        each_n = np.interp((port, starboard, -port, -starboard), self._commands, self._thrusts_n)
        steady_n: Array = self._share * each_n[self._row]
        return steady_n

    def lag(self, command: tuple[float, float], dt_s: float) -> None:
        """Move the thrusts toward those of a command that is held for a time."""
        if self._steady is None or self._steady[0] != command:
            self._steady = command, self.demand_n(command)
        transit_n = self._steady[1] - self.thrust_n
        port_n, starboard_n = transit_n[0].tolist()
        transit_n *= -math.expm1(-dt_s / self._lag_s)
        self.thrust_n += transit_n
        self._transit_n += dt_s / (dt_s + TRANSIT_S) * (abs(port_n) + abs(starboard_n) - self._transit_n)

    def predict(self, dt_s: float, heading_rad: float, wind_ned: tuple[float, float] | None) -> None:
        """One step with the present thrusts and the compass's heading."""
        port_n, starboard_n = self.thrust_n[0].tolist()
        wind = (0.0, 0.0, 0.0) if wind_ned is None else (1.0, *wind_ned)
        self._conditions[:] = (dt_s, heading_rad, *wind, abs(port_n) + abs(starboard_n))
        self._predict()
        self.x[:], self.p[:] = self._after_x, self._after_p

    def correct(self, velocity_ned: tuple[float, float] | None, yaw_rate: float | None) -> tuple[Array, Array]:
        """(logarithm of the likelihood, squared innovations over their variances) of each hypothesis."""
        velocity = (0.0, 0.0, 0.0) if velocity_ned is None else (1.0, *velocity_ned)
        rate = (0.0, 0.0) if yaw_rate is None else (1.0, yaw_rate)
        self._readings[:] = (*velocity, *rate, self._transit_n)
        self._correct()
        self.x[:], self.p[:] = self._after_x, self._after_p
        return self._log.copy(), self._nis.copy()

    def _prior(self) -> list[float]:
        noise = self._noise
        return [
            *(0.2**2, 0.2**2, 0.1**2),
            *(noise.disturbance_mps2**2,) * 2,
            noise.disturbance_yaw_radps2**2,
            noise.gain_std**2,
            *(noise.current_mps**2,) * 2,
        ]


@functools.lru_cache(maxsize=4)
def _for_all(vessel: VesselConfig, noise: BankNoise, count: int) -> tuple[ca.Function, ca.Function]:
    """`prediction` and `correction` of so many hypotheses, which share the conditions and the readings."""
    predict = prediction(vessel, noise).map("predict", "serial", count, [5], [])
    correct = correction(vessel, noise).map("correct", "serial", count, [2], [])
    return fastest(predict), fastest(correct)
