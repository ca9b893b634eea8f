"""What MAVLink links have in common: who is listened to, signatures, and routing between them."""

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
    """MAVLink 2 signing of one link: all that leaves is signed, all that comes in must be."""

    key_file: Annotated[str, Field(min_length=1)]  # 64 hexadecimal digits, or a passphrase
    link_id: Annotated[int, Field(ge=0, le=255)] = 0
    accept_unsigned: tuple[MessageName, ...] = ("RADIO_STATUS",)  # telemetry radios have no key
    max_behind_s: Positive = 60.0  # of a stream that is heard for the first time
    max_ahead_s: Positive | None = 60.0  # null: no limit, for a computer whose clock cannot be trusted
    state_file: str | None = None  # where timestamps outlive a restart; beside the key where absent


class MavlinkLinkConfig(Section):
    """A link that speaks MAVLink."""

    senders: tuple[SenderPattern, ...] = ()  # none: everybody
    signing: SigningConfig | None = None
    allow_in: tuple[MessageName, ...] = ()  # what is taken from this link to others; none: everything
    block_in: tuple[MessageName, ...] = ()
    allow_out: tuple[MessageName, ...] = ()  # what others say on this link
    block_out: tuple[MessageName, ...] = ()


class GroundStationLinkConfig(MavlinkLinkConfig):
    """A ground station, a dashboard, another component: sees the vehicle through us, and us."""

    endpoint: LinkSpecText


class RoutingConfig(Section):
    """Routing between the autopilot's link and those of the ground stations."""

    enabled: bool | None = None  # null: where there are ground stations
    duplicates_s: NonNegative = 0.2  # the same frame by another link within this time is dropped; 0: never
