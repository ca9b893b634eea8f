"""The paper's velocity estimate with the pose of the sensors, and the raw readings: baselines for the EKF.

The paper has no equation for it. In its words (Results, Data Collection): an accelerometer "tends to drift over time,
which is solved using a finite impulse response filter for the acceleration and fusing the speed calculated from the
integration of the acceleration with GPS measurements". Length, window and gain are ours.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from asvhil.config import Config, EkfConfig, FirConfig
from asvhil.dynamics.integrate import integrate, substeps
from asvhil.dynamics.protocol import Dynamics
from asvhil.geo import LocalFrame, body_to_ned, ned_to_body, wrap_rad
from asvhil.types import Estimate, GroundVelocity, Heading, Measurement, Note, Position, SpecificForce, YawRate

MAX_GAP_S = 0.5  # between two accelerations: over a longer one nothing is integrated


class FirFilter:
    """y_k = sum_i h_i x_(k-i): a Hamming window of `taps` samples whose weights sum to one, so it follows the mean.

    Its delay is (taps - 1) / 2 samples. Before it is full, the first sample stands for those before it.
    """

    def __init__(self, taps: int) -> None:
        window = np.hamming(taps) if taps > 1 else np.ones(1)
        self._weights: list[float] = (window / window.sum()).tolist()
        self._past: deque[float] = deque(maxlen=taps)

    def step(self, x: float) -> float:
        """Add one sample: the filtered value."""
        while len(self._past) < len(self._weights) - 1:
            self._past.append(x)
        self._past.append(x)
        return math.fsum(h * value for h, value in zip(self._weights, self._past, strict=True))


class HeldSensors:
    """The last readings of pose, velocity and yaw rate: no filter, no gate, no prediction between readings.

    The model's motor states are propagated, as they are in every estimator, for the controllers that need them.
    """

    def __init__(self, config: EkfConfig, model: Dynamics) -> None:
        self._stale_ns = round(config.stale_after_s * 1e9)
        heading_rad = math.radians(config.heading_std_deg)
        position_m, velocity_mps = config.position_std_m, config.velocity_std_mps
        self._std = (position_m, position_m, heading_rad, velocity_mps, velocity_mps, config.yaw_rate_std_radps)
        self._model = model
        self._input = (0.0, 0.0)
        self._motor = np.zeros(model.n_motor)
        self._motor_ns: int | None = None
        self._n_m = self._e_m = 0.0
        self._psi_rad = self._r_radps = 0.0
        self._vn_mps = self._ve_mps = 0.0
        self._position_ns: int | None = None
        self._heading_ns: int | None = None
        self.frame: LocalFrame | None = None

    def set_forcing(self, model_input: tuple[float, float], wind_ned: tuple[float, float] | None) -> None:
        """Set the model's input, which drives the motor states. The wind is not used."""
        self._input = model_input

    def on_measurements(self, measurements: Sequence[Measurement]) -> None:
        """Keep each value."""
        for m in measurements:
            match m:
                case Position():
                    self._on_position(m)
                case GroundVelocity():
                    self._on_velocity(m)
                case Heading():
                    self._psi_rad, self._heading_ns = m.psi_rad, m.t_ns
                case YawRate():
                    self._r_radps = m.r_radps
                case SpecificForce():
                    self._on_specific_force(m)
                case _:
                    pass

    def estimate(self, t_ns: int) -> Estimate | None:
        """The last readings; not valid while position or heading is stale."""
        if self.frame is None:
            return None
        u, v = ned_to_body(self._psi_rad, self._vn_mps, self._ve_mps)
        self._propagate_motors(t_ns, (u, v, self._r_radps))
        return Estimate(
            t_ns=t_ns,
            n_m=self._n_m,
            e_m=self._e_m,
            psi_rad=wrap_rad(self._psi_rad),
            u_mps=u,
            v_mps=v,
            r_radps=self._r_radps,
            motor=tuple(self._motor.tolist()),
            std=self._std,
            disturbance=(0.0, 0.0, 0.0),
            valid=self._is_fresh(self._position_ns, t_ns) and self._is_fresh(self._heading_ns, t_ns),
        )

    def notes(self, t_ns: int) -> tuple[Note, ...]:
        """No notes: sensors are not monitored."""
        return ()

    def counters(self) -> tuple[tuple[str, int], ...]:
        """No counters: nothing is rejected."""
        return ()

    def _on_position(self, m: Position) -> None:
        if self.frame is None and self._is_fresh(self._heading_ns, m.t_ns):
            self.frame = LocalFrame(lat_deg=m.lat_deg, lon_deg=m.lon_deg)
        if self.frame is not None:
            self._n_m, self._e_m = self.frame.to_ned(m.lat_deg, m.lon_deg)
            self._position_ns = m.t_ns

    def _on_velocity(self, m: GroundVelocity) -> None:
        self._vn_mps, self._ve_mps = m.vn_mps, m.ve_mps

    def _on_specific_force(self, m: SpecificForce) -> None:
        """Not used: the velocity is that of the GNSS."""

    def _is_fresh(self, at_ns: int | None, t_ns: int) -> bool:
        return at_ns is not None and t_ns - at_ns <= self._stale_ns

    def _propagate_motors(self, t_ns: int, nu: tuple[float, float, float]) -> None:
        """Propagate the motor states under the input, at constant velocity."""
        elapsed_s = 0.0 if self._motor_ns is None else (t_ns - self._motor_ns) * 1e-9
        self._motor_ns = t_ns
        if not len(self._motor) or elapsed_s <= 0.0:
            return
        model, a, still = self._model, np.array(self._input), np.zeros(2)

        def rate(motor: np.ndarray) -> np.ndarray:
            return np.asarray(model.derivative(np.concatenate((nu, motor)), a, still))[3:]

        elapsed_s = min(elapsed_s, MAX_GAP_S)
        self._motor = integrate(rate, self._motor, elapsed_s, substeps(elapsed_s, model.max_step_s), euler=False)


