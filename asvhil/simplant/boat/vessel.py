"""The true motion of the simulated boat: 3-DOF rigid body in wind, waves and a current, two lagging motors."""

from __future__ import annotations

import math
from bisect import bisect_right

from asvhil.config import PlantMotorsConfig, PwmConfig, TiltConfig, VesselConfig
from asvhil.dynamics.rigid_body import RigidBody
from asvhil.dynamics.wind_load import WindLoad
from asvhil.geo import GRAVITY_MPS2
from asvhil.simplant.boat.imperfect_motors import ImperfectMotors
from asvhil.simplant.boat.waves import Waves

NO_SIGNAL_US = 0


class MotorTable:
    """Pulse width (us) to the steady thrust (N) of a motor: the measured curve, linear between its rows."""

    def __init__(self, vessel: VesselConfig, pwm: PwmConfig) -> None:
        self._commands = [row[0] for row in vessel.thrust_curve]
        self._thrusts_n = [row[1] for row in vessel.thrust_curve]
        self._pwm = pwm

    def command(self, pulse_us: float) -> float:
        """The command in [-1, 1] of a pulse width; zero without a signal."""
        pwm = self._pwm
        if pulse_us == NO_SIGNAL_US:
            return 0.0
        if pulse_us >= pwm.neutral_us:
            return min(1.0, (pulse_us - pwm.neutral_us) / (pwm.ahead_us - pwm.neutral_us))
        return max(-1.0, (pulse_us - pwm.neutral_us) / (pwm.neutral_us - pwm.astern_us))

    def thrust_n(self, pulse_us: float) -> float:
        """Steady thrust of a pulse width; zero without a signal. Constant beyond the ends of the curve."""
        if pulse_us == NO_SIGNAL_US:
            return 0.0
        command = self.command(pulse_us)
        x, y = self._commands, self._thrusts_n
        if command <= x[0]:
            return y[0]
        if command >= x[-1]:
            return y[-1]
        i = bisect_right(x, command)
        return y[i - 1] + (y[i] - y[i - 1]) * (command - x[i - 1]) / (x[i] - x[i - 1])


class Trim:
    """Roll and pitch of a boat in still water, by its load and by the thrust of both motors (N)."""

    def __init__(self, config: TiltConfig, full_n: float) -> None:
        self._roll_rad, self._pitch_rad = math.radians(config.roll_deg), math.radians(config.pitch_deg)
        self._per_n = math.radians(config.thrust_deg) / full_n

    def at(self, thrust_n: float) -> tuple[float, float]:
        return self._roll_rad, self._pitch_rad + self._per_n * thrust_n


