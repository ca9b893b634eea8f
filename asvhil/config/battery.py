"""When the autopilot's battery counts as low."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from asvhil.config.base import Positive, Section


class BatteryConfig(Section):
    """The watch over the battery of motors and autopilot, by what the autopilot tells of it (SYS_STATUS; of several
    batteries the lowest charge, by BATTERY_STATUS, and what that finds wrong with one).

    The autopilot's own fail-safe (BATT_FS_LOW_ACT, COM_LOW_BAT_ACT) goes on beside it: where it changes the mode, that
    ends the hold.
    """

    low_percent: float | None = Field(
        default=20.0, gt=0.0, lt=100.0, description="Charge that is left, where the autopilot knows it. null: no limit."
    )
    low_v: Positive | None = Field(
        default=None, description="Voltage; set it for a battery whose charge the autopilot does not know."
    )
    lasts_s: Positive = Field(
        default=10.0, description="It is low once it has been so for this long: thrust lets the voltage sag."
    )
    on_low: Literal["tell", "release"] = Field(
        default="tell",
        description=(
            "`tell`: a note, and the hold goes on. `release`: the hold ends, neutral first, and none begins; what is "
            "left takes the boat home."
        ),
    )
