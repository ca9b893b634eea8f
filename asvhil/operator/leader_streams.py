"""Leaders' reports that come late, as over a second and slower radio: not newer by their own time than one before."""

from __future__ import annotations

from asvhil.io.mavlink.frames import Parser
from asvhil.types import Frame, changed, record

# A leader whose clock has gone back by more has started anew; and after so long without a newer report any will do.
LONGEST_MS = 60_000
LONGEST_NS = LONGEST_MS * 1_000_000
# A clock that went back by less shows in late reports alone, one newer than the other. A radio is not as slow as that.
ANEW_NS = 2_000_000_000
ANEW_COUNT = 3


@record
class NewestReport:
    """Of a sender: the time that it told (ms), where it was, when that was received; and the late ones since then, in
    a row of rising times: the last one's, how many, and when the first of them was received.
    """

    told_ms: int
    place: tuple[int, int]
    t_ns: int
    late_ms: int = 0
    late_count: int = 0
    late_ns: int = 0


class LeaderStreams:
    """The newest report of each sender, by the time that it tells, and how many others came after it."""

    def __init__(self) -> None:
        self.late = 0
        self._newest: dict[tuple[int, int], NewestReport] = {}  # by system and component

    def is_late(self, frame: Frame, sender: tuple[int, int], told_ms: int, place: tuple[int, int]) -> bool:
        """Whether this or a newer report of the sender has come already; a time of 0 is none."""
        newest = self._newest.pop(sender, None)
        kept = None if newest is None or told_ms == 0 else _after_late(newest, frame.t_ns, told_ms, place)
        if len(self._newest) >= Parser.MAX_PEERS:
            self._newest.pop(next(iter(self._newest)))
        self._newest[sender] = NewestReport(told_ms=told_ms, place=place, t_ns=frame.t_ns) if kept is None else kept
        self.late += kept is not None
        return kept is not None


def _after_late(newest: NewestReport, t_ns: int, told_ms: int, place: tuple[int, int]) -> NewestReport | None:
    """What is known of a sender after another report that is late; None: it is not late."""
    elapsed_ns = t_ns - newest.t_ns
    if told_ms == newest.told_ms:  # a clock that stands still has no copies: it is heard again before it seems silent
        return newest if place == newest.place and elapsed_ns < ANEW_NS else None
    if not told_ms < newest.told_ms <= told_ms + LONGEST_MS or elapsed_ns >= LONGEST_NS:
        return None
    if newest.late_count and told_ms == newest.late_ms:
        return newest
    if not newest.late_count or told_ms < newest.late_ms:
        return changed(newest, late_ms=told_ms, late_count=1, late_ns=t_ns)
    if newest.late_count + 1 >= ANEW_COUNT and t_ns - newest.late_ns >= ANEW_NS:
        return None
    return changed(newest, late_ms=told_ms, late_count=newest.late_count + 1)
