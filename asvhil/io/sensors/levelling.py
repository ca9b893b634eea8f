"""Takes gravity out of a specific force by the roll and pitch that the same sensor tells.

An accelerometer is fixed to the boat and shows 0.17 m/s^2 of gravity per degree of tilt, more than most winds move a
boat by. In level axes, forward and starboard, what it shows is the acceleration alone (Fossen 2011, section 2.2.1:
R_y(pitch) R_x(roll)).
"""

from __future__ import annotations

import math

from asvhil.geo import GRAVITY_MPS2

FRESH_NS = 500_000_000  # an older tilt says nothing: a boat rolls through in a second or two
LEAST_G, MOST_G = 0.5, 1.5  # of a force in which gravity shows: some bridges fill in two axes alone


class Level:
    """The latest tilt of one sensor, and forces in level axes by it."""

    def __init__(self) -> None:
        self._t_ns: int | None = None
        self._roll_rad = self._pitch_rad = 0.0

    def note(self, t_ns: int, roll_rad: float, pitch_rad: float) -> None:
        """Roll, starboard down, and pitch, bow up; not used where they are no numbers."""
        if math.isfinite(roll_rad) and math.isfinite(pitch_rad):
            self._t_ns, self._roll_rad, self._pitch_rad = t_ns, roll_rad, pitch_rad

    def force(self, t_ns: int, x: float, y: float, z: float) -> tuple[float, float]:
        """The specific force (m/s^2) in level axes; as it is in body axes where no tilt, or no gravity, is known."""
        if self._t_ns is None or t_ns - self._t_ns > FRESH_NS:
            return x, y
        if not LEAST_G * GRAVITY_MPS2 < math.sqrt(x * x + y * y + z * z) < MOST_G * GRAVITY_MPS2:
            return x, y
        cos, sin = math.cos(self._roll_rad), math.sin(self._roll_rad)
        below = y * sin + z * cos
        return x * math.cos(self._pitch_rad) + below * math.sin(self._pitch_rad), y * cos - z * sin


def tilted(ax_mps2: float, ay_mps2: float, roll_rad: float, pitch_rad: float) -> tuple[float, float, float]:
    """What an accelerometer with a tilt shows of an acceleration in level axes: the inverse of `Level.force`."""
    cos, sin = math.cos(pitch_rad), math.sin(pitch_rad)
    x, below = ax_mps2 * cos + GRAVITY_MPS2 * sin, ax_mps2 * sin - GRAVITY_MPS2 * cos
    cos, sin = math.cos(roll_rad), math.sin(roll_rad)
    return x, ay_mps2 * cos + below * sin, below * cos - ay_mps2 * sin
