"""Aligned training data from CSV files of any boat, by a column map. Errors name file, row and column."""

from __future__ import annotations

import codecs
import csv
import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from asvhil.dynamics.arrays import Array
from asvhil.errors import LogError
from asvhil.geo import wrap_rad
from asvhil.train.angles import check_heading, check_within_turn
from asvhil.train.columns import ColumnMap, MotorColumn, load_columns
from asvhil.train.records import Dataset, Segment, source_hash, still_motors
from asvhil.train.series import (
    MIN_DATA_S,
    MIN_SEGMENT_S,
    VELOCITY_HALF_WIDTH_S,
    YAW_HALF_WIDTH_S,
    Series,
    bridged_s,
    grid,
    hold_mean,
    interpolate,
    rotate,
    scattered_words,
    series,
    smooth,
    spans,
    without_outliers,
)

NAN_SHARE = 0.05  # a larger share of missing values is an error
JUMP_SHARE = 0.1  # and of jumps: single ones are a receiver's, many those of a wrong unit
COMMAND_SLACK = 1.05  # commands a little beyond 1 are due to rounding, more to a wrong unit
MISSING = frozenset({"", "nan", "-nan", "na", "n/a", "null", "none"})
DECIMAL = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]{1,3})?", re.ASCII)
PULSE_US = (500.0, 2500.0)
WINDS = ("wind_u", "wind_v", "wind_n", "wind_e", "wind_speed")
FASTEST_WIND_MPS = 75.0  # a hurricane: more is a wrong unit
CALM_MPS = 0.1  # a wind speed may be so far below 0, by the offset of a sensor in a calm
LONGEST_S = 1e7  # of a file, some four months: more is a wrong unit of time
DELIMITERS = (";", "\t", ",", "|")


def dataset_from_csv(
    paths: Sequence[Path], column_map: Path, dt_s: float, *, smoothed: bool = False, max_gap_s: float = 1.0
) -> Dataset:
    """All files as one dataset; `smoothed` is not causal, so it is for training data only.

    Rows with an empty field or NaN are gaps. ConfigError on the column map; LogError on a file that lacks a column
    or has it twice, has text where a number should be, more than 5 % NaN, time that does not rise, or less than 30 s.
    """
    columns = load_columns(column_map)
    segments: list[Segment] = []
    notes: list[str] = []
    outliers = missing = 0
    for path in paths:
        table, left_out = _read(path, columns)
        found, removed = _segments(path, columns, table, dt_s, smoothed, max_gap_s)
        segments += found
        notes += still_motors(path, found)
        outliers += removed
        missing += left_out
    return Dataset(
        dt_s=dt_s,
        segments=tuple(segments),
        source_hash=source_hash(paths),
        outliers=outliers,
        missing=missing,
        notes=tuple(notes),
    )


def _segments(
    path: Path, columns: ColumnMap, table: dict[str, Array], dt_s: float, smoothed: bool, max_gap_s: float
) -> tuple[list[Segment], int]:
    t_s = table["time"]
    max_gap_s = bridged_s(t_s, max_gap_s)
    if columns.psi is not None and columns.psi.settle_s is not None:
        steadied = _steadied_heading(t_s, table["psi"], table["r"], columns.psi.settle_s, max_gap_s)
        turned = rotate(table["psi"] - steadied, np.column_stack([table["u"], table["v"]]))
        table |= {"psi": steadied, "u": turned[:, 0], "v": turned[:, 1]}
    velocity, jumps_v = without_outliers(_series(t_s, table["u"], table["v"]), 1.0, 3.0, 30.0)
    rate, jumps_r = without_outliers(_series(t_s, table["r"]), 0.5, 2.0, 10.0)
    for names, jumps in (("u and v", jumps_v), ("r", jumps_r)):
        if jumps > JUMP_SHARE * len(t_s):
            raise LogError(f"{path}: {jumps} of {len(t_s)} rows have jumps of {names}: is their unit right?")
    command = _series(t_s, table["port"], table["starboard"])
    psi = _series(t_s, np.unwrap(table["psi"])) if columns.psi is not None else None
    wind = _body_wind(columns, table)
    segments = []
    for span in spans(t_s, max_gap_s):
        times = grid(span, dt_s, span[0] % dt_s)
        if len(times) * dt_s < MIN_SEGMENT_S:
            continue
        nu = measured = np.column_stack([interpolate(velocity, times), interpolate(rate, times)])
        if smoothed:
            parts = [smooth(velocity, times, VELOCITY_HALF_WIDTH_S), smooth(rate, times, YAW_HALF_WIDTH_S)]
            nu = np.column_stack(parts)
        segments.append(
            Segment(
                t_s=times,
                nu=nu,
                command=hold_mean(command, times, dt_s),
                wind=interpolate(wind, times),
                psi=interpolate(psi, times)[:, 0] if psi is not None else np.full(len(times), np.nan),
                measured=measured if smoothed else None,
            )
        )
    total_s = dt_s * sum(len(segment.t_s) for segment in segments)
    if total_s < MIN_DATA_S:
        usual_s = float(np.median(np.diff(t_s))) if len(t_s) > 1 else 0.0
        why = scattered_words(float(t_s[-1]), total_s, usual_s, len(t_s), max_gap_s)
        raise LogError(f"{path}: {total_s:.1f} s of usable data, at least {MIN_DATA_S:.0f} s are needed{why}")
    return segments, jumps_v + jumps_r


