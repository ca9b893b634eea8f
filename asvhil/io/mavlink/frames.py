"""MAVLink framing, sans-IO: complete, checked frames out of arbitrary chunks of bytes, and the dialect in use.

pymavlink's own parser throws away everything it has buffered when one byte is wrong; this one only moves on to the
next magic byte, so garbage on a link costs nothing but itself.
"""

from __future__ import annotations

import difflib
import os
import re
import struct
from collections import Counter, OrderedDict
from operator import attrgetter

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.errors import ConfigError, LinkError
from asvhil.io.mavlink.messages import (
    CRC_EXTRA,
    CRC_LENGTH,
    HEADER_V1,
    HEADER_V2,
    MAGIC_V1,
    MAGIC_V2,
    SIGNATURE_LENGTH,
    SIGNED,
    decode,
    decode_checked,
    pack,
)

_ONE_BYTE = frozenset(mcrf4xx(bytes([byte]), 0) for byte in range(256))  # what one more byte can do to a checksum

__all__ = [
    "CRC_LENGTH",
    "HEADER_V1",
    "HEADER_V2",
    "MAGIC_V1",
    "MAGIC_V2",
    "SIGNATURE_LENGTH",
    "SIGNED",
    "FrameSplitter",
    "Numbering",
    "Parser",
    "checksum",
    "decode",
    "decode_checked",
    "dialect",
    "message_id",
    "message_number",
    "pack",
    "refuse_ignored_crc",
    "sequence",
    "source",
    "target",
]


def refuse_ignored_crc() -> None:
    """Raise LinkError where the environment would make pymavlink accept damaged frames."""
    if os.environ.get("MAV_IGNORE_CRC", "0") not in ("", "0"):
        raise LinkError("MAV_IGNORE_CRC is set in the environment: damaged MAVLink frames would be accepted; unset it")


def message_id(frame: bytes) -> int:
    """The message id of a complete frame."""
    return frame[5] if frame[0] == MAGIC_V1 else int.from_bytes(frame[7:10], "little")


def source(frame: bytes) -> tuple[int, int]:
    """(system id, component id) of the sender of a complete frame."""
    return (frame[3], frame[4]) if frame[0] == MAGIC_V1 else (frame[5], frame[6])


def sequence(frame: bytes) -> int:
    """The number that the sender of a complete frame gave it, 0 to 255."""
    return frame[2] if frame[0] == MAGIC_V1 else frame[4]


def checksum(body: bytes, extra: bytes | None = None) -> bytes:
    """The two bytes that follow a MAVLink 2 header and payload; `extra`: CRC_EXTRA of a message not in the dialect."""
    if extra is None:
        extra = CRC_EXTRA[int.from_bytes(body[7:10], "little")]
    return int(mcrf4xx(body[1:] + extra)).to_bytes(CRC_LENGTH, "little")


def renumbered(frame: bytes, number: int) -> bytes:
    """A MAVLink 2 frame without a signature, with another sequence number (modulo 256) and the checksum of it."""
    body = frame[:4] + bytes([number % 256]) + frame[5:-CRC_LENGTH]
    return body + checksum(body)


def message_number(name: str) -> int:
    """The id of a message by its name. Raises ConfigError with the nearest name that exists."""
    number = getattr(dialect, f"MAVLINK_MSG_ID_{name}", None)
    if isinstance(number, int) and number in dialect.mavlink_map:
        return number
    known = [message.msgname for message in dialect.mavlink_map.values()]
    near = difflib.get_close_matches(name.upper(), known, n=1)
    raise ConfigError(f"no MAVLink message is named {name!r}{f', did you mean {near[0]}?' if near else ''}")


def _target_offsets() -> dict[int, tuple[int, int | None]]:
    """Where in the payload target_system and target_component stand, for the messages that have them."""
    found = {}
    for msg_id, message in dialect.mavlink_map.items():
        at = 0
        places = {}
        codes = re.findall(r"\d*[a-zA-Z]", message.unpacker.format)  # one for each field, arrays with their count
        for name, code in zip(message.ordered_fieldnames, codes, strict=True):
            places[name] = at
            at += struct.calcsize(f"<{code}")
        if "target_system" in places:
            found[msg_id] = (places["target_system"], places.get("target_component"))
    return found


