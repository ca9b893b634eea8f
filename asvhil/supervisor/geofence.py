"""The water where the boat may be: a polygon, which neither a station nor a held boat may lie outside of."""

from __future__ import annotations

import math
from collections.abc import Sequence

from asvhil.geo import LocalFrame
from asvhil.supervisor.reasons import Explanation, Reason, explain

Point = tuple[float, float]


class Geofence:
    """A polygon by its corners (latitude, longitude) in degrees; of no corners, there is no fence."""

    def __init__(self, corners_deg: Sequence[Point]) -> None:
        self._corners_deg = tuple(corners_deg)
        self._frame: LocalFrame | None = None
        self._corners_m: list[Point] = []

    def refusal(self, what: str, at_m: Point, frame: LocalFrame) -> Explanation | None:
        """Why a point (north, east) in m of the local frame is not allowed; None where it is."""
        if not self._corners_deg:
            return None
        if frame is not self._frame:
            self._frame, self._corners_m = frame, [frame.to_ned(*corner) for corner in self._corners_deg]
        if is_inside(self._corners_m, at_m):
            return None
        return explain(Reason.OUTSIDE_FENCE, what=what, metres=distance_to_border(self._corners_m, at_m))


def is_inside(corners: Sequence[Point], at: Point) -> bool:
    """Whether a point lies in a polygon, by the crossings of a ray to the east. A NaN lies nowhere."""
    n, e = at
    if not math.isfinite(n + e):
        return False
    inside = False
    n0, e0 = corners[-1]
    for n1, e1 in corners:
        if (n0 > n) != (n1 > n) and e < e0 + (n - n0) / (n1 - n0) * (e1 - e0):
            inside = not inside
        n0, e0 = n1, e1
    return inside


def distance_to_border(corners: Sequence[Point], at: Point) -> float:
    """Distance from a point to the nearest side of a polygon, in the units of both."""
    n, e = at
    nearest = math.inf
    n0, e0 = corners[-1]
    for n1, e1 in corners:
        side_n, side_e = n1 - n0, e1 - e0
        squared = side_n * side_n + side_e * side_e
        along = ((n - n0) * side_n + (e - e0) * side_e) / squared if squared else 0.0
        along = min(max(along, 0.0), 1.0)
        nearest = min(nearest, math.hypot(n - n0 - along * side_n, e - e0 - along * side_e))
        n0, e0 = n1, e1
    return nearest
