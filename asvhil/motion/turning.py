"""The watch over a boat that turns round and round on its station: no weather does that to one whose motors answer."""

from __future__ import annotations

import math

from asvhil.geo import wrap_rad
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.types import Estimate, Station

FAST_RADPS = 0.25  # slower turns are a gust's, a policy's or those of a way round
ROUND_RAD = 5.0 * math.pi  # two turns and a half: a boat that comes from behind its station may take one
PAUSE_S = 4.0  # without a fast turn that way, after which it has stopped


class TurningWatch:
    """How far a held boat has turned one way beside its station's heading, fast: motors that are stuck or reversed.

    Where it stays near the station meanwhile, the distance does not tell; and a motor that is stuck need not look like
    one that is reversed or dead.
    """

    def __init__(self) -> None:
        self._apart_rad: float | None = None  # of the boat's heading from the station's; None: no tick before this one
        self._t_ns = self._fast_ns = 0
        self._turned_rad = 0.0  # this way since it began, clockwise positive

    def begin(self) -> None:
        """Forget all: a hold begins, or the boat's heading is not known."""
        self._apart_rad = None
        self._turned_rad = 0.0

    def step(self, t_ns: int, estimate: Estimate, station: Station) -> Explanation | None:
        """Why the boat is to be let go, in each tick of a hold with a valid estimate."""
        apart_rad = wrap_rad(estimate.psi_rad - station.psi_rad)
        before_rad, self._apart_rad = self._apart_rad, apart_rad
        dt_s, self._t_ns = (t_ns - self._t_ns) * 1e-9, t_ns
        if before_rad is None or dt_s <= 0.0:
            self._fast_ns = t_ns
            return None
        turn_rad = wrap_rad(apart_rad - before_rad)
        fast = abs(turn_rad) >= FAST_RADPS * dt_s
        if fast and turn_rad * self._turned_rad < 0.0:
            self._turned_rad = 0.0
        if fast:
            self._turned_rad += turn_rad
            self._fast_ns = t_ns
        elif (t_ns - self._fast_ns) * 1e-9 > PAUSE_S:
            self._turned_rad = 0.0
        turns = abs(self._turned_rad) / (2.0 * math.pi)
        return explain(Reason.TURNS_ROUND, turns=turns) if abs(self._turned_rad) >= ROUND_RAD else None