class Vessel:
    """Truth: pose in NED, velocity through the water in body axes, thrusts; integrated by Heun's method in fixed steps.

    The state moves with the water, so a constant current is exact: the Coriolis terms see only the relative velocity
    (Fossen 2011, property 8.1). Wave motion is superposed: it is added to the integrated motion, and every
    attribute has the sum. Plain attributes and floats, because `step` is the hot path of every simulation.
    """

    __slots__ = (
        "_acceleration",
        "_current_e",
        "_current_n",
        "_demand_port_n",
        "_demand_starboard_n",
        "_imperfect",
        "_lag_gain",
        "_motor_forces",
        "_motor_lag_s",
        "_motors",
        "_steady_n",
        "_step_s",
        "_still",
        "_thrust_left",
        "_trim",
        "_waves",
        "_wind_forces",
        "ax_mps2",
        "ay_mps2",
        "e_m",
        "motor_commands",
        "n_m",
        "outputs_us",
        "pitch_rad",
        "psi_rad",
        "r_radps",
        "roll_rad",
        "thrust_port_n",
        "thrust_starboard_n",
        "u_mps",
        "v_mps",
    )

    def __init__(
        self,
        vessel: VesselConfig,
        pwm: PwmConfig,
        step_s: float,
        pose: tuple[float, float, float],
        current_mps: tuple[float, float] = (0.0, 0.0),
        waves: Waves | None = None,
        wind_load: WindLoad | None = None,
        imperfect: PlantMotorsConfig | None = None,
        tilt: TiltConfig | None = None,
    ) -> None:
        """`wind_load` is in the place of the vessel's own law; without `imperfect` its thrust curve is what is.

        Without `tilt` the boat is on an even keel but for the waves.
        """
        body = RigidBody(vessel, wind_load)
        # Held as they are: each is called 200 times in a second of the boat.
        self._motor_forces, self._wind_forces = body.motor_forces, body.wind_forces
        self._acceleration = body.acceleration
        self._motors = MotorTable(vessel, pwm)
        self._motor_lag_s = vessel.motor_lag_s
        self.set_step(step_s)
        self._current_n, self._current_e = current_mps
        self._demand_port_n = self._demand_starboard_n = 0.0
        self._steady_n = (0.0, 0.0)
        self._imperfect = None if imperfect is None else ImperfectMotors(imperfect, vessel.thrust_curve[-1][1])
        self.outputs_us: tuple[int, int] = (NO_SIGNAL_US, NO_SIGNAL_US)
        self._thrust_left = (1.0, 1.0)
        self.motor_commands = (0.0, 0.0)
        self._still: tuple[float, ...] = ()
        self.n_m, self.e_m, self.psi_rad = pose
        self.thrust_port_n = self.thrust_starboard_n = 0.0
        self.ax_mps2 = self.ay_mps2 = 0.0  # acceleration over ground in body axes, at the end of the last step
        # At the start the boat is at rest relative to the water.
        self.u_mps = self.v_mps = self.r_radps = 0.0
        self.roll_rad = self.pitch_rad = 0.0  # starboard down, bow up
        self._trim = None if tilt is None else Trim(tilt, 2.0 * vessel.thrust_curve[-1][1])
        self._waves = waves
        self._tilt()
        if waves is not None:
            self._ride(waves)

    def set_step(self, step_s: float) -> None:
        """Steps of another length from now on."""
        self._step_s = step_s
        self._lag_gain = -math.expm1(-step_s / self._motor_lag_s)

    def drive(self, outputs_us: tuple[int, int], thrust_left: tuple[float, float] = (1.0, 1.0)) -> None:
        """Set the pulse widths (port, starboard) that the motors see from now on, and the share of their thrust."""
        if outputs_us != self.outputs_us or thrust_left != self._thrust_left:
            self.outputs_us, self._thrust_left = outputs_us, thrust_left
            port_us, starboard_us = outputs_us
            self.motor_commands = self._motors.command(port_us), self._motors.command(starboard_us)
            self._demand_port_n = thrust_left[0] * self._motors.thrust_n(port_us)
            self._demand_starboard_n = thrust_left[1] * self._motors.thrust_n(starboard_us)
            self._steady_n = self._demand_port_n, self._demand_starboard_n

    def ground_velocity_ned(self) -> tuple[float, float]:
        """North and east velocity over ground (m/s)."""
        c, s = math.cos(self.psi_rad), math.sin(self.psi_rad)
        return (
            c * self.u_mps - s * self.v_mps + self._current_n,
            s * self.u_mps + c * self.v_mps + self._current_e,
        )

    def ground_velocity_body(self) -> tuple[float, float]:
        """Surge and sway velocity over ground (m/s)."""
        c, s = math.cos(self.psi_rad), math.sin(self.psi_rad)
        return (
            self.u_mps + c * self._current_n + s * self._current_e,
            self.v_mps - s * self._current_n + c * self._current_e,
        )

    def step(self, wind_n_mps: float, wind_e_mps: float) -> None:
        """One step under a true wind that is held over it; the motor lag is exact, the rest second order."""
        waves = self._waves
        if waves is not None:
            self.n_m, self.e_m, self.psi_rad, self.u_mps, self.v_mps, self.r_radps = self._still
        dt = self._step_s
        air_n, air_e = wind_n_mps - self._current_n, wind_e_mps - self._current_e
        n, e, psi = self.n_m, self.e_m, self.psi_rad
        u, v, r = self.u_mps, self.v_mps, self.r_radps
        port, starboard = self.thrust_port_n, self.thrust_starboard_n
        if self._imperfect is not None:
            demands_n = self._imperfect.demands_n(self._steady_n, (port, starboard), dt)
            self._demand_port_n, self._demand_starboard_n = demands_n

        n1, e1, u1, v1, r1 = self._rates(psi, u, v, r, port, starboard, air_n, air_e)

        lag_gain = self._lag_gain
        self.thrust_port_n = port = port + lag_gain * (self._demand_port_n - port)
        self.thrust_starboard_n = starboard = starboard + lag_gain * (self._demand_starboard_n - starboard)
        psi_end, u_end, v_end, r_end = psi + dt * r, u + dt * u1, v + dt * v1, r + dt * r1
        n2, e2, u2, v2, r2 = self._rates(psi_end, u_end, v_end, r_end, port, starboard, air_n, air_e)

        half = 0.5 * dt
        self.n_m = n + half * (n1 + n2)
        self.e_m = e + half * (e1 + e2)
        self.psi_rad = psi + half * (r + r_end)
        self.u_mps = u = u + half * (u1 + u2)
        self.v_mps = v = v + half * (v1 + v2)
        self.r_radps = r = r + half * (r1 + r2)
        # Inertial acceleration in body axes, nu_dot + S(r) nu: the specific force at the origin.
        self.ax_mps2 = u2 - r * v
        self.ay_mps2 = v2 + r * u
        if waves is not None:
            waves.advance()
            self._ride(waves)
        elif self._trim is not None:
            self._tilt()

    def _tilt(self) -> None:
        """Roll and pitch without waves."""
        if self._trim is not None:
            self.roll_rad, self.pitch_rad = self._trim.at(self.thrust_port_n + self.thrust_starboard_n)
        else:
            self.roll_rad = self.pitch_rad = 0.0

    def _ride(self, waves: Waves) -> None:
        """Keep the motion without waves for the next step, and set the attributes to the sum of both.

        A surface that the water is accelerated on by its slope alone has the slope -a/g, so that a boat that lies in it
        feels no side force (linear waves; Fossen 2011, section 8.2.1).
        """
        psi, u, v, ax, ay = self.psi_rad, self.u_mps, self.v_mps, self.ax_mps2, self.ay_mps2
        self._still = self.n_m, self.e_m, psi, u, v, self.r_radps
        c, s = math.cos(psi), math.sin(psi)
        vn, ve = c * u - s * v + waves.vn_mps, s * u + c * v + waves.ve_mps
        an, ae = c * ax - s * ay + waves.an_mps2, s * ax + c * ay + waves.ae_mps2
        psi += waves.psi_rad
        c, s = math.cos(psi), math.sin(psi)
        self.n_m += waves.n_m
        self.e_m += waves.e_m
        self.psi_rad = psi
        self.r_radps += waves.r_radps
        self.u_mps, self.v_mps = c * vn + s * ve, c * ve - s * vn
        self.ax_mps2, self.ay_mps2 = c * an + s * ae, c * ae - s * an
        slope = waves.tilt / GRAVITY_MPS2
        self._tilt()
        self.roll_rad += math.atan(slope * (c * waves.ae_mps2 - s * waves.an_mps2))
        self.pitch_rad -= math.atan(slope * (c * waves.an_mps2 + s * waves.ae_mps2))

    def _rates(
        self,
        psi: float,
        u: float,
        v: float,
        r: float,
        port_n: float,
        starboard_n: float,
        air_n: float,
        air_e: float,
    ) -> tuple[float, float, float, float, float]:
        """(n_dot, e_dot over ground, u_dot, v_dot, r_dot); `air` is the wind relative to the water."""
        c, s = math.cos(psi), math.sin(psi)
        x_n, n_nm = self._motor_forces(port_n, starboard_n)
        x_w, y_w, n_w = self._wind_forces(c * air_n + s * air_e - u, c * air_e - s * air_n - v)
        u_dot, v_dot, r_dot = self._acceleration(u, v, r, x_n + x_w, y_w, n_nm + n_w)
        return c * u - s * v + self._current_n, s * u + c * v + self._current_e, u_dot, v_dot, r_dot
