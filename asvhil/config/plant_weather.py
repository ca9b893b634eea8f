"""The simulated weather: wind, current and waves."""

from __future__ import annotations

from pydantic import Field

from asvhil.config.base import Degrees, Fraction, NonNegative, Positive, Section

MOST_WIND_MPS = 100.0


class WindSpreadConfig(Section):
    """A wind given by the spread of its speed and of its direction, as field records give it: light airs wander.

    The speed is lognormal, the direction normal; each follows an Ornstein-Uhlenbeck process with `gust_time_s`.
    """

    speed_mps: NonNegative = Field(default=0.0, le=100.0, description="Standard deviation of the speed.")
    toward_deg: NonNegative = Field(default=0.0, description="Circular standard deviation of the direction.")


class WindConfig(Section):
    """Mean true wind and its gusts: two-component Ornstein-Uhlenbeck, fractions of the mean speed."""

    speed_mps: NonNegative = Field(default=3.0, le=MOST_WIND_MPS, description="Mean speed of the wind over ground.")
    toward_deg: Degrees = Field(
        default=0.0, description="Direction that the wind blows toward, clockwise from north (not where it comes from)."
    )
    gust_along: NonNegative = Field(
        default=0.15, description="Standard deviation of the gusts along the wind, over the mean speed."
    )
    gust_across: NonNegative = Field(
        default=0.075, description="Standard deviation of the gusts across the wind, over the mean speed."
    )
    gust_time_s: Positive = Field(default=15.0, description="Correlation time of the gusts.")
    spread: WindSpreadConfig | None = Field(
        default=None, description="Spread of speed and direction, in the place of gusts along and across; null: these."
    )


class CurrentConfig(Section):
    """A current that is the same everywhere and at all times."""

    speed_mps: NonNegative = Field(default=0.0, le=20.0, description="Speed of the water over ground.")
    toward_deg: Degrees = Field(default=0.0, description="Direction that it sets toward, clockwise from north.")


class WavesConfig(Section):
    """First-order motion of the boat in waves; off while both standard deviations are 0.

    0.07 m/s and 0.02 rad/s make a light chop for a boat of 5 m.
    """

    orbital_std_mps: float = Field(
        default=0.0, ge=0.0, le=5.0, description="Standard deviation of the velocity along the waves' direction."
    )
    yaw_std_radps: float = Field(default=0.0, ge=0.0, le=1.0, description="Standard deviation of the yaw rate.")
    peak_hz: float = Field(default=0.3, ge=0.02, le=5.0, description="Peak frequency of the spectrum.")
    damping: float = Field(
        default=0.15, ge=0.01, lt=1.0, description="Damping ratio of each of two shaping filters in series."
    )
    spreading: Fraction = Field(
        default=0.58,
        description=(
            "Velocity across the waves' direction over that along it: 0 for long-crested waves, sqrt(1/3) for "
            "cosine-squared spreading, 1 for a confused sea."
        ),
    )
    tilt: Fraction = Field(
        default=1.0, description="Share of the water's slope that the boat rolls and pitches with; 0: on an even keel."
    )
    toward_deg: Degrees | None = Field(
        default=None, description="Direction that the waves travel toward, clockwise from north; null: with the wind."
    )


class WeatherConfig(Section):
    """Wind, current and waves."""

    wind: WindConfig = Field(default=WindConfig(), description="Wind.")
    current: CurrentConfig = Field(default=CurrentConfig(), description="Current.")
    waves: WavesConfig = Field(default=WavesConfig(), description="Waves.")
