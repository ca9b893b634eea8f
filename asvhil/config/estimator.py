"""State and wind estimation, and the watch over the model."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from asvhil.config.base import Positive, Section


class EkfConfig(Section):
    """Noise of the extended Kalman filter: random walks per sqrt(s), measurement standard deviations, gates."""

    velocity_walk_mps: Positive = 0.10
    yaw_rate_walk_radps: Positive = 0.05
    position_walk_m: Positive = 0.02
    heading_walk_rad: Positive = 0.002
    disturbance_walk_mps2: Positive = 0.006
    disturbance_yaw_walk_radps2: Positive = 0.003
    disturbance_max_mps2: Positive = 0.3
    disturbance_yaw_max_radps2: Positive = 0.15
    position_std_m: Positive = 0.15
    velocity_std_mps: Positive = 0.06
    heading_std_deg: Positive = 0.4
    yaw_rate_std_radps: Positive = 0.01
    gate_sigma: Positive = 5.0
    reset_after_s: Positive = 3.0
    stale_after_s: Positive = 1.0


class FirConfig(Section):
    """The paper's velocity: taps of the filter on the accelerometer, and how long integration is trusted over GNSS."""

    taps: Annotated[int, Field(ge=1, le=500)] = 9
    fusion_time_s: Positive = 1.0


class WindFilterConfig(Section):
    """Low-pass of the true wind and when it is too old to use."""

    time_constant_s: Positive = 4.0
    stale_after_s: Positive = 3.0


class MonitorConfig(Section):
    """When the boat no longer behaves as the model says: limits of the RMS error after a horizon, over a window."""

    horizon_s: Positive = 4.0
    window_s: Positive = 20.0
    max_u_mps: Positive = 0.35
    max_v_mps: Positive = 0.25
    max_r_radps: Positive = 0.12


class EstimatorConfig(Section):
    """`kind`: the EKF; the paper's FIR-filtered accelerometer fused with the GNSS speed; or the readings as they come.

    The last two have the wind as the sensor gives it, turned by the heading and freed of the velocity.
    """

    kind: Literal["ekf", "fir", "raw"] = "ekf"
    ekf: EkfConfig = EkfConfig()
    fir: FirConfig = FirConfig()
    wind: WindFilterConfig = WindFilterConfig()
    monitor: MonitorConfig = MonitorConfig()
