"""How well the hypotheses predict the readings: how much a step tells, and whether a fault explains what is seen."""

from __future__ import annotations

import numpy as np

from asvhil.dynamics.arrays import Array

GAIN = 0.05  # of a step, on the averages
ROUGH_POWER = 4  # by how much less each tick tells in rough water
# The averages below are of the squared innovation of a reading over its variance: 1 where the noise is what the bank
# takes it to be. It takes it for large, since waves and hulls differ: 0.1 to 0.2 in calm water, 0.3 and more in a chop.
CALM = 0.25  # a step then tells what its likelihoods say
UNSHOWN = 0.5  # when a hold begins: that the water is calm must be shown
MOST = 2.0  # times as much a step tells in calm water
SETTLED_S = 15.0  # a hold has gone on for, from which on a step tells less in water that is not calm
POOR = 0.45  # from there on what is found then may be the water's: a wrong answer that lasts fits its own hypothesis
FITS = 0.85  # of a fault's own filter, at the most, to be told as likely by little evidence


class Fit:
    """`begin` when a hold begins, `add` in each step; then `weight` and `explains`.

    What scales the noise scales the logarithm of a likelihood ratio by its inverse: the innovations of the hypothesis
    that fits best tell by how much (Mehra 1972). A fault that is there fits: with a dead motor or a turned compass its
    own filter predicts about as well as in calm water. That of one that waves only resemble does not.
    """

    def __init__(self, count: int) -> None:
        self._own: Array = np.full(count, CALM)
        self._best, self._held_s = UNSHOWN, 0.0
        self.roughness = 1.0

    def begin(self) -> None:
        """A hold begins: what is known of rough water stays."""
        self._own[:] = CALM
        self._best, self._held_s = UNSHOWN, 0.0

    def add(self, squares: Array, readings: int, dt_s: float) -> None:
        """A step's squared innovations over their variances (H,), sums over so many readings, and its time."""
        self._held_s += dt_s
        least = float(squares.min())
        # In waves no hypothesis predicts well, readings are off for seconds on end, and each tells that much less.
        self.roughness += GAIN * (max(1.0, least / 3.0) - self.roughness)
        if readings > 0:
            self._best += GAIN * (least / readings - self._best)
            self._own += GAIN * (squares / readings - self._own)

    @property
    def weight(self) -> float:
        """How much a step tells, of 1 where noise is what it should be."""
        calm = CALM / max(self._best, CALM / MOST)
        # Less not before: what is wired wrong shows at once, and no hypothesis fits while the boat gathers way.
        weight: float = self.roughness**-ROUGH_POWER * (calm if self._held_s > SETTLED_S else max(1.0, calm))
        return weight

    @property
    def poor(self) -> bool:
        """Whether the hold has gone on for a while, and no hypothesis predicts well."""
        return self._held_s > SETTLED_S and self._best > POOR

    def explains(self, hypothesis: int) -> bool:
        """Whether a hypothesis's own filter has predicted well of late."""
        return float(self._own[hypothesis]) <= FITS
