"""How likely a docking window stays open for another 30, 60 and 150 s, by the features of `DockingWatch`.

A logistic regression of each horizon, and a table of what it told and what came true, which corrects it (isotonic
calibration). Both were fitted on simulated field tests: `python -m bench.docking_forecast`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

HORIZONS_S = (30.0, 60.0, 150.0)

# Of each horizon: constant, log of Rice's rate, log of the rate of ends, nearness to a limit, how calm it is by that
# rate, and this times the distance (m).
COEFFICIENTS: tuple[tuple[float, ...], ...] = (
    (-2.595, -0.25, -0.222, -0.007, 1.791, -0.482),
    (-6.488, -0.25, -1.872, 0.0, 0.0, -0.413),
    (-7.542, -0.25, -1.847, 0.0, 0.0, -0.319),
)
# Of each horizon: what the regression tells, and what came true of it; straight lines between.
CAME_TRUE: tuple[tuple[tuple[float, float], ...], ...] = (
    (
        (0.088, 0.096),
        (0.132, 0.096),
        (0.149, 0.141),
        (0.391, 0.514),
        (0.693, 0.751),
        (0.83, 0.832),
        (0.914, 0.882),
        (0.955, 0.902),
        (0.974, 0.96),
        (0.985, 0.96),
        (0.991, 0.966),
        (0.994, 0.966),
        (0.996, 0.97),
        (0.997, 0.971),
        (0.998, 0.971),
    ),
    (
        (0.005, 0.012),
        (0.044, 0.012),
        (0.073, 0.059),
        (0.277, 0.38),
        (0.542, 0.607),
        (0.706, 0.701),
        (0.827, 0.79),
        (0.9, 0.861),
        (0.939, 0.937),
        (0.962, 0.942),
        (0.975, 0.942),
        (0.983, 0.949),
        (0.988, 0.957),
        (0.992, 0.965),
        (0.995, 0.97),
    ),
    (
        (0.002, 0.002),
        (0.007, 0.002),
        (0.009, 0.002),
        (0.012, 0.002),
        (0.016, 0.003),
        (0.026, 0.004),
        (0.142, 0.201),
        (0.327, 0.434),
        (0.483, 0.531),
        (0.629, 0.571),
        (0.76, 0.739),
        (0.841, 0.846),
        (0.893, 0.866),
        (0.925, 0.871),
        (0.946, 0.89),
        (0.962, 0.923),
        (0.972, 0.952),
        (0.981, 0.964),
    ),
)


def stays_open(features: Sequence[float]) -> tuple[float, ...]:
    """The probabilities of `HORIZONS_S`; longer is never likelier, though each has a regression of its own."""
    likely = (corrected(probability(row, features), table) for row, table in zip(COEFFICIENTS, CAME_TRUE, strict=True))
    return tuple(itertools.accumulate(likely, min))


def probability(coefficients: Sequence[float], features: Sequence[float]) -> float:
    """Of the logistic regression."""
    score = math.fsum(c * x for c, x in zip(coefficients, features, strict=True))
    return 1.0 / (1.0 + math.exp(-min(max(score, -50.0), 50.0)))


def corrected(told: float, table: Sequence[tuple[float, float]]) -> float:
    """What came true of a probability, by a table; beyond its ends as at them."""
    if told <= table[0][0]:
        return table[0][1]
    for (low, came_low), (high, came_high) in itertools.pairwise(table):
        if told <= high:
            return came_low + (came_high - came_low) * (told - low) / (high - low)
    return table[-1][1]
