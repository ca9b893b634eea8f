"""Logs by their bytes, and as other tools write them, for the tests of reading and recovering."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from mcap.writer import Writer


def records_of(data: bytes) -> Iterator[tuple[int, int]]:
    """(opcode, offset) of each record, by a walk of its own over opcodes and lengths."""
    offset = 8
    while offset < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, offset)
        yield opcode, offset
        offset += 9 + length


def chunk_spans(data: bytes) -> list[tuple[int, int]]:
    """(offset, end) of each chunk."""
    starts = [offset for opcode, offset in records_of(data) if opcode == 0x06]
    return [(start, start + 9 + struct.unpack_from("<Q", data, start + 1)[0]) for start in starts]


def rewrite(
    source: Path, target: Path, change: Callable[[dict[str, str]], dict[str, str]] = lambda v: v, **options: Any
) -> None:
    """Write a log anew, with options of the writer and the metadata of its channels changed."""
    writer = Writer(str(target), **options)
    writer.start(profile="asvhil")
    with source.open("rb") as file:
        reader = make_reader(file)
        for item in reader.iter_metadata():
            writer.add_metadata(item.name, item.metadata)
        channels: dict[int, int] = {}
        for _, channel, message in reader.iter_messages(log_time_order=False):
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, 0, change(dict(channel.metadata))
                )
            writer.add_message(
                channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
            )
    writer.finish()
