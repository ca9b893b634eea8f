"""The interface of every vessel model, for estimator, controller and training."""

from __future__ import annotations

from typing import Any, Protocol


class Dynamics(Protocol):
    """A continuous-time model of nu = (u, v, r) and of the motors, for NumPy, CasADi and torch arrays.

    The model's state is x = (u, v, r, motor states ...), of length 3 + n_motor. Its input a = (port, starboard) is
    what the controller optimises, within [input_lower, input_upper]: relative thrust demands, or motor commands. The
    motor command in [-1, 1] is the paper's PWM signal.

    A model does not change once it is made: what is made of it is remembered by it (`remembered.by_model`).
    """

    name: str
    n_motor: int
    input_lower: float
    input_upper: float
    max_step_s: float  # longest integration step for which the model holds
    euler: bool  # integrate by forward Euler, as the network was trained, instead of the midpoint rule

    def derivative(self, x: Any, a: Any, wind: Any) -> Any:
        """x_dot (..., 3 + n_motor) of the state x under input a (..., 2) and true wind in body axes (..., 2; m/s).

        Velocities are over ground, in m/s and rad/s. The result is an array of the kind of x.
        """

    def command_of_input(self, a: tuple[float, float]) -> tuple[float, float]:
        """The motor command (port, starboard) in [-1, 1] for input a; the identity for models of the command."""

    def input_of_command(self, command: tuple[float, float]) -> tuple[float, float]:
        """The input for a motor command (port, starboard) in [-1, 1]."""
