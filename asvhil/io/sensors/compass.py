"""The deviation of a compass: a function of the true heading with coefficients A to E (rad).

It adds A + B sin psi + C cos psi + D sin 2 psi + E cos 2 psi to the heading that is read.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

MOST_STEPS = 10  # of Newton's method: 7 do for the steepest deviation that the config takes
CLOSE_RAD = 1e-12


def deviation_row(psi_rad: float) -> tuple[float, float, float, float, float]:
    """What each coefficient is multiplied with: 1, sin, cos, sin 2, cos 2 of the heading."""
    c, s = math.cos(psi_rad), math.sin(psi_rad)
    return 1.0, s, c, 2.0 * s * c, c * c - s * s


def true_heading(reading_rad: float, deviation_rad: Sequence[float]) -> float:
    """The heading psi for which psi + deviation(psi) is the reading; not wrapped."""
    a, b, c, d, e = deviation_rad
    psi_rad = reading_rad - a
    for _ in range(MOST_STEPS):
        _, s1, c1, s2, c2 = deviation_row(psi_rad)
        miss = psi_rad + a + b * s1 + c * c1 + d * s2 + e * c2 - reading_rad
        if abs(miss) < CLOSE_RAD:
            break
        psi_rad -= miss / (1.0 + b * c1 - c * s1 + 2.0 * (d * c2 - e * s2))
    return psi_rad
