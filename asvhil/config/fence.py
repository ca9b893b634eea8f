"""Whether the corners of a geofence enclose water that a boat could lie in."""

from __future__ import annotations

import math
from collections.abc import Sequence

from asvhil.geo import LocalFrame

LEAST_WIDTH_M = 1.0


def check_corners(corners_deg: Sequence[tuple[float, float]]) -> None:
    """ValueError where corners (latitude, longitude) enclose a strip that is too narrow for any boat, or nothing.

    So do those on a line, and those of a figure of eight, whose two halves cancel.
    """
    if len(set(corners_deg)) < 3:
        raise ValueError("a geofence needs 3 corners [latitude, longitude] or more, or none")
    width_m = _width_m(corners_deg)
    if width_m < LEAST_WIDTH_M:
        raise ValueError(
            f"a geofence needs corners that enclose water, in turn around it; these leave a strip of {width_m:.1g} m"
        )


def _width_m(corners_deg: Sequence[tuple[float, float]]) -> float:
    """Area over half the circumference: the width of a long strip, and half that of a square."""
    lat_deg, lon_deg = corners_deg[0]
    frame = LocalFrame(lat_deg=lat_deg, lon_deg=lon_deg)
    corners_m = [frame.to_ned(*corner) for corner in corners_deg]
    sides = list(zip(corners_m, corners_m[1:] + corners_m[:1], strict=True))
    area_m2 = abs(math.fsum(n0 * e1 - n1 * e0 for (n0, e0), (n1, e1) in sides)) / 2.0
    return 2.0 * area_m2 / math.fsum(math.dist(start, end) for start, end in sides)
