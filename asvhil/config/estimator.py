"""State and wind estimation, and the watch over the model."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from asvhil.config.base import Degrees, NonNegative, Positive, Section


class CompassConfig(Section):
    """Deviation of the compass, A to E in degrees: it adds A + B sin psi + C cos psi + D sin 2 psi + E cos 2 psi.

    They are what a calibration has found (`asvhil calibrate`). `std_deg` is how far each may still be from the boat's
    own: the filter then goes on to estimate them, and lets them wander by `walk_deg` per sqrt(s). 0: they are exact.
    """

    deviation_deg: tuple[Degrees, Degrees, Degrees, Degrees, Degrees] = (0.0, 0.0, 0.0, 0.0, 0.0)
    std_deg: NonNegative = 0.0
    walk_deg: NonNegative = 0.0


class TrustConfig(Section):
    """When a sensor is not believed, for how long the filter does without it, and when it is believed again.

    A reading farther than `ekf.gate_sigma` standard deviations from the prediction is refused. One that repeats itself
    to the last bit for `frozen_after_s`, where it used to be noisy or the boat has moved, is frozen. Without position
    or without heading the filter dead-reckons on the other sensors for `dead_reckoning_s` at most, and only while the
    predicted standard deviations are within the limits. What is refused for longer is believed when it has been
    consistent with the motion for `return_after_s` while there was no valid estimate: never by a jump under way.
    """

    frozen_after_s: Positive = 0.3
    dead_reckoning_s: NonNegative = 35.0
    position_std_max_m: Positive = 1.5
    heading_std_max_deg: Positive = 6.0
    return_after_s: Positive = 3.0


class EkfConfig(Section):
    """Noise of the extended Kalman filter: random walks per sqrt(s), measurement standard deviations, priors of biases.

    The velocity walk is the model's error as white acceleration. With the accelerometer, whose white noise is
    `accel_std_mps2`, the velocity follows what of the two is better, and the model's error is seen at once. A prior of
    0 keeps its bias out: position is then what the receiver says, its slow error included.
    """

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
    stale_after_s: Positive = 1.0
    accelerometer: bool = True
    accel_std_mps2: Positive = 0.03
    accel_bias_std_mps2: NonNegative = 0.05
    accel_bias_walk_mps2: NonNegative = 0.0001
    gyro_bias_std_radps: NonNegative = 0.001
    gyro_bias_walk_radps: NonNegative = 1e-5
    position_bias_std_m: NonNegative = 0.0
    position_bias_time_s: Positive = 90.0
    compass: CompassConfig = CompassConfig()
    history_s: NonNegative = 1.0


class FirConfig(Section):
    """The paper's velocity: taps of the filter on the accelerometer, and how long integration is trusted over GNSS.

    The defaults are the best of taps 1 to 15 and times 0.1 to 2 s, that have a filter at all, on both boats' sensors.
    """

    taps: Annotated[int, Field(ge=1, le=500)] = 3
    fusion_time_s: Positive = 0.5


class WindFilterConfig(Section):
    """Low-pass of the true wind, of its direction and of its speed, and when it is too old to use.

    `vane_offset_deg` is how far the vane's zero is turned clockwise from the bow (`asvhil calibrate` finds it). An
    anemometer that does not move for `stuck_after_s` though it should is stuck; absent: nobody looks. A wind above
    `speed_max_mps` is none; one that differs by more than `leap_max_mps` from the wind so far is believed when it has
    stayed for `leap_after_s`.
    """

    time_constant_s: Positive = 4.0
    speed_time_constant_s: Positive = 0.5
    stale_after_s: Positive = 3.0
    vane_offset_deg: Degrees = 0.0
    stuck_after_s: Positive | None = 2.0
    speed_max_mps: Positive = 60.0
    leap_max_mps: Positive = 10.0
    leap_after_s: Positive = 2.0


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
    trust: TrustConfig = TrustConfig()
    wind: WindFilterConfig = WindFilterConfig()
    monitor: MonitorConfig = MonitorConfig()
