"""Which requests come again: a repetition is answered as before and not done again, and a late one not at all. Sans-IO.

A sender that misses an answer repeats its command: with a higher `confirmation`, or byte for byte. Networks repeat and
reorder datagrams too. In between somebody else may have had a word, and above all the pilot.
"""

from __future__ import annotations

from collections import deque

from asvhil.io.mavlink.frames import HEADER_V1, HEADER_V2, MAGIC_V1, SIGNED, dialect, message_id, sequence, source
from asvhil.supervisor.reasons import Explanation
from asvhil.types import Address, Frame

CONFIRMED_NS = 10_000_000_000  # since a command was last heard: a higher confirmation is a repetition of it
SAME_BYTES_NS = 5_000_000_000
UNNUMBERED_NS = 2_000_000_000  # programs that do not number their frames send the same bytes for a new command too
COPY_NS = 1_000_000_000  # the same bytes from another program on the link, or of a request that was refused
LATE_NS = 5_000_000_000
BEHIND = 100  # by so many numbers at most: further back it is another round
KEPT = 64  # requests, of all senders
COMMAND_LONG_BYTES = 33  # with the confirmation, which is the last


class Heard:
    """A request that was taken: what it asked, by whom, and how it was answered (`result` None: not yet)."""

    def __init__(self, frame: Frame, data: bytes) -> None:
        self.sender = source(data)
        self.address: Address = frame.address
        self.number = sequence(data)
        self.unsigned = _unsigned(data)
        self.content, self.confirmation = _content(data)
        self.t_ns = frame.t_ns
        self.last_ns = frame.t_ns
        self.result: int | None = None
        self.refusal: Explanation | None = None


class Repeats:
    """The commands of the last seconds, over all senders."""

    def __init__(self) -> None:
        self._heard: deque[Heard] = deque(maxlen=KEPT)

    def find(self, frame: Frame, data: bytes) -> Heard | None:
        """The request that a complete frame repeats; None where it is a new one."""
        now = Heard(frame, data)
        among = self._of_sender(now.sender, frame.t_ns)
        for before in reversed(among):
            if before.content == now.content and before.confirmation < now.confirmation:
                before.confirmation, before.last_ns = now.confirmation, frame.t_ns
                return before
        return among[-1] if among and self._is_copy(among[-1], now) else None

    def take(self, frame: Frame, data: bytes) -> Heard:
        """Remember a new request; its `result` is for the caller to fill in."""
        now = Heard(frame, data)
        self._heard.append(now)
        return now

    def is_late(self, frame: Frame, data: bytes) -> bool:
        """Whether its sender's later command has come already."""
        now = Heard(frame, data)
        return any(
            before.address == now.address
            and frame.t_ns - before.t_ns < LATE_NS
            and 0 < (before.number - now.number) % 256 <= BEHIND
            for before in self._of_sender(now.sender, frame.t_ns)
        )

    def _of_sender(self, sender: tuple[int, int], t_ns: int) -> list[Heard]:
        return [one for one in self._heard if one.sender == sender and t_ns - one.last_ns < CONFIRMED_NS]

    @staticmethod
    def _is_copy(before: Heard, now: Heard) -> bool:
        if before.unsigned != now.unsigned:
            return False
        another = before.address.via == now.address.via and before.address != now.address
        longest_ns = COPY_NS if another or before.refusal is not None else SAME_BYTES_NS
        if now.number == 0:
            longest_ns = min(longest_ns, UNNUMBERED_NS)
        if now.t_ns - before.last_ns >= longest_ns:
            return False
        before.last_ns = now.t_ns
        return True


class RepeatedSettings:
    """The last setting of each parameter by each sender, to know one that comes again."""

    def __init__(self) -> None:
        self._last: dict[tuple[tuple[int, int], Address, str], Heard] = {}

    def take(self, frame: Frame, data: bytes, name: str) -> tuple[Heard, bool]:
        """A setting, and whether it is the last of this name by this sender again, byte for byte, of seconds ago.

        The `refusal` of a new one is for the caller to fill in.
        """
        now = Heard(frame, data)
        key = (now.sender, frame.address, name)
        before = self._last.pop(key, None)
        if len(self._last) >= KEPT:
            self._last.pop(next(iter(self._last)))
        longest_ns = SAME_BYTES_NS if now.number else UNNUMBERED_NS
        again = before is not None and before.unsigned == now.unsigned and now.t_ns - before.last_ns < longest_ns
        if before is not None and again:
            before.last_ns, now = now.t_ns, before
        self._last[key] = now
        return now, again


def _unsigned(data: bytes) -> bytes:
    """A frame without its signature and the checksum, which covers the flag that tells of one."""
    if data[0] == MAGIC_V1:
        return data
    end = HEADER_V2 + data[1]
    return data[:2] + bytes([data[2] & ~SIGNED]) + data[3:end]


def _content(data: bytes) -> tuple[bytes, int]:
    """What a COMMAND_LONG or COMMAND_INT asks, and its confirmation (0 of a COMMAND_INT)."""
    header = HEADER_V1 if data[0] == MAGIC_V1 else HEADER_V2
    number, payload = message_id(data), data[header : header + data[1]]
    kind = number.to_bytes(3, "little")
    if number == dialect.MAVLINK_MSG_ID_COMMAND_LONG:
        payload = payload.ljust(COMMAND_LONG_BYTES, b"\0")
        return kind + payload[: COMMAND_LONG_BYTES - 1], payload[COMMAND_LONG_BYTES - 1]
    return kind + payload.rstrip(b"\0"), 0
