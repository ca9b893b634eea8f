"""One step of the filter: the state after an event, from the state before it, which is not changed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from asvhil.config import EstimatorConfig
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.protocol import Dynamics
from asvhil.estimator import fault_recovery, measurement_model, sensor_health, validity
from asvhil.estimator.agreement import Agreement
from asvhil.estimator.covariance import Correction
from asvhil.estimator.measurement_model import Comparison, Corrected, Group
from asvhil.estimator.prediction import MAX_STEP_S, MotionModel
from asvhil.estimator.sensor_health import Track
from asvhil.estimator.states import (
    A_X,
    A_Y,
    B_E,
    B_N,
    D_E,
    D_N,
    D_R,
    DEVIATION,
    PSI,
    SIZE,
    E,
    Factors,
    FilterState,
    Forcing,
    N,
    R,
    U,
    V,
    noise_rate,
    prior,
)
from asvhil.geo import LocalFrame, ned_to_body, wrap_rad
from asvhil.types import GroundVelocity, Heading, Position, SpecificForce, YawRate

MAX_GAP_S = 5.0
SLOWEST_INERTIAL_S = 0.2  # longest time for which a residual of the accelerometer is held
LONGEST_TURN_S = 0.2  # for which a rejected yaw rate counts: less than a slow stream's interval is known of it
COMPASS_FRESH_NS = 1_000_000_000
WIDEST_RAD = 0.35  # how uncertain a heading becomes by that
OVERDUE = 2.5  # intervals without a sample, after which the accelerometer counts as missing
NEW_TRACK = Track()
FORCE_ROWS = slice(0, 2)
BIAS_SIGMA = 3.0  # bound of the slow error of a receiver: more is motion, or a jump
MODEL_S = 8.0  # time constant of the mean of the velocity's innovation
MODEL_MPS = 0.1  # from which on that mean is the model's error, and no noise
MODEL_MOST_MPS = 1.0  # of one reading
CARRIED_NS = 10_000_000_000  # without wind, after which its load stays in the disturbance


class Filter:
    """`step` is a pure function of its arguments. (Its buffers are scratch space.)"""

    def __init__(self, config: EstimatorConfig, model: Dynamics) -> None:
        ekf = config.ekf
        self._config = config
        self._stale_ns = round(ekf.stale_after_s * 1e9)
        self._frozen_ns = round(config.trust.frozen_after_s * 1e9)
        self._return_ns = round(config.trust.return_after_s * 1e9)
        self._gate = ekf.gate_sigma
        self._agreement_slack_m = fault_recovery.AGREEMENT_SLACK * ekf.gate_sigma * ekf.position_std_m
        self._gate2 = ekf.gate_sigma**2
        self._n_motor = model.n_motor
        self._buffered: Forcing | None = None  # the one whose input and wind are in the buffers of the model
        self._noise_rate = noise_rate(ekf)
        self._model_density = float(self._noise_rate[U])  # the same for v
        self._accel_density = ekf.accel_std_mps2**2  # times the interval between samples
        # Bounds of the states from D_N to B_E: disturbance, biases and slow error of the receiver.
        self._most: Array = np.full(B_E + 1 - D_N, np.inf)
        self._most[: D_R - D_N] = ekf.disturbance_max_mps2
        self._most[D_R - D_N] = ekf.disturbance_yaw_max_radps2
        self._most[[B_N - D_N, B_E - D_N]] = BIAS_SIGMA * ekf.position_bias_std_m
        self._least: Array = -self._most
        self._motion = motion = MotionModel(model, ekf.position_bias_time_s, self._noise_rate, self._most)
        heading_rad = math.radians(ekf.heading_std_deg)
        variances: dict[type, list[float]] = {
            Position: [ekf.position_std_m**2] * 2,
            GroundVelocity: [ekf.velocity_std_mps**2] * 2,
            Heading: [heading_rad**2],
            YawRate: [ekf.yaw_rate_std_radps**2],
        }
        together = [(kind,) for kind in variances] + list(measurement_model.PAIRS)
        before = motion.x, motion.p_flat, self._most
        self._comparisons = {
            kinds: Comparison(kinds, [variance for kind in kinds for variance in variances[kind]], *before)
            for kinds in together
        }
        self._partial = {rows: Correction(rows, *before) for rows in (1, 2)}  # by those of a pair that are accepted
        self._all_used, self._unbiased = np.ones(SIZE), np.ones(SIZE)
        self._unbiased[DEVIATION] = self._unbiased[B_N : B_E + 1] = 0.0
        self._frame = LocalFrame(lat_deg=0.0, lon_deg=0.0)

    def start(
        self,
        position: Position,
        velocity: GroundVelocity | None,
        heading: Heading,
        rate: YawRate | None,
        frame: LocalFrame,
    ) -> FilterState:
        """The state at the first position, which is the origin; without a velocity or a yaw rate at rest."""
        self._frame = frame
        ekf = self._config.ekf
        x = np.zeros(SIZE)
        c, s = math.cos(heading.psi_rad), math.sin(heading.psi_rad)
        vn, ve = (velocity.vn_mps, velocity.ve_mps) if velocity is not None else (0.0, 0.0)
        arm_x, arm_y = position.arm_m
        x[PSI] = wrap_rad(heading.psi_rad)
        x[R] = rate.r_radps if rate is not None else 0.0
        x[U], x[V] = c * vn + s * ve, -s * vn + c * ve
        x[N], x[E] = -(c * arm_x - s * arm_y), -(s * arm_x + c * arm_y)
        state = FilterState(position.t_ns, x, np.diag(prior(ekf)), np.zeros(self._n_motor))
        if velocity is not None and velocity.fused:
            state.follows_bias = False
        state.tracks["position"] = Track(received_ns=position.t_ns, accepted_ns=position.t_ns, accepted=1)
        state.tracks["heading"] = Track(received_ns=heading.t_ns, accepted_ns=heading.t_ns, accepted=1)
        return state

    def step(self, before: FilterState, t_ns: int, event: Any) -> FilterState:
        """The state after an event at a time not before that of the state. An event of None is the end of a tick."""
        state = before.copy()
        self._predict(state, t_ns)
        match event:
            case None:
                if validity.is_valid(state, t_ns, self._stale_ns, self._config.trust):
                    state.invalid_since_ns = sensor_health.NEVER
                elif state.invalid_since_ns == sensor_health.NEVER:
                    state.invalid_since_ns = t_ns
            case Forcing():
                self._set_forcing(state, event)
            case Factors():
                own = len(state.motor) - len(event.values)
                state.motor = np.array([*state.motor[:own].tolist(), *event.values])
            case (SpecificForce() as m,):
                self._on_specific_force(state, m)
            case _:
                self._on_correction(state, t_ns, event)
        return state

    # --- prediction ------------------------------------------------------------------------------------------

    def _predict(self, state: FilterState, t_ns: int) -> None:
        remaining_s = (t_ns - state.t_ns) * 1e-9
        state.t_ns = t_ns
        if remaining_s <= 1e-9:
            return
        if remaining_s > MAX_GAP_S:
            noise_rate = self._noise_rate.copy()
            if not state.follows_bias:
                noise_rate[[B_N, B_E]] = 0.0
            state.p = state.p + np.diag(noise_rate) * remaining_s
            return
        motion = self._motion
        motion.residual[:] = state.residual
        fused = state.interval_s > 0.0 and (t_ns - state.inertial_ns) * 1e-9 <= OVERDUE * state.interval_s
        gain = self._gain(state.interval_s) if fused else 0.0
        while remaining_s > 1e-9:
            dt_s = min(remaining_s, MAX_STEP_S)
            remaining_s -= dt_s
            self._fill_buffers(state)
            motion.p[:] = state.p
            motion.predict(dt_s, gain, follows_bias=state.follows_bias)
            state.x, state.motor, state.p = motion.x_after.copy(), motion.motor_after.copy(), motion.p_after.copy()

    def _gain(self, interval_s: float) -> float:
        """Gain of the accelerometer's residual: k = q_m / (q_m + q_a), see `prediction.py`."""
        return self._model_density / (self._model_density + self._accel_density * interval_s)

    def _fill_buffers(self, state: FilterState) -> None:
        motion = self._motion
        motion.x[:] = state.x
        motion.motor[:] = state.motor
        if state.forcing is not self._buffered:
            self._buffered = state.forcing
            motion.input[:] = state.forcing.model_input
            motion.wind[:] = state.forcing.wind_ned or (0.0, 0.0)

    def _set_forcing(self, state: FilterState, forcing: Forcing) -> None:
        """Another input and wind from now on.

        When the wind is no longer known, its load is added to the disturbance; when it returns, the load is subtracted
        again. So the prediction does not jump.
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
        self._fill_buffers(state)
        self._motion.evaluate_acceleration()
        return self._motion.acceleration.copy()

    # --- readings --------------------------------------------------------------------------------------------

    def _on_correction(self, state: FilterState, t_ns: int, measurements: tuple[Corrected, ...]) -> None:
        judged_s = 0.0
        for m in measurements:
            if isinstance(m, GroundVelocity):
                # An error of 1 cm/s for minutes in the velocity of an autopilot's filter would be taken for a slow
                # error of the receiver: the estimate would drift off that filter's own position, and the boat with
                # it. So with a fused velocity the slow error is not estimated, and decays.
                state.follows_bias = not m.fused
                elapsed_s = fault_recovery.integrate_velocity(state, t_ns, m.vn_mps, m.ve_mps)
                if elapsed_s == 0.0:
                    state.agreement, state.model_off = Agreement(), (0.0, 0.0)
                judged_s = 0.0 if m.fused else elapsed_s  # one of a time in doubt says nothing of an acceleration
            elif isinstance(m, YawRate):
                fault_recovery.integrate_rate(state, t_ns, m.r_radps)
        comparison = self._comparisons[tuple(map(type, measurements))]
        self._fill_state(state)
        groups = comparison.compare(measurements, self._frame)
        if judged_s > 0.0:
            rows = next(group.rows for group in groups if group.sensor == "velocity")
            self._judge_model(state, comparison.correction.innovation[rows].tolist(), judged_s)
            self._judge_accelerometer(state, t_ns, comparison.correction, rows, judged_s)
        self._gate_and_correct(state, t_ns, groups, comparison.correction)

    @staticmethod
    def _judge_model(state: FilterState, innovation: list[float], elapsed_s: float) -> None:
        """Follow no slow error of the receiver while the velocity is off the prediction, one way, for long.

        In a current a boat that goes ahead and astern by turns feels forces that change with its course, which a
        constant disturbance cannot be. Its estimated velocity is then off by decimetres a second, and the integral of
        that would be taken for the receiver's error, until its positions are rejected.
        """
        gain = elapsed_s / (MODEL_S + elapsed_s)
        north, east = state.model_off
        # One wild reading says nothing of the model.
        off_n, off_e = (min(max(off, -MODEL_MOST_MPS), MODEL_MOST_MPS) for off in innovation)
        state.model_off = north + gain * (off_n - north), east + gain * (off_e - east)
        if math.hypot(*state.model_off) >= MODEL_MPS:
            state.follows_bias = False

    def _judge_accelerometer(
        self, state: FilterState, t_ns: int, correction: Correction, rows: slice, elapsed_s: float
    ) -> None:
        """Doubt the accelerometer where a receiver's velocity and the model agree against it.

        Then the velocity is as uncertain as it has been off, so that the receiver's is taken.
        """
        off = ned_to_body(float(state.x[PSI]), *correction.innovation[rows].tolist())
        state.doubt = doubt = state.doubt.with_velocity(off, elapsed_s)
        if doubt.holds(t_ns):
            return
        variance = correction.noise[rows.start] + max(state.p[U, U], state.p[V, V])
        if doubt.is_due(math.sqrt(variance)):
            state.p = state.p.copy()
            state.p[[U, V], [U, V]] += 4.0 * (off[0] ** 2 + off[1] ** 2)
            state.doubt = doubt.begun(t_ns)
            state.interval_s = 0.0
            self._compare_again(state, correction)

    def _on_specific_force(self, state: FilterState, m: SpecificForce) -> None:
        interval_s = (m.t_ns - state.inertial_ns) * 1e-9
        state.inertial_ns = m.t_ns
        state.interval_s = 0.0
        if not (self._config.ekf.accelerometer and 0.0 < interval_s <= SLOWEST_INERTIAL_S):
            return
        if state.doubt.is_over(m.t_ns):
            self._believe_accelerometer(state, m.t_ns)
        self._fill_buffers(state)
        motion = self._motion
        motion.p[:] = state.p
        motion.arm[:] = m.arm_m
        motion.force[:] = measured = m.ax_mps2, m.ay_mps2
        correction = motion.correction
        correction.noise[:] = self._model_density / interval_s + self._accel_density
        motion.compare_specific_force()
        expected_x, expected_y = motion.expected_force.tolist()
        group = Group("acceleration", FORCE_ROWS, measured, (expected_x, expected_y))
        if state.doubt.open and self._is_frozen(state, m.t_ns, group):
            return
        shown = m.ax_mps2 - float(state.x[A_X]), m.ay_mps2 - float(state.x[A_Y])
        off_x, off_y = correction.innovation.tolist()
        state.doubt = state.doubt.with_force(m.t_ns, shown, (off_x, off_y), interval_s)
        if state.doubt.open:
            return
        before = state.x
        if self._gate_and_correct(state, m.t_ns, [group], correction):
            state.residual = correction.innovation - np.add.reduce(correction.h * (state.x - before), axis=1)
            state.interval_s = interval_s

    def _is_frozen(self, state: FilterState, t_ns: int, group: Group) -> bool:
        """The health of an accelerometer that is left out: whether it is frozen."""
        track = state.tracks.get(group.sensor, NEW_TRACK)
        limits = fault_recovery.FREEZE_LIMITS[group.sensor]
        track = sensor_health.update(track, t_ns, group.value, group.expected, limits, self._frozen_ns)
        state.tracks[group.sensor] = track
        return track.frozen

    def _believe_accelerometer(self, state: FilterState, t_ns: int) -> None:
        """Use it again after a doubt; what it was off by all the while is its bias from now on.

        Half of that is how uncertain the bias is, for the model may have been off too.
        """
        if not state.doubt.is_bias:
            state.doubt = state.doubt.begun(t_ns)
            return
        x, p = state.x.copy(), state.p.copy()
        x[A_X : A_Y + 1] += state.doubt.force
        p[A_X : A_Y + 1, :] = 0.0
        p[:, A_X : A_Y + 1] = 0.0
        least = self._config.ekf.accel_bias_std_mps2**2
        p[[A_X, A_Y], [A_X, A_Y]] = [least + 0.25 * part**2 for part in state.doubt.force]
        state.x, state.p, state.doubt = x, p, state.doubt.ended()

    # --- correction ------------------------------------------------------------------------------------------

    def _gate_and_correct(self, state: FilterState, t_ns: int, groups: list[Group], correction: Correction) -> bool:
        """Correct with the groups of rows that pass the gate: whether there was any."""
        variances, offs = correction.s.tolist(), correction.innovation.tolist()
        used = []
        for group in groups:
            name, rows, value, expected = group
            track = state.tracks.get(name, NEW_TRACK)
            limits, heard_ns = fault_recovery.FREEZE_LIMITS[name], track.received_ns
            track = sensor_health.update(track, t_ns, value, expected, limits, self._frozen_ns)
            if fault_recovery.is_frozen(state, name, track):
                state.tracks[name] = sensor_health.exclude(track)
                continue
            passes = _mahalanobis2(variances, offs, rows) <= self._gate2 * (rows.stop - rows.start)
            if name in ("position", "heading"):
                fault_recovery.note_place(state, t_ns, name, value, t_ns - heard_ns, accepted=passes)
            if passes:
                state.tracks[name] = sensor_health.accept(track, t_ns)
                used.append(group)
                continue
            off = offs[rows.start], offs[rows.stop - 1] if rows.stop - rows.start == 2 else 0.0
            slack = self._gate * math.sqrt(2.0 * correction.noise[rows.start])
            steady = fault_recovery.consistency_offset(state, t_ns, name, off)
            state.tracks[name] = track = sensor_health.reject(track, t_ns, steady, off, slack)
            if name == "yaw_rate" and track.rejected_in_row > 1:  # a single wild reading is none
                self._widen_heading(state, t_ns, off[0], t_ns - heard_ns)
            cleared = fault_recovery.is_cleared(state, t_ns, name, self._agreement_slack_m, self._return_ns)
            if cleared or fault_recovery.requires_reset(state, t_ns, name, math.hypot(*off) - slack, self._return_ns):
                if cleared:
                    fault_recovery.note_cleared(state, t_ns, name)
                trusted = track.accepted >= fault_recovery.LEAST_ACCEPTED and not cleared
                track = sensor_health.take_over(track, t_ns, math.hypot(*off)) if trusted else track
                self._reset(state, name, math.hypot(*off), moved=cleared)
                self._compare_again(state, correction)
                variances = correction.s.tolist()
                state.tracks[name] = sensor_health.accept(track, t_ns)
                used.append(group)
        if not used:
            return False
        if len(used) < len(groups):
            correction = self._part(correction, used[0].rows)
            self._compare_again(state, correction)
        self._correct(state, correction)
        return True

    @staticmethod
    def _widen_heading(state: FilterState, t_ns: int, off_radps: float, elapsed_ns: int) -> None:
        """A yaw rate that is rejected may have been a turn that no other sensor has shown yet.

        Not while the heading is bridged: nothing would bring it together again.
        """
        if t_ns - state.tracks["heading"].accepted_ns > COMPASS_FRESH_NS:
            return
        turned_rad = abs(off_radps) * min(elapsed_ns * 1e-9, LONGEST_TURN_S)
        state.p = state.p.copy()
        std_rad = math.sqrt(state.p[PSI, PSI])
        state.p[PSI, PSI] = max(std_rad, min(std_rad + turned_rad, WIDEST_RAD)) ** 2

    def _fill_state(self, state: FilterState) -> None:
        """The state and its covariance, which all corrections share."""
        self._motion.x[:], self._motion.p[:] = state.x, state.p

    def _compare_again(self, state: FilterState, correction: Correction) -> None:
        """The covariance of the same innovation, after the state's has been changed."""
        self._fill_state(state)
        correction.evaluate_innovation()

    def _part(self, correction: Correction, rows: slice) -> Correction:
        """The correction by some of the rows."""
        part = self._partial[rows.stop - rows.start]
        part.h[:], part.noise[:] = correction.h[rows], correction.noise[rows]
        part.innovation[:] = correction.innovation[rows]
        return part

    def _reset(self, state: FilterState, name: str, off: float, *, moved: bool) -> None:
        """Reset the states of a rejected sensor to its reading.

        A position that is `off` (m) while the receiver's velocity was accepted means a slow error of the receiver, and
        no motion of the boat, unless it is known to have `moved`: then that error is what is reset.
        """
        std_m = self._config.ekf.position_bias_std_m
        velocity = state.tracks.get("velocity")
        moved = moved or velocity is None or velocity.accepted == 0 or velocity.rejected_in_row > 0
        if name != "position" or moved or not state.follows_bias or off > BIAS_SIGMA * std_m:
            fault_recovery.reset_states(state, name)
            return
        state.resets += 1
        state.p = state.p.copy()
        state.p[[B_N, B_E], [B_N, B_E]] += std_m**2

    def _correct(self, state: FilterState, correction: Correction) -> None:
        """State and covariance after a correction; the covariance stays symmetric."""
        # A fused velocity holds the heading's own error. While a velocity is rejected, a position that leaves the
        # prediction may be a motion as well as an error of the receiver.
        velocity = state.tracks.get("velocity", NEW_TRACK)
        follows = state.follows_bias and velocity.rejected_in_row < sensor_health.TOLD_AFTER
        correction.used[:] = self._all_used if follows else self._unbiased
        correction.evaluate()
        state.x, state.p = correction.x_after.copy(), correction.p_after.copy()

    def _clip(self, x: Array) -> None:
        part = x[D_N : B_E + 1]
        np.minimum(np.maximum(part, self._least, out=part), self._most, out=part)  # as np.clip, and cheaper


def _mahalanobis2(s: list[list[float]], innovation: list[float], rows: slice) -> float:
    """The squared Mahalanobis distance of one or two rows."""
    i: int = rows.start
    j: int = rows.stop - 1
    x, y = innovation[i], innovation[j]
    if i == j:
        return x * x / s[i][i]
    a, b, c, d = s[i][i], s[i][j], s[j][i], s[j][j]
    return (d * x * x - (b + c) * x * y + a * y * y) / (a * d - b * c)
