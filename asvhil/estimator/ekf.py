"""Extended Kalman filter over pose, velocity and disturbance, with the vessel model in its prediction.

State (9): n, e (m), psi (rad), u, v (m/s, over ground, body axes), r (rad/s), and the unmodelled acceleration
d_n, d_e (m/s^2, NED) and d_r (rad/s^2), a random walk. The model's motor states are propagated, not corrected.
"""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from asvhil.config import EkfConfig
from asvhil.dynamics.buffers import bind
from asvhil.dynamics.integrate import integrate, motion_derivative
from asvhil.dynamics.protocol import Dynamics
from asvhil.geo import LocalFrame, wrap_rad
from asvhil.types import Attitude, Estimate, GnssFix, Imu

N, E, PSI, U, V, R, D_N, D_E, D_R = range(9)
SIZE = 9
MAX_STEP_S = 0.1
MAX_GAP_S = 5.0

Array = NDArray[np.float64]


class _Prediction:
    """One midpoint step of pose, velocity and motors with its Jacobian, as a CasADi function on plain buffers."""

    def __init__(self, model: Dynamics) -> None:
        size = SIZE + model.n_motor
        s, a, wind, dt = ca.SX.sym("s", size), ca.SX.sym("a", 2), ca.SX.sym("wind", 2), ca.SX.sym("dt")

        moving = ca.vertcat(s[:D_N], s[SIZE:])
        moved = integrate(lambda x: motion_derivative(model, x, a, wind, s[D_N:SIZE]), moving, dt, 1, euler=False)
        after = ca.vertcat(moved[:D_N], s[D_N:SIZE], moved[D_N:])
        jacobian = ca.jacobian(after[:SIZE], s[:SIZE])
        function = ca.Function("ekf_prediction", [s, a, wind, dt], [after, ca.densify(jacobian)], {"cse": True})
        self.state = np.zeros(size)
        self.input = np.zeros(2)
        self.wind = np.zeros(2)
        self._dt = np.zeros(1)
        self.after = np.zeros(size)
        jacobian_columns = np.zeros(SIZE * SIZE)
        self._run = bind(function, [self.state, self.input, self.wind, self._dt], [self.after, jacobian_columns])
        self.jacobian = jacobian_columns.reshape(SIZE, SIZE, order="F")

    def __call__(self, dt_s: float) -> None:
        self._dt[0] = dt_s
        self._run()


