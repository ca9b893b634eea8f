"""Dual numbers, value and gradient at once, for the exact derivatives of NumPy code."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np


class Dual:
    """A value and its gradient with respect to the inputs; NumPy carries it in arrays of dtype object."""

    __slots__ = ("gradient", "value")

    def __init__(self, value: float, gradient: np.ndarray) -> None:
        self.value, self.gradient = value, gradient

    def __add__(self, other: Dual | float) -> Dual:
        if isinstance(other, Dual):
            return Dual(self.value + other.value, self.gradient + other.gradient)
        if isinstance(other, np.ndarray):
            return NotImplemented  # it is the array that knows how to do this element by element
        return Dual(self.value + other, self.gradient)

    __radd__ = __add__

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.gradient)

    def __sub__(self, other: Dual | float) -> Dual:
        return NotImplemented if isinstance(other, np.ndarray) else self + (-other)

    def __rsub__(self, other: float) -> Dual:
        return -self + other

    def __mul__(self, other: Dual | float) -> Dual:
        if isinstance(other, Dual):
            return Dual(self.value * other.value, self.value * other.gradient + other.value * self.gradient)
        if isinstance(other, np.ndarray):
            return NotImplemented
        return Dual(self.value * other, self.gradient * other)

    __rmul__ = __mul__

    def __truediv__(self, other: float) -> Dual:
        return Dual(self.value / other, self.gradient / other)

    def __abs__(self) -> Dual:
        return self if self.value >= 0.0 else -self

    def tanh(self) -> Dual:
        """What np.tanh calls on the elements of an object array."""
        value = math.tanh(self.value)
        return Dual(value, (1.0 - value * value) * self.gradient)


def jacobian(function: Callable[..., np.ndarray], *arguments: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Value (M,) and Jacobian (M, N) of a function of 1-D arrays, N their lengths together."""
    seeds = np.eye(sum(len(part) for part in arguments))
    columns = iter(seeds)
    duals = [np.array([Dual(float(value), next(columns)) for value in part], dtype=object) for part in arguments]
    rows = function(*duals)
    return np.array([row.value for row in rows]), np.array([row.gradient for row in rows])
