"""Shortest paths of bounded curvature between two poses (Dubins 1957): all six words, in closed form.

A path is three pieces, each an arc to port (L), an arc to starboard (R) or a straight (S). Headings are clockwise from
north, so an arc to starboard has a positive curvature.
"""

from __future__ import annotations

import math

from asvhil.geo import wrap_2pi, wrap_rad
from asvhil.types import record

WORDS = ("LSL", "RSR", "LSR", "RSL", "RLR", "LRL")
SIGN = {"L": -1.0, "S": 0.0, "R": 1.0}
FULL_TURN_RAD = 1e-9  # an arc within this of a full turn is due to rounding, and left out
ROUNDING = 16.0 * math.ulp(1.0)  # of the centre of a circle, relative to the numbers that it is computed from

Pose = tuple[float, float, float]  # n_m, e_m, psi_rad


@record
class Dubins:
    """A path: begin pose (n_m, e_m, psi_rad), word, the radius of its arcs and the length of each piece (m)."""

    begin: Pose
    word: str
    radius_m: float
    pieces_m: tuple[float, float, float]

    @property
    def length_m(self) -> float:
        return math.fsum(self.pieces_m)

    def pose(self, along_m: float) -> Pose:
        """Pose at an arc length (m), held within the path; the heading in [-pi, pi)."""
        n_m, e_m, psi_rad = self.begin
        left_m = max(along_m, 0.0)
        for sign, piece_m in self._pieces():
            travel_m = min(left_m, piece_m)
            n_m, e_m, psi_rad = _advance((n_m, e_m, psi_rad), sign / self.radius_m, travel_m)
            left_m -= travel_m
        return n_m, e_m, wrap_rad(psi_rad)

    def curvature(self, along_m: float) -> float:
        """Signed curvature (1/m, positive to starboard) at an arc length; 0 beyond the end."""
        end_m = 0.0
        for sign, piece_m in self._pieces():
            end_m += piece_m
            if along_m < end_m:
                return sign / self.radius_m
        return 0.0

    def sample(self, from_m: float, step_m: float) -> list[tuple[float, Pose]]:
        """(arc length, pose) from an arc length on every `step_m`, the end always among them."""
        begin_m = min(max(from_m, 0.0), self.length_m)
        count = max(math.ceil((self.length_m - begin_m) / step_m - 1e-9), 0)
        along = [begin_m + i * step_m for i in range(count)] + [self.length_m]
        return [(along_m, self.pose(along_m)) for along_m in along]

    def project(self, n_m: float, e_m: float, low_m: float, high_m: float) -> float:
        """Arc length within [low_m, high_m] of the point of the path nearest to a position."""
        low_m, high_m = max(low_m, 0.0), min(high_m, self.length_m)
        nearest_m, least_m = low_m, math.inf
        begin_m, pose = 0.0, self.begin
        for sign, piece_m in self._pieces():
            from_m, to_m = max(low_m - begin_m, 0.0), min(high_m - begin_m, piece_m)
            if from_m <= to_m:
                foot_m = _foot(pose, sign, self.radius_m, n_m, e_m)
                for along_m in (from_m, min(max(foot_m, from_m), to_m), to_m):
                    at_n_m, at_e_m, _ = _advance(pose, sign / self.radius_m, along_m)
                    distance_m = math.hypot(n_m - at_n_m, e_m - at_e_m)
                    if distance_m < least_m:
                        nearest_m, least_m = begin_m + along_m, distance_m
            begin_m, pose = begin_m + piece_m, _advance(pose, sign / self.radius_m, piece_m)
        return nearest_m

    def _pieces(self) -> list[tuple[float, float]]:
        return [(SIGN[letter], piece_m) for letter, piece_m in zip(self.word, self.pieces_m, strict=True)]


def candidates(begin: Pose, end: Pose, radius_m: float) -> list[Dubins]:
    """Every path of every word that joins two poses; a word without a solution is absent, CCC words may come twice.

    ValueError where the radius is not positive or anything is not finite.
    """
    if not (radius_m > 0.0 and all(map(math.isfinite, (*begin, *end, radius_m)))):
        raise ValueError(f"finite poses and a positive radius are expected, not {begin}, {end}, {radius_m}")
    found = []
    for word in WORDS:
        first, last = SIGN[word[0]], SIGN[word[2]]
        arcs = _csc(begin, end, radius_m, first, last) if word[1] == "S" else _ccc(begin, end, radius_m, first)
        for pieces_m in arcs:
            found.append(Dubins(begin=begin, word=word, radius_m=radius_m, pieces_m=pieces_m))
    return found


def shortest(begin: Pose, end: Pose, radius_m: float) -> Dubins:
    """The shortest of the `candidates`; of equally short ones the first in the order of WORDS."""
    return min(candidates(begin, end, radius_m), key=lambda path: path.length_m)


def _advance(pose: Pose, curvature: float, travel_m: float) -> Pose:
    """The pose after an arc (or a straight where the curvature is 0); the heading is not wrapped."""
    n_m, e_m, psi_rad = pose
    if curvature == 0.0:
        return n_m + travel_m * math.cos(psi_rad), e_m + travel_m * math.sin(psi_rad), psi_rad
    after_rad = psi_rad + curvature * travel_m
    return (
        n_m + (math.sin(after_rad) - math.sin(psi_rad)) / curvature,
        e_m - (math.cos(after_rad) - math.cos(psi_rad)) / curvature,
        after_rad,
    )