class Ekf:
    """Bytes' worth of measurements in, `Estimate` out. Starts at the first GNSS fix with a heading known."""

    def __init__(self, config: EkfConfig, model: Dynamics) -> None:
        self._config = config
        self._n_motor = model.n_motor
        self._prediction = _Prediction(model)
        self._x: Array = np.zeros(SIZE)
        self._motor: Array = np.zeros(model.n_motor)
        self._p: Array = np.zeros((SIZE, SIZE))
        self._t_ns = 0
        self._gnss_ns: int | None = None
        self._attitude_ns: int | None = None
        self._first_attitude: Attitude | None = None
        self.rejected = dict.fromkeys(("gnss", "velocity", "attitude", "yaw_rate"), 0)
        self._rejected_since_ns: dict[str, int | None] = dict.fromkeys(self.rejected)
        self._wind = (0.0, 0.0)
        self._input = (0.0, 0.0)
        self.frame: LocalFrame | None = None
        self.resets = 0
        walks = np.array(
            [config.position_walk_m] * 2
            + [config.heading_walk_rad]
            + [config.velocity_walk_mps] * 2
            + [config.yaw_rate_walk_radps]
            + [config.disturbance_walk_mps2] * 2
            + [config.disturbance_yaw_walk_radps2]
        )
        self._noise_rate: Array = walks**2
        limit = [config.disturbance_max_mps2] * 2 + [config.disturbance_yaw_max_radps2]
        self._disturbance_limit: Array = np.array(limit)
        heading_std_rad = math.radians(config.heading_std_deg)
        self._attitude_noise: Array = np.diag([heading_std_rad**2, config.yaw_rate_std_radps**2])
        self._gnss_noise: Array = np.diag([config.position_std_m**2] * 2 + [config.velocity_std_mps**2] * 2)
        self._attitude_h: Array = np.zeros((2, SIZE))
        self._attitude_h[0, PSI] = self._attitude_h[1, R] = 1.0
        self._eye: Array = np.eye(SIZE)

    @property
    def started(self) -> bool:
        """Whether there is an estimate at all."""
        return self.frame is not None

    def set_forcing(self, model_input: tuple[float, float], wind_ned: tuple[float, float]) -> None:
        """What drives the prediction from now on: the model's input, and the true wind (m/s, NED)."""
        self._input = model_input
        self._wind = wind_ned

    def on_attitude(self, m: Attitude) -> None:
        """Correct heading and yaw rate, or the one of them that the source has."""
        has_heading, has_rate = math.isfinite(m.psi_rad), math.isfinite(m.r_radps)
        if not (has_heading or has_rate):
            return
        if self.frame is None:
            self._first_attitude = m if has_heading else self._first_attitude
            return
        self.predict(m.t_ns)
        innovation = np.array([wrap_rad(m.psi_rad - self._x[PSI]), m.r_radps - self._x[R]])
        rows = slice(0 if has_heading else 1, 2 if has_rate else 1)
        h, noise = self._attitude_h[rows], self._attitude_noise[rows, rows]
        # A yaw rate of another source has a gate of its own: it must neither keep up nor cast out the heading.
        sensor = "attitude" if has_heading else "yaw_rate"
        if self._correct(sensor, m.t_ns, innovation[rows], h, noise) and has_heading:
            self._attitude_ns = m.t_ns

    def on_gnss(self, m: GnssFix) -> None:
        """Correct position and velocity, or the one of them that the fix has."""
        has_position = math.isfinite(m.lat_deg) and math.isfinite(m.lon_deg)
        has_velocity = math.isfinite(m.vn_mps) and math.isfinite(m.ve_mps)
        if self.frame is None:
            if has_position:
                self._start(m, has_velocity)
            return
        if not (has_position or has_velocity):
            return
        self.predict(m.t_ns)
        x = self._x
        n_m, e_m = self.frame.to_ned(m.lat_deg, m.lon_deg)
        c, s = math.cos(x[PSI]), math.sin(x[PSI])
        rows = slice(0 if has_position else 2, 4 if has_velocity else 2)
        h = np.zeros((4, SIZE))
        h[0, N] = h[1, E] = 1.0
        innovation = np.array([n_m - x[N], e_m - x[E], 0.0, 0.0])
        if has_velocity:
            vn, ve = c * x[U] - s * x[V], s * x[U] + c * x[V]
            innovation[2:] = m.vn_mps - vn, m.ve_mps - ve
            h[2, PSI], h[2, U], h[2, V] = -ve, c, -s
            h[3, PSI], h[3, U], h[3, V] = vn, s, c
        sensor = "gnss" if has_position else "velocity"
        if self._correct(sensor, m.t_ns, innovation[rows], h[rows], self._gnss_noise[rows, rows]) and has_position:
            self._gnss_ns = m.t_ns

    def on_imu(self, m: Imu) -> None:
        """Nothing: the model predicts the acceleration."""

    def counters(self) -> tuple[tuple[str, int], ...]:
        """Cumulative counts of what the gates have kept out, and of resets."""
        return (
            ("ekf.rejected_gnss", self.rejected["gnss"] + self.rejected["velocity"]),
            ("ekf.rejected_attitude", self.rejected["attitude"] + self.rejected["yaw_rate"]),
            ("ekf.resets", self.resets),
        )

    def predict(self, t_ns: int) -> None:
        """Bring the state forward to a time; earlier times and gaps beyond 5 s move the clock alone."""
        if self.frame is None or t_ns <= self._t_ns:
            return
        remaining_s = (t_ns - self._t_ns) * 1e-9
        self._t_ns = t_ns
        if remaining_s > MAX_GAP_S:
            self._p += np.diag(self._noise_rate) * remaining_s
            return
        step = self._prediction
        step.input[:] = self._input
        step.wind[:] = self._wind
        while remaining_s > 1e-9:
            dt_s = min(remaining_s, MAX_STEP_S)
            remaining_s -= dt_s
            step.state[:SIZE] = self._x
            step.state[SIZE:] = self._motor
            step(dt_s)
            self._x = step.after[:SIZE].copy()
            self._motor = step.after[SIZE:].copy()
            f = step.jacobian
            self._p = f @ self._p @ f.T
            self._p.flat[:: SIZE + 1] += self._noise_rate * dt_s

    def estimate(self, t_ns: int) -> Estimate | None:
        """The state at a time, or None before the start. Not valid while GNSS or heading is stale."""
        if self.frame is None:
            return None
        self.predict(t_ns)
        x = self._x.tolist()
        stale_ns = self._config.stale_after_s * 1e9
        fresh = all(at is not None and t_ns - at <= stale_ns for at in (self._gnss_ns, self._attitude_ns))
        return Estimate(
            t_ns=t_ns,
            n_m=x[N],
            e_m=x[E],
            psi_rad=wrap_rad(x[PSI]),
            u_mps=x[U],
            v_mps=x[V],
            r_radps=x[R],
            motor=tuple(self._motor.tolist()),
            std=tuple(np.sqrt(np.maximum(np.diag(self._p)[:6], 0.0)).tolist()),
            disturbance=(x[D_N], x[D_E], x[D_R]),
            valid=fresh and bool(np.isfinite(self._x).all()),
        )

    def _start(self, m: GnssFix, has_velocity: bool) -> None:
        attitude = self._first_attitude
        if attitude is None or m.t_ns - attitude.t_ns > self._config.stale_after_s * 1e9:
            return
        self.frame = LocalFrame(lat_deg=m.lat_deg, lon_deg=m.lon_deg)
        self._t_ns = m.t_ns
        self._gnss_ns, self._attitude_ns = m.t_ns, attitude.t_ns
        c, s = math.cos(attitude.psi_rad), math.sin(attitude.psi_rad)
        vn, ve = (m.vn_mps, m.ve_mps) if has_velocity else (0.0, 0.0)
        self._x[:] = 0.0
        self._x[PSI] = attitude.psi_rad
        self._x[R] = attitude.r_radps if math.isfinite(attitude.r_radps) else 0.0
        self._x[U], self._x[V] = c * vn + s * ve, -s * vn + c * ve
        self._p = np.diag([1.0, 1.0, 0.05, 0.25, 0.25, 0.01, 1e-3, 1e-3, 1e-4])

    def _correct(self, source: str, t_ns: int, innovation: Array, h: Array, noise: Array) -> bool:
        """Joseph-form update behind a chi gate; a sensor rejected for too long is believed again. True if used."""
        ph = self._p @ h.T
        s = h @ ph + noise
        weighted = np.linalg.solve(s, np.column_stack((innovation, ph.T)))
        distance2 = float(innovation @ weighted[:, 0])
        if not distance2 <= self._config.gate_sigma**2 * len(innovation):
            self.rejected[source] += 1
            since = self._rejected_since_ns[source]
            if since is None:
                self._rejected_since_ns[source] = t_ns
                return False
            if (t_ns - since) * 1e-9 < self._config.reset_after_s:
                return False
            # The filter, not the sensor, is wrong by now: forget what it believed of pose and velocity.
            self.resets += 1
            self._p[:6, :] = self._p[:, :6] = 0.0
            self._p[:6, :6] = np.diag([1e4, 1e4, 3.0, 4.0, 4.0, 0.25])
            self._rejected_since_ns[source] = None
            return self._correct(source, t_ns, innovation, h, noise)
        self._rejected_since_ns[source] = None
        gain = weighted[:, 1:].T
        self._x = self._x + gain @ innovation
        self._x[PSI] = wrap_rad(self._x[PSI])
        np.clip(self._x[D_N:], -self._disturbance_limit, self._disturbance_limit, out=self._x[D_N:])
        keep = self._eye - gain @ h
        p = keep @ self._p @ keep.T + gain @ noise @ gain.T
        self._p = 0.5 * (p + p.T)
        return True