def _series(t_s: Array, *columns: Array) -> Series:
    return series(np.column_stack([t_s, *columns]), len(columns))


def _steadied_heading(t_s: Array, psi: Array, r: Array, settle_s: float, max_gap_s: float) -> Array:
    """The heading (T,) by the yaw rate, converging to the compass with a time constant; causal.

    After a gap it starts at the compass.
    """
    steadied = np.empty_like(psi)
    steadied[0] = psi[0]
    for k in range(1, len(psi)):
        step_s = t_s[k] - t_s[k - 1]
        led = steadied[k - 1] + 0.5 * (r[k - 1] + r[k]) * step_s
        gain = 1.0 - math.exp(-step_s / settle_s) if step_s <= max_gap_s else 1.0
        steadied[k] = led + gain * wrap_rad(psi[k] - led)
    return steadied


def _body_wind(columns: ColumnMap, table: dict[str, Array]) -> Series:
    """The velocity of the air over ground in body axes; zero where the file has no wind."""
    t_s = table["time"]
    if columns.wind_u is not None:
        return _series(t_s, table["wind_u"], table["wind_v"])
    if columns.wind_n is not None:
        body = rotate(-table["psi"], np.column_stack([table["wind_n"], table["wind_e"]]))
    elif columns.wind_speed is not None:
        speed, origin = table["wind_speed"], table["wind_from"]
        body = np.column_stack([table["u"] - speed * np.cos(origin), table["v"] - speed * np.sin(origin)])
    else:
        body = np.zeros((len(t_s), 2))
    return _series(t_s, body[:, 0], body[:, 1])


# --- reading ---------------------------------------------------------------------------------------------------


def _read(path: Path, columns: ColumnMap) -> tuple[dict[str, Array], int]:
    """Quantities in SI units and commands in [-1, 1], one entry per row without NaN; how many rows have one.

    The time counts from the first row (s).
    """
    wanted = {
        name: column for name in ColumnMap.model_fields if name != "delimiter" and (column := getattr(columns, name))
    }
    raw, rows = _numbers(path, columns.delimiter, {name: column.column for name, column in wanted.items()})
    _check_nan(path, {name: column.column for name, column in wanted.items()}, raw, rows)
    keep = np.isfinite(np.column_stack(list(raw.values()))).all(axis=1)
    raw, rows = {name: values[keep] for name, values in raw.items()}, rows[keep]
    _check_time(path, columns.time.column, raw["time"], rows, columns.time.factor)
    table: dict[str, Array] = {}
    for name, column in wanted.items():
        if isinstance(column, MotorColumn):
            table[name] = _command(path, column, raw[name], rows)
        elif name == "time":
            table[name] = (raw[name] - raw[name][0]) * column.factor
        else:
            table[name] = raw[name] * column.factor
            if name in WINDS:
                good = np.abs(table[name]) <= FASTEST_WIND_MPS
                _check_range(path, column.column, raw[name], rows, good, f"beyond {FASTEST_WIND_MPS:g} m/s of wind")
            if name == "wind_speed":
                good = table[name] >= -CALM_MPS
                _check_range(path, column.column, raw[name], rows, good, "a negative speed: is its sign right?")
            if name == "wind_from":
                check_within_turn(path, columns.wind_from, raw[name], rows)
    if columns.psi is not None:
        check_heading(path, columns.psi, raw["psi"], rows, table)
    return table, int((~keep).sum())


