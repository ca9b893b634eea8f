"""Frames to messages of the dialect and back: as pymavlink does it, and in a third of its time for plain messages.

A boat's link carries a hundred messages a second, and pymavlink's own way through each was the largest single cost of a
tick: it looks at the header field by field, makes it twice, and asks for signing and arrays each time. What is the same
for all frames of a kind is found once here. Texts, frames that are not as they should be, and signing are left to
pymavlink.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
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

_HEAD = struct.Struct("<BBBBBBBHB")  # of MAVLink 2: the message's id is its last three bytes
_DECODER = dialect.MAVLink(None)


class _Kind(NamedTuple):
    """What does not change between messages of one kind that holds numbers alone."""

    msg_id: int
    make: Any  # the class
    blank: dict[str, Any]  # the attributes of a message before its fields are known
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
    return _Kind(
        msg_id=message.id,
        make=message,
        blank=vars(message(*[0] * len(message.fieldnames))),
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
_KIND_OF = {kind.make: kind for kind in _KINDS.values()}  # a message's own `id` may be a field of that name


def decode(frame: bytes) -> Any | None:
    """The message of a complete frame, or None where pymavlink finds its content impossible."""
    if frame[0] == MAGIC_V2 and len(frame) >= HEADER_V2 + CRC_LENGTH:
        _, length, incompatible, compatible, number, system_id, component_id, low, high = _HEAD.unpack_from(frame)
        msg_id, header = low | high << 16, HEADER_V2
        end = header + length
        whole = len(frame) == end + CRC_LENGTH + (SIGNATURE_LENGTH if incompatible & SIGNED else 0)
        kind = _KINDS.get(msg_id)
        if kind is not None and whole:
            crc = frame[end] | frame[end + 1] << 8
            if crc == mcrf4xx(frame[1:end] + kind.crc_extra):
                size = kind.payload.size
                payload = frame[header:end] if length == size else frame[header:end].ljust(size, b"\0")[:size]
                values: Sequence[Any] = kind.payload.unpack(payload)
                if kind.has_arrays:
                    fields = [values[place] for place in kind.places]
                    values = [list(field) if type(field) is tuple else field for field in fields]
                attributes = kind.blank.copy()
                attributes.update(zip(kind.names, values, strict=True))
                attributes["_header"] = dialect.MAVLink_header(
                    msg_id, incompatible, compatible, length, number, system_id, component_id
                )
                attributes["_msgbuf"] = whole_frame = bytearray(frame)
                attributes["_payload"] = whole_frame[HEADER_V1:end]  # so it is in pymavlink
                attributes["_crc"] = crc
                message = kind.make.__new__(kind.make)
                message.__dict__ = attributes
                return message
    try:
        return _DECODER.decode(bytearray(frame))
    except (dialect.MAVError, ValueError, IndexError):
        return None


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
