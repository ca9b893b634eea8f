"""Reads a log that `recorder.py` wrote (the layout is told there), whole or cut off by a crash.

The file is walked record by record here, not by the mcap package's reader, for two things that one does not give: the
byte offset of what is wrong, and the last intact chunk of a file without an end.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeVar

import msgspec
import zstandard

from asvhil.errors import LogError
from asvhil.logs.recorder import INPUTS_TOPIC, LAYOUT, LAYOUT_RECORD, OUTPUTS_TOPIC, PROFILE, TIMING_TOPIC
from asvhil.types import Frame, Inputs, record

T = TypeVar("T")

_MAGIC = b"\x89MCAP0\r\n"
_HEADER, _FOOTER, _CHANNEL, _MESSAGE, _CHUNK = 0x01, 0x02, 0x04, 0x05, 0x06
_STATISTICS, _METADATA, _DATA_END = 0x0B, 0x0C, 0x0F
_CHUNK_COUNT = struct.Struct("<22xI")  # in the statistics, behind the counts of messages, schemas, channels, ...
_RECORD = struct.Struct("<BQ")  # opcode, length of the content
_CHUNK_HEAD = struct.Struct("<QQQII")  # first and last time, raw size, CRC-32 of the raw bytes, length of the next name
_MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_LENGTH = struct.Struct("<I")
_CHUNK_MAX_BYTES = 256 * 1024 * 1024  # a damaged length must not ask for all of the memory


@record
class Timing:
    """How long the step of the tick at t_ns took, and whether it was late for the next."""

    t_ns: int
    step_ns: int
    overrun: bool


class _Marker(msgspec.Struct):
    t_ns: int
    frames: int


class _Channel(NamedTuple):
    topic: str
    port: str
    direction: str  # "in", "out", or empty where the channel holds no frames
    peer: str
    via: str


class _Message(NamedTuple):
    channel: _Channel
    sequence: int
    t_ns: int
    data: bytes
    chunk_at: int


_marker = msgspec.json.Decoder(_Marker)
_timing = msgspec.json.Decoder(Timing)


class LogFile:
    """A log by its path. LogError, one line, if it is none; iterators raise it where they reach damage.

    `truncated`: the file has no end or a damaged tail; all that is intact before it is read. `damage` says in words
    what is wrong, None for a whole file. Damage with intact chunks behind it ends the iterators with a LogError that
    names its byte offset, because a replay must not step over a hole.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.metadata: dict[str, dict[str, str]] = {}
        self.truncated = False
        self.damage: str | None = None
        self._chunks: list[tuple[int, int]] = []  # (offset of the record, length of its content)
        self._hole = False  # the file has its end, but not all before it
        try:
            with path.open("rb") as file:
                self._scan(file)
                self._drop_damaged_tail(file)
        except OSError as error:
            raise LogError(f"{path}: cannot be read ({error.strerror})") from None

    def ticks(self) -> Iterator[tuple[Inputs, bytes | None]]:
        """Inputs of each tick with the bytes of its recorded outputs; None where the log ends between the two."""
        frames: list[Frame] = []
        inputs: Inputs | None = None
        tick = 0
        for channel, sequence, t_ns, data, chunk_at in self._messages():
            if channel.direction == "in":
                frames.append(Frame(t_ns=t_ns, port=channel.port, data=data, peer=channel.peer, via=channel.via))
            elif channel.topic == INPUTS_TOPIC:
                if inputs is not None:
                    yield inputs, None
                tick += 1
                if sequence != tick:
                    raise self._error(f"ticks {tick} to {sequence - 1} were not recorded (the disk stalled)", chunk_at)
                marker = self._decode(_marker, data, INPUTS_TOPIC, chunk_at)
                first = len(frames) - marker.frames
                if first < 0:
                    raise self._error(f"tick {tick} has {len(frames)} of its {marker.frames} frames", chunk_at)
                inputs = Inputs(t_ns=marker.t_ns, frames=tuple(frames[first:]))
                frames.clear()
            elif channel.topic == OUTPUTS_TOPIC:
                if inputs is None:
                    raise self._error("an output record comes without its inputs", chunk_at)
                yield inputs, data
                inputs = None
        if inputs is not None:
            yield inputs, None

    def frames(self, port: str, direction: str) -> Iterator[Frame]:
        """The frames of a port, `in` or `out`, of all its peers in the order of the file."""
        for channel, _, t_ns, data, _ in self._messages():
            if channel.direction == direction and channel.port == port:
                yield Frame(t_ns=t_ns, port=port, data=data, peer=channel.peer, via=channel.via)

    def timing(self) -> Iterator[Timing]:
        """How long each step took."""
        for channel, _, _, data, chunk_at in self._messages():
            if channel.topic == TIMING_TOPIC:
                yield self._decode(_timing, data, TIMING_TOPIC, chunk_at)

    # --- the records of the file ---

    def _scan(self, file: BinaryIO) -> None:
        """Find the chunks and read the metadata, stepping over the contents of all else."""
        size = file.seek(0, 2)
        file.seek(0)
        if file.read(len(_MAGIC)) != _MAGIC:
            raise LogError(f"{self.path}: not a log: an MCAP file starts with another byte sequence at byte 0")
        offset = len(_MAGIC)
        data_ended = whole = False
        chunks_told = None
        while offset + _RECORD.size <= size:
            opcode, length = _RECORD.unpack(file.read(_RECORD.size))
            end = offset + _RECORD.size + length
            if not _HEADER <= opcode <= _DATA_END or end > size:
                break
            if offset == len(_MAGIC):
                self._check_header(file.read(length) if opcode == _HEADER else b"")
            elif opcode == _CHUNK and not data_ended:
                self._chunks.append((offset, length))
            elif opcode == _METADATA and not data_ended:
                name, values = self._read_metadata(file.read(length), offset)
                self.metadata[name] = values
            elif opcode == _DATA_END:
                data_ended = True
            elif opcode == _STATISTICS and length >= _CHUNK_COUNT.size:
                (chunks_told,) = _CHUNK_COUNT.unpack_from(file.read(length))
            elif opcode == _FOOTER:
                whole = file.seek(end) == size - len(_MAGIC) and file.read(len(_MAGIC)) == _MAGIC
                break
            offset = file.seek(end)
        if LAYOUT_RECORD not in self.metadata:
            raise LogError(f"{self.path}: not a log of asvhil, or cut off at byte {offset}, in its metadata")
        told = self.metadata.pop(LAYOUT_RECORD)
        if told.get("layout") != LAYOUT:
            raise LogError(f"{self.path}: the log's layout is {told.get('layout')!r}, and this asvhil reads {LAYOUT!r}")
        if told.get("records") != str(len(self.metadata)):
            raise LogError(f"{self.path}: {len(self.metadata)} of {told.get('records')} metadata records are found")
        if whole:
            if chunks_told != len(self._chunks):
                self._hole = True
                self.damage = f"{self.path}: damaged: {len(self._chunks)} of {chunks_told} chunks are found"
            return
        file.seek(max(0, size - len(_MAGIC)))
        if file.read() == _MAGIC and not data_ended:
            self._hole = True
            self.damage = f"{self.path}: damaged at byte {offset}: no record starts there"
        else:
            self.truncated = True
            self.damage = f"{self.path}: no end: cut off in the record at byte {offset} of {size}"

    def _check_header(self, content: bytes) -> None:
        (length,) = _LENGTH.unpack_from(content) if len(content) >= _LENGTH.size else (0,)
        profile = content[_LENGTH.size : _LENGTH.size + length].decode(errors="replace")
        if profile != PROFILE:
            raise LogError(f"{self.path}: not a log of asvhil: an MCAP file of profile {profile!r}, not {PROFILE!r}")

    def _read_metadata(self, content: bytes, offset: int) -> tuple[str, dict[str, str]]:
        try:
            name, position = _read_text(content, 0)
            return name, _read_map(content, position)
        except (struct.error, ValueError):
            raise LogError(f"{self.path}: the metadata record at byte {offset} is damaged") from None

    def _drop_damaged_tail(self, file: BinaryIO) -> None:
        """After a power cut the last chunks may have their length but not their content."""
        while self._chunks and not self._hole:
            offset, length = self._chunks[-1]
            try:
                self._chunk(file, offset, length)
            except LogError as error:
                self.truncated = True
                self.damage = str(error)
                self._chunks.pop()
            else:
                return

    def _chunk(self, file: BinaryIO, offset: int, length: int) -> bytes:
        """The raw bytes of a chunk, checked by their CRC."""
        file.seek(offset + _RECORD.size)
        content = file.read(length)
        try:
            _, _, raw_size, crc, name_size = _CHUNK_HEAD.unpack_from(content)
            start = _CHUNK_HEAD.size + name_size
            compression = content[_CHUNK_HEAD.size : start]
            packed = content[start + 8 :]
            if raw_size > _CHUNK_MAX_BYTES:
                raise ValueError(f"a size of {raw_size} bytes")
            if compression == b"zstd":
                # The size in the zstd frame is what gets allocated, so it is held against the chunk's own.
                if zstandard.frame_content_size(packed) != raw_size:
                    raise ValueError("its two sizes differ")
                raw = zstandard.decompress(packed)
            elif compression == b"":
                raw = packed
            else:
                raise ValueError(f"unknown compression {compression.decode(errors='replace')!r}")
            if zlib.crc32(raw) != crc:
                raise ValueError("its CRC does not fit")
        except (struct.error, ValueError, zstandard.ZstdError) as error:
            raise self._error(f"damaged ({error})", offset) from None
        return raw

    def _messages(self) -> Iterator[_Message]:
        """All messages in the order of the file."""
        channels: dict[int, _Channel] = {}
        message_head, record_head = _MESSAGE_HEAD.unpack_from, _RECORD.unpack_from
        try:
            with self.path.open("rb") as file:
                for offset, length in self._chunks:
                    raw = self._chunk(file, offset, length)
                    position, size = 0, len(raw)
                    while position < size:
                        opcode, content = record_head(raw, position)
                        end = position + _RECORD.size + content
                        if end > size:
                            raise ValueError("a record longer than its chunk")
                        if opcode == _MESSAGE:
                            _, _, number, sequence, t_ns, _ = message_head(raw, position)
                            data = raw[position + _MESSAGE_HEAD.size : end]
                            yield _Message(channels[number], sequence, t_ns, data, offset)
                        elif opcode == _CHANNEL:
                            number, channel = _read_channel(raw[position + _RECORD.size : end])
                            channels[number] = channel
                        position = end
        except OSError as error:
            raise LogError(f"{self.path}: cannot be read ({error.strerror})") from None
        except KeyError as error:
            raise self._error(f"a message of the channel {error}, which is not declared", offset) from None
        except (struct.error, ValueError) as error:
            raise self._error(f"not readable ({error})", offset) from None
        if self._hole:
            raise LogError(str(self.damage))

    def _decode(self, decoder: msgspec.json.Decoder[T], data: bytes, topic: str, chunk_at: int) -> T:
        try:
            return decoder.decode(data)
        except msgspec.DecodeError as error:
            raise self._error(f"a message of {topic} is not valid: {error}", chunk_at) from None

    def _error(self, what: str, chunk_at: int) -> LogError:
        return LogError(f"{self.path}: chunk at byte {chunk_at}: {what}")


def _read_text(content: bytes, position: int) -> tuple[str, int]:
    """A length-prefixed string, and the position behind it. struct.error or ValueError if it does not fit."""
    (length,) = _LENGTH.unpack_from(content, position)
    start = position + _LENGTH.size
    if start + length > len(content):
        raise ValueError("a text longer than its record")
    return content[start : start + length].decode(), start + length


def _read_map(content: bytes, position: int) -> dict[str, str]:
    (length,) = _LENGTH.unpack_from(content, position)
    position += _LENGTH.size
    end = position + length
    values = {}
    while position < end:
        key, position = _read_text(content, position)
        values[key], position = _read_text(content, position)
    return values


def _read_channel(content: bytes) -> tuple[int, _Channel]:
    number, _schema = struct.unpack_from("<HH", content)
    topic, position = _read_text(content, 4)
    _encoding, position = _read_text(content, position)
    values = _read_map(content, position)
    port, peer, via = values.get("port", ""), values.get("peer", ""), values.get("via")
    if via is None and port == "operator":  # written before there was one
        via, _, peer = peer.rpartition("|")
    return number, _Channel(topic, port, values.get("direction", ""), peer, via or "")
