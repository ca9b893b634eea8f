"""The log of a run: an MCAP file from which replay gets exactly the bytes that the live run had.

Layout, version 1 (profile "asvhil"):
- Metadata records stand at the start of the file, synced before the first tick: what the caller gives (config,
  versions, seed, ...), then the record `asvhil` with the layout's version, the number of the others, and a SHA-256 of
  each and of itself (`metadata.py`), for MCAP has no checksum of them. Older logs have no such digests.
- `/frames/<port>/in` and `/frames/<port>/out`: raw frames, one channel per (port, direction, peer, via), with these
  four in the channel's metadata. log_time is the frame's t_ns. Message encodings are mavlink, nmea, vectornav, or
  octets. Logs of before `via` have `<via>|<peer>` for the peer of an operator behind another link.
- `/frames/<port>/forwarded`: frames of others that the daemon passed on to that port, the link that they came by as
  `via`. No part of inputs or outputs; what is passed on to ground stations is not kept, it stands where it came in.
- `/asvhil/inputs`: the cut of a tick, JSON {"t_ns", "frames"}. An Inputs is this marker and the last `frames` inbound
  frames before it in FILE order. The sequence number counts ticks from 1; a step of more than 1 means that ticks were
  dropped because the disk stalled.
- `/asvhil/outputs`: JSON of `encoding.encode_outputs`, after the marker of its tick. Its frames also stand on their
  own channels.
- `/asvhil/timing`: JSON {"t_ns", "step_ns", "overrun"}; a diagnostic, never compared.
- `/asvhil/fix`, `/asvhil/pose`, `/tf`, `/asvhil/plan`, `/asvhil/log`: for viewers, see `foxglove.py`.
A log may be split: `log.mcap` goes on in `log-001.mcap`, and so on. Each segment is a whole file, with all metadata
and the same numbers of channels, and begins with the inputs of a tick. Its metadata record `segment` has a random word
for the run, its number from 0, and its first tick; one that was ended has a record `continued` at its end, with the
name of the next.
Chunks are compressed with zstd and closed every sync period, so a crash loses no more than that period.
"""

from __future__ import annotations

import errno
import os
import queue
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO, Any, cast

import msgspec
from mcap.writer import CompressionType, Writer

from asvhil import __version__
from asvhil.config.ports import ANEMOMETER, AUTOPILOT, GNSS, INS, OPERATOR
from asvhil.errors import LogError
from asvhil.files import is_there, sync_folder
from asvhil.logs.encoding import encode_outputs
from asvhil.logs.foxglove import LOG_TOPIC, SCHEMAS, TOPIC_SCHEMAS, convert_outputs, log_message
from asvhil.logs.metadata import CONTINUED_RECORD, LAYOUT_RECORD, PROFILE, SEGMENT_RECORD, closing_record
from asvhil.logs.segments import segment_path
from asvhil.types import Frame, Inputs, Outputs

INPUTS_TOPIC = "/asvhil/inputs"
OUTPUTS_TOPIC = "/asvhil/outputs"
TIMING_TOPIC = "/asvhil/timing"
ENCODINGS: Mapping[str, str] = {
    AUTOPILOT: "mavlink",
    OPERATOR: "mavlink",
    ANEMOMETER: "nmea",
    GNSS: "nmea",
    INS: "vectornav",
}

_VIEW_PERIOD_NS = 200_000_000
_CLOSE_TIMEOUT_S = 10.0
_SLOW_S = 2.0
_RECORD_BYTES = 300  # about what a record costs in the queue beside its text or data
_OUTPUTS_BYTES = 8000


