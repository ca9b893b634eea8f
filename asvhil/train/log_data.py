"""Aligned training data from logs of asvhil: rows at a constant step of the backseat's measurements and commands."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from asvhil.dynamics.arrays import Array
from asvhil.errors import LogError
from asvhil.train.log_series import LogSeries, read_log_series
from asvhil.train.records import Dataset, Segment, source_hash, still_motors
from asvhil.train.series import (
    MIN_DATA_S,
    MIN_SEGMENT_S,
    VELOCITY_HALF_WIDTH_S,
    YAW_HALF_WIDTH_S,
    Series,
    change_phase_s,
    common,
    grid,
    hold_mean,
    interpolate,
    low_pass,
    rotate,
    smooth,
    smooth_mean,
    spans,
)

Source = Literal["smoothed", "measured", "estimate", "truth"]

SILENT = "though its config has a source of wind"
WIND_GAP_S = 5.0
OFF = 0.02  # commands below it are motors that are off
OFF_HALF_WIDTH_S = 6.0  # of smoothing the velocity while nothing drives the boat
WIND_HALF_WIDTHS_S = (12.0, 1.0)  # direction, speed
WIND_TIME_CONSTANTS_S = (4.0, 0.5)  # the same, causal


def dataset_from_logs(
    paths: Sequence[Path], dt_s: float, source: Source = "smoothed", max_gap_s: float = 0.6
) -> Dataset:
    """All logs as one dataset. LogError names the file that is no log, too short (30 s), or lacks a quantity.

    Sources of u, v, r. `measured`: the velocities, headings and yaw rates that the backseat measured, of the sources in
    use, at their times, calibrated, and velocities transferred to the boat's origin; interpolated, for test data.
    `smoothed`: the same through local quadratic fits, which are not causal; for training data. `estimate`: the
    backseat's filter, which depends on a vessel model. `truth`: SIM_STATE. RMSE against the truth over 90 s of
    manoeuvres (simulated WAM-V in 6 m/s of steady wind, the true parameters; u, v in m/s, r in rad/s): measured
    .042/.042/.0064, estimate .020/.026/.0066, smoothed .028/.024/.0029. Smoothed is the default: as accurate as the
    estimate, and independent of the errors of a vessel model.

    Commands are the overrides that were sent, and where the motors were released the outputs that the autopilot
    reports. Rows begin when commands change. Gaps beyond max_gap_s in any source end a segment.
    """
    segments: list[Segment] = []
    notes: list[str] = []
    calm: list[tuple[Path, bool]] = []
    outliers = 0
    for path in paths:
        raw = read_log_series(path)
        found = _segments(path, raw, dt_s, source, max_gap_s)
        segments += found
        outliers += raw.outliers
        notes += still_motors(path, found)
        if not len(raw.wind.t_s):
            calm.append((path, raw.wind_link))
    notes += _calm(calm, len(paths))
    return Dataset(
        dt_s=dt_s,
        segments=tuple(segments),
        source_hash=source_hash(paths),
        outliers=outliers,
        notes=tuple(notes),
    )


def _calm(calm: Sequence[tuple[Path, bool]], logs: int) -> list[str]:
    """A line for each log that counts as calm: where it should have had wind, or where others have."""
    return [
        f"{path}: no wind was measured, {SILENT if linked else 'which other logs have'}: it counts as calm"
        for path, linked in calm
        if linked or len(calm) < logs
    ]


def truth_from_log(path: Path, dt_s: float, max_gap_s: float = 0.6) -> Dataset:
    """The simulated truth (SIM_STATE) on the same rows as `dataset_from_logs([path], dt_s)`; the wind is measured."""
    return dataset_from_logs([path], dt_s, "truth", max_gap_s)


def _segments(path: Path, raw: LogSeries, dt_s: float, source: Source, max_gap_s: float) -> list[Segment]:
    needed = (
        ("heading", raw.heading),
        ("yaw rate", raw.yaw_rate),
        ("velocity", raw.velocity),
        ("motor commands", raw.command),
    )
    for name, what in needed:
        if len(what.t_s) < 2:
            raise LogError(f"{path}: holds no {name}: nothing to train on")
    if source == "truth" and len(raw.truth.t_s) < 2:
        raise LogError(f"{path}: holds no SIM_STATE: the truth is known of simulated runs only")
    shared = spans(raw.heading.t_s, max_gap_s)
    for other in (raw.yaw_rate, raw.velocity, raw.command):
        shared = common(shared, spans(other.t_s, max_gap_s))
    if len(raw.wind.t_s):
        shared = common(shared, spans(raw.wind.t_s, max(WIND_GAP_S, max_gap_s)))
    phase_s = change_phase_s(raw.command, dt_s)
    segments = [
        _segment(raw, times, dt_s, source)
        for times in (grid(span, dt_s, phase_s) for span in shared)
        if len(times) * dt_s >= MIN_SEGMENT_S
    ]
    total_s = dt_s * sum(len(segment.t_s) for segment in segments)
    if total_s < MIN_DATA_S:
        why = _gaps(needed, total_s, max_gap_s)
        raise LogError(f"{path}: {total_s:.1f} s of usable data, at least {MIN_DATA_S:.0f} s are needed{why}")
    return segments


def _gaps(sources: Sequence[tuple[str, Series]], total_s: float, max_gap_s: float) -> str:
    """Which source has its gaps where little of a log is left, in words; empty where the log is just short."""
    whole = [(name, source, spans(source.t_s, max_gap_s)) for name, source in sources]
    name, source, stretches = min(whole, key=lambda one: max(end - begin for begin, end in one[2]))
    lasted_s = float(source.t_s[-1] - source.t_s[0])
    if lasted_s - total_s < MIN_SEGMENT_S:
        return ""
    return (
        f": {lasted_s:.0f} s were recorded, and gaps beyond {max_gap_s:g} s end a stretch; of {name} the longest lasts"
        f" {max(end - begin for begin, end in stretches):.1f} s, with samples each"
        f" {float(np.median(np.diff(source.t_s))):.2g} s"
    )


def _segment(raw: LogSeries, t_s: Array, dt_s: float, source: Source) -> Segment:
    psi = _psi_at(raw, t_s)
    body = Series(t_s=raw.velocity.t_s, values=rotate(-_psi_at(raw, raw.velocity.t_s), raw.velocity.values))
    measured = np.column_stack([interpolate(body, t_s), interpolate(raw.yaw_rate, t_s)])
    if source == "smoothed":
        psi = smooth(raw.heading, t_s, YAW_HALF_WIDTH_S)[:, 0]
        rate = smooth(raw.yaw_rate, t_s, YAW_HALF_WIDTH_S)
        nu = np.column_stack([smooth_velocity(body, raw.command, t_s), rate])
    elif source == "measured":
        nu = measured
    else:
        state = interpolate(raw.estimate if source == "estimate" else raw.truth, t_s)
        nu, psi = state[:, :3], state[:, 3]
    return Segment(
        t_s=t_s,
        nu=nu,
        command=np.clip(hold_mean(raw.command, t_s, dt_s), -1.0, 1.0),
        wind=rotate(-psi, _true_wind(raw, t_s, ahead=source == "smoothed")),
        psi=psi,
        measured=measured if source == "smoothed" else None,
    )


def smooth_velocity(body: Series, command: Series, t_s: Array) -> Array:
    """(T, 2) smoothed u, v; over a longer time where the motors are off all that time, as a boat that drifts is slow.

    Noise in the velocity that a window starts from looks like drag, as the error fades; and where drag and wind
    balance, too much drag means too much wind load.
    """
    near = smooth(body, t_s, VELOCITY_HALF_WIDTH_S)
    on = np.abs(command.values).max(axis=1) > OFF
    driven = np.concatenate([[0], np.cumsum(on)])
    first = np.searchsorted(command.t_s, t_s - OFF_HALF_WIDTH_S)
    last = np.searchsorted(command.t_s, t_s + OFF_HALF_WIDTH_S, side="right")
    off = np.flatnonzero(driven[last] == driven[first])
    near[off] = smooth(body, t_s[off], OFF_HALF_WIDTH_S)
    return near


def _true_wind(raw: LogSeries, t_s: Array, *, ahead: bool) -> Array:
    """(T, 2) velocity of the air over ground, NED, low-passed: apparent wind turned by the heading, plus the boat's.

    A vane of 16 positions is wrong by up to 11 degrees at constant heading, while the cups are fast and accurate: so
    the direction is averaged over a long time, and the speed over a short one.
    """
    if len(raw.wind.t_s) == 0:
        return np.zeros((len(t_s), 2))
    speed, origin, from_bow, is_apparent = raw.wind.values.T
    air = -speed[:, None] * np.stack([np.cos(origin), np.sin(origin)], axis=-1)
    over_ground = rotate(from_bow * _psi_at(raw, raw.wind.t_s), air)
    over_ground += is_apparent[:, None] * interpolate(raw.velocity, raw.wind.t_s)
    samples = Series(t_s=raw.wind.t_s, values=over_ground)
    if ahead:
        slow, quick = (smooth_mean(samples, t_s, half_width_s) for half_width_s in WIND_HALF_WIDTHS_S)
    else:
        slow, quick = (low_pass(samples, t_s, time_s) for time_s in WIND_TIME_CONSTANTS_S)
    along = slow / np.maximum(np.linalg.norm(slow, axis=1, keepdims=True), 1e-9)
    wind: Array = slow + along * ((quick - slow) * along).sum(axis=1, keepdims=True)
    return wind


def _psi_at(raw: LogSeries, t_s: Array) -> Array:
    psi: Array = interpolate(raw.heading, t_s)[:, 0]
    return psi
