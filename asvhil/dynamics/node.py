"""NODE: the network of NNSEM as the right-hand side of a neural ordinary differential equation."""

from __future__ import annotations

from asvhil.dynamics.nnsem import Nnsem, TanhNetwork

LONGEST_STEP_S = 0.45  # of the midpoint rule: these models have no motor lag, and hulls respond within seconds


class Node(Nnsem):
    """NNSEM's network as a continuous-time model: trained with a fourth-order solver, so any small step holds."""

    name = "node"
    euler = False

    def __init__(self, network: TanhNetwork, dt_s: float) -> None:
        super().__init__(network, max(dt_s, LONGEST_STEP_S))
