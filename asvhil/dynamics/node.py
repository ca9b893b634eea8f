"""NODE: the network of NNSEM as the right-hand side of a neural ordinary differential equation."""

from __future__ import annotations

from asvhil.dynamics.nnsem import Nnsem, TanhNetwork

LONGEST_STEP_S = 0.45  # of the midpoint rule: hulls answer within seconds, and motor lags are not in these models


class Node(Nnsem):
    """As NNSEM, but trained through an ODE solver of fourth order, so it is no Euler model: any fine step will do."""

    name = "node"
    euler = False

    def __init__(self, network: TanhNetwork, dt_s: float) -> None:
        super().__init__(network, max(dt_s, LONGEST_STEP_S))
