"""How far the boat has been carried while the estimate stayed behind, by the velocity of the receiver."""

from __future__ import annotations

import math
from collections import deque

from asvhil.types import Estimate, GroundVelocity, changed

FORGET_S = 8.0  # a receiver whose position drifts by some metres in minutes then comes to 1 m
LEAST_M = 2.5  # less is noise, waves, and the antenna's turns about the boat
OLD_NS = 1_000_000_000
MIDDLE_OF = 3  # readings, of whose velocities the middle one counts: one that is wrong does not


class CarriedWatch:
    """`step` in each tick with a valid estimate: the estimate, at the place to which the receiver's velocity leads.

    In a current far beyond what the model knows, an estimator may take the receiver's positions for wrong, and follow
    its model, which has the boat near the station. A position that jumps is not borne out by the velocity. The distance
    between velocity, integrated, and estimate is forgotten with a time constant.
    """

    def __init__(self) -> None:
        self._before: tuple[int, float, float] | None = None  # time, and place by the estimate
        self._off_n_m = self._off_e_m = 0.0
        self._readings: deque[GroundVelocity] = deque(maxlen=MIDDLE_OF)
        self._middle_ned: tuple[float, float] | None = None  # of these

    def reset(self) -> None:
        """There is no estimate: the next one is where the boat is."""
        self._before = None
        self._off_n_m = self._off_e_m = 0.0
        self._forget_readings()

    @property
    def off_m(self) -> float:
        """How far apart velocity and estimate are; 0 where that is little."""
        off_m = math.hypot(self._off_n_m, self._off_e_m)
        return off_m if off_m >= LEAST_M else 0.0

    def step(self, t_ns: int, velocity: GroundVelocity | None, estimate: Estimate) -> Estimate:
        """The corrected estimate; `velocity`: the receiver's latest, None where it is silent or frozen."""
        if self._before is not None:
            before_ns, n_m, e_m = self._before
            dt_s = (t_ns - before_ns) * 1e-9
            keep = math.exp(-dt_s / FORGET_S)
            self._off_n_m *= keep
            self._off_e_m *= keep
            middle = self._middle(velocity)
            if velocity is not None and middle is not None and t_ns - velocity.t_ns <= OLD_NS:
                self._off_n_m += middle[0] * dt_s - (estimate.n_m - n_m)
                self._off_e_m += middle[1] * dt_s - (estimate.e_m - e_m)
        self._before = t_ns, estimate.n_m, estimate.e_m
        if self.off_m == 0.0:
            return estimate
        return changed(estimate, n_m=estimate.n_m + self._off_n_m, e_m=estimate.e_m + self._off_e_m)

    def _middle(self, velocity: GroundVelocity | None) -> tuple[float, float] | None:
        """The middle of the last readings, for north and east apart; None until there are enough of them."""
        if velocity is None:
            self._forget_readings()
        elif not self._readings or velocity.t_ns != self._readings[-1].t_ns:
            self._readings.append(velocity)
            if len(self._readings) == MIDDLE_OF:
                north = sorted(reading.vn_mps for reading in self._readings)
                east = sorted(reading.ve_mps for reading in self._readings)
                self._middle_ned = north[MIDDLE_OF // 2], east[MIDDLE_OF // 2]
        return self._middle_ned

    def _forget_readings(self) -> None:
        self._readings.clear()
        self._middle_ned = None
