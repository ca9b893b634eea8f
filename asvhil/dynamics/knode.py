"""KNODE: prior physics and a network, coupled by a second network (the paper's g_lambda) that is trained with it."""

from __future__ import annotations

from typing import Any

from asvhil.dynamics.arrays import namespace_of
from asvhil.dynamics.fitted_sd import FittedSd
from asvhil.dynamics.nnsem import TanhNetwork
from asvhil.dynamics.node import LONGEST_STEP_S


class Knode:
    """nu_dot = g_lambda(f_prior(nu, a, w), f_theta(nu, a, w)), with the motor command as input and no motor states."""

    name = "knode"
    n_motor = 0
    input_lower = -1.0
    input_upper = 1.0
    euler = False

    def __init__(self, prior: FittedSd, network: TanhNetwork, coupling: TanhNetwork, dt_s: float) -> None:
        self._prior, self._network, self._coupling = prior, network, coupling
        self.max_step_s = max(dt_s, LONGEST_STEP_S)

    def derivative(self, x: Any, a: Any, wind: Any) -> Any:
        """nu_dot (..., 3) of x = (u, v, r) under command a (..., 2) and the true wind in body axes (..., 2; m/s)."""
        xp = namespace_of(x)
        prior = self._prior.derivative(x, a, wind)
        return self._coupling(xp.concat([prior, self._network(xp.concat([x, a, wind]))]))

    def command_of_input(self, a: tuple[float, float]) -> tuple[float, float]:
        return a

    def input_of_command(self, command: tuple[float, float]) -> tuple[float, float]:
        return command
