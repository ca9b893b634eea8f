"""LagNet, an improved NNSEM: a learned thrust map, a learned motor lag, and a network with skip terms.

One monotone map, shared by both motors, turns the command into thrust relative to full ahead. Each motor follows it
with a first-order lag. The acceleration is the sum of a small tanh network and of the skip terms, weighted products of
the scaled velocities, thrusts and winds. The map's output is the model's input, so that the optimisation has no dead
band.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from asvhil.dynamics.arrays import Array, namespace_of
from asvhil.dynamics.nnsem import TanhNetwork
from asvhil.dynamics.ordered import product
from asvhil.dynamics.table import Table

MAP_POINTS = 4001
# Each skip term is the product of these components of z; of a component with itself, x |x|.
SKIP_FACTORS = (
    *((0,), (1,), (2,), (0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)),
    *((3,), (4,), (5,), (6,), (5, 5), (6, 6), (5, 6)),
)
STATE_LIMIT = 2.0  # times the training range: beyond it the velocity terms are constant


class ThrustMap:
    """T(c) = (g(c) - g(0)) / (g(1) - g(0)), g(c) = sum_i gain_i tanh(slope_i (c - centre_i)), all gains and slopes > 0.

    It is strictly increasing, with T(0) = 0 and T(1) = 1. Values and inverse are interpolated in a table of MAP_POINTS.
    """

    def __init__(self, gain: Array, slope: Array, centre: Array) -> None:
        command = np.linspace(-1.0, 1.0, MAP_POINTS)
        bent = np.vectorize(math.tanh)(slope * (command[:, None] - centre))
        g = product(bent, gain)
        middle = g[MAP_POINTS // 2]
        thrust: Array = (g - middle) / (g[-1] - middle)
        self.astern = float(thrust[0])
        self._thrust_of, self._command_of = Table(command, thrust), Table(thrust, command)

    def thrust(self, command: float) -> float:
        """Thrust of one motor, relative to full ahead, at a command in [-1, 1]."""
        return self._thrust_of.at(command)

    def command(self, thrust: float) -> float:
        """The command in [-1, 1] that gives a relative thrust, clamped to the map's range."""
        return self._command_of.at(thrust)


class LagNet:
    """State (u, v, r, port, starboard thrust), input (port, starboard) thrust demand; thrusts relative to full ahead.

    `skip` (3, 16) weighs the terms of `skip_terms`; `half` (7) scales (u, v, r, port, starboard, w_u, w_v). `direct`
    in [0, 1] is the part of a change of demand that acts within the same Euler step.
    """

    name = "lagnet"
    n_motor = 2
    input_upper = 1.0
    euler = True

    def __init__(
        self,
        thrust_map: ThrustMap,
        lag_s: float,
        direct: float,
        network: TanhNetwork,
        skip: Array,
        half: Array,
        dt_s: float,
    ) -> None:
        self._map, self._lag_s, self._direct = thrust_map, lag_s, direct
        self._network, self._skip, self._half = network, skip, half
        self._no_bias = np.zeros(3)
        self.input_lower = thrust_map.astern
        self.max_step_s = dt_s

    def derivative(self, x: Any, a: Any, wind: Any) -> Any:
        """x_dot (..., 5) of x under thrust demands a (..., 2) and the true wind in body axes (..., 2; m/s)."""
        xp = namespace_of(x)
        u, v, r, port, starboard = (xp.component(x, i) for i in range(5))
        to_port, to_starboard = xp.component(a, 0) - port, xp.component(a, 1) - starboard
        z = xp.stack(
            [
                u,
                v,
                r,
                port + self._direct * to_port,
                starboard + self._direct * to_starboard,
                xp.component(wind, 0),
                xp.component(wind, 1),
            ]
        )
        nu_dot = self._network(z) + xp.affine(self._skip, self._no_bias, skip_terms(xp, z, self._half))
        motors = [to_port / self._lag_s, to_starboard / self._lag_s]
        return xp.concat([nu_dot, xp.stack(motors)])

    def command_of_input(self, a: tuple[float, float]) -> tuple[float, float]:
        return self._map.command(a[0]), self._map.command(a[1])

    def input_of_command(self, command: tuple[float, float]) -> tuple[float, float]:
        return self._map.thrust(command[0]), self._map.thrust(command[1])


def skip_terms(xp: Any, z: Any, half: Array) -> Any:
    """The 16 skip terms (..., 16) of z = (u, v, r, port, starboard, w_u, w_v), each component over its half width.

    (u, v, r), their x |x|, (u v, v r, r u), the two thrusts, (w_u, w_v), their w |w|, and w_u w_v.
    """
    u, v, r = (clip(xp.component(z, i) / half[i], STATE_LIMIT) for i in range(3))
    port, starboard, w_u, w_v = (xp.component(z, i) / half[i] for i in range(3, 7))
    return xp.stack(
        [
            *(u, v, r, u * abs(u), v * abs(v), r * abs(r), u * v, v * r, r * u),
            *(port, starboard, w_u, w_v, w_u * abs(w_u), w_v * abs(w_v), w_u * w_v),
        ]
    )


def clip(x: Any, limit: float) -> Any:
    """x clamped to +-limit, written with abs(), which all three kinds of array have."""
    return 0.5 * (abs(x + limit) - abs(x - limit))
