"""Calls of CasADi functions on NumPy buffers, which cost microseconds where a usual call costs tens of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

from asvhil.dynamics.arrays import Array


def bind(function: ca.Function, arguments: list[Array], results: list[Array]) -> Callable[[], None]:
    """A callable that evaluates the function on the present contents of `arguments` and writes into `results`.

    Arrays are 1-D and contiguous, one for each argument and result, of the length of its nonzeros.
    """
    bound: Any = function.buffer()  # its type hints ask for a size, which it does not take with a memoryview
    buffer, call = bound
    for i, array in enumerate(arguments):
        buffer.set_arg(i, array.data)
    for i, array in enumerate(results):
        buffer.set_res(i, array.data)

    def evaluate(keep_alive: tuple[object, ...] = (function, buffer, *arguments, *results)) -> None:
        call()

    return evaluate
