"""IPOPT through CasADi by multiple shooting: the paper's second solver. Exact Hessians, expanded to SX."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from asvhil.controller.solvers.nlp import NlpSolver
from asvhil.controller.solvers.problem import StationProblem


class Ipopt(NlpSolver):
    """IPOPT with its own defaults; a dual warm start was slower than none, so the start is a plan alone."""

    def __init__(self, problem: StationProblem, caps: Sequence[int] = ()) -> None:
        super().__init__(problem, False, _make, caps)


def _make(symbols: dict[str, Any], cap: int) -> ca.Function:
    options: dict[str, Any] = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": cap}}
    return ca.nlpsol("ipopt", "ipopt", symbols, options)
