"""A vessel model whose thrusts and responses can be corrected while it runs, by factors that are states of it."""

from __future__ import annotations

from typing import Any

from asvhil.dynamics.arrays import namespace_of
from asvhil.dynamics.protocol import Dynamics

# Thrust of each motor, and the whole acceleration in surge, sway and yaw. A heavier boat has less of the latter, and by
# the same thrust it turns as fast in the end, since the drag decides that; by a weak motor it does not.
FACTORS = ("port", "starboard", "surge", "sway", "yaw")
COUNT = len(FACTORS)


class CorrectedModel:
    """The model with `FACTORS`, each kept less 1 in the last states: all zero is the model itself.

    Factors have no motion of their own. As states they are at hand wherever the model is: in the filter, in the plan,
    in the monitor, and nothing is built again when they change.

    A thrust is multiplied where the model has it as a state; elsewhere its effect is, the difference that the motor's
    input makes: exact where the thrust is linear in it, and right for each input by itself in a network.
    """

    def __init__(self, model: Dynamics) -> None:
        self.model = model
        self.name = model.name
        self.n_motor = model.n_motor + COUNT
        self.input_lower, self.input_upper = model.input_lower, model.input_upper
        self.max_step_s, self.euler = model.max_step_s, model.euler
        self._of_thrust = model.n_motor == 2

    def derivative(self, x: Any, a: Any, wind: Any) -> Any:
        """x_dot (..., 3 + n_motor) of x = (u, v, r, motor states ..., factors - 1 ...); zero for the factors."""
        xp = namespace_of(x)
        first = 3 + self.model.n_motor
        own = [xp.component(x, i) for i in range(first)]
        port, starboard, surge, sway, yaw = (1.0 + xp.component(x, first + i) for i in range(COUNT))
        a_port, a_starboard = xp.component(a, 0), xp.component(a, 1)
        if self._of_thrust:
            scaled = xp.stack([*own[:3], port * own[3], starboard * own[4]])
            rate = self.model.derivative(scaled, xp.stack([port * a_port, starboard * a_starboard]), wind)
            motors = [xp.component(rate, 3) / port, xp.component(rate, 4) / starboard]
            nu_dot = [xp.component(rate, i) for i in range(3)]
        else:
            state = xp.stack(own)
            rate = self.model.derivative(state, a, wind)
            idle = self.model.input_of_command((0.0, 0.0))
            without_port = self.model.derivative(state, xp.stack([idle[0] + 0.0 * a_port, a_starboard]), wind)
            without_starboard = self.model.derivative(state, xp.stack([a_port, idle[1] + 0.0 * a_starboard]), wind)
            nu_dot = [
                whole
                + (port - 1.0) * (whole - xp.component(without_port, i))
                + (starboard - 1.0) * (whole - xp.component(without_starboard, i))
                for i, whole in enumerate(xp.component(rate, i) for i in range(3))
            ]
            motors = [xp.component(rate, 3 + i) for i in range(self.model.n_motor)]
        still = [0.0 * sway] * COUNT
        return xp.stack([surge * nu_dot[0], sway * nu_dot[1], yaw * nu_dot[2], *motors, *still])

    def command_of_input(self, a: tuple[float, float]) -> tuple[float, float]:
        """The motor command (port, starboard) in [-1, 1] for input a, as of the model."""
        return self.model.command_of_input(a)

    def input_of_command(self, command: tuple[float, float]) -> tuple[float, float]:
        """The input for a motor command (port, starboard) in [-1, 1], as of the model."""
        return self.model.input_of_command(command)


def has_lag(model: Dynamics) -> bool:
    """Whether a model, corrected or not, has states of the motors."""
    return (model.model if isinstance(model, CorrectedModel) else model).n_motor > 0
