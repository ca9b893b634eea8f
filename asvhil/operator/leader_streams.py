"""Leaders' reports that come late, as over a second and slower radio: older by their own time than one before."""

from __future__ import annotations

from asvhil.io.mavlink.frames import Parser
from asvhil.types import Frame

# A leader whose clock has gone back by more has started anew; and after so long without a newer report any will do.
LONGEST_MS = 60_000
LONGEST_NS = LONGEST_MS * 1_000_000


class LeaderStreams:
    """The newest report of each sender, by the time that it tells, and how many others came after it."""

    def __init__(self) -> None:
        self.late = 0
        self._newest: dict[tuple[int, int], tuple[int, int]] = {}  # by system and component: told (ms), received (ns)

    def is_late(self, frame: Frame, sender: tuple[int, int], told_ms: int) -> bool:
        """Whether a newer report of the sender has come already; a time of 0 is none."""
        newest = self._newest.pop(sender, None)
        late = (
            newest is not None
            and 0 < told_ms < newest[0] <= told_ms + LONGEST_MS
            and frame.t_ns - newest[1] < LONGEST_NS
        )
        if len(self._newest) >= Parser.MAX_PEERS:
            self._newest.pop(next(iter(self._newest)))
        self._newest[sender] = newest if late and newest is not None else (told_ms, frame.t_ns)
        self.late += late
        return late
