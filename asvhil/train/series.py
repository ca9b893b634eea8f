"""Samples at irregular times to rows at a constant step: outliers, gaps, interpolation, smoothing, holds."""

from __future__ import annotations

import numpy as np

from asvhil.dynamics.arrays import Array
from asvhil.types import record

WINDOW = 7  # samples of the running median that a sample is held against

# Widths of the smoothing, chosen against the simulated truth: see `dataset_from_logs`.
MIN_DATA_S = 30.0  # of one file
MIN_SEGMENT_S = 2.0
SLOW_GAPS = 1.2  # times the usual step of a slow record: some jitter of it is no gap
SLOWEST_S = 1.1  # a usual step: one that is longer is of no record to train on
VELOCITY_HALF_WIDTH_S = 1.2
YAW_HALF_WIDTH_S = 0.7


@record
class Series:
    """Samples of one source: t_s (N,) rising, values (N, K)."""

    t_s: Array
    values: Array


def series(rows: list[tuple[float, ...]] | Array, width: int) -> Series:
    """Rows of (t_s, values...) as a series; rows that are not finite and all but the last of one time are left out."""
    table = np.asarray(rows, dtype=float).reshape(-1, width + 1)
    table = table[np.isfinite(table).all(axis=1)]
    table = table[np.argsort(table[:, 0], kind="stable")]
    last = np.append(np.diff(table[:, 0]) > 0.0, True)[: len(table)]
    return Series(t_s=table[last, 0], values=table[last, 1:])


def without_outliers(source: Series, offset: float, rate_per_s: float, bound: float) -> tuple[Series, int]:
    """The series without outliers, and their number.

    A sample is an outlier if it lies off the median of its neighbours by more than `offset` plus what `rate_per_s`
    allows over half the window, or beyond `bound`; the motion of a boat within a window is far smaller.
    """
    t_s, values = source.t_s, source.values
    if len(t_s) < WINDOW:
        good = (np.abs(values) <= bound).all(axis=1)
    else:
        half = WINDOW // 2
        padded = np.concatenate([values[:WINDOW][half:0:-1], values, values[-WINDOW:][-2 : -half - 2 : -1]])
        median = np.median(np.lib.stride_tricks.sliding_window_view(padded, WINDOW, axis=0), axis=-1)
        limit = offset + rate_per_s * half * float(np.median(np.diff(t_s)))
        good = ((np.abs(values - median) <= limit) & (np.abs(values) <= bound)).all(axis=1)
    return Series(t_s=t_s[good], values=values[good]), int((~good).sum())


def spans(t_s: Array, max_gap_s: float) -> list[tuple[float, float]]:
    """(begin, end) of each stretch of time without a gap between samples beyond max_gap_s."""
    if len(t_s) == 0:
        return []
    breaks = np.flatnonzero(np.diff(t_s) > max_gap_s)
    begins, ends = np.append(0, breaks + 1), np.append(breaks, len(t_s) - 1)
    return [(float(t_s[a]), float(t_s[b])) for a, b in zip(begins, ends, strict=True)]


def bridged_s(t_s: Array, max_gap_s: float) -> float:
    """The longest gap that a record is bridged over: max_gap_s, or a little more than a step of one as slow as that."""
    if len(t_s) < 3:
        return max_gap_s
    usual_s = float(np.median(np.diff(t_s)))
    return max(max_gap_s, SLOW_GAPS * usual_s) if usual_s <= SLOWEST_S else max_gap_s


def scattered_words(total_s: float, stretches_s: float, step_s: float, rows: int, max_gap_s: float) -> str:
    """Why a record of total_s has little in stretches long enough, where its gaps or its unit of time are to blame."""
    if total_s - stretches_s < MIN_SEGMENT_S:
        return ""
    return (
        f": {total_s:.3g} s in {rows} rows, but rows are {step_s:.3g} s apart and gaps beyond {max_gap_s:.3g} s end a"
        f" stretch, of which those of {MIN_SEGMENT_S:.0f} s or more count; is the unit of time right?"
    )


