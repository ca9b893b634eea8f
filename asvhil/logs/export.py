"""A log for other tools: the vehicle's MAVLink as a telemetry log, or the ticks as a table."""

from __future__ import annotations

import csv
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeAlias

from mcap.records import Message

from asvhil.config.ports import AUTOPILOT
from asvhil.errors import AsvhilError, LogError
from asvhil.files import is_there, whole_file
from asvhil.geo import LocalFrame
from asvhil.io.mavlink.frames import Parser, decode, dialect, message_id
from asvhil.logs.chunk_records import LogChannel
from asvhil.logs.clock import TickClock, clock_of, jump_words, stall_words
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.reader import LogFile, Timing, decode_timing
from asvhil.logs.recorder import INPUTS_TOPIC, OUTPUTS_TOPIC, TIMING_TOPIC
from asvhil.types import Outputs, record

Progress: TypeAlias = Callable[[int], None]
Row: TypeAlias = tuple[float | int | str | bool | None, ...]

FORMATS = (".tlog", ".csv", ".parquet")
_TLOG_TIME = struct.Struct(">Q")
_ROWS_AT_ONCE = 5000

# One row a tick. Times: since 1970, and since the first tick, in which a jump of the clock is none. Positions: the
# local NED frame, whose origin is the last two columns. What is unknown in a tick is empty. Truth is the last SIM_STATE
# of a simulator that sends it.
COLUMNS: dict[str, type] = {
    "unix_ns": int,
    "t_s": float,
    "phase": str,
    "code": str,
    "n_m": float,
    "e_m": float,
    "psi_rad": float,
    "u_mps": float,
    "v_mps": float,
    "r_radps": float,
    "station_n_m": float,
    "station_e_m": float,
    "station_psi_rad": float,
    "station_vn_mps": float,
    "station_ve_mps": float,
    "wind_n_mps": float,
    "wind_e_mps": float,
    "wind_origin": str,
    "command_port": float,
    "command_starboard": float,
    "pwm_port_us": int,
    "pwm_starboard_us": int,
    "solution_ok": bool,
    "solution_iterations": int,
    "stage": str,
    "link_ok": bool,
    "estimate_ok": bool,
    "wind_ok": bool,
    "model_ok": bool,
    "step_ms": float,
    "overrun": bool,
    "truth_n_m": float,
    "truth_e_m": float,
    "truth_psi_rad": float,
    "origin_lat_deg": float,
    "origin_lon_deg": float,
}


@record
class Exported:
    """How many frames or rows were written, what the log lacks (None: nothing), and a line for each jump and stall."""

    count: int
    damage: str | None
    warnings: tuple[str, ...]


def export_log(source: Path, target: Path, on_bytes: Progress = lambda done: None) -> Exported:
    """Write a log in the format that the target's ending names.

    A file that exists is not overwritten. LogError where the log is damaged;
    AsvhilError for an unknown ending, or where the file cannot be written. Nothing is left of a failed export.
    """
    kind = target.suffix.lower()
    if kind not in FORMATS:
        raise AsvhilError(f"{target}: a file that ends in {', '.join(FORMATS)} is expected")
    log = LogFile(source)
    clock = clock_of(log.metadata)
    if is_there(target):
        raise AsvhilError(f"{target}: exists already; give another name")
    try:
        with whole_file(target) as part:
            if kind == ".tlog":
                count = _write_tlog(_messages(log, clock, on_bytes), part)
            else:
                rows = _rows(log, clock, on_bytes)
                count = _write_csv(rows, part) if kind == ".csv" else _write_parquet(rows, part)
    except OSError as error:
        raise AsvhilError(f"{target}: cannot be written ({error.strerror or error})") from None
    warnings = (*jump_words(clock.jumps), *stall_words(clock.stalls))
    return Exported(count=count, damage=log.damage, warnings=warnings)


def _messages(log: LogFile, clock: TickClock, on_bytes: Progress) -> Iterator[tuple[LogChannel, Message]]:
    """All messages, with their channels, and the clock set to the tick of each.

    LogError at the first damage; a log without an end is read up to it.
    """
    for channel, message, offset in log.messages():
        on_bytes(offset)
        if channel.topic == INPUTS_TOPIC:
            clock.tick(message.log_time, message.sequence)
        yield channel, message


