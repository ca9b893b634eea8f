"""SD fitted to data: the paper's simplified dynamics, each equation divided by its mass, with linear thrust."""

from __future__ import annotations

from typing import Any

from asvhil.dynamics.arrays import namespace_of

# Magnitudes (>= 0) in SI units, divided by the mass (m_u, m_v) or inertia (m_r) of their equation.
PARAMETERS = (
    "thrust_surge",  # K / m_u, per unit of command
    "thrust_yaw",  # B K / (2 m_r)
    "mass_ratio",  # m_v / m_u
    "munk_yaw",  # (m_v - m_u) / m_r
    "drag_u",
    "drag_uu",
    "drag_v",
    "drag_vv",
    "drag_r",
    "drag_rr",
    "wind_surge",
    "wind_sway",
    "wind_yaw",
)


class FittedSd:
    """The simplified dynamics with thrust K (u_p + u_s), moment K B/2 (u_p - u_s) of the command, and no motor lag.

    `parameters` (13) are in the order of PARAMETERS: numbers, or CasADi symbols during the fit.
    """

    name = "sd"
    n_motor = 0
    input_lower = -1.0
    input_upper = 1.0
    euler = False

    def __init__(self, parameters: Any, max_step_s: float) -> None:
        self._p = parameters
        self.max_step_s = max_step_s

    def derivative(self, x: Any, a: Any, wind: Any) -> Any:
        """nu_dot (..., 3) of x = (u, v, r) under command a (..., 2) and the true wind in body axes (..., 2; m/s)."""
        xp = namespace_of(x)
        p = self._p
        u, v, r = (xp.component(x, i) for i in range(3))
        port, starboard = xp.component(a, 0), xp.component(a, 1)
        air_u, air_v = xp.component(wind, 0) - u, xp.component(wind, 1) - v
        return xp.stack(
            [
                p[0] * (port + starboard) + p[2] * v * r - (p[4] + p[5] * abs(u)) * u + p[10] * air_u * abs(air_u),
                -u * r / p[2] - (p[6] + p[7] * abs(v)) * v + p[11] * air_v * abs(air_v),
                p[1] * (port - starboard) - p[3] * u * v - (p[8] + p[9] * abs(r)) * r - p[12] * air_u * air_v,
            ]
        )

    def command_of_input(self, a: tuple[float, float]) -> tuple[float, float]:
        return a

    def input_of_command(self, command: tuple[float, float]) -> tuple[float, float]:
        return command
