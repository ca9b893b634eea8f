"""The records in an unpacked chunk of a log, and what a log says of a channel."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from io import BytesIO
from typing import NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, McapRecord, Message, Schema

from asvhil.config.ports import OPERATOR
from asvhil.logs.resync import RECORD_HEAD

_MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # opcode, length; channel, sequence, log time, publish time
_MESSAGE, _CHANNEL, _SCHEMA = int(Opcode.MESSAGE), int(Opcode.CHANNEL), int(Opcode.SCHEMA)


class LogChannel(NamedTuple):
    """What a log says of a channel; without frames all but the topic are empty."""

    topic: str
    port: str
    direction: str  # "in", "out", or empty where the channel holds no frames
    peer: str
    via: str


def chunk_records(data: bytes) -> Iterator[McapRecord]:
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


def log_channel(declared: Channel) -> LogChannel:
    """What the declaration of a channel says."""
    values = declared.metadata
    port, peer, via = values.get("port", ""), values.get("peer", ""), values.get("via")
    if via is None and port == OPERATOR:  # of a log older than `via`
        via, _, peer = peer.rpartition("|")
    return LogChannel(declared.topic, port, values.get("direction", ""), peer, via or "")
