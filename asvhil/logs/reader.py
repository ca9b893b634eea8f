"""Reads the log of a run that `recorder.py` wrote (the layout is described there): one file, or all its segments."""

from __future__ import annotations

import contextlib
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

import msgspec
from mcap.records import Channel, McapRecord, Message

from asvhil.errors import LogError
from asvhil.files import is_there
from asvhil.logs.chunk_records import LogChannel
from asvhil.logs.encoding import decode_record
from asvhil.logs.one_file import DamageError, OneFile
from asvhil.logs.recorder import INPUTS_TOPIC, OUTPUTS_TOPIC, TIMING_TOPIC
from asvhil.logs.segments import first_in, segment_path, segments_behind
from asvhil.types import Frame, Inputs, record

T = TypeVar("T")


@record
class Timing:
    """How long the step of the tick at t_ns took, and whether it was late for the next."""

    t_ns: int
    step_ns: int
    overrun: bool


def decode_timing(data: bytes, log: Path) -> Timing:
    """The content of a message of `TIMING_TOPIC`. LogError names the log."""
    return decode_record(_timing, data, f"{log}: a message of {TIMING_TOPIC} is not valid")


class _Marker(msgspec.Struct):
    t_ns: int
    frames: int


_marker = msgspec.json.Decoder(_Marker)
_timing = msgspec.json.Decoder(Timing)


