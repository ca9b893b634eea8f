"""Linear algebra in one order of operations: the same bits on every machine, where BLAS has a kernel for each.

A library for matrices sums products in the order that suits the processor, and fuses them where it can. In a loop that
is closed by an optimiser such last bits grow to decimetres within minutes, and a log would replay on machines of its
own kind alone. Products of small matrices are made here by multiplications and additions of whole arrays, which round
once each. CasADi functions of SX do the same, and faster: they are evaluated one scalar operation after the other.
"""

from __future__ import annotations

from collections.abc import Iterable

import casadi as ca
import numpy as np

from asvhil.dynamics.arrays import Array


class SingularMatrix(ArithmeticError):
    """A pivot is zero or not finite: there is no solution to give."""


def symmetric(p: ca.SX) -> ca.SX:
    """A symmetric matrix by its lower triangle: the upper one is then never evaluated."""
    return ca.densify(ca.tril2symm(ca.tril(p)))


def product(a: Array, b: Array) -> Array:
    """A (m, k) times B (k, n), or times a vector (k): the products are summed in one order on every machine.

    For a matrix that of k: NumPy adds up along the outermost axis row by row. For a vector of more than eight entries
    it is NumPy's own, pairwise.
    """
    if b.ndim == 1:
        return product(a, b[:, None])[:, 0]
    result: Array = np.add.reduce(a.T[:, :, None] * b[:, None, :], axis=0)
    return result


def solve(a: Array, b: Array) -> Array:
    """X (n, m) of A X = B, or x (n) of a vector, by elimination with partial pivoting.

    Raises SingularMatrix where a pivot is zero or not finite.
    """
    if b.ndim == 1:
        return solve(a, b[:, None])[:, 0]
    count = len(a)
    rows: Array = np.concatenate([a, b], axis=1, dtype=np.float64)
    for k in range(count):
        pivot = k + int(np.argmax(np.abs(rows[k:, k])))
        if pivot != k:
            rows[[k, pivot]] = rows[[pivot, k]]
        if not 0.0 < abs(rows[k, k]) < np.inf:
            raise SingularMatrix("the matrix is singular or not finite")
        factors = rows[k + 1 :, k : k + 1] / rows[k, k]
        rows[k + 1 :, k:] -= factors * rows[k : k + 1, k:]
    x = rows[:, count:]
    for k in range(count - 1, -1, -1):
        x[k] /= rows[k, k]
        x[:k] -= rows[:k, k : k + 1] * x[k : k + 1]
    return x


def total(values: Iterable[float]) -> float:
    """The sum of numbers in their order. (From Python 3.12 on `sum` compensates for rounding, before it does not.)"""
    result = 0.0
    for value in values:
        result += value
    return result
