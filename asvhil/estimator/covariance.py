"""Covariances of the filter as CasADi functions of scalars: one order of operations, on every machine the same.

Of a covariance only the lower triangle is read and worked out, and mirrored: it stays symmetric to the bit.
"""

from __future__ import annotations

import functools
from typing import Any

import casadi as ca
import numpy as np

from asvhil.dynamics.arrays import Array
from asvhil.dynamics.buffers import bind, fastest
from asvhil.dynamics.ordered import symmetric
from asvhil.estimator.states import SIZE


class Correction:
    """Kalman correction by `rows` scalar readings with independent noise.

    Fill `p` (SIZE * SIZE), `h` (rows, SIZE) and `noise` (rows, variances), call `evaluate_innovation`, and read `s`
    (rows, rows), the covariance of the innovation. Then fill `innovation` (rows) and `used` (SIZE; 0 for a state that
    is to stay, else 1), call `evaluate`, and read `change` (SIZE) of the state and the covariance `after`.
    """

    def __init__(self, rows: int) -> None:
        self.p, self.after = np.zeros(SIZE * SIZE), np.zeros(SIZE * SIZE)
        h_rows, self.noise, self.innovation = np.zeros(rows * SIZE), np.zeros(rows), np.zeros(rows)
        s_columns, self._ph = np.zeros(rows * rows), np.zeros(SIZE * rows)
        self.used, self.change = np.ones(SIZE), np.zeros(SIZE)
        self.h: Array = h_rows.reshape(rows, SIZE)
        self.s: Array = s_columns.reshape(rows, rows, order="F")
        before, innovate = _functions(rows)
        self.evaluate_innovation = bind(before, [self.p, h_rows, self.noise], [self._ph, s_columns])
        self.evaluate = bind(
            innovate, [self.p, self._ph, s_columns, self.innovation, self.used], [self.change, self.after]
        )


@functools.lru_cache(maxsize=8)
def _functions(rows: int) -> tuple[ca.Function, ca.Function]:
    """(P, H, variances) -> (P H', S), and (P, P H', S, innovation, used) -> (change of the state, P after it).

    With any gain K the covariance is (I - K H) P (I - K H)' + K R K' (the Joseph form), which is
    P - K (P H')' - P H' K' + K S K'.
    """
    p, h_rows, variances = ca.SX.sym("p", SIZE, SIZE), ca.SX.sym("h", rows * SIZE), ca.SX.sym("r", rows)
    before, h = symmetric(p), ca.reshape(h_rows, SIZE, rows).T
    ph_of = before @ h.T
    s_of = symmetric(h @ ph_of + ca.diag(variances))
    innovation_of = ca.Function("ekf_innovation", [p, h_rows, variances], [ph_of, s_of], {"cse": True})

    ph, s, innovation = ca.SX.sym("ph", SIZE, rows), ca.SX.sym("s", rows, rows), ca.SX.sym("i", rows)
    used = ca.SX.sym("used", SIZE)
    gain = _times_inverse(ph, s) * ca.repmat(used, 1, rows)
    half = ph - 0.5 * (gain @ s)
    after = symmetric(before - gain @ half.T - half @ gain.T)
    correct = ca.Function("ekf_correct", [p, ph, s, innovation, used], [gain @ innovation, after], {"cse": True})
    return fastest(innovation_of), fastest(correct)


def _times_inverse(ph: Any, s: Any) -> Any:
    """P H' S^-1 by elimination, S symmetric and positive definite."""
    rows = s.shape[0]
    lower: list[list[Any]] = [[s[i, j] for j in range(rows)] for i in range(rows)]
    columns = [ph[:, i] for i in range(rows)]
    for j in range(rows):
        for i in range(j + 1, rows):
            factor = lower[i][j] / lower[j][j]
            for k in range(j + 1, i + 1):
                lower[i][k] = lower[i][k] - factor * lower[k][j]
            columns[i] = columns[i] - factor * columns[j]
    for j in range(rows - 1, -1, -1):
        for k in range(j + 1, rows):
            columns[j] = columns[j] - lower[k][j] * columns[k]
        columns[j] = columns[j] / lower[j][j]
    return ca.horzcat(*columns)
