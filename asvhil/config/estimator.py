"""State and wind estimation, and the monitor of the model's predictions."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from asvhil.config.base import Degrees, Fraction, NonNegative, Positive, Section
from asvhil.config.chosen import Choosing, NamedIn
from asvhil.config.registry import ESTIMATORS, EstimatorKind

STEEPEST_DEG = 50.0  # a deviation that falls by 57.3 degrees per radian of heading shows two headings as one


class CompassConfig(Section):
    """Deviation of the compass: it reads psi + A + B sin psi + C cos psi + D sin 2 psi + E cos 2 psi.

    `asvhil calibrate` finds the coefficients in a log of circles. The deviation is taken from every heading as it is
    decoded, whichever source is in use.
    """

    deviation_deg: tuple[Degrees, Degrees, Degrees, Degrees, Degrees] = Field(
        default=(0.0, 0.0, 0.0, 0.0, 0.0), description="Coefficients A to E."
    )
    std_deg: NonNegative = Field(
        default=0.0,
        description=(
            "Standard deviation of each coefficient; above 0 the EKF goes on to estimate what is left of the "
            "deviation, 0: they are exact."
        ),
    )
    walk_deg: NonNegative = Field(
        default=0.0, description="Random walk of each coefficient (degrees per sqrt(s)), where std_deg is above 0."
    )

    @model_validator(mode="after")
    def _check_deviation(self) -> CompassConfig:
        _, b, c, d, e = self.deviation_deg
        steepest_deg = math.hypot(b, c) + 2.0 * math.hypot(d, e)
        if steepest_deg > STEEPEST_DEG:
            raise ValueError(
                f"deviation_deg: sqrt(B^2 + C^2) + 2 sqrt(D^2 + E^2) is {steepest_deg:.0f}, and must be at most "
                f"{STEEPEST_DEG:g}: else two headings have one reading"
            )
        return self


class TrustConfig(Section):
    """When the EKF rejects a sensor, how long it dead-reckons without it, and when it accepts it again."""

    frozen_after_s: Positive = Field(
        default=0.3,
        description=(
            "A sensor that repeats a reading exactly for this long is frozen, if it used to be noisy or the boat has "
            "moved."
        ),
    )
    dead_reckoning_s: NonNegative = Field(
        default=35.0,
        description=(
            "Longest time without position, or without heading, for which the estimate stays valid on the other one "
            "and the yaw rate."
        ),
    )
    position_std_max_m: Positive = Field(
        default=1.5, description="Predicted standard deviation of the position at which dead reckoning ends."
    )
    heading_std_max_deg: Positive = Field(
        default=6.0, description="Predicted standard deviation of the heading at which dead reckoning ends."
    )
    return_after_s: Positive = Field(
        default=3.0,
        description=(
            "A sensor that the gate rejects is accepted again only after there has been no valid estimate for this "
            "long, and its readings have been consistent with the motion as long."
        ),
    )


class EkfConfig(Section):
    """The extended Kalman filter: random walks per sqrt(s), standard deviations of measurements, priors of biases.

    Standard deviations of measurements come from data sheets, or from a log of the boat at rest. Random walks say how
    far the model can be wrong: raise them where the estimate lags behind the boat, lower them where it follows noise.
    The defaults suit a VN-300 on a WAM-V; `config/bream.yaml` has those of cheap sensors.
    """

    velocity_walk_mps: Positive = Field(
        default=0.10, description="Random walk of u and v (m/s per sqrt(s)): the model's error as white acceleration."
    )
    yaw_rate_walk_radps: Positive = Field(default=0.05, description="Random walk of r (rad/s per sqrt(s)).")
    position_walk_m: Positive = Field(default=0.02, description="Random walk of the position (m per sqrt(s)).")
    heading_walk_rad: Positive = Field(default=0.002, description="Random walk of the heading (rad per sqrt(s)).")
    disturbance_walk_mps2: Positive = Field(
        default=0.006, description="Random walk of the disturbance, the acceleration that the model misses, NED."
    )
    disturbance_yaw_walk_radps2: Positive = Field(default=0.003, description="Random walk of the disturbance in yaw.")
    disturbance_max_mps2: Positive = Field(default=0.3, description="Bound on each of the disturbance's components.")
    disturbance_yaw_max_radps2: Positive = Field(default=0.15, description="Bound on the disturbance in yaw.")
    position_std_m: Positive = Field(default=0.15, description="Noise of a GNSS position, each axis.")
    velocity_std_mps: Positive = Field(default=0.06, description="Noise of a GNSS velocity, each axis.")
    heading_std_deg: Positive = Field(default=0.4, description="Noise of a heading.")
    yaw_rate_std_radps: Positive = Field(default=0.01, description="Noise of a yaw rate.")
    gate_sigma: Positive = Field(
        default=5.0, description="A reading farther than this many standard deviations from the prediction is rejected."
    )
    stale_after_s: Positive = Field(default=1.0, description="A sensor without a reading for this long is silent.")
    accelerometer: bool = Field(
        default=True,
        description="Whether the accelerometer takes part in the prediction; it must come at 5 Hz or more.",
    )
    accel_std_mps2: Positive = Field(
        default=0.03,
        description=(
            "Noise of the specific force. Without an INS that levels it, add what gravity contributes: 0.17 m/s^2 per "
            "degree of roll and pitch."
        ),
    )
    accel_bias_std_mps2: NonNegative = Field(
        default=0.05, description="Prior of the accelerometer's bias; 0: no bias is estimated."
    )
    accel_bias_walk_mps2: NonNegative = Field(default=0.0001, description="Random walk of the accelerometer's bias.")
    gyro_bias_std_radps: NonNegative = Field(
        default=0.001, description="Prior of the gyro's bias; 0: no bias is estimated."
    )
    gyro_bias_walk_radps: NonNegative = Field(default=1e-5, description="Random walk of the gyro's bias.")
    position_bias_std_m: NonNegative = Field(
        default=0.0,
        description=(
            "Standard deviation of the GNSS position's slow error, which is then estimated instead of being followed "
            "by the boat; 0: none is estimated, as for an RTK receiver."
        ),
    )
    position_bias_time_s: Positive = Field(
        default=90.0, description="Correlation time of that slow error (first-order Gauss-Markov)."
    )
    compass: CompassConfig = Field(default=CompassConfig(), description="Deviation of the compass.")
    history_s: NonNegative = Field(
        default=1.0,
        description=(
            "Readings that arrive up to this much later than they were measured are processed at their own time; "
            "later ones are dropped and counted."
        ),
    )


class WaveFilterConfig(Section):
    """The wave filter: takes first-order wave motion out of what the EKF gives to the controller.

    It splits the motion by the vessel model, so in waves the model counts for more: its walks are less than the EKF's.
    """

    mode: Literal["auto", "on", "off"] = Field(
        default="auto",
        description=(
            "`auto`: by as much as there are waves, and not at all where there are none. `on`: always. `off`: never, "
            "and the motors work against every wave."
        ),
    )
    least_mps: Positive = Field(
        default=0.04,
        description=(
            "Velocity (rms of surge, sway and yaw together) at the peak from which on `auto` takes waves out, wholly "
            "from twice this on."
        ),
    )
    damping: Fraction = Field(
        default=0.2, gt=0.0, description="Relative damping of the wave spectrum that is assumed: less is narrower."
    )
    velocity_walk_mps: Positive = Field(
        default=0.015, description="Random walk of the low-frequency velocity (m/s per sqrt(s)): the model's error."
    )
    yaw_rate_walk_radps: Positive = Field(
        default=0.015, description="Random walk of the low-frequency yaw rate (rad/s per sqrt(s))."
    )
    disturbance_walk_mps2: Positive = Field(
        default=0.002, description="Random walk of the disturbance, beside waves (m/s^2 per sqrt(s))."
    )
    disturbance_yaw_walk_radps2: Positive = Field(
        default=0.001, description="Random walk of the disturbance in yaw, beside waves (rad/s^2 per sqrt(s))."
    )


class FirConfig(Section):
    """The paper's velocity estimate: a FIR filter on the accelerometer, integrated and fused with the GNSS velocity.

    The paper gives neither value. Of up to 15 taps and times of 0.1 to 2 s the defaults are the best that filter at
    all, on the simulated sensors of both boats.
    """

    taps: int = Field(default=3, ge=1, le=500, description="Length of the FIR filter, in samples; 1: no filter.")
    fusion_time_s: Positive = Field(
        default=0.5, description="Time constant at which the integrated velocity is drawn to that of the GNSS."
    )


class WindFilterConfig(Section):
    """Low-pass of the true wind, and when a wind measurement is too old, stuck or implausible."""

    time_constant_s: Positive = Field(
        default=4.0,
        description="Time constant for the direction; long, since a vane of 16 positions is 11 degrees off.",
    )
    speed_time_constant_s: Positive = Field(default=0.5, description="Time constant for the speed.")
    stale_after_s: Positive = Field(default=3.0, description="A wind without a sample for this long is not valid.")
    vane_offset_deg: Degrees = Field(
        default=0.0,
        description="How far the vane's zero is turned clockwise from the bow; `asvhil calibrate` finds it.",
    )
    stuck_after_s: Positive | None = Field(
        default=2.0,
        description=(
            "An anemometer whose reading stays the same for this long, though it should change, is stuck; null: not "
            "checked."
        ),
    )
    speed_max_mps: Positive = Field(default=60.0, description="A higher wind speed is rejected as implausible.")
    leap_max_mps: Positive = Field(
        default=10.0, description="A wind that differs by more than this from the filtered one is rejected at first."
    )
    leap_after_s: Positive = Field(
        default=2.0,
        description=(
            "Such a wind is accepted once it has lasted for this long, times the square of its difference over "
            "leap_max_mps, five times at most."
        ),
    )


class MonitorConfig(Section):
    """The monitor of the model: RMS errors of its open-loop predictions beyond which `health.model_ok` is false."""

    horizon_s: Positive = Field(default=4.0, le=60.0, description="How far ahead the model is rolled out.")
    window_s: Positive = Field(default=20.0, description="Sliding window over which the RMS is taken.")
    max_u_mps: Positive = Field(default=0.35, description="Limit for the surge velocity.")
    max_v_mps: Positive = Field(default=0.25, description="Limit for the sway velocity.")
    max_r_radps: Positive = Field(default=0.12, description="Limit for the yaw rate.")
    mismatch_s: Positive = Field(
        default=10.0, description="Errors beyond a limit for this long mean that the model does not fit the boat."
    )
    on_mismatch: Literal["tell", "release"] = Field(
        default="tell",
        description="What then follows. `tell`: a note, and the hold goes on. `release`: the hold ends, neutral first.",
    )


ESTIMATORS.fill(
    (
        EstimatorKind(name="ekf", build="asvhil.estimator.ekf:build"),
        EstimatorKind(
            name="fir",
            build="asvhil.estimator.fir_estimator:build_fir",
            section=FirConfig,
            filters_wind=False,
            disturbance=False,
        ),
        EstimatorKind(
            name="raw", build="asvhil.estimator.fir_estimator:build_raw", filters_wind=False, disturbance=False
        ),
    )
)


class EstimatorConfig(Choosing):
    """The state estimator, the wind filter and the monitor of the model.

    An estimator of a plug-in has its settings here too, under its own name with `_` for `-`.
    """

    registry = ESTIMATORS
    chooser = "kind"

    kind: Annotated[str, NamedIn(ESTIMATORS)] = Field(
        default="ekf",
        description=(
            "`ekf`: extended Kalman filter with the vessel model. `fir`: the paper's FIR-filtered accelerometer fused "
            "with the GNSS velocity. `raw`: the latest readings. The last two are for comparison and check no sensor; "
            "their wind is not filtered."
        ),
    )
    ekf: EkfConfig = Field(
        default=EkfConfig(),
        description="The filter; `fir` and `raw` take the standard deviations, stale_after_s and the compass from it.",
    )
    fir: FirConfig = Field(default=FirConfig(), description="The paper's velocity estimate.")
    trust: TrustConfig = Field(default=TrustConfig(), description="Fault detection of the EKF.")
    waves: WaveFilterConfig = Field(
        default=WaveFilterConfig(), description="The wave filter; `fir` and `raw`, which have no model, do without."
    )
    wind: WindFilterConfig = Field(default=WindFilterConfig(), description="The wind filter.")
    monitor: MonitorConfig = Field(default=MonitorConfig(), description="The monitor of the model.")
