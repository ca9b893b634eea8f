"""The watch over a boat that turns round and round on its station: no weather does that to one whose motors answer."""

from __future__ import annotations

import math

from asvhil.geo import wrap_rad
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.types import Estimate, Station

FAST_RADPS = 0.25  # slower turns are a gust's, a policy's or those of a way round
ROUND_RAD = 5.0 * math.pi  # two turns and a half: a boat that comes from behind its station may take one
FORGET_S = 60.0  # time constant: a boat that lies as it likes in a swell may turn as far in many minutes
PAUSE_S = 4.0  # without a fast turn, after which it has stopped


class TurningWatch:
    """How far a held boat has turned one way beside its station's heading, fast: motors that are stuck or reversed.

    Where it stays near the station meanwhile, the distance does not tell; and a motor that is stuck need not look like
    one that is reversed or dead.
    """

    def __init__(self) -> None:
        self._before: tuple[int, float, float] | None = None  # (time, headings of boat and station) of the last tick
        self._fast_ns = 0
        self._turned_rad = 0.0  # this way since it began, clockwise positive

    def begin(self) -> None:
        """Forget all: a hold begins, or the boat's heading is not known."""
        self._before = None
        self._turned_rad = 0.0

    def step(self, t_ns: int, estimate: Estimate, station: Station, *, follows: bool = False) -> Explanation | None:
        """Why the boat is to be let go, in each tick of a hold with a valid estimate.

        `follows`: a policy turns the station's heading, after the weather or the boat itself, so it excuses no turn.
        """
        before, self._before = self._before, (t_ns, estimate.psi_rad, station.psi_rad)
        if before is None or t_ns <= before[0]:
            self._fast_ns = t_ns
            return None
        turn_rad, dt_s = wrap_rad(estimate.psi_rad - before[1]), (t_ns - before[0]) * 1e-9
        if abs(turn_rad) >= FAST_RADPS * dt_s:
            self._fast_ns = t_ns
        elif (t_ns - self._fast_ns) * 1e-9 > PAUSE_S:
            self._turned_rad = 0.0
            return None
        # With what goes back: an estimate whose gyro is rejected jumps by a little at each reading of the compass.
        turn_rad -= 0.0 if follows else wrap_rad(station.psi_rad - before[2])
        self._turned_rad += turn_rad - self._turned_rad * min(dt_s / FORGET_S, 1.0)
        if abs(self._turned_rad) < ROUND_RAD:
            return None
        return explain(Reason.TURNS_ROUND, turns=abs(self._turned_rad) / (2.0 * math.pi))
