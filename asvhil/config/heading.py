"""Which heading a station has: the one that was asked for, or one that the weather wants."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from asvhil.config.base import Positive, Section

POLICIES = ("fixed", "bow", "stern", "either", "free")


class HeadingConfig(Section):
    """The heading of a station while it is held.

    Across the weather a boat with two fixed motors swings, and works its motors at their limits. With the weather on
    its bow or its stern it lies still, at a small part of the thrust.
    """

    policy: Literal["fixed", "bow", "stern", "either", "free"] = Field(
        default="fixed",
        description=(
            "`fixed`: the heading that was asked for. `bow`: the one at which the mean force of wind, current and "
            "waves comes from ahead. `stern`: from astern. `either`: the nearer of both, when the hold begins. `free`: "
            "position alone, by the least effort: the one of both that asks less of the motors, and as the boat lies "
            "where there is no weather."
        ),
    )
    time_constant_s: Positive = Field(
        default=60.0,
        le=1000.0,
        description="Time constant over which the weather's force is averaged; a quarter of it for the wind.",
    )
    deadband_deg: Positive = Field(
        default=8.0,
        le=90.0,
        description="The station's heading stays where it is until the weather's is off by more than this.",
    )
    turn_deg_per_min: Positive = Field(
        default=30.0,
        le=60.0,
        description=(
            "How fast the station's heading follows then; a fifth of it in the last degrees, three times as fast when "
            "a hold begins."
        ),
    )
