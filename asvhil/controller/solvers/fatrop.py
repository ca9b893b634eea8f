"""fatrop through CasADi: an interior point method that uses the stagewise structure (Vanroye et al. 2023)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from asvhil.controller.solvers.nlp import NlpSolver
from asvhil.controller.solvers.problem import StationProblem
from asvhil.errors import ConfigError


class Fatrop(NlpSolver):
    """fatrop with its structure detected from the order of variables and constraints.

    Raises ConfigError where this build of CasADi comes without fatrop.
    """

    def __init__(self, problem: StationProblem, caps: Sequence[int] = ()) -> None:
        if not available():
            raise ConfigError("controller.solver fatrop: this build of CasADi comes without fatrop; use sqp or ipopt")
        super().__init__(problem, True, _make, caps)


def available() -> bool:
    """Whether this build of CasADi comes with fatrop."""
    return bool(ca.has_nlpsol("fatrop"))


def _make(symbols: dict[str, Any], cap: int) -> ca.Function:
    options: dict[str, Any] = {
        "print_time": False,
        "structure_detection": "auto",
        "equality": [True] * symbols["g"].numel(),
        "fatrop": {"print_level": 0, "max_iter": cap},
    }
    return ca.nlpsol("fatrop", "fatrop", symbols, options)
