"""What MAVLink links have in common: accepted senders, signing, and routing between them."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import AfterValidator, Field

from asvhil.config.base import LinkSpecText, NonNegative, Positive, Section

_SENDER = re.compile(r"(\*|\d{1,3})(?:/(\*|\d{1,3}))?")


def _checked_sender(text: str) -> str:
    found = _SENDER.fullmatch(text)
    if found is None or any(number not in (None, "*") and int(number) > 255 for number in found.groups()):
        raise ValueError("a sender is SYSTEM/COMPONENT, such as 1/1, 255/* or */190")
    return text


SenderPattern = Annotated[str, AfterValidator(_checked_sender)]
LinkName = Annotated[str, Field(pattern=r"^[a-z0-9_-]+$")]
MessageName = Annotated[str, Field(pattern=r"^[A-Z][A-Z0-9_]*$")]


class SigningConfig(Section):
    """MAVLink 2 signing of one link: the daemon's own frames are signed, and frames that arrive must be."""

    key_file: str = Field(
        min_length=1,
        description=(
            "File with the key: 64 hexadecimal digits, or a passphrase, whose SHA-256 is the key. Only its owner "
            "should be able to read it."
        ),
    )
    link_id: int = Field(default=0, ge=0, le=255, description="Link id in the signatures of this link.")
    accept_unsigned: tuple[MessageName, ...] = Field(
        default=("RADIO_STATUS",),
        description="Messages that are accepted without a signature; telemetry radios cannot sign theirs.",
    )
    max_behind_s: Positive = Field(
        default=60.0, description="How far behind the present time the first frame of a stream may be dated."
    )
    max_ahead_s: Positive | None = Field(
        default=60.0,
        description=(
            "How far ahead of this computer's clock a timestamp may be; null: no limit, for a computer whose clock "
            "cannot be trusted."
        ),
    )
    state_file: str | None = Field(
        default=None,
        description="File in which timestamps outlive a restart; default: beside the key, KEYFILE.LINK.timestamps.",
    )


class MavlinkLinkConfig(Section):
    """What all MAVLink links have: accepted senders, signing, and filters for the frames that are routed."""

    senders: tuple[SenderPattern, ...] = Field(
        default=(),
        description=(
            "Senders whose frames are accepted: SYSTEM/COMPONENT such as `1/1`, `255/*`, `*/190`; a system alone "
            "means all of its components. Empty: all senders."
        ),
    )
    signing: SigningConfig | None = Field(default=None, description="Signing of this link; null: frames are unsigned.")
    allow_in: tuple[MessageName, ...] = Field(
        default=(), description="Messages that are routed from this link to others; empty: all."
    )
    block_in: tuple[MessageName, ...] = Field(
        default=(), description="Messages that are not routed from this link to others."
    )
    allow_out: tuple[MessageName, ...] = Field(
        default=(), description="Messages of others that are routed to this link; empty: all."
    )
    block_out: tuple[MessageName, ...] = Field(
        default=(), description="Messages of others that are not routed to this link."
    )


class GroundStationLinkConfig(MavlinkLinkConfig):
    """A ground station, a dashboard or another component, which gets the vehicle's frames and the daemon's own."""

    endpoint: LinkSpecText = Field(description="Link spec, such as udpin:0.0.0.0:14550.")


class RoutingConfig(Section):
    """Routing of frames between the autopilot's link and those of the ground stations."""

    enabled: bool | None = Field(
        default=None, description="Whether frames are routed; null: if there are ground stations."
    )
    duplicates_s: NonNegative = Field(
        default=0.2, description="A frame that arrives again on another link within this time is dropped; 0: never."
    )
