"""What every vessel model offers to the estimator and the controller."""

from __future__ import annotations

from typing import Any, Protocol


class Dynamics(Protocol):
    """A continuous-time model of nu = (u, v, r) and of the motors, for NumPy, CasADi and torch arrays alike.

    The model's state is x = (u, v, r, motor states ...), of length 3 + n_motor. Its input a = (port, starboard) is
    what the controller optimises, within [input_lower, input_upper]; `command_of_input` turns it into the paper's
    PWM command in [-1, 1] (the identity for models that are driven by the command itself).
    """

    name: str
    n_motor: int
    input_lower: float
    input_upper: float
    max_step_s: float  # longest integration step for which the model holds
    euler: bool  # integrate by forward Euler (a network trained so) rather than by Runge-Kutta

    def derivative(self, x: Any, a: Any, wind: Any) -> Any:
        """x_dot of the state x (3 + n_motor), under input a (2) and true wind in body axes (2, m/s)."""

    def command_of_input(self, a: tuple[float, float]) -> tuple[float, float]:
        """The motor command in [-1, 1] that realises input a."""

    def input_of_command(self, command: tuple[float, float]) -> tuple[float, float]:
        """The model's input under a motor command in [-1, 1]."""
