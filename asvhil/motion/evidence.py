"""Sequential evidence for each fault against the sound hypotheses together: Page's test, one for each fault."""

from __future__ import annotations

import math

import numpy as np

from asvhil.dynamics.arrays import Array

LEAK = 1e-3  # of the weights of the sound hypotheses, in each step: any of them may become the true one
MOST = 2.0  # of one step: no single reading decides that something is wrong
MOST_OF_NAME = 10.0  # of one step: nor what


class Evidence:
    """Sums of the log likelihood ratio of each fault to the sound hypotheses, which never fall below 0.

    A sum at 0 says that the fault, if it is there, begins now (Page 1954). The sound ones count as one: by the mixture
    of their likelihoods, with the weights that their past gives them. `names` are the same sums with more from each
    step: two faults that both explain what no sound boat does differ by the steps that tell most.
    """

    def __init__(self, sound: int, faulty: int) -> None:
        self._weights = np.full(sound, 1.0 / sound)
        self.sums: Array = np.zeros(faulty)
        self.names: Array = np.zeros(faulty)

    def reset(self) -> None:
        self._weights[:] = 1.0 / len(self._weights)
        self.sums[:] = self.names[:] = 0.0

    @property
    def best_sound(self) -> int:
        return int(np.argmax(self._weights))

    def add(self, log: Array) -> None:
        """Add a step: the log likelihoods of the sound ones, then those of the faults."""
        count = len(self._weights)
        sound, faulty = log[:count], log[count:]
        top = float(sound.max())
        # By the C library: NumPy has an exponential for each kind of processor, of other last bits.
        parts = self._weights * [math.exp(each - top) for each in sound.tolist()]
        total = float(parts.sum())
        mixture = top + math.log(total)
        self._weights = (1.0 - LEAK) * parts / total + LEAK / count
        ratios = faulty - mixture
        self.sums = np.maximum(0.0, self.sums + ratios.clip(-MOST, MOST))
        self.names = np.where(self.sums > 0.0, self.names + ratios.clip(-MOST_OF_NAME, MOST_OF_NAME), 0.0)