def _foot(pose: Pose, sign: float, radius_m: float, n_m: float, e_m: float) -> float:
    """Arc length at which the piece, run on without end, is nearest to a position; on arcs in [0, one turn)."""
    if sign == 0.0:
        return (n_m - pose[0]) * math.cos(pose[2]) + (e_m - pose[1]) * math.sin(pose[2])
    centre_n_m, centre_e_m = _centre(pose, sign, radius_m)
    outward_rad = math.atan2(e_m - centre_e_m, n_m - centre_n_m)
    return radius_m * wrap_2pi(sign * (outward_rad + sign * math.pi / 2.0 - pose[2]))


def _centre(pose: Pose, sign: float, radius_m: float) -> tuple[float, float]:
    """Centre of the circle that a pose runs on to starboard (sign 1) or to port (-1)."""
    return pose[0] - sign * radius_m * math.sin(pose[2]), pose[1] + sign * radius_m * math.cos(pose[2])


def _turn(sign: float, from_rad: float, to_rad: float, slack_rad: float = FULL_TURN_RAD) -> float:
    """Angle in [0, 2 pi) through which one turns from a heading to another, in one direction of rotation.

    A turn within the slack of a full one counts as zero.
    """
    turn_rad = wrap_2pi(sign * (to_rad - from_rad))
    return 0.0 if turn_rad > 2.0 * math.pi - slack_rad else turn_rad


def _centres(begin: Pose, end: Pose, radius_m: float, first: float, last: float) -> tuple[float, float]:
    """Distance and bearing from the centre of the first circle to that of the last."""
    n1_m, e1_m = _centre(begin, first, radius_m)
    n2_m, e2_m = _centre(end, last, radius_m)
    return math.hypot(n2_m - n1_m, e2_m - e1_m), math.atan2(e2_m - e1_m, n2_m - n1_m)


def _csc(begin: Pose, end: Pose, radius_m: float, first: float, last: float) -> list[tuple[float, float, float]]:
    """The tangent of two circles: outer where both turn the same way, else inner, which circles that overlap lack.

    At heading phi a circle of sign s is left at its centre + s R (sin phi, -cos phi), so for centres d apart at bearing
    b the straight of length l asks for d sin(phi - b) = (s1 - s3) R and d cos(phi - b) = l.
    """
    distance_m, bearing_rad = _centres(begin, end, radius_m, first, last)
    if first == last:
        straight_m, heading_rad = distance_m, bearing_rad
        # The bearing between close centres is inaccurate: without slack a straight of 1 nm would begin with a turn.
        size_m = max(abs(begin[0]), abs(begin[1]), abs(end[0]), abs(end[1])) + radius_m
        slack_rad = max(FULL_TURN_RAD, ROUNDING * size_m / max(distance_m, FULL_TURN_RAD * radius_m))
    else:
        square_m2 = _inner_tangent_m2(begin, end, first * radius_m)
        if square_m2 < 0.0:
            return []
        straight_m = math.sqrt(square_m2)
        heading_rad = bearing_rad + math.atan2((first - last) * radius_m, straight_m)
        slack_rad = FULL_TURN_RAD
    one_circle = distance_m < FULL_TURN_RAD * radius_m  # then there is no straight, and any heading is a tangent's
    in_rad = 0.0 if one_circle else _turn(first, begin[2], heading_rad, slack_rad)
    if in_rad == 0.0:
        heading_rad = begin[2]
    out_rad = _turn(last, heading_rad, end[2], slack_rad)
    return [(radius_m * in_rad, straight_m, radius_m * out_rad)]


def _inner_tangent_m2(begin: Pose, end: Pose, first_m: float) -> float:
    """The square of the length of the inner tangent, d^2 - 4 R^2, without the difference of two large numbers.

    `first_m` is the radius with the sign of the first circle. With the step p from begin to end, their directions to
    starboard a and b, and |a + b|^2 = 4 - 4 sin^2(turn / 2): |p|^2 - 2 s R p (a + b) - 4 R^2 sin^2(turn / 2).
    """
    dn_m, de_m = end[0] - begin[0], end[1] - begin[1]
    abeam_m = dn_m * (-math.sin(begin[2]) - math.sin(end[2])) + de_m * (math.cos(begin[2]) + math.cos(end[2]))
    half_m = 2.0 * first_m * math.sin(0.5 * (end[2] - begin[2]))
    return dn_m**2 + de_m**2 - 2.0 * first_m * abeam_m - half_m**2


def _ccc(begin: Pose, end: Pose, radius_m: float, first: float) -> list[tuple[float, float, float]]:
    """A third circle that touches both from outside: one on either side of the line of centres, none beyond 4 R."""
    distance_m, bearing_rad = _centres(begin, end, radius_m, first, first)
    if distance_m > 4.0 * radius_m:
        return []
    found = []
    for side in (1.0, -1.0):
        # Directions from the first and from the last centre to the middle one; the path crosses both at right angles.
        out_rad = bearing_rad + side * math.acos(distance_m / (4.0 * radius_m))
        back_rad = 2.0 * bearing_rad + math.pi - out_rad
        enter_rad = out_rad + first * math.pi / 2.0
        leave_rad = back_rad + first * math.pi / 2.0
        arcs = (
            _turn(first, begin[2], enter_rad),
            _turn(-first, enter_rad, leave_rad),
            _turn(first, leave_rad, end[2]),
        )
        found.append((radius_m * arcs[0], radius_m * arcs[1], radius_m * arcs[2]))
    return found
