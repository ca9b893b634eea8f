"""Calls of CasADi functions on NumPy buffers: microseconds instead of the tens of a normal call."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

from asvhil.dynamics.arrays import Array


def bind(function: ca.Function, arguments: list[Array], results: list[Array]) -> Callable[[], None]:
    """A callable that evaluates the function on the present contents of `arguments` and writes into `results`.

    Arrays are 1-D and contiguous, one for each argument and result, of the length of its nonzeros.
    """
    bound: Any = function.buffer()  # the type hints want a size, which it does not accept with a memoryview
    buffer, call = bound
    for i, array in enumerate(arguments):
        buffer.set_arg(i, array.data)
    for i, array in enumerate(results):
        buffer.set_res(i, array.data)

    def evaluate(keep_alive: tuple[object, ...] = (function, buffer, *arguments, *results)) -> None:
        call()

    return evaluate
