"""One step of the filter: a state and an event to the state after it, the one before left as it was."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from asvhil.config import EstimatorConfig
from asvhil.dynamics.protocol import Dynamics
from asvhil.estimator import trust, validity
from asvhil.estimator.prediction import MAX_STEP_S, Motion
from asvhil.estimator.states import (
    B_E,
    B_N,
    D_E,
    D_N,
    D_R,
    DEVIATION,
    G_R,
    PSI,
    SIZE,
    Array,
    E,
    FilterState,
    Forcing,
    N,
    R,
    U,
    V,
    deviation_row,
    noise_rate,
    prior,
)
from asvhil.estimator.trust import Liveliness, Track
from asvhil.geo import LocalFrame, wrap_rad
from asvhil.types import Attitude, GnssFix, Imu

MAX_GAP_S = 5.0
SLOWEST_INERTIAL_S = 0.2  # a residual that is held for longer says nothing of the motion meanwhile
OVERDUE = 2.5  # intervals, after which the accelerometer is gone
LONGEST_TRAVEL_S = 1.5  # between two velocities that are added up
NEW = 20  # readings of a sensor, before which it has no record against which to hold a jump
CARRIED_NS = 10_000_000_000  # without wind, after which its load has become part of the disturbance

Group = tuple[str, slice, tuple[float, float], tuple[float, float]]  # sensor, rows, reading, what was expected

# States that are given up with a sensor's, and the variances that are left of them. The velocity over ground is known
# in NED: with another heading it is another one in body axes.
GIVEN_UP = {
    "position": ((N, 1e4), (E, 1e4), (U, 4.0), (V, 4.0)),
    "heading": ((PSI, 3.0), (U, 4.0), (V, 4.0), (R, 0.25)),
    "velocity": ((U, 4.0), (V, 4.0)),
    "yaw_rate": ((R, 0.25),),
    "acceleration": (),
}

ALIVE = {
    "position": Liveliness(noise=0.02, motion=0.1),
    "velocity": Liveliness(noise=0.012, motion=0.1),
    "heading": Liveliness(noise=math.radians(0.05), motion=math.radians(1.0)),
    "yaw_rate": Liveliness(noise=0.002, motion=0.02),
    "acceleration": Liveliness(noise=0.01, motion=0.05),
}


class Filter:
    """`step` is a pure function of its arguments. (Its buffers are scratch space.)"""

    def __init__(self, config: EstimatorConfig, model: Dynamics) -> None:
        ekf = config.ekf
        self._config = config
        self._stale_ns = round(ekf.stale_after_s * 1e9)
        self._frozen_ns = round(config.trust.frozen_after_s * 1e9)
        self._return_ns = round(config.trust.return_after_s * 1e9)
        self._gate = ekf.gate_sigma
        self._gate2 = ekf.gate_sigma**2
        self._n_motor = model.n_motor
        self._motion = Motion(model, ekf.position_bias_time_s)
        self._noise_rate = noise_rate(ekf)
        self._accel_density = ekf.accel_std_mps2**2  # times the interval between samples
        self._limit: Array = np.array([ekf.disturbance_max_mps2] * 2 + [ekf.disturbance_yaw_max_radps2])
        heading_rad = math.radians(ekf.heading_std_deg)
        self._attitude_noise: Array = np.diag([heading_rad**2, ekf.yaw_rate_std_radps**2])
        self._gnss_noise: Array = np.diag([ekf.position_std_m**2] * 2 + [ekf.velocity_std_mps**2] * 2)
        self._eye: Array = np.eye(SIZE)
        self._frame = LocalFrame(lat_deg=0.0, lon_deg=0.0)

    def start(self, m: GnssFix, attitude: Attitude, frame: LocalFrame) -> FilterState:
        """The state at the first fix, whose position is the origin; at rest where it has no velocity."""
        self._frame = frame
        ekf = self._config.ekf
        x = np.zeros(SIZE)
        x[DEVIATION] = np.radians(ekf.compass.deviation_deg)
        psi = attitude.psi_rad
        psi -= float(x[DEVIATION] @ deviation_row(psi))
        c, s = math.cos(psi), math.sin(psi)
        has_velocity = math.isfinite(m.vn_mps) and math.isfinite(m.ve_mps)
        vn, ve = (m.vn_mps, m.ve_mps) if has_velocity else (0.0, 0.0)
        x[PSI] = wrap_rad(psi)
        x[R] = attitude.r_radps if math.isfinite(attitude.r_radps) else 0.0
        x[U], x[V] = c * vn + s * ve, -s * vn + c * ve
        x[N], x[E] = -(c * m.arm_m[0] - s * m.arm_m[1]), -(s * m.arm_m[0] + c * m.arm_m[1])
        state = FilterState(m.t_ns, x, np.diag(prior(ekf)), np.zeros(self._n_motor))
        state.tracks["position"] = Track(heard_ns=m.t_ns, used_ns=m.t_ns, used=1)
        state.tracks["heading"] = Track(heard_ns=attitude.t_ns, used_ns=attitude.t_ns, used=1)
        return state

    def step(self, before: FilterState, t_ns: int, event: Any) -> FilterState:
        """The state after an event at a time that is not before the state's. None: the end of a tick."""
        state = before.copy()
        self._predict(state, t_ns)
        match event:
            case None:
                if validity.of(state, t_ns, self._stale_ns, self._config.trust):
                    state.invalid_since_ns = trust.NEVER
                elif state.invalid_since_ns == trust.NEVER:
                    state.invalid_since_ns = t_ns
            case Forcing():
                self._force(state, event)
            case Attitude():
                self._on_attitude(state, event)
            case GnssFix():
                self._on_gnss(state, event)
            case Imu():
                self._on_imu(state, event)
        return state

    # --- prediction ------------------------------------------------------------------------------------------

    def _predict(self, state: FilterState, t_ns: int) -> None:
        remaining_s = (t_ns - state.t_ns) * 1e-9
        state.t_ns = t_ns
        if remaining_s > MAX_GAP_S:
            state.p = state.p + np.diag(self._noise_rate) * remaining_s
            return
        motion = self._motion
        fused = state.interval_s > 0.0 and (t_ns - state.inertial_ns) * 1e-9 <= OVERDUE * state.interval_s
        gain = self._gain(state.interval_s) if fused else 0.0
        while remaining_s > 1e-9:
            dt_s = min(remaining_s, MAX_STEP_S)
            remaining_s -= dt_s
            self._load(state)
            motion.residual[:] = state.residual
            motion.predict(dt_s, gain)
            state.x = motion.after[:SIZE].copy()
            state.motor = motion.after[SIZE:].copy()
            p = motion.jacobian @ state.p @ motion.jacobian.T
            p.flat[:: SIZE + 1] += self._noise_rate * dt_s
            if gain:
                p[U, U] -= gain * self._noise_rate[U] * dt_s
                p[V, V] -= gain * self._noise_rate[V] * dt_s
            state.p = p

    def _gain(self, interval_s: float) -> float:
        """Share of the model's error that the accelerometer takes away: q_m / (q_m + q_a)."""
        q_m = float(self._noise_rate[U])
        return q_m / (q_m + self._accel_density * interval_s)

    def _load(self, state: FilterState) -> None:
        motion = self._motion
        motion.state[:SIZE] = state.x
        motion.state[SIZE:] = state.motor
        motion.input[:] = state.forcing.model_input
        motion.wind[:] = state.forcing.wind_ned or (0.0, 0.0)

    def _force(self, state: FilterState, forcing: Forcing) -> None:
        """Another input and wind from now on.

        A wind that is no longer known leaves its load on the boat to the disturbance, and takes it back when it
        returns, so that neither makes the prediction jump.
        """
        known, was_known = forcing.wind_ned is not None, state.forcing.wind_ned is not None
        hand_over = was_known and not known
        if known and not was_known:
            hand_over = state.carries_wind or state.t_ns - state.started_ns > CARRIED_NS
        before = self._acceleration(state) if hand_over else None
        state.forcing = forcing
        if before is None:
            return
        change = before - self._acceleration(state)
        c, s = math.cos(state.x[PSI]), math.sin(state.x[PSI])
        x = state.x.copy()
        x[D_N] += c * change[0] - s * change[1]
        x[D_E] += s * change[0] + c * change[1]
        x[D_R] += change[2]
        state.x = x
        self._clip(x)
        state.carries_wind = not known

    def _acceleration(self, state: FilterState) -> Array:
        """(u, v, r) dot by the model and the disturbance (3)."""
        self._load(state)
        self._motion.accelerate()
        return self._motion.acceleration.copy()

    # --- readings --------------------------------------------------------------------------------------------

    def _on_attitude(self, state: FilterState, m: Attitude) -> None:
        x = state.x
        has_heading, has_rate = math.isfinite(m.psi_rad), math.isfinite(m.r_radps)
        _, s1, c1, s2, c2 = row = deviation_row(float(x[PSI]))
        _, b, c, d, e = x[DEVIATION].tolist()
        heading = float(x[PSI] + x[DEVIATION] @ row)
        off = wrap_rad(m.psi_rad - heading) if has_heading else 0.0
        rate = float(x[R] + x[G_R])
        innovation = np.array([off, m.r_radps - rate])
        h = np.zeros((2, SIZE))
        h[0, PSI] = 1.0 + b * c1 - c * s1 + 2.0 * (d * c2 - e * s2)
        h[0, DEVIATION] = row
        h[1, R] = h[1, G_R] = 1.0
        groups = []
        if has_heading:
            groups.append(("heading", slice(0, 1), (m.psi_rad, 0.0), (m.psi_rad - off, 0.0)))
        if has_rate:
            groups.append(("yaw_rate", slice(1, 2), (m.r_radps, 0.0), (rate, 0.0)))
        self._take(state, m.t_ns, groups, innovation, h, self._attitude_noise)

    def _on_gnss(self, state: FilterState, m: GnssFix) -> None:
        x = state.x
        has_position = math.isfinite(m.lat_deg) and math.isfinite(m.lon_deg)
        has_velocity = math.isfinite(m.vn_mps) and math.isfinite(m.ve_mps)
        c, s = math.cos(x[PSI]), math.sin(x[PSI])
        arm_x, arm_y = m.arm_m
        arm_n, arm_e = c * arm_x - s * arm_y, s * arm_x + c * arm_y
        u, v = x[U] - x[R] * arm_y, x[V] + x[R] * arm_x
        vn, ve = float(c * u - s * v), float(s * u + c * v)
        n, e = float(x[N] + arm_n + x[B_N]), float(x[E] + arm_e + x[B_E])
        h = np.zeros((4, SIZE))
        h[0, N] = h[1, E] = h[0, B_N] = h[1, B_E] = 1.0
        h[0, PSI], h[1, PSI] = -arm_e, arm_n
        h[2, PSI], h[2, U], h[2, V], h[2, R] = -ve, c, -s, -arm_e
        h[3, PSI], h[3, U], h[3, V], h[3, R] = vn, s, c, arm_n
        groups = []
        innovation = np.zeros(4)
        if has_velocity:
            elapsed_s = (m.t_ns - state.travelled_ns) * 1e-9
            if elapsed_s <= LONGEST_TRAVEL_S:
                state.travel = (state.travel[0] + m.vn_mps * elapsed_s, state.travel[1] + m.ve_mps * elapsed_s)
            state.travelled_ns = m.t_ns
        if has_position:
            z_n, z_e = self._frame.to_ned(m.lat_deg, m.lon_deg)
            innovation[:2] = z_n - n, z_e - e
            groups.append(("position", slice(0, 2), (z_n, z_e), (n, e)))
        if has_velocity:
            innovation[2:] = m.vn_mps - vn, m.ve_mps - ve
            groups.append(("velocity", slice(2, 4), (m.vn_mps, m.ve_mps), (vn, ve)))
        self._take(state, m.t_ns, groups, innovation, h, self._gnss_noise)

    def _on_imu(self, state: FilterState, m: Imu) -> None:
        interval_s = (m.t_ns - state.inertial_ns) * 1e-9
        state.inertial_ns = m.t_ns
        if not (self._config.ekf.accelerometer and 0.0 < interval_s <= SLOWEST_INERTIAL_S):
            state.interval_s = 0.0
            return
        state.interval_s = interval_s
        self._load(state)
        motion = self._motion
        motion.arm[:] = m.arm_m
        motion.feel()
        expected = motion.force
        innovation = np.array([m.ax_mps2, m.ay_mps2]) - expected
        h = motion.force_jacobian.copy()
        variance = float(self._noise_rate[U]) / interval_s + self._accel_density
        before = state.x
        group = ("acceleration", slice(0, 2), (m.ax_mps2, m.ay_mps2), (float(expected[0]), float(expected[1])))
        if self._take(state, m.t_ns, [group], innovation, h, np.diag([variance, variance])):
            state.residual = innovation - h @ (state.x - before)
        else:
            state.interval_s = 0.0

    # --- correction ------------------------------------------------------------------------------------------

    def _take(
        self, state: FilterState, t_ns: int, groups: list[Group], innovation: Array, h: Array, noise: Array
    ) -> bool:
        """Correct with those groups of rows that can be believed; True if any."""
        if not groups:
            return False
        ph = state.p @ h.T
        s = h @ ph + noise
        used = []
        for group in groups:
            name, rows, value, expected = group
            track = state.tracks.get(name, Track())
            track = trust.hear(track, t_ns, value, expected, ALIVE[name], self._frozen_ns)
            if track.frozen or (name == "velocity" and self._receiver_frozen(state, track)):
                state.tracks[name] = trust.skip(track)
                continue
            distance2 = _distance2(s[rows, rows], innovation[rows])
            if distance2 <= self._gate2 * (rows.stop - rows.start):
                state.tracks[name] = trust.use(track, t_ns)
                used.append(group)
                continue
            off = float(innovation[rows.start]), float(innovation[rows.stop - 1])
            slack = self._gate * math.sqrt(2.0 * noise[rows.start, rows.start])
            state.tracks[name] = track = trust.refuse(
                track, t_ns, self._steady_part(state, t_ns, name, off), off, slack
            )
            if self._convinces(state, t_ns, name, math.hypot(*off) - slack):
                self._give_up(state, name)
                ph = state.p @ h.T
                s = h @ ph + noise
                state.tracks[name] = trust.use(track, t_ns)
                used.append(group)
        if not used:
            return False
        if len(used) == 1:
            rows = used[0][1]
            ph, s, innovation, h, noise = ph[:, rows], s[rows, rows], innovation[rows], h[rows], noise[rows, rows]
        self._correct(state, ph, s, innovation, h, noise)
        return True

    def _correct(self, state: FilterState, ph: Array, s: Array, innovation: Array, h: Array, noise: Array) -> None:
        """Joseph-form update, which keeps the covariance symmetric and positive."""
        gain = np.linalg.solve(s, ph.T).T
        x = state.x + gain @ innovation
        x[PSI] = wrap_rad(x[PSI])
        self._clip(x)
        keep = self._eye - gain @ h
        p = keep @ state.p @ keep.T + gain @ noise @ gain.T
        state.x = x
        state.p = 0.5 * (p + p.T)

    def _clip(self, x: Array) -> None:
        np.clip(x[D_N : D_R + 1], -self._limit, self._limit, out=x[D_N : D_R + 1])

    # --- belief ----------------------------------------------------------------------------------------------

    def _receiver_frozen(self, state: FilterState, velocity: Track) -> bool:
        """A velocity that repeats itself beside a frozen position is as old."""
        position = state.tracks.get("position")
        return position is not None and position.frozen and velocity.repeats >= trust.LEAST_REPEATS

    def _steady_part(self, state: FilterState, t_ns: int, name: str, off: tuple[float, float]) -> tuple[float, float]:
        """What stays the same while a refused sensor goes on to be consistent: its distance to what it should say.

        A position is held against what the receiver's own velocity has added up to, where it has one.
        """
        if name != "position" or t_ns - state.travelled_ns > LONGEST_TRAVEL_S * 1e9:
            return off
        value = state.tracks[name].value
        return value[0] - state.travel[0], value[1] - state.travel[1]

    def _convinces(self, state: FilterState, t_ns: int, name: str, distance: float) -> bool:
        """Whether the filter must be wrong, and not the sensor that it goes on refusing.

        It must have been steady for the return time, and one of these hold: it has no record yet; there has been no
        valid estimate for as long; or, of a receiver, position and velocity are refused both, agree with each other,
        and such a velocity explains how far off (m) the position is, as after a push that nothing else has seen.
        """
        track = state.tracks[name]
        if track.steady_since_ns == trust.NEVER or t_ns - track.steady_since_ns < self._return_ns:
            return False
        if track.used < NEW:
            return True
        if state.invalid_since_ns != trust.NEVER and t_ns - state.invalid_since_ns >= self._return_ns:
            return True
        velocity = state.tracks.get("velocity")
        if name != "position" or velocity is None or velocity.refused_in_row == 0:
            return False
        span_s = (t_ns - velocity.refused_since_ns) * 1e-9
        return span_s * 1e9 >= self._return_ns and distance <= math.hypot(*velocity.off) * span_s

    def _give_up(self, state: FilterState, name: str) -> None:
        """Forget what is believed of what a sensor tells, and of what hangs on it."""
        state.resets += 1
        p = state.p.copy()
        for i, variance in GIVEN_UP[name]:
            p[i, :] = p[:, i] = 0.0
            p[i, i] = variance
        state.p = p


def _distance2(s: Array, innovation: Array) -> float:
    """The squared Mahalanobis distance of one or two rows."""
    if len(innovation) == 1:
        return float(innovation[0] * innovation[0] / s[0, 0])
    (a, b), (c, d) = s.tolist()
    x, y = innovation.tolist()
    return float((d * x * x - (b + c) * x * y + a * y * y) / (a * d - b * c))
