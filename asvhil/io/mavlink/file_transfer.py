"""MAVFTP, the file transfer protocol of MAVLink: the payload of FILE_TRANSFER_PROTOCOL, both ways. Sans-IO.

Little-endian: number (u16), session, opcode, size, opcode of the request, burst complete, padding, offset (u32), data.
"""

from __future__ import annotations

import enum
import os
import struct

from asvhil.types import record

HEADER = struct.Struct("<HBBBBBxI")
DATA_BYTES = 239
PAYLOAD_BYTES = HEADER.size + DATA_BYTES


class Op(enum.IntEnum):
    """What a payload is."""

    NONE = 0
    TERMINATE = 1
    RESET = 2
    LIST = 3
    OPEN_READ = 4
    READ = 5
    CREATE = 6
    WRITE = 7
    REMOVE = 8
    MAKE_FOLDER = 9
    REMOVE_FOLDER = 10
    OPEN_WRITE = 11
    TRUNCATE = 12
    RENAME = 13
    CRC32 = 14
    READ_BURST = 15
    ACK = 128
    NAK = 129


class FileRefusal(enum.IntEnum):
    """Why a request is refused: the first byte of the data of a NAK."""

    FAIL = 1
    FAIL_ERRNO = 2
    INVALID_DATA_SIZE = 3
    INVALID_SESSION = 4
    NO_SESSIONS = 5
    END_OF_FILE = 6
    UNKNOWN_COMMAND = 7
    FILE_EXISTS = 8
    FILE_PROTECTED = 9
    FILE_NOT_FOUND = 10


TEXTS = {
    FileRefusal.FAIL: "it failed",
    FileRefusal.INVALID_DATA_SIZE: "the size is wrong",
    FileRefusal.INVALID_SESSION: "another program transfers a file",
    FileRefusal.NO_SESSIONS: "too many transfers at once",
    FileRefusal.END_OF_FILE: "the end of the file",
    FileRefusal.UNKNOWN_COMMAND: "it does not know the request",
    FileRefusal.FILE_EXISTS: "the file is there already",
    FileRefusal.FILE_PROTECTED: "the file is protected",
    FileRefusal.FILE_NOT_FOUND: "no such file",
}


@record
class FilePacket:
    """A request or an answer. `size` is that of the data, but in a request to read: how much is wanted."""

    number: int
    session: int
    op: int
    offset: int = 0
    data: bytes = b""
    size: int | None = None  # None: of the data
    request: int = 0
    burst_complete: bool = False

    def encode(self) -> bytes:
        """The 251 bytes of the payload."""
        size = len(self.data) if self.size is None else self.size
        head = HEADER.pack(
            self.number % 65536, self.session, self.op, size, self.request, self.burst_complete, self.offset
        )
        return (head + self.data).ljust(PAYLOAD_BYTES, b"\0")


def decode_packet(payload: bytes) -> FilePacket | None:
    """The packet in the payload of a message; None where its size is impossible."""
    if len(payload) < PAYLOAD_BYTES:
        return None
    number, session, op, size, request, burst_complete, offset = HEADER.unpack_from(payload)
    if size > DATA_BYTES:
        return None
    data = bytes(payload[HEADER.size : HEADER.size + size])
    return FilePacket(
        number=number,
        session=session,
        op=op,
        offset=offset,
        data=data,
        size=size,
        request=request,
        burst_complete=burst_complete != 0,
    )


def refusal_text(data: bytes) -> str:
    """What the data of a NAK say, in words."""
    code = data[0] if data else 0
    if code == FileRefusal.FAIL_ERRNO and len(data) > 1:
        return os.strerror(data[1]).lower()
    return TEXTS[FileRefusal(code)] if code in TEXTS else f"reason {code}"