def _write_tlog(messages: Iterator[tuple[LogChannel, Message]], part: Path) -> int:
    """The frames of the autopilot's link, in and out, in the order of their time: as a ground station would have it."""
    frames: list[tuple[int, bytes]] = []
    parsers: dict[str, Parser] = {}
    for channel, message in messages:
        if channel.port == AUTOPILOT:
            parser = parsers.setdefault(channel.direction, Parser())
            frames += [(message.log_time // 1000, bytes(data)) for data in parser.receive(channel.peer, message.data)]
    frames.sort(key=lambda frame: frame[0])  # stable: those of one time stay in the order of the file
    with part.open("wb") as file:
        for t_us, data in frames:
            file.write(_TLOG_TIME.pack(t_us) + data)
    return len(frames)


def _rows(log: LogFile, clock: TickClock, on_bytes: Progress) -> Iterator[Row]:
    """A row of `COLUMNS` for each tick with outputs."""
    outputs: Outputs | None = None
    t_s = 0.0
    parser = Parser()
    truth: Any = None
    truth_at: Any = None
    timing: Timing | None = None
    for channel, message in _messages(log, clock, on_bytes):
        if channel.topic == OUTPUTS_TOPIC:
            if outputs is not None:
                yield _row(outputs, t_s, timing, truth_at)
            outputs, timing, truth_at = decode_outputs(message.data, log.path), None, truth
            t_s = clock.t_s(outputs.t_ns)
        elif channel.topic == TIMING_TOPIC:
            timing = decode_timing(message.data, log.path)
        elif channel.port == AUTOPILOT and channel.direction == "in":
            for data in parser.receive(channel.peer, message.data):
                if message_id(data) == dialect.MAVLINK_MSG_ID_SIM_STATE:
                    truth = decode(data) or truth
    if outputs is None:
        raise LogError(f"{log.path}: holds no tick with outputs")
    yield _row(outputs, t_s, timing, truth_at)


def _row(outputs: Outputs, t_s: float, timing: Timing | None, truth: Any) -> Row:
    estimate, station, wind, control = outputs.estimate, outputs.station, outputs.wind, outputs.control
    health, origin = outputs.health, outputs.origin_deg
    true_pose: Row = (None, None, None)
    if truth is not None and origin is not None:
        frame = LocalFrame(lat_deg=origin[0], lon_deg=origin[1])
        true_pose = (*frame.to_ned(truth.lat_int * 1e-7, truth.lon_int * 1e-7), float(truth.yaw))
    unknown3: Row = (None, None, None)
    if timing is not None and timing.t_ns != outputs.t_ns:
        timing = None
    return (
        outputs.t_ns,
        t_s,
        outputs.phase.value,
        health.code,
        *((estimate.n_m, estimate.e_m, estimate.psi_rad) if estimate else unknown3),
        *((estimate.u_mps, estimate.v_mps, estimate.r_radps) if estimate else unknown3),
        *((station.n_m, station.e_m, station.psi_rad) if station else unknown3),
        *((station.vn_mps, station.ve_mps) if station else (None, None)),
        *((wind.vn_mps, wind.ve_mps, wind.origin) if wind else unknown3),
        *(control.command if control else (None, None)),
        *(outputs.pwm_us or (None, None)),
        *((control.ok, control.iterations, control.stage) if control else unknown3),
        health.link_ok,
        health.estimate_ok,
        health.wind_ok,
        health.model_ok,
        *((timing.step_ns * 1e-6, timing.overrun) if timing else (None, None)),
        *true_pose,
        *(origin or (None, None)),
    )


def _write_csv(rows: Iterator[Row], part: Path) -> int:
    count = 0
    with part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for row in rows:
            writer.writerow(["" if value is None else _text(value) for value in row])
            count += 1
    return count


def _text(value: Any) -> Any:
    return str(value).lower() if isinstance(value, bool) else value


def _write_parquet(rows: Iterator[Row], part: Path) -> int:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise AsvhilError("Parquet needs pyarrow: pip install '.[parquet]' in the clone of asvhil") from None
    types = {float: pa.float64(), int: pa.int64(), str: pa.string(), bool: pa.bool_()}
    schema = pa.schema([(name, types[kind]) for name, kind in COLUMNS.items()])
    count = 0
    with part.open("wb") as file, pq.ParquetWriter(file, schema, compression="zstd") as writer:
        batch: list[Row] = []

        def flush() -> None:
            columns = [
                pa.array(column, field.type) for column, field in zip(zip(*batch, strict=True), schema, strict=True)
            ]
            writer.write_batch(pa.record_batch(columns, schema=schema))
            batch.clear()

        for row in rows:
            batch.append(row)
            count += 1
            if len(batch) == _ROWS_AT_ONCE:
                flush()
        if batch:
            flush()
    return count
