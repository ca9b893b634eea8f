"""Seeded random numbers as plain floats, drawn in blocks: one source per sensor or weather component."""

from __future__ import annotations

import math

import numpy as np

BLOCK = 512


class NormalSource:
    """Standard normal numbers from a seeded generator, one at a time."""

    __slots__ = ("_at", "_block", "_rng")

    def __init__(self, seed: np.random.SeedSequence) -> None:
        self._rng = np.random.Generator(np.random.PCG64(seed))
        self._block: list[float] = []
        self._at = 0

    def next(self) -> float:
        """The next number. Blocks are drawn at once, since calls of NumPy are slow."""
        if self._at == len(self._block):
            self._block = self._rng.standard_normal(BLOCK).tolist()
            self._at = 0
        value = self._block[self._at]
        self._at += 1
        return value


class OrnsteinUhlenbeck:
    """A stationary OU process of given standard deviation and correlation time, sampled every `step_s`.

    Exact discretisation: x' = a x + std sqrt(1 - a^2) z with a = exp(-step / time), started from its stationary law.
    """

    __slots__ = ("_a", "_kick", "_source", "_std", "_time_s", "value")

    def __init__(self, std: float, time_s: float, step_s: float, source: NormalSource) -> None:
        self._std, self._time_s = std, time_s
        self._source = source
        self.set_step(step_s)
        self.value = std * source.next()

    def set_step(self, step_s: float) -> None:
        """Another sampling interval from now on."""
        self._a = math.exp(-step_s / self._time_s)
        self._kick = self._std * math.sqrt(-math.expm1(-2.0 * step_s / self._time_s))

    def advance(self) -> float:
        """One step on; the new value."""
        self.value = self._a * self.value + self._kick * self._source.next()
        return self.value
