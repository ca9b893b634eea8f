"""Reads one file that `recorder.py` wrote (the layout is described there), whole or cut off by a crash.

The mcap package parses the records. Which record starts at which byte is followed here, by opcodes and lengths, so that
the offset of damage is known, and a file without an end is read up to its last intact chunk.
"""

from __future__ import annotations

import contextlib
import mmap
import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, McapRecord, Message, Metadata, Schema, Statistics
from mcap.stream_reader import MAGIC_SIZE, StreamReader, get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC

from asvhil.config.ports import OPERATOR
from asvhil.errors import LogError
from asvhil.logs.recorder import CONTINUED_RECORD, LAYOUT, LAYOUT_RECORD, PROFILE, SEGMENT_RECORD
from asvhil.logs.resync import RECORD_HEAD, behind_indexes, chunks_behind

_MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # opcode, length; channel, sequence, log time, publish time
_KNOWN = frozenset(Opcode)
COMPRESSIONS = ("zstd", "lz4", "")
_MESSAGE, _CHANNEL, _SCHEMA = int(Opcode.MESSAGE), int(Opcode.CHANNEL), int(Opcode.SCHEMA)
_DATA = frozenset({Opcode.CHUNK, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE})
_UNKNOWN_SIZE = -1  # of a zstd frame that was written as a stream
_CHUNK_MAX_BYTES = 256 * 1024 * 1024  # unpacked; a damaged size must not ask for all of the memory
# What the package raises on damaged bytes. RuntimeError is lz4's, OverflowError that of a length beyond 2^63.
_DAMAGE = (McapError, struct.error, ValueError, OverflowError, zstandard.ZstdError, RuntimeError, MemoryError)


class LogChannel(NamedTuple):
    """What a log says of a channel; without frames all but the topic are empty."""

    topic: str
    port: str
    direction: str  # "in", "out", or empty where the channel holds no frames
    peer: str
    via: str


class DamageError(LogError):
    """Bytes of a log that are not what was written; what is before them can be recovered."""


