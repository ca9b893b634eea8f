"""NNSEM: the paper's network for the acceleration, nu_dot = N_f(nu, a, w), trained with forward Euler steps."""

from __future__ import annotations

from typing import Any

from asvhil.dynamics.arrays import Array, namespace_of
from asvhil.dynamics.ordered import product
from asvhil.types import record


@record
class Scaling:
    """Centre and half width of each component of z in the training set: (z - centre) / half lies in [-1, 1]."""

    centre: Array
    half: Array


class TanhNetwork:
    """y = W2 tanh(W1 z + b1) + b2, one hidden layer; NumPy, CasADi or torch arrays."""

    def __init__(self, w1: Any, b1: Any, w2: Any, b2: Any) -> None:
        self._w1, self._b1, self._w2, self._b2 = w1, b1, w2, b2

    @classmethod
    def in_units(cls, w1: Array, b1: Array, w2: Array, b2: Array, scaling: Scaling) -> TanhNetwork:
        """A network trained on scaled inputs and outputs, as one from SI units to nu_dot (m/s^2, m/s^2, rad/s^2).

        The scaling is folded into the weights. The outputs are rates of the scaled (u, v, r), the first three inputs.
        """
        folded = w1 / scaling.half
        half_nu = scaling.half[:3]
        return cls(folded, b1 - product(folded, scaling.centre), half_nu[:, None] * w2, half_nu * b2)

    def __call__(self, z: Any) -> Any:
        xp = namespace_of(z)
        return xp.affine(self._w2, self._b2, xp.tanh(xp.affine(self._w1, self._b1, z)))


class Nnsem:
    """nu_dot = N_f(u, v, r, port, starboard, w_u, w_v), with the motor command as input and no motor states."""

    name = "nnsem"
    n_motor = 0
    input_lower = -1.0
    input_upper = 1.0
    euler = True

    def __init__(self, network: TanhNetwork, dt_s: float) -> None:
        self._network = network
        self.max_step_s = dt_s

    def derivative(self, x: Any, a: Any, wind: Any) -> Any:
        """nu_dot (..., 3) of x = (u, v, r) under command a (..., 2) and the true wind in body axes (..., 2; m/s)."""
        return self._network(namespace_of(x).concat([x, a, wind]))

    def command_of_input(self, a: tuple[float, float]) -> tuple[float, float]:
        return a

    def input_of_command(self, command: tuple[float, float]) -> tuple[float, float]:
        return command