_TARGETS = _target_offsets()


def target(frame: bytes) -> tuple[int, int]:
    """(system id, component id) that a complete frame is addressed to; 0 for everybody, and where none is named."""
    places = _TARGETS.get(message_id(frame))
    if places is None:
        return 0, 0
    header = HEADER_V1 if frame[0] == MAGIC_V1 else HEADER_V2
    length = frame[1]  # MAVLink 2 leaves out zeros at the end of the payload
    system_at, component_at = places
    system_id = frame[header + system_at] if system_at < length else 0
    component_id = frame[header + component_at] if component_at is not None and component_at < length else 0
    return system_id, component_id


def _is_numbered(frame: bytes) -> bool:
    return frame[0] == MAGIC_V2 and not frame[2] & SIGNED and message_id(frame) in CRC_EXTRA


def _with_number(frame: bytes, number: int) -> bytes:
    body = frame[:4] + bytes([number]) + frame[5:-CRC_LENGTH]
    return body + checksum(body)


class Numbering:
    """Numbers frames as they leave, for each sender by itself, and knows those of the last 3 s."""

    KEPT = 256
    KEPT_NS = 3_000_000_000

    def __init__(self) -> None:
        self._next: dict[tuple[int, int], int] = {}
        self._sent: OrderedDict[bytes, int] = OrderedDict()

    def number(self, t_ns: int, frame: bytes) -> bytes:
        """A MAVLink 2 frame of ours with its number; any other as it is."""
        if not _is_numbered(frame):
            return frame
        sender = frame[5], frame[6]
        number = self._next.get(sender, 0)
        self._next[sender] = (number + 1) % 256
        numbered = _with_number(frame, number)
        self._sent[numbered] = t_ns
        if len(self._sent) > self.KEPT:
            self._sent.popitem(last=False)
        return numbered

    def ahead(self, frame: bytes, by: int) -> bytes:
        """A frame that may leave later, with the number after the `by` next ones."""
        if not _is_numbered(frame):
            return frame
        return _with_number(frame, (self._next.get(source(frame), 0) + by) % 256)

    def was_sent(self, t_ns: int, frame: bytes) -> bool:
        """Whether a complete frame, signed since or not, is one that left a moment ago."""
        if frame[0] != MAGIC_V2:
            return False
        body = frame[:2] + bytes([frame[2] & ~SIGNED]) + frame[3 : HEADER_V2 + frame[1]]
        left_ns = self._sent.get(body + checksum(body)) if message_id(frame) in CRC_EXTRA else None
        return left_ns is not None and t_ns - left_ns < self.KEPT_NS


COUNTERS = ("frames", "bad_crc", "unknown", "garbage_bytes")
NO_COUNTS = (0, 0, 0, 0)
_counts_of = attrgetter(*COUNTERS)