class OneFile:
    """A file of a log by its path. LogError, one line, if it is none; iterators raise it where they reach damage.

    `truncated`: the file has no end or a damaged tail; all that is intact before it is read. `damage` says in words
    what is wrong, None for a whole file. Damage with intact chunks behind it ends the iterators with a LogError that
    names its byte offset, because a replay must not skip a gap.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.metadata: dict[str, dict[str, str]] = {}
        self.segment: dict[str, str] = {}  # which of a run's it is, and the run; empty of a run in one file
        self.goes_on_in = ""  # the name of the next, where this one was ended for it
        self.size = 0
        self.truncated = False
        self.damage: str | None = None
        self._data: list[tuple[int, int]] = []  # (offset, size) of chunks, and of what stands outside of them
        self._scanned_to = 0  # the first byte that belongs to no intact record
        self._compression = ""
        self.gap = False  # the file has its end, but a gap before it
        try:
            with path.open("rb") as file:
                self._scan(file)
                self._check_compression(file)
                self._drop_damaged_tail(file)
        except OSError as error:
            raise LogError(f"{path}: cannot be read ({error.strerror})") from None

    def pieces(self) -> Iterator[tuple[int, list[McapRecord] | LogError]]:
        """What is left of the data, in the order of the file: byte offset, and schemas, channels and messages there.

        A chunk whose content is damaged gives its error instead. Behind damage that hides where records start, the next
        intact chunk is searched for; where anything was between, an error with its offset stands for it.
        """
        try:
            with self.path.open("rb") as file:
                for offset, size in self._data:
                    try:
                        yield offset, self._contents(file, offset, size)
                    except LogError as error:
                        yield offset, error
                if self.damage is not None:
                    yield from self._found_again(file)
        except OSError as error:
            raise LogError(f"{self.path}: cannot be read ({error.strerror})") from None

    def _found_again(self, file: BinaryIO) -> Iterator[tuple[int, list[McapRecord] | LogError]]:
        """Chunks behind the last byte that the scan understood."""
        last_offset, last_size = self._data[-1] if self._data else (self._scanned_to, 0)
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            known = first = behind_indexes(data, last_offset + last_size)

            def read(offset: int, size: int) -> list[McapRecord] | None:
                with contextlib.suppress(LogError):
                    return self._contents(file, offset, size)
                return None

            for damaged, offset, end, records in chunks_behind(data, known, self._compression, read):
                if damaged:
                    yield offset - damaged, self.error(f"{damaged} bytes are damaged", offset - damaged)
                yield offset, records
                known = end
        if self.truncated or known == first:
            yield known, LogError(str(self.damage))

    # --- the records of the file ---

    def _scan(self, file: BinaryIO) -> None:
        """Index the records that hold data and read the metadata; the contents of all others are skipped."""
        size = self.size = file.seek(0, 2)
        file.seek(0)
        if file.read(MAGIC_SIZE) != MCAP0_MAGIC:
            raise LogError(f"{self.path}: not a log: an MCAP file starts with another byte sequence at byte 0")
        offset = MAGIC_SIZE
        chunks, chunks_expected = 0, None
        data_ended = whole = False
        while offset + RECORD_HEAD.size <= size:
            opcode, length = RECORD_HEAD.unpack(file.read(RECORD_HEAD.size))
            end = offset + RECORD_HEAD.size + length
            if opcode not in _KNOWN or end > size:
                break
            if offset == MAGIC_SIZE:
                self._check_profile(file, offset, end)
            elif opcode in _DATA and not data_ended:
                chunks += opcode == Opcode.CHUNK
                self._data.append((offset, end - offset))
            elif opcode == Opcode.METADATA and not data_ended:
                metadata = self._parse(file, offset, end - offset)
                assert isinstance(metadata, Metadata)
                self.metadata[metadata.name] = metadata.metadata
            elif opcode == Opcode.DATA_END:
                data_ended = True
            elif opcode == Opcode.STATISTICS:
                with contextlib.suppress(LogError):  # the data are readable without it
                    statistics = self._parse(file, offset, end - offset)
                    assert isinstance(statistics, Statistics)
                    chunks_expected = statistics.chunk_count
            elif opcode == Opcode.FOOTER:
                whole = file.seek(end) == size - MAGIC_SIZE and file.read(MAGIC_SIZE) == MCAP0_MAGIC
                break
            offset = file.seek(end)
        self._scanned_to = offset
        self._check_metadata(offset)
        if whole:
            if chunks_expected not in (None, chunks):
                self.gap = True
                self.damage = f"{self.path}: damaged: {chunks} of {chunks_expected} chunks are found"
            return
        file.seek(max(0, size - MAGIC_SIZE))
        if file.read() == MCAP0_MAGIC and not data_ended:
            self.gap = True
            self.damage = f"{self.path}: damaged at byte {offset}: no record starts there"
        else:
            self.truncated = True
            self.damage = f"{self.path}: no end: cut off in the record at byte {offset} of {size}"

    def _check_profile(self, file: BinaryIO, offset: int, end: int) -> None:
        header = self._parse(file, offset, end - offset)
        profile = header.profile if isinstance(header, Header) else ""
        if profile != PROFILE:
            raise LogError(f"{self.path}: not a log of asvhil: an MCAP file of profile {profile!r}, not {PROFILE!r}")

    def _check_metadata(self, end: int) -> None:
        """LogError unless all metadata of the recorder are in the bytes up to `end`."""
        if LAYOUT_RECORD not in self.metadata:
            raise LogError(f"{self.path}: not a log of asvhil, or cut off at byte {end}, in its metadata")
        about = self.metadata.pop(LAYOUT_RECORD)
        self.goes_on_in = self.metadata.pop(CONTINUED_RECORD, {}).get("in", "")
        layout, count = about.get("layout"), about.get("records")
        if layout != LAYOUT:
            raise LogError(f"{self.path}: the log's layout is {layout!r}, and this asvhil reads {LAYOUT!r}")
        if count != str(len(self.metadata)):
            raise LogError(f"{self.path}: {len(self.metadata)} of {count} metadata records are found")
        self.segment = self.metadata.pop(SEGMENT_RECORD, {})

    def _check_compression(self, file: BinaryIO) -> None:
        """LogError for an unknown compression of the chunks, which would otherwise all count as damaged."""
        first: McapRecord | None = None
        for offset, size in self._data:
            with contextlib.suppress(LogError):  # reported where the chunk is read
                first = self._parse(file, offset, size)
            if isinstance(first, Chunk):
                break
        if isinstance(first, Chunk) and first.compression not in COMPRESSIONS:
            known = ", ".join(name or "none" for name in COMPRESSIONS)
            raise LogError(f"{self.path}: its compression {first.compression!r} is not supported ({known} are)")
        self._compression = first.compression if isinstance(first, Chunk) else ""

    def _drop_damaged_tail(self, file: BinaryIO) -> None:
        """After a power cut the last chunks may have their length but not their content."""
        while self._data and not self.gap:
            try:
                self._contents(file, *self._data[-1])
            except LogError as error:
                self.truncated = True
                self.damage = str(error)
                self._data.pop()
            else:
                return

    def _parse(self, file: BinaryIO, offset: int, size: int) -> McapRecord:
        """The record in a range of bytes; a chunk is not decompressed."""
        file.seek(offset)
        try:
            return next(StreamReader(BytesIO(file.read(size)), skip_magic=True, emit_chunks=True).records)
        except _DAMAGE as error:
            raise DamageError(f"{self.path}: the record at byte {offset} is damaged ({error})") from None

    def _contents(self, file: BinaryIO, offset: int, size: int) -> list[McapRecord]:
        """The schemas, channels and messages of a chunk, checked by its CRC; those outside of chunks as they are."""
        item = self._parse(file, offset, size)
        if not isinstance(item, Chunk):
            return [item]
        try:
            if item.uncompressed_size > _CHUNK_MAX_BYTES:
                raise ValueError(f"a size of {item.uncompressed_size} bytes")
            # The size in the zstd frame, where it has one, is what gets allocated: it is held against the chunk's own.
            if item.compression == "zstd":
                size = zstandard.frame_content_size(item.data)
                if size not in (_UNKNOWN_SIZE, item.uncompressed_size):
                    raise ValueError("its two sizes differ")
            stream, size = get_chunk_data_stream(item, validate_crc=True)
            return list(_records(stream.read(size)))
        except _DAMAGE as error:
            raise self.error(f"damaged ({error})", offset) from None

    def messages(self) -> Iterator[tuple[LogChannel, Message, int]]:
        """All messages in the order of the file, with their channel and the offset of their chunk."""
        channels: dict[int, LogChannel] = {}
        try:
            with self.path.open("rb") as file:
                for offset, size in self._data:
                    for item in self._contents(file, offset, size):
                        if isinstance(item, Message):
                            yield channels[item.channel_id], item, offset
                        elif isinstance(item, Channel):
                            channels[item.id] = _channel(item)
        except OSError as error:
            raise LogError(f"{self.path}: cannot be read ({error.strerror})") from None
        except KeyError as error:
            raise self.error(f"a message of the channel {error}, which is not declared", offset) from None
        if self.gap:
            raise DamageError(str(self.damage))

    def error(self, what: str, chunk_at: int) -> DamageError:
        """What is wrong in a chunk."""
        return DamageError(f"{self.path}: chunk at byte {chunk_at}: {what}")


def _records(data: bytes) -> Iterator[McapRecord]:
    """The records of an unpacked chunk. Messages are cut here: the package takes three times as long."""
    at, size = 0, len(data)
    while at < size:
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        end = at + RECORD_HEAD.size + length
        if end > size:
            raise ValueError("a record is longer than its chunk")
        if opcode == _MESSAGE:
            _, _, channel_id, sequence, log_time, publish_time = _MESSAGE_HEAD.unpack_from(data, at)
            content = data[at + _MESSAGE_HEAD.size : end]
            yield Message(
                channel_id=channel_id, data=content, log_time=log_time, publish_time=publish_time, sequence=sequence
            )
        elif opcode == _CHANNEL:
            yield Channel.read(ReadDataStream(BytesIO(data[at + RECORD_HEAD.size : end])))
        elif opcode == _SCHEMA:
            yield Schema.read(ReadDataStream(BytesIO(data[at + RECORD_HEAD.size : end])))
        at = end


def _channel(declared: Channel) -> LogChannel:
    values = declared.metadata
    port, peer, via = values.get("port", ""), values.get("peer", ""), values.get("via")
    if via is None and port == OPERATOR:  # of a log older than `via`
        via, _, peer = peer.rpartition("|")
    return LogChannel(declared.topic, port, values.get("direction", ""), peer, via or "")
