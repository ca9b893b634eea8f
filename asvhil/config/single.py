"""Bounds of values that came as 32-bit floats, which is how MAVLink has parameters, speeds and distances.

0.8 comes as 0.800000012: by the next double it would be beyond a bound of 0.8 that people read and type.
"""

from __future__ import annotations

import math

import numpy as np


def within(value: float, least: float, most: float) -> bool:
    """Whether a value is within bounds, or on one as it comes on the link; a NaN is not."""
    return min(least, _as_sent(least)) <= value <= max(most, _as_sent(most))


def clipped(value: float, least: float, most: float) -> float:
    """A value that is `within` bounds, without what the link added on them: as people have typed it."""
    return min(max(value, least), most)


def _as_sent(bound: float) -> float:
    """What comes of a bound that is sent."""
    return float(np.float32(bound))


def told(most: float) -> float:
    """A bound in hundredths, never more than it is: what people read as allowed must be."""
    return math.floor(most * 100.0 + 1e-6) / 100.0
