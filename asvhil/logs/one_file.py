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
from typing import BinaryIO

import zstandard
from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, McapRecord, Message
from mcap.stream_reader import MAGIC_SIZE, StreamReader, get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC

from asvhil.errors import LogError
from asvhil.files import is_file, is_there
from asvhil.logs.beginning import Beginning
from asvhil.logs.chunk_records import LogChannel, chunk_records, log_channel
from asvhil.logs.metadata import LAYOUT, PROFILE, SEGMENT_RECORD, search_records
from asvhil.logs.resync import behind_indexes, chunks_behind
from asvhil.logs.walk import Walk, walk_records

COMPRESSIONS = ("zstd", "lz4", "")
_UNKNOWN_SIZE = -1  # of a zstd frame that was written as a stream
_CHUNK_MAX_BYTES = 256 * 1024 * 1024  # unpacked; a damaged size must not ask for all of the memory
# What the package raises on damaged bytes. RuntimeError is lz4's, OverflowError that of a length beyond 2^63.
_DAMAGE = (McapError, struct.error, ValueError, OverflowError, zstandard.ZstdError, RuntimeError, MemoryError)


class DamageError(LogError):
    """Bytes of a log that are not what was written; what is before them can be recovered."""


class OneFile:
    """A file of a log by its path. LogError, one line, if it is none; iterators raise it where they reach damage.

    `truncated`: the file has no end or a damaged tail; all that is intact before it is read. `damage` says in words
    what is wrong, None for a whole file. Damage with intact chunks behind it ends the iterators with a LogError that
    names its byte offset, because a replay must not skip a gap. So does another log behind the end of this one. Damage
    of the records before the data stands apart, in `damaged`, and so do bytes behind the end that are no log.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.metadata: dict[str, dict[str, str]] = {}
        self.segment: dict[str, str] = {}  # which of a run's it is, and the run; empty of a run in one file
        self.goes_on_in = ""  # the name of the next, where this one was ended for it
        self.size = 0
        self.truncated = False
        self.damage: str | None = None
        self.damaged: dict[str, str] = {}  # before the data: what is wrong with a record, by its name
        self._data: list[tuple[int, int]] = []  # (offset, size) of chunks, and of what stands outside of them
        self._scanned_to = 0  # the first byte that belongs to no intact record
        self._compression = ""
        self.gap = False  # there are data behind what is damaged or missing
        self._another_at: int | None = None  # where another log follows the end of this one
        if is_there(path) and not is_file(path):  # opening a pipe would wait for a writer
            raise LogError(f"{path}: not a regular file; a log is expected")
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
            known = first = self._another_at or behind_indexes(data, last_offset + last_size)

            def read(offset: int, size: int) -> list[McapRecord] | None:
                with contextlib.suppress(LogError):
                    return self._contents(file, offset, size)
                return None

            for damaged, offset, end, records in chunks_behind(data, known, self._compression, read):
                if damaged and known == self._another_at:
                    yield known, LogError(str(self.damage))
                elif damaged:
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
        torn = self._check_magic(file.read(MAGIC_SIZE))
        walk = walk_records(file, MAGIC_SIZE, size)
        beginning = Beginning(walk.begin)
        if not beginning.is_complete:
            foreign = beginning.profile not in (None, PROFILE) and not beginning.closed
            first = None if foreign else self._first_data(file, walk)
            if first is not None:
                with mmap.mmap(file.fileno(), first, access=mmap.ACCESS_READ) as data:
                    begin = search_records(data, MAGIC_SIZE)
                if [offset for offset, _ in walk.data[:1]] != [first]:
                    walk = walk_records(file, first, size)
                beginning = Beginning([*begin, *(one for one in walk.begin if one.offset > first)])
            elif not beginning.closed:
                raise self._no_log(beginning, walk.offset)
        self._take_beginning(beginning)
        self.damaged = torn | self.damaged
        offset = self._scanned_to = walk.offset
        self._data = walk.data
        if walk.end is not None:
            if walk.chunks_expected not in (None, walk.chunks):
                self.gap = True
                self.damage = f"{self.path}: damaged: {walk.chunks} of {walk.chunks_expected} chunks are found"
            elif walk.end < size:
                self._take_rest(file, walk.end)
            return
        file.seek(max(0, size - MAGIC_SIZE))
        ended = file.read() == MCAP0_MAGIC and not walk.data_ended
        if ended or self._chunk_from(file, offset) is not None:
            self.gap = True
            self.damage = f"{self.path}: damaged at byte {offset}: no record starts there"
        else:
            self.truncated = True
            self.damage = f"{self.path}: no end: cut off in the record at byte {offset} of {size}"

    def _take_rest(self, file: BinaryIO, end: int) -> None:
        """What stands behind the end of the log, at a byte: another log, or bytes that are none."""
        file.seek(end)
        if file.read(MAGIC_SIZE) == MCAP0_MAGIC or self._chunk_from(file, end) is not None:
            self.gap = True
            self._another_at = end
            self.damage = f"{self.path}: the log ends at byte {end} of {self.size}, and another log follows"
        else:
            line = f"{self.size - end} bytes behind the end of the log (byte {end}) are not of it, and left out"
            self.damaged["bytes behind the end"] = line

    def _check_magic(self, head: bytes) -> dict[str, str]:
        """The damage of a file's first bytes. LogError where they are not nearly those of an MCAP file."""
        if head == MCAP0_MAGIC:
            return {}
        if not head:
            raise LogError(f"{self.path}: is empty; a log is expected")
        if MCAP0_MAGIC.startswith(head):
            raise LogError(f"{self.path}: cut off at byte {len(head)}, in the first bytes of an MCAP file")
        if sum(a == b for a, b in zip(head, MCAP0_MAGIC, strict=False)) <= MAGIC_SIZE // 2:
            raise LogError(f"{self.path}: not a log: an MCAP file starts with another byte sequence at byte 0")
        return {"first bytes": "damaged: the first bytes of an MCAP file (byte 0)"}

    def _no_log(self, beginning: Beginning, end: int) -> LogError:
        if beginning.profile not in (None, PROFILE):
            what = f"an MCAP file of profile {beginning.profile!r}, not {PROFILE!r}"
            return LogError(f"{self.path}: not a log of asvhil: {what}")
        return LogError(f"{self.path}: not a log of asvhil, or cut off at byte {end}, in its metadata")

    def _first_data(self, file: BinaryIO, walk: Walk) -> int | None:
        """Where the data begin, of a file whose beginning is damaged; None where there are none."""
        found = self._chunk_from(file, MAGIC_SIZE)
        return found if found is not None or not walk.data else walk.data[0][0]

    def _chunk_from(self, file: BinaryIO, start: int) -> int | None:
        """Where the first intact chunk is from a byte on, whatever stands before it; None where there is none."""

        def read(offset: int, size: int) -> list[McapRecord] | None:
            with contextlib.suppress(LogError):
                return self._contents(file, offset, size)
            return None

        # Up to the size of the scan: a log that is still being written has gone on since.
        with mmap.mmap(file.fileno(), self.size, access=mmap.ACCESS_READ) as data:
            for compression in filter(None, COMPRESSIONS):
                for _, offset, _, _ in chunks_behind(data, start, compression, read):
                    return offset
        return None

    def _take_beginning(self, beginning: Beginning) -> None:
        """LogError for a layout that is not known."""
        layout = LAYOUT if beginning.closing is None else beginning.closing.get("layout")
        if layout != LAYOUT:
            raise LogError(f"{self.path}: the log's layout is {layout!r}, and this asvhil reads {LAYOUT!r}")
        self.damaged = beginning.damaged()
        self.metadata = beginning.metadata
        self.goes_on_in = beginning.goes_on_in
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
            return list(chunk_records(stream.read(size)))
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
                            channels[item.id] = log_channel(item)
        except OSError as error:
            raise LogError(f"{self.path}: cannot be read ({error.strerror})") from None
        except KeyError as error:
            raise self.error(f"a message of the channel {error}, which is not declared", offset) from None
        if self.gap:
            raise DamageError(str(self.damage))

    def end_ns(self) -> int | None:
        """The latest time in the last chunk; None of a file without a message there."""
        times = [0]
        with contextlib.suppress(LogError, OSError), self.path.open("rb") as file:
            for offset, size in self._data[-1:]:
                times += [item.log_time for item in self._contents(file, offset, size) if isinstance(item, Message)]
        return max(times) or None

    def error(self, what: str, chunk_at: int) -> DamageError:
        """What is wrong in a chunk."""
        return DamageError(f"{self.path}: chunk at byte {chunk_at}: {what}")
