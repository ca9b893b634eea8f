"""Seeded random numbers as plain floats, drawn in blocks: one source per sensor or weather component."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np

BLOCK = 512


class NormalSource:
    """Standard normal numbers from a seeded generator, one at a time by `next()`.

    Blocks are drawn at once, since calls of NumPy are slow; and `next` is the iterator's own, since it is called
    twenty times in a tick.
    """

    __slots__ = ("next",)

    def __init__(self, seed: np.random.SeedSequence) -> None:
        rng = np.random.Generator(np.random.PCG64(seed))
        blocks = (rng.standard_normal(BLOCK).tolist() for _ in itertools.repeat(None))
        self.next: Callable[[], float] = itertools.chain.from_iterable(blocks).__next__


class OrnsteinUhlenbeck:
    """A stationary OU process of given standard deviation and correlation time, sampled every `step_s`.

    Exact discretisation: x' = a x + std sqrt(1 - a^2) z with a = exp(-step / time), started from its stationary law.
    """

    __slots__ = ("_a", "_kick", "_next", "_std", "_time_s", "value")

    def __init__(self, std: float, time_s: float, step_s: float, source: NormalSource) -> None:
        self._std, self._time_s = std, time_s
        self._next = source.next
        self.set_step(step_s)
        self.value = std * source.next()

    def set_step(self, step_s: float) -> None:
        """Another sampling interval from now on."""
        self._a = math.exp(-step_s / self._time_s)
        self._kick = self._std * math.sqrt(-math.expm1(-2.0 * step_s / self._time_s))

    def advance(self) -> float:
        """One step on; the new value."""
        self.value = self._a * self.value + self._kick * self._next()
        return self.value
