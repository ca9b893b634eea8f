"""Peak frequency and size of the waves, from what a boat's motion has beyond that of model and motors.

A bank of resonators (damped complex exponentials, log-spaced frequencies) follows the velocity that is left over in
surge, sway and yaw. The motors cause some of it, since no model is exact: a share of the velocity that they cause at
the same frequency is taken off. They cannot push sideways, so sway tells most.
"""

from __future__ import annotations

import cmath
import functools
import math

import casadi as ca
import numpy as np

from asvhil.dynamics.arrays import Array
from asvhil.dynamics.buffers import bind, fastest

FREQUENCIES_HZ: Array = np.array([0.12 * 10.0 ** (k / 13.0) for k in range(14)])  # slower is station keeping itself
DAMPING = 0.15  # of the resonators: their neighbours are 19 % apart
MEAN_S = 30.0  # time constant of the mean power
MODEL_ERROR = 0.3  # share of what the motors do that may be left over
STAYS = 1.3  # by how much another peak must be higher than the one in use


class WaveSpectrum:
    """`step` with each sample of the velocities that are left over; `peak` (index), `level` and `std` tell the rest.

    `arm_m`: what a yaw rate is worth as a velocity.
    """

    def __init__(self, step_s: float, arm_m: float) -> None:
        count = len(FREQUENCIES_HZ)
        self._before, self._after, self._sample = np.zeros(15 * count), np.zeros(15 * count), np.zeros(6)
        self._run = bind(_function(step_s), [self._before, self._sample], [self._after])
        self._power: Array = self._after[12 * count :].reshape(count, 3)
        self._worth: Array = np.array([1.0, 1.0, arm_m]) ** 2
        self._total: Array = np.zeros(count)
        self.peak = int(np.argmin(np.abs(FREQUENCIES_HZ - 0.3)))

    def step(self, left_over: Array, pushed: Array) -> None:
        """A sample: velocities left over (3; m/s, m/s, rad/s) and accelerations by model and motors (3), body axes."""
        self._sample[:3], self._sample[3:] = left_over, pushed
        self._before[:] = self._after
        self._run()
        total = (np.maximum(self._power, 0.0) * self._worth).sum(axis=1)
        highest = int(total.argmax())
        if total[highest] > STAYS * total[self.peak]:
            self.peak = highest
        self._total = total

    @property
    def level_mps(self) -> float:
        """Root mean square velocity at the peak, all three axes together."""
        return math.sqrt(float(self._total[self.peak]))

    @property
    def std(self) -> tuple[float, float]:
        """Standard deviations at the peak: of the velocity along one axis (m/s), and of the yaw rate (rad/s)."""
        surge, sway, yaw = np.maximum(self._power[self.peak], 0.0).tolist()
        return math.sqrt(0.5 * (surge + sway)), math.sqrt(yaw)


@functools.lru_cache(maxsize=8)
def _function(step_s: float) -> ca.Function:
    """(state, sample) -> state: real and imaginary parts of the resonators (6 each), and the mean power (3).

    By real and imaginary parts, so that one order of operations is that of every machine.
    """
    omega = math.tau * FREQUENCIES_HZ
    count, forget = len(omega), step_s / MEAN_S
    state, sample = ca.SX.sym("s", 15 * count), ca.SX.sym("u", 6)
    x, y = ca.reshape(state[: 6 * count], 6, count), ca.reshape(state[6 * count : 12 * count], 6, count)
    mean = ca.reshape(state[12 * count :], 3, count)
    columns = []
    for k, each in enumerate(omega.tolist()):
        pole = cmath.exp((1j - DAMPING) * each * step_s)
        a, b, unit = pole.real, pole.imag, 1.0 - abs(pole)
        re, im = a * x[:, k] - b * y[:, k] + unit * sample, a * y[:, k] + b * x[:, k]
        power = 2.0 * (re * re + im * im)
        slowness = MODEL_ERROR / each
        excess = power[:3] - slowness * slowness * power[3:]
        columns.append((re, im, mean[:, k] + forget * (excess - mean[:, k])))
    after = ca.vertcat(*(column for part in zip(*columns, strict=True) for column in part))
    return fastest(ca.Function("wave_spectrum", [state, sample], [after], {"cse": True}))
