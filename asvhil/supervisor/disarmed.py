"""An autopilot that has disarmed without anybody's doing: the boat is adrift, and no pilot has it. Sans-IO."""

from __future__ import annotations

from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.types import FrontseatStatus

REBOOT = "reboot"  # as `FrontseatStatus.disarmed_itself` has it; else what the autopilot says
BY_ITSELF = frozenset({Reason.AUTOPILOT_DISARMED, Reason.AUTOPILOT_REBOOTED})
# What may be seen first of it, and how much later its own word of it still names that end of a hold.
_AT_ONCE_NS, _LATER_NS = 2_000_000_000, 10_000_000_000
_SEEN_FIRST = {
    **dict.fromkeys((Reason.OUTPUT_STUCK, Reason.OUTPUTS_UNCHANGED, Reason.OUTPUTS_DIFFER), _AT_ONCE_NS),
    **dict.fromkeys((Reason.DISARMED, Reason.HEARTBEAT_LOST, Reason.MODE_UNKNOWN), _LATER_NS),
    **dict.fromkeys((Reason.ESTIMATE_STALE, Reason.STICKS_UNSEEN), _LATER_NS),
    # Overrides that do not get through lapse, and the sticks show: the autopilot's fail-safe acts after that.
    Reason.OVERRIDE_NOT_FOLLOWED: _LATER_NS,
}


def disarmed_by_itself(status: FrontseatStatus | None) -> Explanation | None:
    """Why the autopilot is disarmed, where that was nobody's doing."""
    if status is None or status.armed or not status.disarmed_itself:
        return None
    if status.disarmed_itself == REBOOT:
        return explain(Reason.AUTOPILOT_REBOOTED)
    return explain(Reason.AUTOPILOT_DISARMED, why=status.disarmed_itself)


class Aftermath:
    """Whether a person has acted since a hold has ended: what its autopilot does later did not end it."""

    def __init__(self, status: FrontseatStatus | None) -> None:
        self.acted = False
        self._mode = None if status is None else status.mode
        self._was_disarmed = False

    def note(self, status: FrontseatStatus | None) -> None:
        """One tick. Of a vehicle that is disarmed the mode may be that of its boot."""
        if status is None:
            return
        self.acted |= status.armed and (self._was_disarmed or status.mode != self._mode)
        self._was_disarmed |= not status.armed


def cause_of_end(why: Explanation, since_ns: int, status: FrontseatStatus | None) -> Explanation | None:
    """What has ended a hold that ended for another reason so long ago, as the autopilot tells only now."""
    return disarmed_by_itself(status) if since_ns <= _SEEN_FIRST.get(why.reason, -1) else None
