"""Messages and frames: whatever the kind, and however the frame is, the same as by pymavlink itself."""

import random
import struct
from typing import Any

import pytest

from asvhil.io.mavlink.frames import checksum
from asvhil.io.mavlink.messages import CRC_EXTRA, decode, decode_checked, dialect, pack

KINDS = sorted(dialect.mavlink_map)
OF_ALL = {*vars(dialect.MAVLink_message(0, "")), "_instance_offset"}  # what messages hold besides their fields
SIGNATURE = bytes(range(13))


def frame_of(msg_id: int, payload: bytes, flags: int = 0, number: int = 7) -> bytes:
    head = struct.pack("<BBBBBBB", 0xFD, len(payload), flags, 0, number, 3, 4) + msg_id.to_bytes(3, "little")
    return head + payload + checksum(head + payload) + (SIGNATURE if flags else b"")


def by_pymavlink(frame: bytes) -> Any | None:
    try:
        return dialect.MAVLink(None).decode(bytearray(frame))
    except (dialect.MAVError, ValueError, IndexError):
        return None


def content(message: Any | None) -> Any:
    """All that a message holds, by pymavlink's names; as text, in which NaN equals NaN and a float is no integer."""
    if message is None:
        return None
    kind = next(kind for kind in type(message).__mro__ if kind.__module__ == dialect.__name__)
    held = {name: getattr(message, name, None) for name in {*OF_ALL, *vars(message)} - {"_frame"}}
    return kind, {name: repr(vars(value) if name == "_header" else value) for name, value in held.items()}


@pytest.mark.parametrize("msg_id", KINDS)
def test_every_message_is_decoded_and_packed_as_by_pymavlink(msg_id: int) -> None:
    rng = random.Random(msg_id)
    size = dialect.mavlink_map[msg_id].unpacker.size
    for length in {size, size - 1, size // 2, 1, 0, min(size + 3, 255)}:
        for flags in (0, 1):
            frame = frame_of(msg_id, rng.randbytes(length), flags, rng.randrange(256))
            message = decode(frame)
            assert content(message) == content(decode_checked(frame)) == content(by_pymavlink(frame))
            assert message is not None or length == 0 or "char" in dialect.mavlink_map[msg_id].fieldtypes
            for spoilt in (frame[:-1], frame + b"\0", frame[:-3] + bytes([frame[-3] ^ 1]) + frame[-2:]):
                assert content(decode(spoilt)) == content(by_pymavlink(spoilt))
            if message is not None:
                sender = dialect.MAVLink(None, srcSystem=9, srcComponent=191)
                sender.seq = rng.randrange(256)
                assert pack(message, sender) == bytes(message.pack(sender))


def test_mavlink_1_signing_and_unknown_kinds_are_left_to_pymavlink() -> None:
    sender = dialect.MAVLink(None, srcSystem=9, srcComponent=191)
    attitude = dialect.MAVLink_attitude_message(1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    old = bytes(attitude.pack(sender, force_mavlink1=True))
    assert content(decode(old)) == content(decode_checked(old)) == content(by_pymavlink(old)) is not None
    unknown = bytearray(frame_of(30, bytes(4)))
    unknown[7:10] = (max(CRC_EXTRA) + 1).to_bytes(3, "little")
    assert content(decode(bytes(unknown))) == content(by_pymavlink(bytes(unknown)))
    sender.signing.secret_key, sender.signing.sign_outgoing = bytes(32), True
    signed = pack(attitude, sender)
    assert signed[2] == 1 and len(signed) == 10 + signed[1] + 2 + 13


def test_a_value_beyond_its_field_is_refused() -> None:
    with pytest.raises(struct.error):
        pack(dialect.MAVLink_attitude_message(2**32, 0, 0, 0, 0, 0, 0), dialect.MAVLink(None))