def _numbers(path: Path, delimiter: str, names: dict[str, str]) -> tuple[dict[str, Array], Array]:
    """The columns as numbers, NaN where a field is empty, and the row of the file (from 1) that each comes from."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, delimiter=delimiter, strict=True)
            header = [name.strip() for name in next(reader, [])]
            if not header:
                raise LogError(f"{path}: row 1: empty, where the names of the columns should be")
            missing = [f"{column!r} (for {name})" for name, column in names.items() if column not in header]
            if missing:
                there = ", ".join(repr(name) for name in header) or "nothing"
                raise LogError(
                    f"{path}: row 1: no column {', '.join(missing)}; the header has {there}{_other(header, delimiter)}"
                )
            twice = [column for column in names.values() if header.count(column) > 1]
            if twice:
                at = [str(place) for place, name in enumerate(header, 1) if name == twice[0]]
                raise LogError(f"{path}: row 1: column {twice[0]!r} is there {len(at)} times (as {' and '.join(at)})")
            places = {name: header.index(column) for name, column in names.items()}
            values: list[list[float]] = []
            rows: list[int] = []
            for fields in reader:
                if not fields:
                    continue
                if len(fields) < len(header) or any(map(str.strip, fields[len(header) :])):
                    raise LogError(f"{path}: row {reader.line_num}: {len(fields)} of {len(header)} fields")
                rows.append(reader.line_num)
                values.append([_number(path, reader.line_num, header[at], fields[at]) for at in places.values()])
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise LogError(f"{path}: {_encoded(path)}") from None
    except csv.Error as error:
        raise LogError(f"{path}: row {reader.line_num}: not valid CSV ({error})") from None
    if not values:
        raise LogError(f"{path}: holds no row of data")
    table = np.array(values)
    return {name: table[:, i] for i, name in enumerate(places)}, np.array(rows)


def _other(header: list[str], delimiter: str) -> str:
    """What a header of one column with another delimiter in it tells: `delimiter` belongs into the column map."""
    used = max((one for one in DELIMITERS if one != delimiter), key=header[0].count)
    return f"; key delimiter: {used!r}?" if len(header) == 1 and used in header[0] else ""


def _encoded(path: Path) -> str:
    """How a file that is no UTF-8 text can be made one."""
    with path.open("rb") as file:
        start = file.read(4)
    if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "UTF-16 text, and a CSV file is to be UTF-8: iconv -f UTF-16 -t UTF-8"
    return "not UTF-8 text, so no CSV file; if it is one of an older program: iconv -f WINDOWS-1252 -t UTF-8"


def _number(path: Path, row: int, column: str, text: str) -> float:
    """A decimal number; NaN if the field is empty or NaN. Other notations of Python (1_500, inf, 0x10) are refused."""
    text = text.strip()
    if text.lower() in MISSING:
        return math.nan
    value = float(text) if DECIMAL.fullmatch(text) else math.inf
    if not math.isfinite(value):
        near = text.replace("_", "").replace(" ", "").replace(",", "." if text.count(",") == 1 else "")
        meant = f"; did you mean {near}?" if near != text and DECIMAL.fullmatch(near) else ""
        raise LogError(f"{path}: row {row}, column {column!r}: a number is expected, not {text!r}{meant}")
    return value


def _check_nan(path: Path, names: dict[str, str], raw: dict[str, Array], rows: Array) -> None:
    for name, values in raw.items():
        bad = np.isnan(values)
        if bad.sum() > NAN_SHARE * len(values):
            raise LogError(
                f"{path}: column {names[name]!r}: {bad.sum()} of {len(values)} values are NaN or empty, the first in "
                f"row {rows[bad][0]}; up to {NAN_SHARE:.0%} are taken as gaps"
            )


def _check_time(path: Path, column: str, time: Array, rows: Array, factor: float) -> None:
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if len(back):
        at = back[0] + 1
        raise LogError(
            f"{path}: row {rows[at]}, column {column!r}: time does not rise ({time[at]:.10g} after {time[at - 1]:.10g})"
        )
    late = np.flatnonzero((time - time[0]) * factor > LONGEST_S)
    if len(late):
        words = f"{time[late[0]]:.10g} is more than {LONGEST_S:g} s after the first row: is the unit of time right?"
        raise LogError(f"{path}: row {rows[late[0]]}, column {column!r}: {words}")


def _command(path: Path, column: MotorColumn, values: Array, rows: Array) -> Array:
    """Commands in [-1, 1] of raw values in their unit."""
    if column.unit == "us":
        assert column.astern_us is not None and column.neutral_us is not None and column.ahead_us is not None
        low, high = PULSE_US
        silent = values == 0.0  # no signal: the motor is off
        _check_range(path, column.column, values, rows, ((values >= low) & (values <= high)) | silent, "no pulse width")
        offset = np.where(silent, 0.0, values - column.neutral_us)
        span = np.where(offset > 0.0, column.ahead_us - column.neutral_us, column.neutral_us - column.astern_us)
        command = offset / span
    else:
        command = values / (100.0 if column.unit == "%" else 1.0)
        what = "beyond -100..100 %" if column.unit == "%" else "beyond -1..1"
        _check_range(path, column.column, values, rows, np.abs(command) <= COMMAND_SLACK, what)
    return column.sign * np.clip(command, -1.0, 1.0)


def _check_range(path: Path, column: str, values: Array, rows: Array, good: NDArray[np.bool_], what: str) -> None:
    if not good.all():
        at = np.flatnonzero(~good)[0]
        raise LogError(f"{path}: row {rows[at]}, column {column!r}: {values[at]:g} is {what}")
