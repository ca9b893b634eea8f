"""The watch over the distance to the station: carried off, and motors at their limit that do not help."""

from __future__ import annotations

import math
from collections import deque

from asvhil.config import MotionConfig, ProcedureConfig, VesselConfig
from asvhil.geo import ned_to_body
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.supervisor.stations import has_leapt
from asvhil.types import Estimate, Station

SATURATED = 0.95  # of a motor's full command
SHARE = 0.7  # of the time, at the least, for the motors to be at their limit
LOOK_BACK_NS = 10_000_000_000
BRAKING = 0.5  # of the thrust of both motors astern, of which a boat is taken to stop with
STRONG = 0.7  # of the boat's top speed: a current that leaves the motors little to hold against it with
IN_STRONG = 0.5  # of the distance that is allowed: what such a current takes away does not come back
# No move of a station takes anything back of how far the boat has been carried: set-points that jitter, or a station
# that is stepped on, would else have it carried off without end. One that is put elsewhere by more gives room to turn.
ELSEWHERE_M = 3.0
# Time constant with which is forgotten what a boat was carried beyond the distance there is, as where its station was
# put to where it had got: one that keeps that station is well.
FORGET_S = 60.0

Place = tuple[float, float]  # north, east (m)


class DistanceWatch:
    """From the begin of a hold on: how near the boat has been to its station, and what the motors did.

    The heading of a station does not matter: one that the boat lies at as it happens to turns with a boat in trouble.
    `approach`: the station keeping procedure's settings, None where there is none. `farther_m`: how much farther off
    the boat is now than it has been; where the station was moved meanwhile, by the boat's own motion alone.
    """

    def __init__(self, config: MotionConfig, vessel: VesselConfig, approach: ProcedureConfig | None = None) -> None:
        self._config, self._approach = config, approach
        mass_kg = vessel.mass_kg + vessel.added_mass_surge_kg
        self._braking_mps2 = BRAKING * 2.0 * abs(vessel.thrust_curve[0][1]) / mass_kg
        self._strong_mps = STRONG * vessel.speed_ahead_mps()
        # Beyond r_d_m the approach starts over: that far off, and on the way round to its path, is where the procedure
        # means the boat to be.
        self._of_procedure_m = 0.0 if approach is None else approach.r_d_m + 2.0 * approach.turn_radius_m
        self._least_m = 0.0  # how near it has been; below 0 by what it was carried beyond its distance now
        self._allowed_m = self.farther_m = 0.0
        self._nearest: Place = (0.0, 0.0)  # where the boat was when it was not carried
        self._t_ns = 0
        self._station: Station | None = None
        self._point: Station = Station(n_m=0.0, e_m=0.0, psi_rad=0.0)
        self._begun: Place = (0.0, 0.0)  # where the point was when this began; goes along on a course
        self._boat: Place = (0.0, 0.0)
        self._past: deque[tuple[int, bool]] = deque()  # (time, whether a motor was at its limit)

    def begin(self) -> None:
        """Forget all: a hold begins."""
        self._station = None
        self.farther_m = 0.0

    def step(
        self,
        t_ns: int,
        estimate: Estimate,
        station: Station,
        command: tuple[float, float],
        current_ned: tuple[float, float] = (0.0, 0.0),
        doubt_m: float = 0.0,
        point: Station | None = None,
    ) -> Explanation | None:
        """Why the boat is to be let go; `command` is what the motors got since the last tick.

        `doubt_m`: by how much the place is in doubt, which counts as distance. `point`: the station of the point of the
        boat that is kept there, by which it is told whether somebody has moved it; None where that is the origin.
        """
        boat = estimate.n_m, estimate.e_m
        distance_m = _distance_m(boat, station)
        point = station if point is None else point
        if self._station is None:
            self._begun, self._least_m = (point.n_m, point.e_m), distance_m
            self._nearest = boat
            self._past.clear()
            self._allowed_m = 0.0
            self._allow(distance_m, estimate, current_ned, doubt_m)
        else:
            if has_leapt(station, self._station):
                apart_m = _distance_m(self._boat, station) - _distance_m(self._boat, self._station)
                self._least_m += apart_m
            if self._least_m < 0.0:
                self._least_m = self._beyond_m(t_ns, boat, distance_m)
            if self._is_elsewhere(point):
                self._begun = (point.n_m, point.e_m)
                self._allow(distance_m, estimate, current_ned, doubt_m)
            elif not has_leapt(point, self._point):
                n_m, e_m = self._begun
                self._begun = (n_m + point.n_m - self._point.n_m, e_m + point.e_m - self._point.e_m)
        self._station, self._point, self._boat, self._t_ns = station, point, boat, t_ns
        if distance_m <= self._least_m:
            self._least_m, self._nearest = distance_m, boat
        saturated = max(abs(command[0]), abs(command[1])) >= SATURATED
        self._past.append((t_ns, saturated))
        while t_ns - self._past[0][0] > LOOK_BACK_NS:
            self._past.popleft()
        self.farther_m = distance_m - self._least_m + doubt_m
        is_strong = self._is_strong(current_ned)
        if self.farther_m <= (IN_STRONG if is_strong else 1.0) * self._allowed_m:
            return None
        if distance_m - min(0.0, self._least_m) <= self._of_procedure_m and not is_strong and doubt_m == 0.0:
            return None
        share = sum(at_limit for _, at_limit in self._past) / len(self._past)
        reason = Reason.BEYOND_MOTORS if share >= SHARE else Reason.DRIFTED_OFF
        return explain(reason, metres=self.farther_m)

    def _is_elsewhere(self, point: Station) -> bool:
        """Whether the station was put so far away since room was given last, all at once or bit by bit."""
        off_m = math.hypot(point.n_m - self._begun[0], point.e_m - self._begun[1])
        return has_leapt(point, self._point) and off_m > ELSEWHERE_M

    def _beyond_m(self, t_ns: int, boat: Place, distance_m: float) -> float:
        """What the boat was carried beyond its distance now, below 0: less than a moment ago, and no more than it has
        moved. Waves, counted toward and away from set-points that jitter, would else add up.
        """
        kept_m = self._least_m * math.exp((self._t_ns - t_ns) * 1e-9 / FORGET_S)
        moved_m = math.hypot(boat[0] - self._nearest[0], boat[1] - self._nearest[1])
        return min(0.0, max(kept_m, distance_m - moved_m))

    def _is_strong(self, current_ned: tuple[float, float]) -> bool:
        return math.hypot(*current_ned) >= self._strong_mps

    def _allow(self, distance_m: float, estimate: Estimate, current_ned: tuple[float, float], doubt_m: float) -> None:
        """How far off the boat may get: by the config, and by the way through the water that it needs to stop.

        A boat that has been carried when its station is put elsewhere gets room to turn beyond that, but no more than
        a boat at rest would: one that never gets nearer is let go all the same. Nor does it lose room by the move that
        a hold which began far off has given: at the least it may go on as a boat at rest may, up to what it had.
        """
        u_c, v_c = ned_to_body(estimate.psi_rad, *current_ned)
        way_mps = math.hypot(estimate.u_mps - u_c, estimate.v_mps - v_c)
        stopping_m = 0.5 * way_mps**2 / self._braking_mps2
        asked_m = min(self._least_m, distance_m)
        share = IN_STRONG if self._is_strong(current_ned) else 1.0  # of the room, that will count
        room_m, before_m = self._config.farther_m, self._allowed_m
        carried_m = min((distance_m - asked_m) / share, room_m)
        self._allowed_m = max(room_m, self._config.farther_share * asked_m, stopping_m) + carried_m
        if self._approach is not None and distance_m > self._approach.r_s_m:
            # A path that begins with the station astern goes once round, on the far side of it at worst; the boat may
            # be off that path as off its station.
            self._allowed_m += 2.0 * self._approach.turn_radius_m
        self._allowed_m = max(self._allowed_m, min(before_m, room_m + (distance_m - asked_m + doubt_m) / share))


def _distance_m(boat: Place, station: Station) -> float:
    return math.hypot(boat[0] - station.n_m, boat[1] - station.e_m)