class FrameSplitter:
    """Puts MAVLink frames together whose checksum holds, wherever their bytes were cut. Never raises; counts drops.

    A chunk may end anywhere in a frame, also where it is a datagram: radios and bridges from serial lines cut as it
    suits them. The beginning of a frame whose rest is lost delays nothing: a chunk that begins with a whole frame is
    not its rest. `lost` counts the frames that are missing in the senders' sequence numbers.

    A message that the dialect does not know is passed over whole and counted as `unknown`. Its CRC_EXTRA, the seed of
    its checksum, is not known either: the checksum must hold for some seed, which it does for one in 256 of random
    bytes. So a known frame that stands whole inside it wins: a stray magic byte neither hides nor delays it.
    """

    MAX_BUFFER = 4096
    MAX_SENDERS = 64

    def __init__(self, *, datagrams: bool = False) -> None:
        """`datagrams`: the data come as whole frames, as in a file of them, and the rest of a chunk is garbage."""
        self._buffer = b""
        self._datagrams = datagrams
        self._sequences: dict[tuple[int, int], int] = {}
        self._lost: Counter[tuple[int, int]] = Counter()
        self.frames = 0
        self.bad_crc = 0
        self.unknown = 0
        self.garbage_bytes = 0

    @property
    def held(self) -> int:
        """How many bytes wait for the rest of their frame."""
        return len(self._buffer)

    def receive(self, data: bytes) -> list[bytes]:
        """All complete frames that `data` brings to an end, in order."""
        if not self._buffer and _is_one_frame(data):  # as nearly all datagrams are
            self.frames += 1
            self._count_lost(data[4], (data[5], data[6]))
            return [data]
        buffer = self._buffer + data if self._buffer else data
        chunk_at = len(self._buffer)  # a frame that spans this is whole in `buffer`, or `data` does not begin with one
        begins_whole: bool | None = None
        found: list[bytes] = []
        at = 0
        size = len(buffer)
        while at < size:
            magic = buffer[at]
            if magic == MAGIC_V2:
                header = HEADER_V2
            elif magic == MAGIC_V1:
                header = HEADER_V1
            else:
                start = self._next_magic(buffer, at + 1)
                self.garbage_bytes += start - at
                at = start
                continue
            if size - at < header:
                break
            length = header + buffer[at + 1] + CRC_LENGTH
            if magic == MAGIC_V2:
                flags = buffer[at + 2]
                msg_id = int.from_bytes(buffer[at + 7 : at + 10], "little")
                signature = SIGNATURE_LENGTH if flags & SIGNED else 0
            else:
                flags, msg_id, signature = 0, buffer[at + 5], 0
            extra = CRC_EXTRA.get(msg_id)
            end = at + length + signature
            if at < chunk_at and end > size:
                if begins_whole is None:
                    begins_whole = _is_whole(buffer, chunk_at)
                if begins_whole:
                    self.garbage_bytes += 1
                    at += 1
                    continue
            if extra is None and not flags & ~SIGNED and not self._known_within(buffer, at + 1, end):
                if end > size and not self._datagrams:
                    break
                if end <= size and _holds_for_some_seed(buffer, at, at + length - CRC_LENGTH):
                    self.unknown += 1
                    at = end
                    continue
            if extra is None or flags & ~SIGNED:
                self.garbage_bytes += 1
                at += 1
                continue
            if end > size:
                break
            body_end = at + length - CRC_LENGTH
            crc = mcrf4xx(buffer[at + 1 : body_end] + extra)
            if crc != buffer[body_end] | buffer[body_end + 1] << 8:
                self.bad_crc += 1
                self.garbage_bytes += 1
                at += 1
                continue
            found.append(buffer[at:end])
            if magic == MAGIC_V2:
                self._count_lost(buffer[at + 4], (buffer[at + 5], buffer[at + 6]))
            else:
                self._count_lost(buffer[at + 2], (buffer[at + 3], buffer[at + 4]))
            at = end
        self.frames += len(found)
        rest = buffer[at:]
        if self._datagrams:
            self.garbage_bytes += len(rest)
            rest = b""
        self._buffer = rest[-self.MAX_BUFFER :]
        return found

    def _count_lost(self, number: int, sender: tuple[int, int]) -> None:
        """A step back, or of half a round, is a repetition, a restart or a sender that does not count."""
        last = self._sequences.get(sender)
        if last is not None:
            missing = (number - last - 1) % 256
            if 0 < missing < 128:
                self._lost[sender] += missing
        elif len(self._sequences) >= self.MAX_SENDERS:
            return
        self._sequences[sender] = number

    def lost_of(self, sender: tuple[int, int]) -> int:
        """Frames of a (system, component) that did not come. Of one that is routed to us others may be held back."""
        return self._lost.get(sender, 0)

    def forget(self, other: FrameSplitter) -> None:
        """Go on with the counts of another, which is gone."""
        for name in COUNTERS:
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self._lost += other._lost

    def _known_within(self, buffer: bytes, at: int, end: int) -> bool:
        """Whether a whole frame of a known message begins in buffer[at:end]."""
        while (at := self._next_magic(buffer, at)) < min(end, len(buffer)):
            if _is_whole(buffer, at):
                return True
            at += 1
        return False

    @staticmethod
    def _next_magic(buffer: bytes, at: int) -> int:
        v2 = buffer.find(b"\xfd", at)
        v1 = buffer.find(b"\xfe", at, v2 if v2 >= 0 else len(buffer))
        if v1 >= 0:
            return v1
        return v2 if v2 >= 0 else len(buffer)


