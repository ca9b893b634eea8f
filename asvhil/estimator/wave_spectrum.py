"""Peak frequency and size of the waves, from what a boat's motion has beyond that of model and motors.

A bank of resonators (damped complex exponentials, log-spaced frequencies) follows the velocity that is left over in
surge, sway and yaw. The motors cause some of it, since no model is exact: a share of the velocity that they cause at
the same frequency is taken off. They cannot push sideways, so sway tells most.
"""

from __future__ import annotations

import cmath
import math

import numpy as np

from asvhil.dynamics.arrays import Array

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
        omega = math.tau * FREQUENCIES_HZ
        poles = [cmath.exp((1j - DAMPING) * each * step_s) for each in omega.tolist()]
        self._pole = np.array([[pole.real] for pole in poles]), np.array([[pole.imag] for pole in poles])
        self._unit = np.array([[1.0 - abs(pole)] for pole in poles])
        self._slowness = MODEL_ERROR / omega[:, None]
        self._forget = step_s / MEAN_S
        self._arm = np.array([1.0, 1.0, arm_m])
        self._z: tuple[Array, Array] = np.zeros((len(omega), 6)), np.zeros((len(omega), 6))
        self._power: Array = np.zeros((len(omega), 3))
        self._total: Array = np.zeros(len(omega))
        self.peak = int(np.argmin(np.abs(FREQUENCIES_HZ - 0.3)))

    def step(self, left_over: Array, pushed: Array) -> None:
        """A sample: velocities left over (3; m/s, m/s, rad/s) and accelerations by model and motors (3), body axes."""
        # By real and imaginary parts: NumPy fuses the operations of a complex product on some processors.
        (a, b), (x, y) = self._pole, self._z
        x, y = a * x - b * y + self._unit * np.concatenate([left_over, pushed]), a * y + b * x
        self._z = x, y
        power = 2.0 * (x * x + y * y)  # of a sine: its mean square
        excess = power[:, :3] - self._slowness**2 * power[:, 3:]
        self._power += self._forget * (excess - self._power)
        total = (np.maximum(self._power, 0.0) * self._arm**2).sum(axis=1)
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
