"""Functions of one number that are given by points."""

from __future__ import annotations

from bisect import bisect_right

from asvhil.dynamics.arrays import Array


class Table:
    """Linear between points (x, y) with x ascending, constant beyond them; NaN of NaN.

    What `np.interp` gives for a single number, in a quarter of its time, and with no product fused with a sum.
    """

    def __init__(self, x: Array, y: Array) -> None:
        self._x: list[float] = x.tolist()
        self._y: list[float] = y.tolist()

    def at(self, x: float) -> float:
        """y at x."""
        known, values = self._x, self._y
        if x < known[0]:
            return values[0]
        if not x < known[-1]:
            return values[-1] if x >= known[-1] else x
        i = bisect_right(known, x) - 1  # the last of the points at or before x
        begin, low = known[i], values[i]
        if x == begin:
            return low
        return (values[i + 1] - low) / (known[i + 1] - begin) * (x - begin) + low
