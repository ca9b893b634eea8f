"""Calls of CasADi functions on NumPy buffers: microseconds instead of the tens of a normal call."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

from asvhil.dynamics.arrays import Array

Evaluator = Callable[[ca.Function], ca.Function | None]

_evaluator: Evaluator | None = None


def evaluate_with(evaluator: Evaluator | None) -> None:
    """From now on `fastest` asks this for an equal function that takes less time; None: CasADi's own evaluation.

    It belongs to the process, like the library itself: which way a function is evaluated changes no bit of a result.
    """
    global _evaluator
    _evaluator = evaluator


def fastest(function: ca.Function) -> ca.Function:
    """An equal function, the fastest at hand; what was composed of others is one list of scalar operations then."""
    faster = _evaluator(function) if _evaluator is not None else None
    if faster is not None:
        return faster
    return function.expand() if function.is_a("MXFunction") else function


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

    call.kept_alive = (function, buffer, *arguments, *results)  # a functools.partial, which takes attributes
    evaluate: Callable[[], None] = call
    return evaluate
