"""How a station may move: by a course that operators give it, or after a leader."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from asvhil.config.base import Positive, Section


class MovingConfig(Section):
    """A station that moves: `asvhil hold --drift`, set-points with a velocity, or a leader that is followed."""

    max_speed_mps: Positive = Field(
        default=0.8,
        le=3.0,
        description=(
            "No station moves faster; nor than the boat keeps up with half of its thrust ahead, in still water. A "
            "course that is faster is refused, a leader that is faster gets away."
        ),
    )
    wait_beyond_m: Positive = Field(
        default=6.0,
        description="A station that moves waits while the boat is farther from it than this, until half as far off.",
    )
    silence_s: Positive = Field(
        default=3.0,
        le=30.0,
        description="The motion of a leader, or of a set-point, goes on for so long without another message; then the "
        "station stays where it is.",
    )
    jump_m: Positive = Field(
        default=5.0,
        description=(
            "A leader that is farther than this from where its last message had it, or has it by now, is not followed."
        ),
    )
    offset_m: tuple[float, float] = Field(
        default=(0.0, 0.0),
        description="Where the station of a leader that is followed is from it (m), in the frame of `offset_frame`.",
    )
    offset_frame: Literal["north", "course"] = Field(
        default="north",
        description=(
            "`north`: offset_m is north and east. `course`: along and to the right of the leader's course over some "
            "seconds, of the last one while it is slower than 0.1 m/s."
        ),
    )
