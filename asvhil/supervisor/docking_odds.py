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
    (-2.728, -0.732, -1.146, -2.631, -0.205, -0.807),
    (-6.381, -0.729, -2.721, -2.689, -1.910, -0.834),
    (-10.887, -1.051, -4.230, -2.343, -3.945, -0.427),
)
# Of each horizon: what the regression tells, and what came true of it; straight lines between.
CAME_TRUE: tuple[tuple[tuple[float, float], ...], ...] = (
    (
        (0.026, 0.048),
        (0.058, 0.065),
        (0.094, 0.11),
        (0.126, 0.136),
        (0.156, 0.15),
        (0.195, 0.184),
        (0.252, 0.202),
        (0.33, 0.215),
        (0.433, 0.314),
        (0.536, 0.574),
        (0.594, 0.637),
        (0.642, 0.727),
        (0.683, 0.76),
        (0.721, 0.768),
        (0.76, 0.768),
        (0.802, 0.79),
        (0.845, 0.862),
        (0.888, 0.882),
        (0.93, 0.914),
        (0.977, 0.941),
    ),
    (
        (0.002, 0.011),
        (0.005, 0.012),
        (0.01, 0.024),
        (0.025, 0.024),
        (0.045, 0.039),
        (0.081, 0.039),
        (0.147, 0.073),
        (0.246, 0.193),
        (0.347, 0.341),
        (0.417, 0.483),
        (0.468, 0.526),
        (0.513, 0.557),
        (0.555, 0.583),
        (0.598, 0.627),
        (0.647, 0.627),
        (0.705, 0.653),
        (0.771, 0.764),
        (0.843, 0.851),
        (0.937, 0.927),
    ),
    (
        (0, 0),
        (0.001, 0.001),
        (0.003, 0.002),
        (0.007, 0.002),
        (0.018, 0.012),
        (0.045, 0.037),
        (0.099, 0.087),
        (0.15, 0.167),
        (0.183, 0.235),
        (0.234, 0.235),
        (0.261, 0.263),
        (0.291, 0.34),
        (0.444, 0.34),
        (0.58, 0.479),
        (0.782, 0.891),
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
