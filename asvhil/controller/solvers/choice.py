"""The solver that a config asks for, imported only then: torch and the solvers of CasADi stay out of the rest."""

from __future__ import annotations

from collections.abc import Callable

from asvhil.config import ControllerConfig, MpcConfig
from asvhil.controller.solvers.problem import Solver, StationProblem
from asvhil.controller.solvers.sqp import Sqp
from asvhil.errors import ConfigError


def choose_solver(config: ControllerConfig) -> tuple[MpcConfig, Callable[[StationProblem], Solver]]:
    """The MPC config with that solver's caps of iterations, and what makes it of a problem.

    Raises ConfigError, also from the making, where the solver's package is not installed.
    """
    if config.solver == "sqp":
        return config.mpc, Sqp
    caps = {"ipopt": config.ipopt, "fatrop": config.fatrop, "torch-lqr": config.torch_lqr}[config.solver]
    mpc = config.mpc.model_copy(
        update={"iterations": caps.iterations, "alternate_iterations": caps.alternate_iterations}
    )
    prepared = [cap for cap in (caps.iterations, caps.alternate_iterations) if cap]
    match config.solver:
        case "ipopt":
            from asvhil.controller.solvers.ipopt import Ipopt

            return mpc, lambda problem: Ipopt(problem, prepared)
        case "fatrop":
            from asvhil.controller.solvers.fatrop import Fatrop

            return mpc, lambda problem: Fatrop(problem, prepared)
        case "torch-lqr":
            try:
                from asvhil.controller.solvers.torch_lqr import TorchLqr
            except ImportError:
                raise ConfigError("controller.solver torch-lqr needs torch: install asvhil[train]") from None
            return mpc, TorchLqr
