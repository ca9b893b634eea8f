"""The solver that a config asks for, imported only then: torch and the solvers of CasADi stay out of the rest."""

from __future__ import annotations

from collections.abc import Callable

from asvhil.config import ControllerConfig, MpcConfig
from asvhil.config.registry import SOLVERS
from asvhil.controller.solvers.problem import Solver, StationProblem
from asvhil.errors import ConfigError


def choose_solver(config: ControllerConfig) -> tuple[MpcConfig, Callable[[StationProblem], Solver]]:
    """The MPC config with that solver's caps of iterations, and what makes it of a problem.

    Raises ConfigError, also from the making, where the solver's package is not installed.
    """
    kind, mpc = SOLVERS.find(config.solver), config.mpc
    try:
        build = kind.builder()
    except ImportError as error:
        raise ConfigError(f"controller.solver {kind.name} {kind.missing or f'cannot be loaded: {error}'}") from None
    if kind.section is not None:
        own = getattr(config, kind.settings_key)
        mpc = mpc.model_copy(update={name: getattr(own, name) for name in ("iterations", "alternate_iterations")})
    caps = tuple(cap for cap in (mpc.iterations, mpc.alternate_iterations) if cap)
    return mpc, lambda problem: build(problem, caps)
