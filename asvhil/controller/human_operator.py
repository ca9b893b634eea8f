"""A simulated human operator at the sticks who keeps a station imperfectly, for data collection."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from asvhil.geo import ned_to_body, wrap_rad
from asvhil.types import Estimate, Station

LEVEL = 0.2  # sticks are moved in coarse steps
LOOK_S = (0.3, 0.9)  # time between two looks at the boat, drawn anew each time
NEAR_M = 3.0  # within it the heading is controlled, beyond it the way back
WOBBLE = 0.12  # standard deviation of where the stick ends up
WRONG_SHARE = 0.05  # looks that end with a stick moved the wrong way


class HumanOperator:
    """A proportional-derivative law with reaction delay, coarse levels, random wobble and some mistakes. Seeded."""

    def __init__(self, rng: np.random.Generator, reaction_s: float) -> None:
        self._rng = rng
        self._reaction_ns = round(reaction_s * 1e9)
        self._seen: deque[Estimate] = deque()
        self._look_ns = 0
        self._sticks = (0.0, 0.0)

    def step(self, estimate: Estimate, station: Station) -> tuple[float, float]:
        """Stick positions (surge, turn) in [-1, 1]: updated at each look, from the estimate of a reaction time ago."""
        self._seen.append(estimate)
        while len(self._seen) > 1 and self._seen[1].t_ns <= estimate.t_ns - self._reaction_ns:
            self._seen.popleft()
        if estimate.t_ns >= self._look_ns:
            self._look_ns = estimate.t_ns + round(1e9 * float(self._rng.uniform(*LOOK_S)))
            self._sticks = self._decide(self._seen[0], station)
        return self._sticks

    def _decide(self, seen: Estimate, station: Station) -> tuple[float, float]:
        ahead_m, abeam_m = ned_to_body(seen.psi_rad, station.n_m - seen.n_m, station.e_m - seen.e_m)
        surge = 0.12 * ahead_m - 0.5 * seen.u_mps
        if math.hypot(ahead_m, abeam_m) > NEAR_M:
            # Bow or stern towards the station, whichever is nearer.
            turn_rad = math.atan2(abeam_m, ahead_m) if ahead_m > 0.0 else math.atan2(-abeam_m, -ahead_m)
        else:
            turn_rad = wrap_rad(station.psi_rad - seen.psi_rad)
        turn = 0.8 * turn_rad - 1.2 * seen.r_radps
        if self._rng.random() < WRONG_SHARE:
            surge, turn = -surge, -turn
        wobble = self._rng.normal(0.0, WOBBLE, 2)
        return _quantised(surge + float(wobble[0])), _quantised(turn + float(wobble[1]))


def _quantised(stick: float) -> float:
    """The nearest level within [-1, 1]."""
    return LEVEL * round(min(max(stick, -1.0), 1.0) / LEVEL)
