"""When a boat that does not move as it is told to is let go."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from asvhil.config.base import NonNegative, Positive, Section


class MotionConfig(Section):
    """The watch over the motion while a station is held: motors, compass, and the distance to the station.

    It compares what velocity, yaw rate and heading do with what the commands should make them do by vehicle.vessel, and
    names what explains them best: a motor reversed, swapped or dead, or a heading that is off (docs/safety.md).
    """

    on_fault: Literal["release", "tell", "off"] = Field(
        default="release",
        description=(
            "`release`: the hold ends, neutral first. `tell`: it goes on, with a note for the operator. `off`: nothing "
            "is watched."
        ),
    )
    evidence: float = Field(
        default=6.5,
        ge=2.0,
        le=100.0,
        description=(
            "How much likelier a fault must be than a sound boat, as the natural logarithm of the ratio of their "
            "likelihoods since it began, of which each fifth of a second counts for 0.4 at the most, and in calm water "
            "for 0.8. Lower: sooner; higher: fewer false alarms where hull or waves differ much."
        ),
    )
    early_evidence: float = Field(
        default=4.0,
        ge=1.0,
        le=100.0,
        description=(
            "As evidence, of which each fifth of a second counts for 10 at the most, for what is told as likely in the "
            "first 20 s of a hold, and ends none."
        ),
    )
    early_lasts_s: NonNegative = Field(
        default=5.0,
        description=(
            "What is likely is told once one fault has had about that evidence, and the lead, for this long; or for "
            "twice as long with no lead."
        ),
    )
    lead: NonNegative = Field(
        default=3.0, description="A fault must be so much likelier than the next one, or be waited for for lead_s."
    )
    lead_s: NonNegative = Field(
        default=2.0, description="After this long with enough evidence the likeliest fault is named, with no lead."
    )
    sense_s: NonNegative = Field(
        default=30.0,
        description="For so long after a hold has begun, a fault of motors or compass ends it at once.",
    )
    confirm_m: NonNegative = Field(
        default=6.0,
        description=(
            "Later such a fault is told at once, for as long as there is evidence of it, and ends the hold once the "
            "boat is this much farther off than it has been: by waves and gusts alone a sound boat may seem to have "
            "one, and stays all the same."
        ),
    )
    farther_m: Positive = Field(
        default=8.0,
        description=(
            "A hold ends once the boat is this much farther from the station than it has been since the hold began, "
            "by its own motion: a move of the station takes nothing back of that. One that was carried when its "
            "station is put elsewhere has that much more room to turn, this much at most. A boat that was fast then "
            "may go on for as far as it needs to stop, one that approaches by the procedure twice its turn_radius_m "
            "farther; with the procedure it need not end within r_d_m and those of the station, from where the "
            "approach starts over."
        ),
    )
    farther_share: NonNegative = Field(
        default=0.25,
        description="Where that is more: this share of the distance at the begin, which leaves room to turn.",
    )