def _is_one_frame(data: bytes) -> bool:
    """Whether bytes are one MAVLink 2 frame of a known message and nothing else, with the right checksum."""
    size = len(data)
    if size < HEADER_V2 + CRC_LENGTH or data[0] != MAGIC_V2 or data[2] & ~SIGNED:
        return False
    body_end = HEADER_V2 + data[1]
    if size != body_end + CRC_LENGTH + (SIGNATURE_LENGTH if data[2] else 0):
        return False
    extra = CRC_EXTRA.get(data[7] | data[8] << 8 | data[9] << 16)
    crc = data[body_end] | data[body_end + 1] << 8
    return extra is not None and crc == mcrf4xx(data[1:body_end] + extra)


def _is_whole(buffer: bytes, at: int) -> bool:
    """Whether a frame of a known message stands whole in the buffer at `at`, and its checksum holds."""
    if at >= len(buffer) or buffer[at] not in (MAGIC_V1, MAGIC_V2):
        return False
    header = HEADER_V2 if buffer[at] == MAGIC_V2 else HEADER_V1
    if len(buffer) - at < header + CRC_LENGTH:
        return False
    body_end = at + header + buffer[at + 1]
    extra = CRC_EXTRA.get(message_id(buffer[at : at + header]))
    crc = buffer[body_end : body_end + CRC_LENGTH]
    return extra is not None and crc == mcrf4xx(buffer[at + 1 : body_end] + extra).to_bytes(2, "little")


def _holds_for_some_seed(buffer: bytes, at: int, body_end: int) -> bool:
    """Whether there is a CRC_EXTRA for which the checksum of the frame at `at` holds."""
    crc = mcrf4xx(buffer[at + 1 : body_end])
    seeded = buffer[body_end] | buffer[body_end + 1] << 8
    return seeded ^ crc >> 8 in _ONE_BYTE  # CRC-16: the new value is (old >> 8) ^ table[(old ^ byte) & 0xFF]


class Parser:
    """Frames of one port, put together for each peer by itself. At most 16 peers are remembered.

    Beyond that the one that was not heard for longest is forgotten, those first that have never sent a whole frame.
    """

    MAX_PEERS = 16

    def __init__(self) -> None:
        self._splitters: dict[tuple[str, str], FrameSplitter] = {}  # the one heard last stands last
        self._forgotten = FrameSplitter()

    def receive(self, peer: str, data: bytes, via: str = "") -> list[bytes]:
        """The frames that bytes of one peer bring to an end; those of another link, `via`, come whole."""
        splitter = self._splitters.get((via, peer))
        if splitter is None:
            if len(self._splitters) >= self.MAX_PEERS:
                self._forget()
            splitter = self._splitters[via, peer] = FrameSplitter(datagrams=bool(via))
        elif len(self._splitters) > 1:
            self._splitters[via, peer] = self._splitters.pop((via, peer))
        return splitter.receive(data)

    def totals(self) -> tuple[int, int, int, int]:
        """The counters (frames, bad_crc, unknown, garbage_bytes) over all peers."""
        if not self._splitters:
            return NO_COUNTS
        frames, bad_crc, unknown, garbage_bytes = _counts_of(self._forgotten)
        for splitter in self._splitters.values():
            frames += splitter.frames
            bad_crc += splitter.bad_crc
            unknown += splitter.unknown
            garbage_bytes += splitter.garbage_bytes
        return frames, bad_crc, unknown, garbage_bytes

    def lost_of(self, sender: tuple[int, int]) -> int:
        """Frames of a (system, component) that did not come, over all peers: by its numbers with each of them."""
        return self._forgotten.lost_of(sender) + sum([one.lost_of(sender) for one in self._splitters.values()])

    def _forget(self) -> None:
        oldest = next(iter(self._splitters))
        gone = self._splitters.pop(next((key for key, one in self._splitters.items() if not one.frames), oldest))
        self._forgotten.forget(gone)
