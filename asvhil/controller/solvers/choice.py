"""The solver that a config names. It is imported only when chosen, so that torch is not loaded otherwise."""

from __future__ import annotations

from collections.abc import Callable

from asvhil.config import ControllerConfig, MpcConfig
from asvhil.config.registry import SOLVERS
from asvhil.controller.solvers.problem import Solver, StationProblem
from asvhil.errors import ConfigError


def choose_solver(config: ControllerConfig) -> tuple[MpcConfig, Callable[[StationProblem], Solver]]:
    """The MPC config with the solver's iteration caps, and the function that builds the solver of a problem.

    Raises ConfigError, also from that function, where the solver's package is not installed.
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
