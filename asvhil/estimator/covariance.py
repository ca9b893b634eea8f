"""Covariances of the filter as CasADi functions of scalars: one order of operations, on every machine the same.

Of a covariance only the lower triangle is read and worked out, and mirrored: it stays symmetric to the bit.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from asvhil.dynamics.arrays import Array
from asvhil.dynamics.buffers import bind, fastest
from asvhil.dynamics.ordered import symmetric
from asvhil.estimator.states import B_E, D_N, PSI, SIZE


class Correction:
    """Kalman correction of `x` (SIZE) and `p` (SIZE * SIZE) by `rows` scalar readings with independent noise.

    Fill `h` (rows, SIZE), `noise` (rows, variances) and `innovation` (rows), call `evaluate_innovation`, and read `s`
    (rows, rows), the covariance of the innovation. Or `compares` has made the function that gives all of these from
    readings. Then fill `used` (SIZE; 0 for a state that is to stay, else 1), call `evaluate`, and read the state
    `x_after` and its covariance `p_after` (SIZE, SIZE).

    `most` bounds the states from D_N to B_E. Corrections may share `x`, `p` and `most`.
    """

    def __init__(self, rows: int, x: Array, p: Array, most: Array) -> None:
        self._p = p
        self._h, self.noise, self.innovation = np.zeros(rows * SIZE), np.zeros(rows), np.zeros(rows)
        self._s, self._ph = np.zeros(rows * rows), np.zeros(SIZE * rows)
        self.used, self.x_after = np.ones(SIZE), np.zeros(SIZE)
        after = np.zeros(SIZE * SIZE)
        self.p_after: Array = after.reshape(SIZE, SIZE)
        self.h: Array = self._h.reshape(rows, SIZE)
        self.s: Array = self._s.reshape(rows, rows, order="F")
        innovate, correct = _functions(rows)
        self.evaluate_innovation = bind(innovate, [p, self._h, self.noise], [self._ph, self._s])
        arguments = [x, p, self._ph, self._s, self.innovation, self.used, most]
        self.evaluate = bind(correct, arguments, [self.x_after, after])

    def compares(self, function: ca.Function, readings: list[Array], expected: Array) -> Callable[[], None]:
        """A call of (*readings, p, variances) -> (*`compared`), which fills what `evaluate` needs, and `expected`."""
        results = [self.innovation, expected, self._h, self._ph, self._s]
        return bind(function, [*readings, self._p, self.noise], results)


def compared(innovation: Any, expected: Any, h: Any, p: Any, variances: Any) -> list[Any]:
    """Of readings, for `Correction.compares`: innovation, expected readings, H by rows, P H' and S.

    S is not a number where P is not finite, so that no reading passes the gate then, whichever states it is of.
    """
    ph, s = _innovation_covariance(p, h, variances)
    return [innovation, expected, ca.vec(ca.densify(h.T)), ph, ca.if_else(ca.fabs(ca.trace(p)) < math.inf, s, math.nan)]


def wrapped(angle: Any) -> Any:
    """The angle (rad) in [-pi, pi), as `geo.wrap_rad`: the remainder of C has the sign of the dividend."""
    rest = ca.fmod(angle + math.pi, 2.0 * math.pi)
    return rest + (rest < 0.0) * (2.0 * math.pi) - math.pi


def _innovation_covariance(p: Any, h: Any, variances: Any) -> tuple[Any, Any]:
    """P H', and S = H P H' + R."""
    ph = ca.densify(symmetric(p) @ h.T)
    return ph, symmetric(h @ ph + ca.diag(variances))


@functools.lru_cache(maxsize=8)
def _functions(rows: int) -> tuple[ca.Function, ca.Function]:
    """(P, H, variances) -> (P H', S), and (x, P, P H', S, innovation, used, most) -> (x, P) after the correction.

    With any gain K the covariance is (I - K H) P (I - K H)' + K R K' (the Joseph form), which is
    P - K (P H')' - P H' K' + K S K'.
    """
    p, h_rows, variances = ca.SX.sym("p", SIZE, SIZE), ca.SX.sym("h", rows * SIZE), ca.SX.sym("r", rows)
    h = ca.reshape(h_rows, SIZE, rows).T
    innovation_of = ca.Function(
        "ekf_innovation", [p, h_rows, variances], [*_innovation_covariance(p, h, variances)], {"cse": True}
    )

    ph, s, innovation = ca.SX.sym("ph", SIZE, rows), ca.SX.sym("s", rows, rows), ca.SX.sym("i", rows)
    x, used, most = ca.SX.sym("x", SIZE), ca.SX.sym("used", SIZE), ca.SX.sym("most", B_E + 1 - D_N)
    gain = _times_inverse(ph, s) * ca.repmat(used, 1, rows)
    half = ph - 0.5 * (gain @ s)
    p_after = symmetric(symmetric(p) - gain @ half.T - half @ gain.T)
    moved = x + gain @ innovation
    bounded = moved[D_N : B_E + 1]
    bounded = ca.if_else(bounded < -most, -most, bounded)
    bounded = ca.if_else(bounded > most, most, bounded)
    x_after = ca.vertcat(moved[:PSI], wrapped(moved[PSI]), moved[PSI + 1 : D_N], bounded, moved[B_E + 1 :])
    correct = ca.Function("ekf_correct", [x, p, ph, s, innovation, used, most], [x_after, p_after], {"cse": True})
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