class LogFile:
    """The log of a run by its path: a file, the first of its segments, or the run's folder. LogError if it is none.

    Iterators raise LogError where they reach damage. A later segment, named by its own path, is read alone;
    `first_tick` is not 1 then.

    `truncated`: the log has no end or a damaged tail; all that is intact before it is read. `damage` says in words
    what is wrong, None for a whole log. Damage with intact chunks behind it ends the iterators with a LogError that
    names its byte offset, because a replay must not skip a gap. Offsets count over all files; `size` is that of all.
    `damaged` has what is wrong with records before the data, by their names: `config`, `model`, ...
    """

    def __init__(self, path: Path) -> None:
        self.path = first_in(path)
        first = OneFile(self.path)
        self.metadata = first.metadata
        self.first_tick = int(first.segment.get("first_tick", "1"))
        self._files = [first]
        lost = self._find_segments() if first.segment.get("number") == "0" else None
        last = self._files[-1]
        # A segment that has no end only because the power went while the next was begun has lost nothing: its last
        # tick is followed by the first of the next, which `ticks` checks.
        damages = [file.damage for file in self._files if file.damage is not None and (file.gap or file is last)]
        self._lost = lost
        self.truncated = last.truncated or lost is not None
        self.damage = next(iter(damages), lost)
        self.damaged = self._damaged_records()
        self.size = sum(file.size for file in self._files)

    @property
    def run(self) -> str:
        """The random word of the run that the files belong to; empty of a run in one file, which has none."""
        return self._files[0].segment.get("run", "")

    @property
    def parts(self) -> frozenset[str]:
        """The numbers of the run's segments that are read; empty of a run in one file."""
        return frozenset(file.segment["number"] for file in self._files if "number" in file.segment)

    @property
    def segments(self) -> int:
        """How many files there are."""
        return len(self._files)

    def end_ns(self) -> int | None:
        """The latest time at the end of the log, without a reading of the whole; None where it is not found."""
        return self._files[-1].end_ns()

    def _damaged_records(self) -> dict[str, str]:
        """What is damaged before the data; of a record that another segment has intact, that one is taken."""
        first, *others = self._files
        found = {}
        for name, line in first.damaged.items():
            same = [file for file in others if name in file.metadata and name not in file.damaged]
            if same:
                self.metadata[name] = same[0].metadata[name]
            found[f"{first.path.name} {name}" if same else name] = f"{first.path.name}: {line}" if others else line
        for file in others:
            found |= {f"{file.path.name} {name}": f"{file.path.name}: {line}" for name, line in file.damaged.items()}
        return found

    def _find_segments(self) -> str | None:
        """The segments behind the first, up to one that is not there or not of this run: what is wrong with that."""
        while True:
            last = self._files[-1]
            path = segment_path(self.path, len(self._files))
            if not is_there(path):
                lost = f"{path}: is not there, and the run goes on in it"
                return lost + self._left_out(last) if last.goes_on_in else None
            try:
                file = OneFile(path)
            except LogError as error:
                return str(error) + self._left_out(last)
            if file.segment.get("run") != last.segment.get("run"):
                return f"{path}: is a log of another run" if last.goes_on_in else None
            if file.segment.get("number") != str(len(self._files)):
                found = f"{path}: segments out of order: it begins with tick {file.segment.get('first_tick')}"
                return found + self._left_out(last)
            self._files.append(file)

    def _left_out(self, last: OneFile) -> str:
        """The segments behind one that cannot be read, in words."""
        names = []
        for path in segments_behind(self.path, len(self._files)):
            with contextlib.suppress(LogError):
                if OneFile(path).segment.get("run") == last.segment.get("run"):
                    names.append(path.name)
        if not names:
            return ""
        those = names[0] if len(names) == 1 else f"{names[0]} to {names[-1]} ({len(names)} files)"
        return f"; left out behind it: {those}, each readable by its own path"

    def ticks(
        self, on_timing: Callable[[Timing], None] = lambda timing: None, *, up_to_gap: bool = False
    ) -> Iterator[tuple[Inputs, bytes | None]]:
        """Inputs of each tick with the bytes of its recorded outputs; None where the log ends between the two.

        What a step took is recorded after its tick, and told meanwhile. Ticks that are missing in the middle end it,
        with a LogError or, `up_to_gap`, as a log that ends there: then `damage` says so.
        """
        frames: list[Frame] = []
        inputs: Inputs | None = None
        tick = self.first_tick - 1
        for channel, message, chunk_at in self.messages():
            if channel.direction == "in":
                frames.append(_frame(channel, message))
            elif channel.topic == INPUTS_TOPIC:
                if inputs is not None:
                    yield inputs, None
                tick += 1
                if message.sequence != tick:
                    gap = self._error(gap_words(tick, message.sequence), chunk_at)
                    if up_to_gap and tick > self.first_tick:
                        self.truncated, self.damage = True, str(gap)
                        return
                    raise gap
                marker = self._decode(_marker, message.data, INPUTS_TOPIC, chunk_at)
                first = len(frames) - marker.frames
                if first < 0:
                    raise self._error(f"tick {tick} has {len(frames)} of its {marker.frames} frames", chunk_at)
                inputs = Inputs(t_ns=marker.t_ns, frames=tuple(frames[first:]))
                frames.clear()
            elif channel.topic == OUTPUTS_TOPIC:
                if inputs is None:
                    raise self._error("an output record comes without its inputs", chunk_at)
                yield inputs, message.data
                inputs = None
            elif channel.topic == TIMING_TOPIC:
                on_timing(self._decode(_timing, message.data, TIMING_TOPIC, chunk_at))
        if inputs is not None:
            yield inputs, None

    def frames(self, port: str, direction: str) -> Iterator[Frame]:
        """The frames of a port, `in` or `out`, of all its peers in the order of the file."""
        for channel, message, _ in self.messages():
            if channel.direction == direction and channel.port == port:
                yield _frame(channel, message)

    def timing(self) -> Iterator[Timing]:
        """How long each step took."""
        for channel, message, chunk_at in self.messages():
            if channel.topic == TIMING_TOPIC:
                yield self._decode(_timing, message.data, TIMING_TOPIC, chunk_at)

    def messages(self) -> Iterator[tuple[LogChannel, Message, int]]:
        """All messages in the order of the files, with their channel and the offset of their chunk."""
        before = 0
        try:
            for file in self._files:
                for channel, message, offset in file.messages():
                    yield channel, message, before + offset
                before += file.size
        except DamageError as error:
            way_out = f"`asvhil log recover {shlex.quote(str(self.path))} -o NEW`"
            raise LogError(f"{error}; {way_out} keeps what is intact before it") from None

    def pieces(self) -> Iterator[tuple[int, list[McapRecord] | LogError]]:
        """What is left of the data, in the order of the files: byte offset, and schemas, channels and messages there.

        A chunk whose content is damaged gives its error instead. Behind damage that hides where records start, the next
        intact chunk is searched for; where anything was between, an error with its offset stands for it.
        """
        before = 0
        declared: dict[int, Channel] = {}
        last_tick = 0
        for file, later in zip(self._files, [*self._files[1:], None], strict=True):
            held: tuple[int, LogError] | None = None
            damaged = False
            for offset, piece in file.pieces():
                if held is not None:
                    yield held
                held = None
                if isinstance(piece, LogError):
                    held, damaged = (before + offset, piece), True
                    continue
                if not _declare(declared, piece):
                    if not damaged:
                        raise LogError(f"{file.path}: numbers its channels otherwise than the segments before it")
                    what = "of a log that numbers its channels otherwise, left out with all behind it in the file"
                    held = before + offset, file.error(what, offset)
                    break
                for item in piece:
                    if isinstance(item, Message) and _topic(declared, item) == INPUTS_TOPIC:
                        last_tick = item.sequence
                yield before + offset, piece
            unbroken = later is not None and file.truncated and later.segment.get("first_tick") == str(last_tick + 1)
            if held is not None and not unbroken:
                yield held
            before += file.size
        if self._lost is not None:
            yield before, LogError(self._lost)

    def _decode(self, decoder: msgspec.json.Decoder[T], data: bytes, topic: str, chunk_at: int) -> T:
        try:
            return decode_record(decoder, data, f"a message of {topic} is not valid")
        except LogError as error:
            raise self._error(str(error), chunk_at) from None

    def _error(self, what: str, chunk_at: int) -> LogError:
        for file in self._files[:-1]:
            if chunk_at < file.size:
                return file.error(what, chunk_at)
            chunk_at -= file.size
        return self._files[-1].error(what, chunk_at)


