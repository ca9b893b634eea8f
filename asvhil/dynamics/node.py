"""NODE: the network of NNSEM as the right-hand side of a neural ordinary differential equation."""

from __future__ import annotations

from asvhil.dynamics.nnsem import Nnsem


class Node(Nnsem):
    """As NNSEM, but trained through an ODE solver of fourth order, so it is no Euler model: any fine step will do."""

    name = "node"
    euler = False
