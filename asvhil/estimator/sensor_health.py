"""The health of one sensor: whether its readings arrive, are accepted, frozen, or off the prediction.

A `Track` is replaced and never changed, so that the filter can return to an earlier one for a late reading.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from asvhil.types import changed, record

NEVER = -(2**62)
SILENT, FROZEN, REJECTED = "silent", "frozen", "jump rejected"  # faults, as `fault` tells them
LEAST_REPEATS = 4  # a stream that sends each reading twice makes three of one repeat by chance
JITTER_GAIN = 0.05
STEPS_OF_NOISE = 3.0  # noise of fewer steps of the resolution repeats itself often enough
TAKEN_TOLD_NS = 60_000_000_000
TOLD_AFTER = 2  # rejections in a row: a single outlier is not reported


@record
class Track:
    """The record of one sensor. Times are those of its readings."""

    received_ns: int = NEVER
    accepted_ns: int = NEVER
    accepted: int = 0
    rejected: int = 0
    rejected_in_row: int = 0
    rejected_since_ns: int = NEVER
    # A rejected sensor at a constant distance to the prediction is steady: it may be right, and the filter wrong.
    steady_since_ns: int = NEVER
    steady: tuple[float, float] = (0.0, 0.0)
    innovation: tuple[float, float] = (0.0, 0.0)
    value: tuple[float, float] = (math.nan, math.nan)
    expected: tuple[float, float] = (math.nan, math.nan)
    jitter: float = 0.0
    step: float = 0.0  # the least change of an axis so far: its resolution, if that is coarser than its noise
    repeats: int = 0
    repeated_since_ns: int = NEVER
    apart_since_ns: int = NEVER  # since when the prediction has left a reading that repeats itself
    frozen: bool = False
    taken_ns: int = NEVER  # when the filter was reset to it, after it had been rejected for long
    taken_off: float = 0.0  # and how far off it was


class FreezeLimits(NamedTuple):
    """Limits of noise and motion above which a sensor that repeats its reading is frozen.

    `lag_ns`: for how long the prediction may be ahead of a sound sensor, as when motors start later than predicted.
    """

    noise: float
    motion: float
    lag_ns: int = 0


def update(
    track: Track,
    t_ns: int,
    value: tuple[float, float],
    expected: tuple[float, float],
    limits: FreezeLimits,
    after_ns: int,
) -> Track:
    """The track after a reading whose prediction was `expected`. `Track.frozen` then tells of a frozen sensor."""
    if value != track.value:
        jitter, step = track.jitter, track.step
        for change in (abs(value[0] - track.value[0]), abs(value[1] - track.value[1])):
            if change > 0.0 and (change < step or step == 0.0):  # False for the first, which has none before it
                step = change
        if track.accepted > 1 and not track.frozen:
            moved = math.hypot(
                value[0] - track.value[0] - expected[0] + track.expected[0],
                value[1] - track.value[1] - expected[1] + track.expected[1],
            )
            if math.isfinite(moved):
                jitter += JITTER_GAIN * (min(moved, 10.0 * limits.noise) - jitter)
        return changed(
            track,
            received_ns=t_ns,
            value=value,
            expected=expected,
            jitter=jitter,
            step=step,
            repeats=0,
            repeated_since_ns=t_ns,
            apart_since_ns=NEVER,
            frozen=False,
        )
    repeats = track.repeats + 1
    frozen, apart_ns = track.frozen, track.apart_since_ns
    if not frozen and repeats >= LEAST_REPEATS and t_ns - track.repeated_since_ns >= after_ns:
        # The motion is that of the prediction since the first of them, if the prediction agreed with the reading then.
        off = math.hypot(value[0] - track.expected[0], value[1] - track.expected[1])
        moved = math.hypot(expected[0] - track.expected[0], expected[1] - track.expected[1])
        # Many receivers report a velocity of exactly zero for a slow boat.
        noisy = track.jitter > max(limits.noise, STEPS_OF_NOISE * track.step) and value != (0.0, 0.0)
        motion = max(limits.motion, track.step)
        apart = moved > motion and off < motion
        apart_ns = (t_ns if apart_ns == NEVER else apart_ns) if apart else NEVER
        frozen = noisy or (apart and t_ns - apart_ns >= limits.lag_ns)
    return changed(track, received_ns=t_ns, repeats=repeats, apart_since_ns=apart_ns, frozen=frozen)


def accept(track: Track, t_ns: int) -> Track:
    """Record that the reading was used for a correction."""
    return changed(track, accepted_ns=t_ns, accepted=track.accepted + 1, rejected_in_row=0, steady_since_ns=NEVER)


def reject(
    track: Track, t_ns: int, steady: tuple[float, float], innovation: tuple[float, float], slack: float
) -> Track:
    """Record that the reading was rejected by its innovation; steady while `steady` changes by at most `slack`."""
    since_ns, first = track.steady_since_ns, track.steady
    if since_ns == NEVER or math.hypot(steady[0] - first[0], steady[1] - first[1]) > slack:
        since_ns, first = t_ns, steady
    return changed(
        track,
        rejected=track.rejected + 1,
        rejected_in_row=track.rejected_in_row + 1,
        rejected_since_ns=track.rejected_since_ns if track.rejected_in_row else t_ns,
        steady_since_ns=since_ns,
        steady=first,
        innovation=innovation,
    )


def exclude(track: Track) -> Track:
    """Record that the reading was left out, as one of a frozen sensor."""
    return changed(track, rejected=track.rejected + 1, rejected_in_row=0, steady_since_ns=NEVER)


def take_over(track: Track, t_ns: int, off: float) -> Track:
    """Record that the filter was reset to a sensor that it had trusted, and then rejected `off` its prediction."""
    return changed(track, taken_ns=t_ns, taken_off=off)


def is_taken_over(track: Track, t_ns: int) -> bool:
    """Whether that was of late: the sensor has not recovered, it has been believed."""
    return track.taken_ns != NEVER and t_ns - track.taken_ns < TAKEN_TOLD_NS


def fault(track: Track, t_ns: int, stale_ns: int) -> str:
    """The present fault of the sensor as text; empty if there is none, or if it was never heard."""
    if track.received_ns == NEVER:
        return ""
    if t_ns - track.received_ns > stale_ns:
        return SILENT
    if track.frozen:
        return FROZEN
    if track.rejected_in_row >= TOLD_AFTER:
        return REJECTED
    return ""