def common(a: list[tuple[float, float]], b: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The intersections of two rising lists of spans."""
    both = [(max(p[0], q[0]), min(p[1], q[1])) for p in a for q in b]
    return sorted(span for span in both if span[1] > span[0])


def interpolate(source: Series, t_s: Array) -> Array:
    """(T, K): linear between the samples, the first and last held outside."""
    return np.stack([np.interp(t_s, source.t_s, column) for column in source.values.T], axis=-1)


def smooth(source: Series, t_s: Array, half_width_s: float) -> Array:
    """(T, K): the local quadratic fit at each time, tricube weights over +- half_width_s. Not causal.

    Where fewer than 4 samples are that near, the samples are interpolated instead.
    """
    result = interpolate(source, t_s)
    first = np.searchsorted(source.t_s, t_s - half_width_s)
    last = np.searchsorted(source.t_s, t_s + half_width_s, side="right")
    for k in np.flatnonzero(last - first >= 4):
        part = slice(first[k], last[k])
        x = (source.t_s[part] - t_s[k]) / half_width_s
        weight = np.sqrt((1.0 - np.minimum(np.abs(x), 1.0) ** 3) ** 3)
        basis = np.stack([weight, weight * x, weight * x * x], axis=-1)
        result[k] = np.linalg.lstsq(basis, weight[:, None] * source.values[part], rcond=1e-8)[0][0]
    return result


def low_pass(source: Series, t_s: Array, time_constant_s: float) -> Array:
    """(T, K): a causal first-order low-pass of the samples, its latest value held."""
    states = np.empty_like(source.values)
    for k, value in enumerate(source.values):
        if k == 0:
            states[0] = value
            continue
        gain = 1.0 - np.exp(-(source.t_s[k] - source.t_s[k - 1]) / time_constant_s)
        states[k] = states[k - 1] + gain * (value - states[k - 1])
    at = np.clip(np.searchsorted(source.t_s, t_s, side="right") - 1, 0, None)
    held: Array = states[at]
    return held


def smooth_mean(source: Series, t_s: Array, half_width_s: float) -> Array:
    """(T, K): the mean over +- half_width_s with tricube weights. Not causal."""
    result = interpolate(source, t_s)
    first = np.searchsorted(source.t_s, t_s - half_width_s)
    last = np.searchsorted(source.t_s, t_s + half_width_s, side="right")
    for k in np.flatnonzero(last > first):
        part = slice(first[k], last[k])
        x = np.abs(source.t_s[part] - t_s[k]) / half_width_s
        weight = (1.0 - np.minimum(x, 1.0) ** 3) ** 3 + 1e-9
        result[k] = weight @ source.values[part] / weight.sum()
    return result


def hold_mean(source: Series, t_s: Array, dt_s: float) -> Array:
    """(T, K): the mean over [t, t + dt) of samples that are held until the next one; the last is held on."""
    steps = np.diff(source.t_s, append=max(source.t_s[-1], t_s[-1] + dt_s) + dt_s)
    integral = np.vstack([np.zeros(source.values.shape[1]), np.cumsum(steps[:, None] * source.values, axis=0)])
    over = Series(t_s=np.append(source.t_s, source.t_s[-1] + steps[-1]), values=integral)
    mean: Array = (interpolate(over, t_s + dt_s) - interpolate(over, t_s)) / dt_s
    return mean


def change_phase_s(source: Series, dt_s: float) -> float:
    """When within a step of dt the values change; 0 if never. The circular mean, weighted by how much they change.

    It is taken twice, the second time of the changes near the first mean, so that single others do not shift it.
    """
    if len(source.t_s) < 2:
        return 0.0
    jumps = np.abs(np.diff(source.values, axis=0)).sum(axis=1)
    turns = np.exp(2j * np.pi * source.t_s[1:] / dt_s)
    mean = (jumps * turns).sum()
    if abs(mean) < 1e-12:
        return 0.0
    near = (turns * np.conj(mean)).real > 0.5 * abs(mean)
    return float(np.angle((jumps * turns)[near].sum()) / (2.0 * np.pi) * dt_s % dt_s)


def grid(span: tuple[float, float], dt_s: float, phase_s: float) -> Array:
    """Times at phase + k dt whose steps [t, t + dt] lie within a span."""
    slack = 1e-6 * dt_s
    first = int(np.ceil((span[0] - phase_s - slack) / dt_s))
    last = int(np.floor((span[1] - phase_s + slack) / dt_s)) - 1
    times: Array = phase_s + dt_s * np.arange(first, last + 1, dtype=float)
    return times


def rotate(angle: Array, vectors: Array) -> Array:
    """(T, 2) vectors turned by angles (T,): from body axes to NED by psi, and back by -psi."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]], axis=-1)
