"""Frames to messages of the dialect and back: as pymavlink does it, and in a third of its time for plain messages.

A boat's link carries a hundred messages a second, and pymavlink's own way through each was the largest single cost of a
tick: it looks at the header field by field, makes it twice, and asks for signing and arrays each time. What is the same
for all frames of a kind is found once here, and what few ask for is made when they do. Texts, frames that are not as
they should be, and signing are left to pymavlink.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from functools import cached_property
from operator import attrgetter
from typing import Any, NamedTuple

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import ardupilotmega as dialect

MAGIC_V1 = 0xFE
MAGIC_V2 = 0xFD
SIGNED = 0x01
SIGNATURE_LENGTH = 13
HEADER_V1, HEADER_V2 = 6, 10
CRC_LENGTH = 2

CRC_EXTRA = {msg_id: bytes([message.crc_extra]) for msg_id, message in dialect.mavlink_map.items()}

_LAZY = ("_header", "_msgbuf", "_payload", "_crc")  # attributes of a message
_HEAD = struct.Struct("<BBBBBBBHB")  # of MAVLink 2: the message's id is its last three bytes
_DECODER = dialect.MAVLink(None)


class _Decoded:
    """What pymavlink keeps of a message besides its fields, made of the frame when it is asked for: few do so.

    A base class of each kind's own, which stands before pymavlink's and has the rest as its attributes.
    """

    id: int
    _frame: bytes

    @cached_property
    def _header(self) -> Any:
        _, length, incompatible, compatible, number, system_id, component_id, low, high = _HEAD.unpack_from(self._frame)
        msg_id = low | high << 16
        return dialect.MAVLink_header(msg_id, incompatible, compatible, length, number, system_id, component_id)

    @cached_property
    def _msgbuf(self) -> bytearray:
        return bytearray(self._frame)

    @cached_property
    def _payload(self) -> bytearray:
        return bytearray(self._frame[HEADER_V1 : HEADER_V2 + self._frame[1]])  # from there it is in pymavlink

    @cached_property
    def _crc(self) -> int:
        end = HEADER_V2 + self._frame[1]
        return self._frame[end] | self._frame[end + 1] << 8

    def get_msgId(self) -> int:
        return type(self).id


class _Kind(NamedTuple):
    """What does not change between messages of one kind that holds numbers alone."""

    msg_id: int
    make: Any  # the class of a decoded message
    names: tuple[str, ...]  # of the fields, in the order of the payload
    places: list[int | slice]  # of these among the payload's values; arrays are slices
    has_arrays: bool
    payload: struct.Struct
    values: Callable[[Any], tuple[Any, ...]]  # the payload's, of a message without arrays
    crc_extra: bytes


def _kind(message: Any) -> _Kind:
    starts = [sum(message.lengths[:at]) for at in range(len(message.lengths))]
    places: list[int | slice] = [
        start if length == 1 else slice(start, start + length)
        for start, length in zip(starts, message.lengths, strict=True)
    ]
    of_all = vars(message(*[0] * len(message.fieldnames)))
    same = {name: value for name, value in of_all.items() if name not in message.fieldnames and name not in _LAZY}
    return _Kind(
        msg_id=message.id,
        make=type(message.__name__, (_Decoded, message), same),
        names=tuple(message.ordered_fieldnames),
        places=places,
        has_arrays=any(length > 1 for length in message.lengths),
        payload=message.unpacker,
        values=attrgetter(*message.ordered_fieldnames),
        crc_extra=CRC_EXTRA[message.id],
    )


_KINDS: dict[int, _Kind] = {
    msg_id: _kind(message)
    for msg_id, message in dialect.mavlink_map.items()
    if "char" not in message.fieldtypes and len(message.fieldtypes) > 1
}
# By class, for a message's own `id` may be a field of that name: pymavlink's, and that of a decoded message.
_KIND_OF = {made: kind for kind in _KINDS.values() for made in (kind.make, dialect.mavlink_map[kind.msg_id])}


def decode(frame: bytes) -> Any | None:
    """The message of a complete frame, or None where pymavlink finds its content impossible."""
    if frame[0] == MAGIC_V2 and len(frame) >= HEADER_V2 + CRC_LENGTH:
        kind = _KINDS.get(frame[7] | frame[8] << 8 | frame[9] << 16)
        end = HEADER_V2 + frame[1]
        whole = len(frame) == end + CRC_LENGTH + (SIGNATURE_LENGTH if frame[2] & SIGNED else 0)
        if kind is not None and whole:
            crc = frame[end] | frame[end + 1] << 8
            if crc == mcrf4xx(frame[1:end] + kind.crc_extra):
                return _message(kind, frame)
    try:
        return _DECODER.decode(bytearray(frame))
    except (dialect.MAVError, ValueError, IndexError):
        return None


def decode_checked(frame: bytes) -> Any | None:
    """The same for a frame that a FrameSplitter has put together: that its checksum holds is known."""
    kind = _KINDS.get(frame[7] | frame[8] << 8 | frame[9] << 16) if frame[0] == MAGIC_V2 else None
    return decode(frame) if kind is None else _message(kind, frame)


def _message(kind: _Kind, frame: bytes) -> Any:
    """The message of a whole frame of MAVLink 2."""
    length, size = frame[1], kind.payload.size
    payload = frame[HEADER_V2 : HEADER_V2 + length]
    values: Sequence[Any] = kind.payload.unpack(payload if length == size else payload.ljust(size, b"\0")[:size])
    if kind.has_arrays:
        fields = [values[place] for place in kind.places]
        values = [list(field) if type(field) is tuple else field for field in fields]
    message = kind.make.__new__(kind.make)
    message.__dict__ = attributes = dict(zip(kind.names, values, strict=True))
    attributes["_frame"] = frame
    return message


def pack(message: Any, sender: Any) -> bytes:
    """The MAVLink 2 frame of a message, by the sender's (`dialect.MAVLink`) ids and its next sequence number.

    struct.error where a value is out of its field's range.
    """
    kind = _KIND_OF.get(type(message))
    if kind is None or kind.has_arrays or sender.signing.sign_outgoing:
        return bytes(message.pack(sender))
    payload = kind.payload.pack(*kind.values(message))
    payload = payload.rstrip(b"\0") or payload[:1]  # zeros at the end are not sent
    msg_id = kind.msg_id
    head = _HEAD.pack(
        MAGIC_V2, len(payload), 0, 0, sender.seq, sender.srcSystem, sender.srcComponent, msg_id & 0xFFFF, msg_id >> 16
    )
    body = head + payload
    return body + mcrf4xx(body[1:] + kind.crc_extra).to_bytes(CRC_LENGTH, "little")
