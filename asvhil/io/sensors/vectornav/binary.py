"""VectorNav binary output messages: measured, checked, taken apart and put together, without any state.

A message is the sync byte 0xFA, the groups byte, a 16-bit word of fields for each group (low byte first), the fields
in the order of their groups and bits, and a CRC (high byte first) over all but the sync byte: CRC-16 CCITT, polynomial
0x1021 from zero, so that the CRC over a whole message is zero.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Mapping, Sequence

from fastcrc.crc16 import xmodem

from asvhil.io.sensors.vectornav.fields import BY_NAME, EXTENSION_BIT, GNSS_GROUPS, GROUPS, WORD_FIELDS, Field

SYNC = 0xFA
CRC_LENGTH = 2
MAX_PACKET = 2048  # a header that asks for more is garbage: at 115200 baud it would be a message of 0.2 s
INCOMPLETE, IMPOSSIBLE = 0, -1

_GROUP_EXTENDED = 0x80  # groups beyond the seventh, which a VN-300 does not have
_LAYOUTS = 64  # headers in use at a time are a handful; garbage must not grow the cache

Values = dict[str, tuple[float, ...] | bytes]


@functools.lru_cache(maxsize=_LAYOUTS)
def _layout(header: bytes) -> tuple[Field, ...] | None:
    """The fields of a complete header (groups byte and words), or None where it names one that does not exist."""
    found: list[Field] = []
    at = 1
    for group, table in enumerate(GROUPS):
        if not header[0] >> group & 1:
            continue
        bits = int.from_bytes(header[at : at + 2], "little")
        at += 2
        if group in GNSS_GROUPS and bits >> EXTENSION_BIT & 1:
            bits = bits & ~(1 << EXTENSION_BIT) | int.from_bytes(header[at : at + 2], "little") << WORD_FIELDS
            at += 2
        if not bits:
            return None
        for bit in range(bits.bit_length()):
            if bits >> bit & 1:
                field = table.get(bit)
                if field is None:
                    return None
                found.append(field)
    return tuple(found)


def _header_end(buffer: bytes, at: int) -> int:
    """Where the header of the message that starts at `at` ends; INCOMPLETE or IMPOSSIBLE instead."""
    if len(buffer) < at + 2:
        return INCOMPLETE
    groups = buffer[at + 1]
    if groups == 0 or groups & _GROUP_EXTENDED:
        return IMPOSSIBLE
    end = at + 2
    for group in range(len(GROUPS)):
        if groups >> group & 1:
            end += 2
            if len(buffer) < end:
                return INCOMPLETE
            if buffer[end - 1] & 0x80:
                if group not in GNSS_GROUPS:
                    return IMPOSSIBLE
                end += 2
                if len(buffer) < end:
                    return INCOMPLETE
    return end


def measure(buffer: bytes, at: int) -> int:
    """The length of the message that starts with the sync byte at `at`, from its header.

    INCOMPLETE while more bytes are needed to tell, IMPOSSIBLE where no message begins like this.
    """
    end = _header_end(buffer, at)
    if end in (INCOMPLETE, IMPOSSIBLE):
        return end
    layout = _layout(bytes(buffer[at + 1 : end]))
    if layout is None:
        return IMPOSSIBLE
    for field in layout:
        size = field.size
        if not field.form:
            if len(buffer) <= end + field.count_at:
                return INCOMPLETE
            count = buffer[end + field.count_at]
            if count > field.most:
                return IMPOSSIBLE
            size = field.base + field.each * count
        end += size
        if end - at + CRC_LENGTH > MAX_PACKET:
            return IMPOSSIBLE
    return end - at + CRC_LENGTH


def is_intact(packet: bytes) -> bool:
    """Whether the CRC of a complete message holds."""
    return bool(xmodem(packet[1:]) == 0)


def decode(packet: bytes) -> Values:
    """The fields of a complete, intact message by name (Group.Field); those of variable size as their bytes."""
    at = _header_end(packet, 0)
    layout = _layout(packet[1:at])
    assert layout is not None  # measured before
    values: Values = {}
    for field in layout:
        if field.form:
            values[field.name] = struct.unpack_from(field.form, packet, at)
            at += field.size
        else:
            size = field.base + field.each * packet[at + field.count_at]
            values[field.name] = packet[at : at + size]
            at += size
    return values


def encode(values: Mapping[str, Sequence[float] | bytes]) -> bytes:
    """A message with these fields, in the order that the protocol asks for: the inverse of `decode`."""
    fields = sorted((BY_NAME[name] for name in values), key=lambda field: (field.group, field.bit))
    groups, words = 0, bytearray()
    payload = bytearray()
    for group in range(len(GROUPS)):
        mine = [field for field in fields if field.group == group]
        if not mine:
            continue
        groups |= 1 << group
        bits = sum(1 << field.bit for field in mine)
        if bits >> WORD_FIELDS:
            words += (bits & 0x7FFF | 1 << EXTENSION_BIT).to_bytes(2, "little")
            bits >>= WORD_FIELDS
        words += bits.to_bytes(2, "little")
        for field in mine:
            value = values[field.name]
            if field.form:
                payload += struct.pack(field.form, *value)
            else:
                payload += bytes(value)  # type: ignore[arg-type]  # a field of variable size is given as its bytes
    body = bytes([groups]) + words + payload
    return bytes([SYNC]) + body + int(xmodem(body)).to_bytes(2, "big")
