"""What comes by a second way and is no news: copies of frames that were taken in, and older states. Sans-IO.

A boat may be heard by two radios, or through a router with two links. The later way repeats what the other one has
brought. Taken for new, a state of a second ago would turn heading and position back, and an output of a second ago
would not follow the commands.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from typing import Any

from asvhil.io.mavlink.frames import dialect

KEPT_NS = 5_000_000_000  # for so long a copy is known by its bytes
KEPT = 2048  # frames
ONE_BOAT_NS = 10_000_000_000  # for so long two peers that have brought the same bytes are taken for ways of one boat
# The sender's time in a message: its field, and what that counts in a second.
CLOCKS = {
    msg_id: (name, per_s)
    for name, per_s in (("time_usec", 1_000_000), ("time_boot_ms", 1000))
    for msg_id, message in dialect.mavlink_map.items()
    if name in message.fieldnames
}
NO_CLOCK = ("", 0)
LATE_S = 60.0  # a clock that is farther back is another one, or has begun anew


class Copies:
    """`is_copy` for every frame, then `is_older` for those that are none."""

    def __init__(self) -> None:
        self._only: str | None = None  # the peer, while there is one alone
        self._several = False
        self._recent: deque[tuple[bytes, int]] = deque(maxlen=KEPT)  # what it brought, and when
        self._taken: OrderedDict[bytes, tuple[int, str]] = OrderedDict()  # when, and by which peer
        self._newest: dict[int, tuple[int, str]] = {}  # by message: its clock, and the peer
        self._same_ns: dict[frozenset[str], int] = {}  # when two peers brought the same last

    def is_copy(self, t_ns: int, peer: str, data: bytes) -> bool:
        """Whether another peer has brought these bytes within the last seconds."""
        if not self._several:
            if self._only in (None, peer):  # as nearly always
                self._only = peer
                self._recent.append((data, t_ns))
                return False
            self._several = True
            for brought, at_ns in self._recent:
                self._take(at_ns, str(self._only), brought)
            self._recent.clear()
        before = self._taken.get(data)
        if before is not None and before[1] != peer and t_ns - before[0] < KEPT_NS:
            self._same_ns[frozenset((peer, before[1]))] = t_ns
            return True
        self._take(t_ns, peer, data)
        return False

    def _take(self, t_ns: int, peer: str, data: bytes) -> None:
        self._taken[data] = t_ns, peer
        self._taken.move_to_end(data)
        while len(self._taken) > KEPT or t_ns - next(iter(self._taken.values()))[0] > KEPT_NS:
            self._taken.popitem(last=False)

    def is_older(self, t_ns: int, peer: str, m: Any, *, new_clock: bool) -> bool:
        """Whether another way of the same boat has brought a later message of this kind.

        `new_clock`: the boat has booted anew, so that its times begin again. Of two boats with one number the one whose
        clock is behind is not the later way: only peers that have brought the same frames are ways of one boat.
        """
        number = m.get_msgId()
        name, per_s = CLOCKS.get(number, NO_CLOCK)
        clock = getattr(m, name) if name else 0
        if not clock:
            return False
        newest, by = self._newest.get(number, (0, peer))
        if by != peer and not new_clock and 0 < newest - clock < LATE_S * per_s:
            same_ns = self._same_ns.get(frozenset((peer, by)))
            if same_ns is not None and t_ns - same_ns < ONE_BOAT_NS:
                return True
        self._newest[number] = clock, peer
        return False
