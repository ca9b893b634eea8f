"""Sequential evidence for each fault against the sound hypotheses together: Page's test, one for each fault."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from asvhil.dynamics.arrays import Array

LEAK = 1e-3  # of the weights of the sound hypotheses, in each step: any of them may become the true one
# Of one step, to both sums. What decides that something is wrong grows by little at a time, whatever a reading tells: a
# wave that passes is off for a second or two, a fault for as long as there is thrust (Huber 1965).
MOST, MOST_OF_NAME = 0.4, 10.0


class Evidence:
    """Sums of the log likelihood ratio of each fault to the sound hypotheses, which never fall below 0.

    A sum at 0 says that the fault, if it is there, begins now (Page 1954). The sound ones count as one: by the mixture
    of their likelihoods, with the weights that their past gives them. What one step adds to `sums` is bounded. `names`
    are the same sums with more from each step: two faults that both explain what no sound boat does differ by the steps
    that tell most, and by how likely they are beforehand, of which `log_priors` are the logarithms.
    """

    def __init__(self, sound: int, log_priors: Sequence[float]) -> None:
        self._weights = np.full(sound, 1.0 / sound)
        self._log_priors = np.array(log_priors)
        self.sums: Array = np.zeros(len(log_priors))
        self._found: Array = np.zeros(len(log_priors))
        self.names: Array = self._log_priors.copy()  # the sums that tell faults apart, with their priors

    def reset(self) -> None:
        self._weights[:] = 1.0 / len(self._weights)
        self.sums[:] = self._found[:] = 0.0
        self.names = self._found + self._log_priors

    @property
    def best_sound(self) -> int:
        return int(self._weights.argmax())

    def add(self, log: Array, weight: float = 1.0) -> None:
        """Add a step: the log likelihoods of the sound ones, then those of the faults.

        `weight`: how much it tells, of 1 where noise is what it should be.
        """
        count = len(self._weights)
        weighted = weight * log
        sound, faulty = weighted[:count], weighted[count:]
        top = float(sound.max())
        # By the C library: NumPy has an exponential for each kind of processor, of other last bits.
        parts = self._weights * [math.exp(each - top) for each in sound.tolist()]
        total = float(parts.sum())
        mixture = top + math.log(total)
        self._weights = (1.0 - LEAK) * parts / total + LEAK / count
        ratios = faulty - mixture
        self.sums = np.maximum(0.0, self.sums + _clipped(ratios, weight * MOST))
        self._found = np.where(self.sums > 0.0, self._found + _clipped(ratios, MOST_OF_NAME), 0.0)
        self.names = self._found + self._log_priors


def _clipped(ratios: Array, most: float) -> Array:
    """In [-most, most]: as np.clip, in half of its time for so few."""
    clipped: Array = np.minimum(np.maximum(ratios, -most), most)
    return clipped
