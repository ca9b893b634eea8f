"""SD: the paper's 3-DOF dynamics (Fossen 2011, eq. 6.109 in the plane) with wind load and motor lag."""

from __future__ import annotations

from typing import Any

import numpy as np

from asvhil.config import VesselConfig
from asvhil.dynamics.arrays import namespace_of
from asvhil.dynamics.coupling import CoupledBody
from asvhil.dynamics.table import Table
from asvhil.dynamics.wind_load import QuadraticWind, WindLoad


class RigidBody:
    """M nu_dot + C(nu) nu + D(nu) nu = tau + tau_w: the paper's simplified dynamics, whose centre of gravity is at the
    origin, or its full ones where the vessel has terms that couple sway and yaw.

    Works on components of any kind (float, CasADi, NumPy or torch), so that plant and model share the equations.
    """

    def __init__(self, vessel: VesselConfig, wind_load: WindLoad | None = None) -> None:
        """`wind_load` in the place of the vessel's own law."""
        self._m_u = vessel.mass_kg + vessel.added_mass_surge_kg
        self._m_v = vessel.mass_kg + vessel.added_mass_sway_kg
        self._m_r = vessel.inertia_yaw_kgm2 + vessel.added_inertia_yaw_kgm2
        self._d_u, self._d_uu = vessel.surge_drag_n_per_mps, vessel.surge_drag_n_per_mps2
        self._d_v, self._d_vv = vessel.sway_drag_n_per_mps, vessel.sway_drag_n_per_mps2
        self._d_r, self._d_rr = vessel.yaw_drag_nm_per_radps, vessel.yaw_drag_nm_per_radps2
        self._arm = vessel.motor_arm_m
        # Held as it is, not behind a method of this class: the simulated boat calls it hundreds of times a second.
        self.wind_forces = (wind_load or QuadraticWind(vessel)).forces
        self._coupled = None if vessel.coupling is None else CoupledBody(vessel, vessel.coupling)

    def motor_forces(self, port_n: Any, starboard_n: Any) -> tuple[Any, Any]:
        """Surge force (N) and yaw moment (N m) of the two thrusts (N)."""
        return port_n + starboard_n, self._arm * (port_n - starboard_n)

    def acceleration(self, u: Any, v: Any, r: Any, x_n: Any, y_n: Any, n_nm: Any) -> tuple[Any, Any, Any]:
        """nu_dot (m/s^2, m/s^2, rad/s^2) of u, v (m/s), r (rad/s) under forces X, Y (N) and moment N (N m)."""
        if self._coupled is not None:
            return self._coupled.acceleration(u, v, r, x_n, y_n, n_nm)
        u_dot = (x_n + self._m_v * v * r - (self._d_u + self._d_uu * abs(u)) * u) / self._m_u
        v_dot = (y_n - self._m_u * u * r - (self._d_v + self._d_vv * abs(v)) * v) / self._m_v
        r_dot = (n_nm + (self._m_u - self._m_v) * u * v - (self._d_r + self._d_rr * abs(r)) * r) / self._m_r
        return u_dot, v_dot, r_dot


class ThrustCurve:
    """Thrust (N) of one motor at a command in [-1, 1], by linear interpolation in a table, and its inverse."""

    def __init__(self, rows: tuple[tuple[float, float], ...]) -> None:
        command = np.array([row[0] for row in rows])
        thrust_n = np.array([row[1] for row in rows])
        dead = command[thrust_n == 0.0]
        if not dead.size:  # the curve crosses zero between two rows
            dead = np.interp([0.0], thrust_n, command)
        # The inverse steps across the dead band: each side ends at its own edge of it.
        below, above = thrust_n < 0.0, thrust_n > 0.0
        self._thrust_of = Table(command, thrust_n)
        self._command_astern = Table(np.append(thrust_n[below], 0.0), np.append(command[below], dead[0]))
        self._command_ahead = Table(np.append(0.0, thrust_n[above]), np.append(dead[-1], command[above]))
        self._idle = float(np.clip(0.0, dead[0], dead[-1]))
        self.astern_n = float(thrust_n[0])
        self.ahead_n = float(thrust_n[-1])

    def thrust_n(self, command: float) -> float:
        """Thrust (N) at a command, clamped to the table's ends."""
        return self._thrust_of.at(command)

    def command(self, thrust_n: float) -> float:
        """The command that gives a thrust (N), clamped to the table's ends; for zero thrust, that nearest to 0."""
        if thrust_n > 0.0:
            return self._command_ahead.at(thrust_n)
        return self._command_astern.at(thrust_n) if thrust_n < 0.0 else self._idle


class SimplifiedDynamics:
    """The SD model: rigid body, wind load, and a first-order lag of each motor.

    Input and motor states are thrust demands and thrusts relative to full ahead. The known thrust curve is inverted
    outside of the optimisation, which therefore has no dead band.
    """

    name = "sd"
    n_motor = 2
    euler = False

    def __init__(
        self, vessel: VesselConfig, wind_load: WindLoad | None = None, shares: tuple[float, float] = (1.0, 1.0)
    ) -> None:
        """`wind_load` in the place of the vessel's own law; (port, starboard) give `shares` of the curve's thrust."""
        self._body = RigidBody(vessel, wind_load)
        self._curve = ThrustCurve(vessel.thrust_curve)
        self._scale_n = self._curve.ahead_n
        self._port_n, self._starboard_n = (share * self._scale_n for share in shares)
        self._lag_s = vessel.motor_lag_s
        self.max_step_s = min(0.45, 1.5 * vessel.motor_lag_s)  # the midpoint rule is stable to twice the lag
        self.input_lower = self._curve.astern_n / self._scale_n
        self.input_upper = 1.0

    def derivative(self, x: Any, a: Any, wind: Any) -> Any:
        """x_dot (..., 5) of x = (u, v, r, T_port, T_starboard) under thrust demands a and true wind in body axes."""
        xp = namespace_of(x)
        u, v, r, port, starboard = (xp.component(x, i) for i in range(5))
        x_n, n_nm = self._body.motor_forces(self._port_n * port, self._starboard_n * starboard)
        x_w, y_w, n_w = self._body.wind_forces(xp.component(wind, 0) - u, xp.component(wind, 1) - v)
        u_dot, v_dot, r_dot = self._body.acceleration(u, v, r, x_n + x_w, y_w, n_nm + n_w)
        return xp.stack(
            [
                u_dot,
                v_dot,
                r_dot,
                (xp.component(a, 0) - port) / self._lag_s,
                (xp.component(a, 1) - starboard) / self._lag_s,
            ]
        )

    def command_of_input(self, a: tuple[float, float]) -> tuple[float, float]:
        port, starboard = (self._curve.command(self._scale_n * part) for part in a)
        return port, starboard

    def input_of_command(self, command: tuple[float, float]) -> tuple[float, float]:
        port, starboard = (self._curve.thrust_n(part) / self._scale_n for part in command)
        return port, starboard