class FirFusion(HeldSensors):
    """The paper's estimator: the FIR-filtered acceleration is integrated, and corrected by each GNSS velocity.

    v += R(psi) a_f dt at each acceleration (trapezoidal rule, NED), and v += (1 - exp(-dt / T)) (v_gnss - v) at each
    fix, with T = `fusion_time_s`: the drift of a biased accelerometer ends at about T times the bias. Everything else
    is as the sensors give it.
    """

    def __init__(self, config: EkfConfig, fir: FirConfig, model: Dynamics) -> None:
        super().__init__(config, model)
        self._fusion_time_s = fir.fusion_time_s
        self._surge, self._sway = FirFilter(fir.taps), FirFilter(fir.taps)
        self._imu_ns: int | None = None
        self._velocity_ns: int | None = None
        self._an_mps2 = self._ae_mps2 = 0.0

    def _on_specific_force(self, m: SpecificForce) -> None:
        """Integrate one acceleration, once there is an initial velocity."""
        an, ae = body_to_ned(self._psi_rad, self._surge.step(m.ax_mps2), self._sway.step(m.ay_mps2))
        elapsed_s = 0.0 if self._imu_ns is None else (m.t_ns - self._imu_ns) * 1e-9
        if self._velocity_ns is not None and 0.0 < elapsed_s <= MAX_GAP_S:
            self._vn_mps += 0.5 * elapsed_s * (self._an_mps2 + an)
            self._ve_mps += 0.5 * elapsed_s * (self._ae_mps2 + ae)
        self._an_mps2, self._ae_mps2, self._imu_ns = an, ae, m.t_ns

    def _on_velocity(self, m: GroundVelocity) -> None:
        if self._velocity_ns is None:
            gain = 1.0
        else:
            gain = -math.expm1(-max(m.t_ns - self._velocity_ns, 0) * 1e-9 / self._fusion_time_s)
        self._vn_mps += gain * (m.vn_mps - self._vn_mps)
        self._ve_mps += gain * (m.ve_mps - self._ve_mps)
        self._velocity_ns = m.t_ns


def build_fir(settings: FirConfig, config: Config, model: Dynamics) -> FirFusion:
    """The paper's estimator of a config."""
    return FirFusion(config.estimator.ekf, settings, model)


def build_raw(settings: None, config: Config, model: Dynamics) -> HeldSensors:
    """The estimator of raw readings, of a config."""
    return HeldSensors(config.estimator.ekf, model)
