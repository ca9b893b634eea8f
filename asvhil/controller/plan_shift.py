"""The last plan as it is seen at the next step: where its stages have moved on the horizon's grid."""

from __future__ import annotations

import math

import numpy as np

from asvhil.dynamics.arrays import Array


def shift_matrix(times_s: Array, elapsed_s: float, onto_s: Array | None = None) -> Array:
    """S (stages, stages) with S @ plan = the plan seen elapsed_s later: means over the moved grid, the end held.

    The new plan has the grid `onto_s`, by default that of the old one, `times_s` (stages + 1 each, from 0 on).
    """
    onto_s = times_s if onto_s is None else onto_s
    begin, end = times_s[:-1], times_s[1:].copy()
    end[-1] = math.inf
    moved_begin, moved_end = onto_s[:-1] + elapsed_s, onto_s[1:] + elapsed_s
    overlap = np.minimum(moved_end[:, None], end[None, :]) - np.maximum(moved_begin[:, None], begin[None, :])
    matrix: Array = np.maximum(overlap, 0.0) / np.diff(onto_s)[:, None]
    return matrix