def begin_words(first_tick: int) -> list[str]:
    """The line on a log that is a later segment of a run, read alone; none of one that begins with the run."""
    return [] if first_tick == 1 else [f"begins with tick {first_tick}: a later segment of a run, read alone"]


def gap_words(expected: int, found: int) -> str:
    """What is wrong where a tick has another number than the one that is expected."""
    if found < expected:
        return f"tick {found} comes after tick {expected - 1}: another log, or a part of this one again, follows"
    last = "" if found == expected + 1 else f" to {found - 1}"
    what = f"ticks {expected}{last} are missing" if last else f"tick {expected} is missing"
    return f"{what} (the disk stalled, or they were damaged and the log was recovered)"


def _declare(channels: dict[int, Channel], piece: list[McapRecord]) -> bool:
    """Take in the channels of a piece; False, and none is taken, where one of their numbers is of another channel."""
    found = [item for item in piece if isinstance(item, Channel)]
    if any(_content(channels.get(item.id, item)) != _content(item) for item in found):
        return False
    for item in found:
        channels.setdefault(item.id, item)
    return True


def _topic(channels: dict[int, Channel], message: Message) -> str:
    channel = channels.get(message.channel_id)
    return "" if channel is None else channel.topic


def _content(channel: Channel) -> tuple[str, str, dict[str, str]]:
    return channel.topic, channel.message_encoding, channel.metadata


def _frame(channel: LogChannel, message: Message) -> Frame:
    return Frame(t_ns=message.log_time, port=channel.port, data=message.data, peer=channel.peer, via=channel.via)