class Recorder:
    """Writes a log on a thread of its own. No call blocks or raises when the disk stalls or fails.

    When the disk fails, `error` is set and recording stops. When more than `queue_bytes` wait for a stalled disk, whole
    ticks are dropped (an Inputs with its Outputs). `dropped` counts the calls that were not written. LogError is
    raised by the constructor alone: the file exists already, or cannot be made.
    `threaded=False` writes within the calls and syncs at `close` only. A file of `segment_bytes`, or of `segment_s` of
    ticks, is ended and goes on in another, which takes the next tick (0: never). If that cannot be made, it goes on in
    the present one.
    """

    def __init__(
        self,
        path: Path,
        *,
        metadata: dict[str, dict[str, str]],
        chunk_kib: int,
        sync_period_s: float,
        threaded: bool = True,
        encodings: Mapping[str, str] = ENCODINGS,
        queue_bytes: int = 64 * 1024 * 1024,
        segment_bytes: int = 0,
        segment_s: float = 0.0,
    ) -> None:
        self.path = path
        self.error: LogError | None = None
        try:
            limits = segment_bytes, round(segment_s * 1e9)
            self._file = _LogWriter(path, metadata, chunk_kib * 1024, encodings, limits)
        except OSError as error:
            raise LogError(f"{path}: the log cannot be made ({error.strerror})") from None
        self._sync_period_s = sync_period_s
        self._queue_bytes = queue_bytes
        # Each counter is written by one thread only, so none needs a lock.
        self._entered_bytes = 0
        self._left_bytes = 0
        self._refused = 0
        self._discarded = 0
        self._tick = 0
        self._gap = 0
        self._closed = False
        self._stopped = ""
        self._busy_since_s: float | None = None  # when the write or the sync that is being done began
        self._queue: queue.SimpleQueue[tuple[int, Callable[..., None], tuple[Any, ...]] | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        if threaded:
            self._thread = threading.Thread(target=self._work, name="recorder", daemon=True)
            self._thread.start()

    @property
    def dropped(self) -> int:
        """How many write calls were lost to a full queue, a failed disk, or came after `close`."""
        return self._refused + self._discarded

    @property
    def trouble(self) -> str:
        """What is wrong with the recording now; empty while nothing is."""
        if self._stopped:
            return self._stopped
        if self._gap:
            return "ticks are not recorded: the disk does not keep up"
        if self._file.stuck:
            return self._file.stuck
        since_s = self._busy_since_s
        slow = since_s is not None and time.monotonic() - since_s > _SLOW_S
        return f"the disk has not answered for more than {_SLOW_S:g} s" if slow else ""

    def write_inputs(self, inputs: Inputs) -> None:
        """The frames of a tick, then its marker."""
        self._tick += 1
        size = _RECORD_BYTES + sum(len(frame.data) + _RECORD_BYTES for frame in inputs.frames)
        if not self._submit(size, self._file.write_inputs, inputs, self._tick):
            self._gap += 1
        elif self._gap:
            gap, self._gap = self._gap, 0
            self.write_log(inputs.t_ns, "error", f"recorder: {gap} ticks before this one were dropped")

    def write_outputs(self, outputs: Outputs) -> None:
        """The record of a tick, its outbound frames, and what viewers draw of it."""
        if self._gap:  # the inputs of this tick were dropped
            self._refused += 1
            return
        size = _OUTPUTS_BYTES + sum(len(sent.data) + _RECORD_BYTES for sent in outputs.frames)
        self._submit(size, self._file.write_outputs, outputs, always=True)

    def write_timing(self, t_ns: int, step_ns: int, overrun: bool) -> None:
        """How long the step of a tick took; a diagnostic, never compared."""
        self._submit(_RECORD_BYTES, self._file.write_timing, t_ns, step_ns, overrun)

    def write_forwarded(self, frame: Frame) -> None:
        """A frame of others that was passed on."""
        self._submit(_RECORD_BYTES + len(frame.data), self._file.write_forwarded, frame)

    def write_log(self, t_ns: int, level: str, text: str) -> None:
        """A line of text at a level of `logging` (debug, info, warning, error, critical)."""
        self._submit(_RECORD_BYTES + len(text), self._file.write_log, t_ns, level, text)

    def close(self) -> None:
        """Write the queue, finish the file, sync and close it. Idempotent."""
        if self._closed:
            return
        self._closed = True
        if self._thread is None:
            self._finish()
            return
        self._queue.put(None)
        self._thread.join(_CLOSE_TIMEOUT_S)
        if self._thread.is_alive() and self.error is None:
            self.error = LogError(f"{self.path}: not finished: the disk did not answer for {_CLOSE_TIMEOUT_S:.0f} s")

    def _submit(self, size: int, write: Callable[..., None], *args: Any, always: bool = False) -> bool:
        full = self._entered_bytes - self._left_bytes + size > self._queue_bytes
        if self._closed or self.error is not None or (full and not always):
            self._refused += 1
            return False
        if self._thread is None:
            if not self._attempt(write, *args):
                self._refused += 1
        else:
            self._entered_bytes += size
            self._queue.put((size, write, args))
        return True

    def _work(self) -> None:
        """The thread: write what comes, sync every period, finish at the end of the queue."""
        sync_at_s = time.monotonic() + self._sync_period_s
        while True:
            try:
                item = self._queue.get(timeout=max(0.0, sync_at_s - time.monotonic()))
            except queue.Empty:
                pass
            else:
                if item is None:
                    break
                size, write, args = item
                if not self._attempt(write, *args):
                    self._discarded += 1
                self._left_bytes += size
            if time.monotonic() >= sync_at_s:
                self._attempt(self._file.sync)
                sync_at_s = time.monotonic() + self._sync_period_s
        self._finish()

    def _finish(self) -> None:
        self._attempt(self._file.finish)
        self._attempt(self._file.close, even_after_error=True)

    def _attempt(self, write: Callable[..., None], *args: Any, even_after_error: bool = False) -> bool:
        """Write, and tell whether it succeeded; the first failure ends the recording."""
        if self.error is not None and not even_after_error:
            return False
        self._busy_since_s = time.monotonic()
        try:
            write(*args)
        except Exception as error:  # whatever it is, control goes on without a log
            reason = error.strerror if isinstance(error, OSError) else f"{type(error).__name__}: {error}"
            self._stopped = self._stopped or f"recording stopped: {reason}"
            self.error = self.error or LogError(f"{self.path}: {self._stopped}")
            return False
        finally:
            self._busy_since_s = None
        return True


class _LogWriter:
    """The file in its layout; raises OSError. Not safe to use after it has raised, but for `close`."""

    def __init__(
        self,
        path: Path,
        metadata: dict[str, dict[str, str]],
        chunk_bytes: int,
        encodings: Mapping[str, str],
        limits: tuple[int, int],
    ) -> None:
        """`limits`: bytes and nanoseconds of a segment; 0: none."""
        self._path, self._metadata, self._chunk_bytes = path, metadata, chunk_bytes
        self._encodings = encodings
        self._limits = limits
        self._run = os.urandom(8).hex() if any(limits) else ""
        self._number = 0
        self._limit_bytes = 0  # of the file that is written
        self._since_ns: int | None = None  # the tick from which its time counts
        self._written = False
        self._viewed_ns: int | None = None
        self._frame_channels: dict[tuple[str, str, str, str], int] = {}
        self.stuck = ""  # why the next segment could not be made
        if self._run and is_there(segment_path(path, 1)):
            raise FileExistsError(errno.EEXIST, f"{segment_path(path, 1).name}, a segment of another run, is there")
        self._sink, self._mcap = self._make(0, 1)
        self._declare()

    def _make(self, number: int, first_tick: int) -> tuple[_Sink, Writer]:
        """A new file with all metadata, synced."""
        path = segment_path(self._path, number)
        metadata = dict(self._metadata)
        if self._run:
            metadata[SEGMENT_RECORD] = {"run": self._run, "number": str(number), "first_tick": str(first_tick)}
        sink = _Sink(path)
        try:
            # The writer only writes, tells and flushes, which is all that the sink can do.
            mcap = Writer(
                cast(IO[Any], sink), chunk_size=self._chunk_bytes, compression=CompressionType.ZSTD, enable_crcs=True
            )
            mcap.start(profile=PROFILE, library=f"asvhil {__version__}")
            for name, values in metadata.items():
                mcap.add_metadata(name, values)
            mcap.add_metadata(LAYOUT_RECORD, closing_record(metadata))
            sink.sync()
            sync_folder(path.parent)
        except BaseException:
            sink.close()
            raise
        self._limit_bytes = sink.tell() + self._limits[0]
        return sink, mcap

    def _declare(self) -> None:
        """Register all channels in a new file, so that they have the same numbers in each."""
        self._inputs = self._register(INPUTS_TOPIC)
        self._outputs = self._register(OUTPUTS_TOPIC)
        self._timing = self._register(TIMING_TOPIC)
        self._views = {topic: self._register(topic, schema) for topic, schema in TOPIC_SCHEMAS.items()}
        for key in self._frame_channels:
            self._frame_channels[key] = self._register_frames(key)

    def _go_on_in_another(self, t_ns: int, tick: int) -> None:
        """End the file before a tick, once the next one is there: nothing is lost, whatever happens on the way."""
        self.sync()
        self._since_ns = t_ns
        try:
            sink, mcap = self._make(self._number + 1, tick)
        except OSError as error:
            self._limit_bytes = self._sink.tell() + self._limits[0]
            name = segment_path(self._path, self._number + 1).name
            self.stuck = f"{name} cannot be made ({error.strerror}): the log goes on in the same file"
            return
        old_sink, old = self._sink, self._mcap
        self._sink, self._mcap = sink, mcap
        self._number += 1
        self.stuck = ""
        self._declare()
        try:
            old.add_metadata(CONTINUED_RECORD, {"in": segment_path(self._path, self._number).name})
            old.finish()  # type: ignore[no-untyped-call]
            old_sink.sync()
        finally:
            old_sink.close()

    def _is_full(self, t_ns: int) -> bool:
        most_bytes, most_ns = self._limits
        if self._since_ns is None:
            self._since_ns = t_ns
            return False
        return bool(most_bytes and self._sink.tell() >= self._limit_bytes) or bool(
            most_ns and t_ns - self._since_ns >= most_ns
        )

    def write_inputs(self, inputs: Inputs, tick: int) -> None:
        if self._run and self._is_full(inputs.t_ns):
            self._go_on_in_another(inputs.t_ns, tick)
        for frame in inputs.frames:
            self._add_frame(frame, "in")
        self._add(self._inputs, inputs.t_ns, _json({"t_ns": inputs.t_ns, "frames": len(inputs.frames)}), tick)

    def write_outputs(self, outputs: Outputs) -> None:
        self._add(self._outputs, outputs.t_ns, encode_outputs(outputs))
        for sent in outputs.frames:
            self._add_frame(sent, "out")
        fresh = self._viewed_ns is not None and outputs.t_ns - self._viewed_ns < _VIEW_PERIOD_NS
        if outputs.control is not None or not fresh:
            self._viewed_ns = outputs.t_ns
            for topic, data in convert_outputs(outputs):
                self._add(self._views[topic], outputs.t_ns, data)

    def write_timing(self, t_ns: int, step_ns: int, overrun: bool) -> None:
        self._add(self._timing, t_ns, _json({"t_ns": t_ns, "step_ns": step_ns, "overrun": overrun}))

    def write_forwarded(self, frame: Frame) -> None:
        self._add_frame(frame, "forwarded")

    def write_log(self, t_ns: int, level: str, text: str) -> None:
        self._add(self._views[LOG_TOPIC], t_ns, log_message(t_ns, level, text))

    def sync(self) -> None:
        """End the chunk and sync the file."""
        if self._written:
            self._mcap.flush()  # type: ignore[no-untyped-call]
            self._sink.sync()
            self._written = False

    def finish(self) -> None:
        """Write the summary and the end of the file."""
        self._mcap.finish()  # type: ignore[no-untyped-call]
        self._sink.sync()

    def close(self) -> None:
        self._sink.close()

    def _register(self, topic: str, schema: str = "") -> int:
        schema_id = self._mcap.register_schema(schema, "jsonschema", _json(SCHEMAS[schema])) if schema else 0
        return self._mcap.register_channel(topic, "json", schema_id)

    def _add_frame(self, frame: Frame, direction: str) -> None:
        key = (frame.port, direction, frame.peer, frame.via)
        channel = self._frame_channels.get(key)
        if channel is None:
            channel = self._frame_channels[key] = self._register_frames(key)
        self._add(channel, frame.t_ns, frame.data)

    def _register_frames(self, key: tuple[str, str, str, str]) -> int:
        port, direction, peer, via = key
        return self._mcap.register_channel(
            f"/frames/{port}/{direction}",
            self._encodings.get(port, "octets"),
            0,
            {"port": port, "direction": direction, "peer": peer, "via": via},
        )

    def _add(self, channel: int, t_ns: int, data: bytes, sequence: int = 0) -> None:
        self._mcap.add_message(channel, log_time=t_ns, data=data, publish_time=t_ns, sequence=sequence)
        self._written = True


class _Sink:
    """A new file, unbuffered: the MCAP writer hands over whole chunks, and a failed write leaves nothing behind in
    a buffer that would fail once more at close."""

    def __init__(self, path: Path) -> None:
        # Exclusively: a log is never overwritten.
        self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        self._offset = 0
        self._open = True

    def write(self, data: bytes) -> int:
        left = memoryview(data)
        while left:
            left = left[os.write(self._fd, left) :]
        self._offset += len(data)
        return len(data)

    def tell(self) -> int:
        return self._offset

    def flush(self) -> None:
        """Nothing is held back."""

    def sync(self) -> None:
        """Raises OSError also where the file is no longer in its folder: what is written then is lost."""
        os.fsync(self._fd)
        if os.fstat(self._fd).st_nlink == 0:
            raise OSError(errno.ENOENT, "the file was deleted while it was written")

    def close(self) -> None:
        if self._open:
            self._open = False
            os.close(self._fd)


_json = msgspec.json.encode
