"""Takes gravity out of a specific force by the roll and pitch that the same sensor tells.

An accelerometer is fixed to the boat and shows 0.17 m/s^2 of gravity per degree of tilt, more than most winds move a
boat by. In level axes, forward and starboard, what it shows is the acceleration alone (Fossen 2011, section 2.2.1:
R_y(pitch) R_x(roll)).
"""

from __future__ import annotations

import math
from collections.abc import Callable

from asvhil.geo import GRAVITY_MPS2

FRESH_NS = 500_000_000  # an older tilt says nothing of waves: a boat rolls through in a second or two
MEAN_S = 10.0  # time constant of the mean tilt, a list, which lasts


class Level:
    """The latest tilt of one sensor and its mean, and forces in level axes by it.

    `trim_rad`: roll and pitch of the accelerometer's axes over those whose tilt is told.
    """

    def __init__(self, trim_rad: Callable[[], tuple[float, float]] = lambda: (0.0, 0.0)) -> None:
        self._trim_rad = trim_rad
        self._t_ns: int | None = None
        self._tilt_rad = self._mean_rad = (0.0, 0.0)  # roll, pitch

    def note(self, t_ns: int, roll_rad: float, pitch_rad: float) -> None:
        """Roll, starboard down, and pitch, bow up; not used where they are no numbers."""
        trim_rad = self._trim_rad()
        roll_rad, pitch_rad = roll_rad + trim_rad[0], pitch_rad + trim_rad[1]
        if not (math.isfinite(roll_rad) and math.isfinite(pitch_rad)):
            return
        before_ns, self._t_ns = self._t_ns, t_ns
        self._tilt_rad = roll_rad, pitch_rad
        share = 0.0 if before_ns is None else max(t_ns - before_ns, 0) * 1e-9 / MEAN_S
        gain = 1.0 if before_ns is None else share / (1.0 + share)
        roll, pitch = self._mean_rad
        self._mean_rad = roll + gain * (roll_rad - roll), pitch + gain * (pitch_rad - pitch)

    def force(self, t_ns: int, x: float, y: float, z: float) -> tuple[float, float]:
        """The specific force (m/s^2) in level axes: by the tilt of now, else by the mean tilt of before.

        As it is in body axes where no tilt was ever told, or z is 0: some bridges fill in two axes alone.
        """
        if self._t_ns is None or z == 0.0:
            return x, y
        roll_rad, pitch_rad = self._tilt_rad if t_ns - self._t_ns <= FRESH_NS else self._mean_rad
        cos, sin = math.cos(roll_rad), math.sin(roll_rad)
        below = y * sin + z * cos
        return x * math.cos(pitch_rad) + below * math.sin(pitch_rad), y * cos - z * sin


def tilted(ax_mps2: float, ay_mps2: float, roll_rad: float, pitch_rad: float) -> tuple[float, float, float]:
    """What an accelerometer with a tilt shows of an acceleration in level axes: the inverse of `Level.force`."""
    cos, sin = math.cos(pitch_rad), math.sin(pitch_rad)
    x, below = ax_mps2 * cos + GRAVITY_MPS2 * sin, ax_mps2 * sin - GRAVITY_MPS2 * cos
    cos, sin = math.cos(roll_rad), math.sin(roll_rad)
    return x, ay_mps2 * cos + below * sin, below * cos - ay_mps2 * sin
