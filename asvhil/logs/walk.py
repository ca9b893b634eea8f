"""The walk over the records of an MCAP file, by their opcodes and lengths."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from io import BytesIO
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Statistics
from mcap.stream_reader import MAGIC_SIZE
from mcap.writer import MCAP0_MAGIC

from asvhil.logs.metadata import Found, found_record
from asvhil.logs.resync import RECORD_HEAD

_KNOWN = frozenset(Opcode)
_DATA = frozenset({Opcode.CHUNK, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE})


@dataclass
class Walk:
    """What a walk has found. `offset`: the first byte that belongs to no intact record, or the footer's."""

    offset: int
    begin: list[Found] = field(default_factory=list)  # header and metadata
    data: list[tuple[int, int]] = field(default_factory=list)  # (offset, size) of chunks, and of data outside of them
    chunks: int = 0
    chunks_expected: int | None = None
    data_ended: bool = False
    end: int | None = None  # the first byte behind the end that a whole file has; None: it has none


def walk_records(file: BinaryIO, offset: int, size: int) -> Walk:
    """Follow the records of a file of a size, from an offset on, to its end or to where no record is."""
    walk = Walk(offset)
    file.seek(offset)
    while offset + RECORD_HEAD.size <= size:
        opcode, length = RECORD_HEAD.unpack(file.read(RECORD_HEAD.size))
        end = offset + RECORD_HEAD.size + length
        if opcode not in _KNOWN or end > size:
            break
        if offset == MAGIC_SIZE or (opcode == Opcode.METADATA and not walk.data_ended):
            walk.begin.append(found_record(offset, opcode, file.read(length)))
        elif opcode in _DATA and not walk.data_ended:
            walk.chunks += opcode == Opcode.CHUNK
            walk.data.append((offset, end - offset))
        elif opcode == Opcode.DATA_END:
            walk.data_ended = True
        elif opcode == Opcode.STATISTICS:
            walk.chunks_expected = _chunk_count(file.read(length))
        elif opcode == Opcode.FOOTER:
            file.seek(end)
            if file.read(MAGIC_SIZE) == MCAP0_MAGIC:
                walk.end = end + MAGIC_SIZE
            break
        offset = file.seek(end)
    walk.offset = offset
    return walk


def _chunk_count(statistics: bytes) -> int | None:
    """None of a damaged record: the data are readable without it."""
    try:
        return int(Statistics.read(ReadDataStream(BytesIO(statistics))).chunk_count)
    except (McapError, struct.error, ValueError, OverflowError, MemoryError):
        return None
