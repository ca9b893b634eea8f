"""The watch over the distance to the station: carried off, and motors at their limit that do not help."""

from __future__ import annotations

import math
from collections import deque

from asvhil.config import MotionConfig, ProcedureConfig, VesselConfig
from asvhil.geo import ned_to_body
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.supervisor.stations import is_another
from asvhil.types import Estimate, Station

SATURATED = 0.95  # of a motor's full command
SHARE = 0.7  # of the time, at the least, for the motors to be at their limit
LOOK_BACK_NS = 10_000_000_000
BRAKING = 0.5  # of the thrust of both motors astern, of which a boat is taken to stop with
STRONG = 0.7  # of the boat's top speed: a current that leaves the motors little to hold against it with
IN_STRONG = 0.5  # of the distance that is allowed: what such a current takes away does not come back


class DistanceWatch:
    """From the begin of a hold, or a move of its station, on: how near the boat has been, and what the motors did.

    `approach`: the station keeping procedure's settings, None where there is none. `farther_m`: how much farther off
    the boat is now than it has been.
    """

    def __init__(self, config: MotionConfig, vessel: VesselConfig, approach: ProcedureConfig | None = None) -> None:
        self._config, self._approach = config, approach
        mass_kg = vessel.mass_kg + vessel.added_mass_surge_kg
        self._braking_mps2 = BRAKING * 2.0 * abs(vessel.thrust_curve[0][1]) / mass_kg
        self._strong_mps = STRONG * vessel.speed_ahead_mps()
        # Beyond r_d_m the approach starts over: that far off, and on the way round to its path, is where the procedure
        # means the boat to be.
        self._of_procedure_m = 0.0 if approach is None else approach.r_d_m + 2.0 * approach.turn_radius_m
        self._least_m = self._allowed_m = self.farther_m = 0.0
        self._station: Station | None = None
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
    ) -> Explanation | None:
        """Why the boat is to be let go; `command` is what the motors got since the last tick.

        `doubt_m`: by how much the place is in doubt, which counts as distance.
        """
        distance_m = math.hypot(estimate.n_m - station.n_m, estimate.e_m - station.e_m)
        if self._station is None or is_another(station, self._station):
            self._start(distance_m, estimate, current_ned)
        self._station = station
        self._least_m = min(self._least_m, distance_m)
        saturated = max(abs(part) for part in command) >= SATURATED
        self._past.append((t_ns, saturated))
        while t_ns - self._past[0][0] > LOOK_BACK_NS:
            self._past.popleft()
        self.farther_m = distance_m - self._least_m + doubt_m
        is_strong = math.hypot(*current_ned) >= self._strong_mps
        if self.farther_m <= (IN_STRONG if is_strong else 1.0) * self._allowed_m:
            return None
        if distance_m <= self._of_procedure_m and not is_strong and doubt_m == 0.0:
            return None
        share = sum(at_limit for _, at_limit in self._past) / len(self._past)
        reason = Reason.BEYOND_MOTORS if share >= SHARE else Reason.DRIFTED_OFF
        return explain(reason, metres=self.farther_m)

    def _start(self, distance_m: float, estimate: Estimate, current_ned: tuple[float, float]) -> None:
        """How far off the boat may get: by the config, and by the way through the water that it needs to stop."""
        u_c, v_c = ned_to_body(estimate.psi_rad, *current_ned)
        way_mps = math.hypot(estimate.u_mps - u_c, estimate.v_mps - v_c)
        stopping_m = 0.5 * way_mps**2 / self._braking_mps2
        self._least_m = distance_m
        self._allowed_m = max(self._config.farther_m, self._config.farther_share * distance_m, stopping_m)
        if self._approach is not None and distance_m > self._approach.r_s_m:
            # A path that begins with the station astern goes once round, on the far side of it at worst; the boat may
            # be off that path as off its station.
            self._allowed_m += 2.0 * self._approach.turn_radius_m
        self._past.clear()
