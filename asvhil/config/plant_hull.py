"""What the simulated boat has that no model of the controllers knows: wind load by another law, imperfect motors."""

from __future__ import annotations

from pydantic import Field

from asvhil.config.base import Degrees, Fraction, NonNegative, Positive, Section


class BlendermannConfig(Section):
    """Wind load after Blendermann (1994; Fossen 2011, section 8.1) in the place of the law of `vessel.wind_*`.

    The defaults are Blendermann's coefficients of a speed boat.
    """

    frontal_area_m2: Positive = Field(description="Area above the water as seen from ahead, A_Fw.")
    lateral_area_m2: Positive = Field(description="Area above the water as seen from abeam, A_Lw.")
    length_m: Positive = Field(description="Length over all, L_oa.")
    centroid_ahead_m: float = Field(default=0.0, description="Centroid of the lateral area, ahead of the origin, s_L.")
    drag_side: Positive = Field(default=0.9, description="Drag coefficient of wind from abeam, C_Dt.")
    drag_bow: Positive = Field(default=0.55, description="Drag coefficient of wind on the bow, C_Dl,AF(0).")
    drag_stern: Positive = Field(default=0.6, description="Drag coefficient of wind on the stern, C_Dl,AF(pi).")
    cross_force: float = Field(default=0.6, ge=0.0, le=1.0, description="Cross-force parameter, delta.")
    air_density_kgpm3: Positive = Field(default=1.2, description="Density of the air.")


class PlantMotorsConfig(Section):
    """How the simulated boat's motors fall short of `vessel.thrust_curve`; the defaults are perfect motors."""

    port_thrust: NonNegative = Field(default=1.0, description="Thrust of the port motor over that of the curve.")
    starboard_thrust: NonNegative = Field(
        default=1.0, description="Thrust of the starboard motor over that of the curve."
    )
    reversal_dead_time_s: NonNegative = Field(
        default=0.0, description="Time without thrust after a motor is told to turn the other way."
    )
    sag_at_full_thrust: Fraction = Field(
        default=0.0,
        description="Part of the thrust that is lost to the battery's falling voltage while both motors give all.",
    )
    sag_per_hour: Fraction = Field(
        default=0.0,
        description="Part of the thrust that is lost in each hour, as the battery empties, down to 0.2.",
    )


class TiltConfig(Section):
    """Roll and pitch of the simulated boat beside those of its waves, and what its autopilot knows of them.

    The accelerometer shows gravity as far as the boat is tilted. The defaults are an even keel and a perfect autopilot.
    """

    roll_deg: Degrees = Field(default=0.0, description="List of the boat, starboard down.")
    pitch_deg: Degrees = Field(default=0.0, description="Trim of the boat at rest, bow up.")
    thrust_deg: Degrees = Field(default=0.0, description="Further pitch while both motors give all ahead, bow up.")
    imu_roll_deg: Degrees = Field(
        default=0.0,
        description="Roll of the inertial unit beside the boat's, which the autopilot's attitude leaves out.",
    )
    imu_pitch_deg: Degrees = Field(default=0.0, description="The same of its pitch.")
    attitude_deg: NonNegative = Field(
        default=0.0,
        description="Standard deviation of the slow error of roll and pitch that the autopilot tells, each.",
    )
    attitude_time_s: Positive = Field(default=60.0, description="Correlation time of that error.")
