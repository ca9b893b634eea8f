"""A bank of Kalman filters, one for each hypothesis of how the boat answers its commands, evaluated together.

Each has the state (v_n, v_e, r, d_n, d_e, d_r, g, c_n, c_e): velocity over ground in NED, yaw rate, the acceleration
that nothing explains (wind, a wrong hull), the gain of the thrust, and the current. It predicts with the rigid body of
the config, the thrust that its hypothesis makes of the commands, and the heading that it makes of the compass's. The
likelihood of what is then measured tells the hypotheses apart (multiple-model estimation: Bar-Shalom, Li and
Kirubarajan 2001, ch. 11.6).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from asvhil.config import VesselConfig
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.rigid_body import RigidBody
from asvhil.motion.hypotheses import Hypothesis
from asvhil.types import record

VN, VE, R, DN, DE, DR, G, CN, CE = range(9)
SIZE = 9
TRANSIT_S = 0.2
GAINS = (0.6, 3.0)  # so that no hypothesis becomes another one: at a gain of -1 a sound boat would be a reversed one


@record
class BankNoise:
    """How far the bank's physics may be wrong. Walks are per sqrt(s).

    A part of the walks grows with the thrust: lag, curve and hull are never quite known. The disturbance and the gain
    forget: they are drawn to 0 and 1. `timing_s`: how early or late a thrust may come, or its effect be seen.
    """

    velocity_std_mps: float
    yaw_rate_std_radps: float
    velocity_walk_mps: float = 0.05
    yaw_walk_radps: float = 0.03
    of_thrust: float = 0.10
    heading_std_rad: float = 0.10
    disturbance_mps2: float = 0.08
    disturbance_yaw_radps2: float = 0.04
    disturbance_time_s: float = 20.0
    gain_std: float = 0.20
    gain_time_s: float = 40.0
    current_mps: float = 0.15
    timing_s: float = 0.15


class Bank:
    """`predict`, then `correct` with what was measured: the logarithms of its likelihoods, one for each hypothesis."""

    def __init__(self, hypotheses: Sequence[Hypothesis], vessel: VesselConfig, noise: BankNoise) -> None:
        self._body = RigidBody(vessel)
        self._commands, self._thrusts_n = np.array(vessel.thrust_curve).T
        self._vessel = vessel
        self._noise = noise
        self._count = len(hypotheses)
        self._off = np.array([h.off_rad for h in hypotheses])
        self._source = np.array([h.source for h in hypotheses])
        self._sign = np.array([[math.copysign(1.0, share) for share in h.share] for h in hypotheses])
        self._share = np.abs(np.array([h.share for h in hypotheses]))
        self._m_u = vessel.mass_kg + vessel.added_mass_surge_kg
        self._m_v = vessel.mass_kg + vessel.added_mass_sway_kg
        self._m_r = vessel.inertia_yaw_kgm2 + vessel.added_inertia_yaw_kgm2
        self.thrust_n = np.zeros((self._count, 2))
        self._transit_n = 0.0  # how far the thrusts have been from what is commanded
        self.x: Array = np.zeros((self._count, SIZE))
        self.p: Array = np.zeros((self._count, SIZE, SIZE))
        self.reset((0.0, 0.0), 0.0)

    def reset(self, velocity_ned: tuple[float, float], yaw_rate: float) -> None:
        """Start all of them at a velocity and a yaw rate, with nothing known of disturbance and gain.

        What moves may have way on, or be carried: half of the velocity is taken for a current, give or take half.
        """
        vn, ve = velocity_ned
        self.x[:] = 0.0
        self.x[:, VN], self.x[:, VE], self.x[:, R], self.x[:, G] = vn, ve, yaw_rate, 1.0
        self.x[:, CN], self.x[:, CE] = 0.5 * vn, 0.5 * ve
        self.p[:] = np.diag(self._prior())
        self.p[:, CN : CE + 1, CN : CE + 1] += 0.25 * np.outer(velocity_ned, velocity_ned)
        self.thrust_n[:] = 0.0
        self._transit_n = 0.0

    @property
    def current_ned(self) -> tuple[float, float]:
        """The current (m/s) by the first hypothesis."""
        return float(self.x[0, CN]), float(self.x[0, CE])

    def restart(self, which: Array, like: int) -> None:
        """Start some of them again, as if their fault began now: with the motion and disturbance of another one."""
        self.x[which] = self.x[like]
        self.p[which] = self.p[like]
        self.x[which, G] = 1.0
        self.p[which, G, :] = self.p[which, :, G] = 0.0
        self.p[which, G, G] = self._noise.gain_std**2

    def demand_n(self, command: tuple[float, float]) -> Array:
        """Steady thrusts (N) of the motors (H, 2) for commands in [-1, 1]."""
        both = np.array(command)[self._source] * self._sign
        steady_n: Array = self._share * np.interp(both, self._commands, self._thrusts_n)
        return steady_n

    def lag(self, command: tuple[float, float], dt_s: float) -> None:
        """Move the thrusts toward those of a command that is held for a time."""
        gain = -math.expm1(-dt_s / self._vessel.motor_lag_s)
        transit_n = self.demand_n(command) - self.thrust_n
        self.thrust_n += gain * transit_n
        self._transit_n += dt_s / (dt_s + TRANSIT_S) * (float(np.abs(transit_n[0]).sum()) - self._transit_n)

    def predict(self, dt_s: float, heading_rad: float, wind_ned: tuple[float, float] | None) -> None:
        """One step with the present thrusts and the compass's heading."""
        x, p, noise, vessel = self.x, self.p, self._noise, self._vessel
        psi = heading_rad - self._off
        c, s = np.cos(psi), np.sin(psi)
        vn, ve, r = x[:, VN], x[:, VE], x[:, R]
        wn_mps, we_mps = x[:, CN], x[:, CE]  # of the water
        u, v = c * (vn - wn_mps) + s * (ve - we_mps), c * (ve - we_mps) - s * (vn - wn_mps)
        force_n, moment_nm = self._body.motor_forces(self.thrust_n[:, 0], self.thrust_n[:, 1])
        x_n, y_n, n_nm = x[:, G] * force_n, np.zeros(self._count), x[:, G] * moment_nm
        if wind_ned is not None:
            wn, we = wind_ned
            air_n, air_e = wn - vn, we - ve
            x_w, y_w, n_w = self._body.wind_forces(c * air_n + s * air_e, c * air_e - s * air_n)
            x_n, y_n, n_nm = x_n + x_w, y_n + y_w, n_nm + n_w
        u_dot, v_dot, r_dot = self._body.acceleration(u, v, r, x_n, y_n, n_nm)
        a_x, a_y = u_dot - r * v, v_dot + r * u
        forget_d, forget_g = math.exp(-dt_s / noise.disturbance_time_s), math.exp(-dt_s / noise.gain_time_s)

        f = np.zeros((self._count, SIZE, SIZE))
        drag_u = -(vessel.surge_drag_n_per_mps + 2.0 * vessel.surge_drag_n_per_mps2 * np.abs(u)) / self._m_u
        drag_v = -(vessel.sway_drag_n_per_mps + 2.0 * vessel.sway_drag_n_per_mps2 * np.abs(v)) / self._m_v
        drag_r = -(vessel.yaw_drag_nm_per_radps + 2.0 * vessel.yaw_drag_nm_per_radps2 * np.abs(r)) / self._m_r
        f[:, VN, VN] = 1.0 + dt_s * np.maximum(c * c * drag_u + s * s * drag_v, -1.0 / dt_s)
        f[:, VE, VE] = 1.0 + dt_s * np.maximum(s * s * drag_u + c * c * drag_v, -1.0 / dt_s)
        f[:, VN, VE] = f[:, VE, VN] = dt_s * c * s * (drag_u - drag_v)
        f[:, R, R] = np.maximum(1.0 + dt_s * drag_r, 0.0)
        f[:, VN, DN] = f[:, VE, DE] = f[:, R, DR] = dt_s
        f[:, VN, G], f[:, VE, G] = dt_s * c * force_n / self._m_u, dt_s * s * force_n / self._m_u
        f[:, R, G] = dt_s * moment_nm / self._m_r
        f[:, DN, DN] = f[:, DE, DE] = f[:, DR, DR] = forget_d
        f[:, G, G] = forget_g
        f[:, CN, CN] = f[:, CE, CE] = 1.0
        f[:, VN, CN], f[:, VE, CE] = 1.0 - f[:, VN, VN], 1.0 - f[:, VE, VE]
        f[:, VN, CE] = f[:, VE, CN] = -f[:, VN, VE]

        x[:, VN] += dt_s * (c * a_x - s * a_y + x[:, DN])
        x[:, VE] += dt_s * (s * a_x + c * a_y + x[:, DE])
        # The drag in yaw may be faster than the step: it is taken at the step's end.
        x[:, R] += dt_s * (r_dot + x[:, DR]) / np.maximum(1.0 - dt_s * drag_r, 1.0)
        x[:, DN : DR + 1] *= forget_d
        x[:, G] = 1.0 + forget_g * (x[:, G] - 1.0)
        self.p = p = f @ p @ f.transpose(0, 2, 1)

        # What is not known of the thrust: along it by its size, across it by the heading's error. By the size of what
        # is commanded, for all alike: else a hypothesis without thrust would be sure of more, and win where all are
        # right.
        commanded_n = float(np.abs(self.thrust_n[0]).sum())
        thrust_a = commanded_n / self._m_u
        thrust_r = commanded_n * vessel.motor_arm_m / self._m_r
        along = (noise.of_thrust * thrust_a) ** 2 + noise.velocity_walk_mps**2
        across = (noise.heading_std_rad * thrust_a) ** 2 + noise.velocity_walk_mps**2
        p[:, VN, VN] += dt_s * (c * c * along + s * s * across)
        p[:, VE, VE] += dt_s * (s * s * along + c * c * across)
        cross = dt_s * c * s * (along - across)
        p[:, VN, VE] += cross
        p[:, VE, VN] += cross
        p[:, R, R] += dt_s * ((noise.of_thrust * thrust_r) ** 2 + noise.yaw_walk_radps**2)
        d_q, d_qr = (std**2 * (1.0 - forget_d**2) for std in (noise.disturbance_mps2, noise.disturbance_yaw_radps2))
        p[:, DN, DN] += d_q
        p[:, DE, DE] += d_q
        p[:, DR, DR] += d_qr
        p[:, G, G] += noise.gain_std**2 * (1.0 - forget_g**2)

    def correct(self, velocity_ned: tuple[float, float] | None, yaw_rate: float | None) -> tuple[Array, Array]:
        """(logarithm of the likelihood, squared innovations over their variances) of each hypothesis."""
        log, nis = np.zeros(self._count), np.zeros(self._count)
        noise = self._noise
        late_n = self._transit_n
        if velocity_ned is not None:
            variance = noise.velocity_std_mps**2 + (noise.timing_s * late_n / self._m_u) ** 2
            for row, value in zip((VN, VE), velocity_ned, strict=True):
                self._correct_one(row, value, variance, log, nis)
        if yaw_rate is not None:
            late = noise.timing_s * late_n * self._vessel.motor_arm_m / self._m_r
            self._correct_one(R, yaw_rate, noise.yaw_rate_std_radps**2 + late**2, log, nis)
        np.clip(self.x[:, G], *GAINS, out=self.x[:, G])
        return log, nis

    def _correct_one(self, row: int, value: float, variance: float, log: Array, nis: Array) -> None:
        x, p = self.x, self.p
        off = value - x[:, row]
        s = p[:, row, row] + variance
        square = off * off / s
        log -= 0.5 * (square + np.log(s))
        nis += square
        gain = p[:, :, row] / s[:, None]
        x += gain * off[:, None]
        self.p = p - gain[:, :, None] * p[:, None, row, :]

    def _prior(self) -> list[float]:
        noise = self._noise
        return [
            *(0.2**2, 0.2**2, 0.1**2),
            *(noise.disturbance_mps2**2,) * 2,
            noise.disturbance_yaw_radps2**2,
            noise.gain_std**2,
            *(noise.current_mps**2,) * 2,
        ]
