"""The search for intact chunks behind damage that hides where the records of an MCAP file start."""

from __future__ import annotations

import mmap
import struct
from collections.abc import Callable, Iterator
from typing import TypeVar

from mcap.opcode import Opcode

T = TypeVar("T")

RECORD_HEAD = struct.Struct("<BQ")  # opcode, length of the content
_BEFORE_COMPRESSION = RECORD_HEAD.size + 8 + 8 + 8 + 4  # of a chunk: its two times, unpacked size and CRC


def chunks_behind(
    data: mmap.mmap, start: int, compression: str, read: Callable[[int, int], T | None]
) -> Iterator[tuple[int, int, int, T]]:
    """(bytes that are damaged before it, offset, end, content) of each chunk from `start` on that `read` accepts.

    A chunk is found by the name of its compression, which stands at a fixed place in it; without a name none is. `read`
    gives the content of the record at an offset and of a size, None where it is not intact. `end` is behind the
    message indexes that follow a chunk.
    """
    name = compression.encode()
    if not name:
        return
    mark = struct.pack("<I", len(name)) + name
    known = behind_indexes(data, start)
    at = data.find(mark, known)
    while at >= 0:
        begin = at - _BEFORE_COMPRESSION
        found = None
        if begin >= known:
            opcode, length = RECORD_HEAD.unpack_from(data, begin)
            size = RECORD_HEAD.size + length
            if opcode == Opcode.CHUNK and begin + size <= len(data):
                found = read(begin, size)
        if found is None:
            at = data.find(mark, at + 1)
            continue
        end = behind_indexes(data, begin + size)
        yield begin - known, begin, end, found
        known = end
        at = data.find(mark, known)


def behind_indexes(data: mmap.mmap, at: int) -> int:
    """The end of the message indexes that stand at a place, as they do behind a chunk."""
    while at + RECORD_HEAD.size <= len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        end = at + RECORD_HEAD.size + int(length)
        if opcode != Opcode.MESSAGE_INDEX or end > len(data):
            break
        at = end
    return at
