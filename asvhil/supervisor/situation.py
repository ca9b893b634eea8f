"""What a tick is decided by: one record of all that is known of the boat, its autopilot and its motors."""

from __future__ import annotations

from asvhil.geo import LocalFrame
from asvhil.types import Estimate, FrontseatStatus, record


@record
class Situation:
    """None: not known, or not yet.

    `fault`: why the motors do not, or would not, do as told. `unheard`: what it means if the motors' sticks do not show
    our commands; None once they have, for then somebody else has them.
    """

    t_ns: int
    status: FrontseatStatus | None = None
    heartbeat_age_s: float | None = None
    estimate: Estimate | None = None
    frame: LocalFrame | None = None
    fault: str | None = None
    unheard: str | None = None
