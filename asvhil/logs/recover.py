"""A log written again from what is intact of it: after a power cut, a full disk, or damage on the card."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator
from hashlib import blake2b
from pathlib import Path

from mcap.records import Channel, McapRecord, Message, Schema
from mcap.writer import CompressionType, Writer

from asvhil import __version__
from asvhil.errors import LogError
from asvhil.files import is_there, whole_file
from asvhil.logs.metadata import DAMAGED_PREFIX, LAYOUT_RECORD, PROFILE, closing_record
from asvhil.logs.reader import LogFile
from asvhil.logs.recorder import INPUTS_TOPIC, OUTPUTS_TOPIC
from asvhil.types import record

PROVENANCE = "recovered"  # the metadata record of a recovered log: from which file, and what that had lost
CHUNK_BYTES = 256 * 1024


@record
class Recovery:
    """What `recover` has written: messages by topic, span, and in words what was lost; nothing was if that is empty.

    `left_out` counts intact chunks behind the first damage, which were not written.
    """

    path: Path
    messages: dict[str, int]
    ticks: int
    span_s: float
    lost: tuple[str, ...]
    left_out: int


class _Copy:
    """Messages of a log in the order of its file, as far as they are intact, with their schemas and channels."""

    def __init__(self, log: LogFile, *, behind_damage: bool, on_bytes: Callable[[int], None]) -> None:
        self._log = log
        self._behind_damage = behind_damage
        self._on_bytes = on_bytes
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._undeclared = 0
        self.lost: list[str] = []
        self.left_out = 0

    def messages(self) -> Iterator[tuple[Message, Channel, Schema | None]]:
        prefix = f"{self._log.path}: "
        for offset, piece in self._log.pieces():
            self._on_bytes(offset)
            if isinstance(piece, LogError):
                self.lost.append(str(piece).removeprefix(prefix))
            elif self.lost and not self._behind_damage:
                self.left_out += 1
            else:
                yield from self._known(piece)
        if self._undeclared:
            self.lost.append(f"{self._undeclared} messages of channels that are not declared any more")

    def _known(self, records: list[McapRecord]) -> Iterator[tuple[Message, Channel, Schema | None]]:
        for item in records:
            if isinstance(item, Schema):
                self._schemas[item.id] = item
            elif isinstance(item, Channel):
                self._channels[item.id] = item
            elif isinstance(item, Message):
                channel = self._channels.get(item.channel_id)
                if channel is None:
                    self._undeclared += 1
                else:
                    yield item, channel, self._schemas.get(channel.schema_id)


def recover(
    source: Path,
    target: Path,
    *,
    behind_damage: bool = False,
    on_bytes: Callable[[int], None] = lambda done: None,
) -> Recovery:
    """Write the intact part of a log to a new file, read that again, and compare it message by message.

    The part ends before the first damage, so that the new log replays as far as it goes. With `behind_damage` whatever
    is intact behind is kept too, for other tools; a replay ends at the gap. `on_bytes` is told the place in the source
    that has been reached. LogError where nothing is left, where the target exists, or where the new file is not what
    was written; then there is no new file.
    """
    log = LogFile(source)
    copy = _Copy(log, behind_damage=behind_damage, on_bytes=on_bytes)
    if is_there(target):
        raise LogError(f"{target}: exists already; a log is never overwritten")
    try:
        with whole_file(target) as part:
            counts, span_s, written = _write(log, copy, part)
            on_bytes(log.size)
            if not counts[INPUTS_TOPIC]:
                raise LogError(f"{source}: nothing to recover: no tick is intact")
            if _digest(LogFile(part)) != written:
                raise LogError(f"{target}: the recovered log is not what was written: is the disk sound?")
    except OSError as error:
        raise LogError(f"{target}: the recovered log cannot be written ({error.strerror})") from None
    return Recovery(
        path=target,
        messages=dict(counts),
        ticks=counts[OUTPUTS_TOPIC],
        span_s=span_s,
        lost=(*log.damaged.values(), *copy.lost),
        left_out=copy.left_out,
    )


def _write(log: LogFile, copy: _Copy, path: Path) -> tuple[Counter[str], float, bytes]:
    """Messages by topic, the span of the ticks (s), and the digest of all messages."""
    counts: Counter[str] = Counter()
    digest = blake2b()
    first_ns = last_ns = 0
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, enable_crcs=True)
        writer.start(profile=PROFILE, library=f"asvhil {__version__}")
        metadata = _metadata(log)
        for name, values in metadata.items():
            writer.add_metadata(name, values)
        writer.add_metadata(LAYOUT_RECORD, closing_record(metadata))
        schema_ids: dict[int, int] = {}
        channel_ids: dict[int, int] = {}
        for message, channel, schema in copy.messages():
            if channel.id not in channel_ids:
                if schema is not None and schema.id not in schema_ids:
                    schema_ids[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
                channel_ids[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schema_ids.get(channel.schema_id, 0), channel.metadata
                )
            _add(digest, channel, message)
            counts[channel.topic] += 1
            if channel.topic == INPUTS_TOPIC:
                first_ns, last_ns = first_ns or message.log_time, message.log_time
            writer.add_message(
                channel_ids[channel.id], message.log_time, message.data, message.publish_time, message.sequence
            )
        writer.finish()  # type: ignore[no-untyped-call]
        file.flush()
        os.fsync(file.fileno())
    return counts, (last_ns - first_ns) * 1e-9, digest.digest()


def _metadata(log: LogFile) -> dict[str, dict[str, str]]:
    """The records of the new log. A damaged one is kept under a name by which nothing is taken from it."""
    damage = "; ".join((*log.damaged.values(), *([log.damage] if log.damage else [])))
    records = {f"{DAMAGED_PREFIX}{name}" if name in log.damaged else name: log.metadata[name] for name in log.metadata}
    return records | {PROVENANCE: {"from": log.path.name, "damage": damage}}


def _digest(log: LogFile) -> bytes:
    """Of all messages. LogError where the file is damaged."""
    damage = log.damage or next(iter(log.damaged.values()), None)
    if damage is not None:
        raise LogError(damage)
    digest = blake2b()
    copy = _Copy(log, behind_damage=True, on_bytes=lambda done: None)
    for message, channel, _ in copy.messages():
        _add(digest, channel, message)
    if copy.lost:
        raise LogError(copy.lost[0])
    return digest.digest()


def _add(digest: blake2b, channel: Channel, message: Message) -> None:
    head = (
        f"{channel.topic}|{sorted(channel.metadata.items())}|{message.log_time}|{message.sequence}|{len(message.data)}|"
    )
    digest.update(head.encode())
    digest.update(message.data)
