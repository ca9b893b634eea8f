"""Aligned training data: segments at a constant step, their split by time, and the ranges for scaling. No torch."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from asvhil.dynamics.arrays import Array
from asvhil.errors import LogError
from asvhil.types import record

MOTORS = ("port", "starboard")
STILL_COMMAND = 1e-6  # a command that spans less never changes: what is left is rounding


@record
class Segment:
    """One uninterrupted stretch at constant dt; row k of every array belongs to t_s[k]."""

    t_s: Array  # (T,) since the start of the file it came from
    nu: Array  # (T, 3) u, v (m/s over ground, body axes), r (rad/s)
    command: Array  # (T, 2) port, starboard in [-1, 1], held over [t, t + dt)
    wind: Array  # (T, 2) true wind in body axes (m/s): velocity of the air over ground, rotated by the heading
    psi: Array  # (T,) rad, continuous; NaN where unknown
    measured: Array | None = None  # (T, 3) nu before it was smoothed, where it was


@record
class Dataset:
    """All segments of some files at one step. `source_hash` is the SHA-256 of the files, in the order given."""

    dt_s: float
    segments: tuple[Segment, ...]
    source_hash: str
    outliers: int = 0  # samples that were left out because no boat jumps like that
    missing: int = 0  # rows of CSV files that were left out because a value is missing
    notes: tuple[str, ...] = ()  # what is odd about the files, a line each

    @property
    def duration_s(self) -> float:
        """The length of all segments together (s)."""
        return self.dt_s * sum(len(segment.t_s) for segment in self.segments)


@record
class Ranges:
    """Extremes of a training set, for the scaling to [-1, 1]: (low, high) per component."""

    nu: Array  # (3, 2)
    command: Array  # (2, 2)
    wind: Array  # (2, 2)


def slice_segment(segment: Segment, start: int, stop: int) -> Segment:
    """Rows start to stop of a segment."""
    part = slice(start, stop)
    return Segment(
        t_s=segment.t_s[part],
        nu=segment.nu[part],
        command=segment.command[part],
        wind=segment.wind[part],
        psi=segment.psi[part],
        measured=None if segment.measured is None else segment.measured[part],
    )


def split(dataset: Dataset, test_fraction: float) -> tuple[Dataset, Dataset]:
    """(training, test): the last test_fraction of each segment's time is the test set. LogError where one is empty."""
    if not 0.0 < test_fraction < 1.0:
        raise ValueError(f"test_fraction must lie between 0 and 1, not {test_fraction}")
    train: list[Segment] = []
    test: list[Segment] = []
    for segment in dataset.segments:
        rows = len(segment.t_s)
        cut = round(rows * (1.0 - test_fraction))
        train += [slice_segment(segment, 0, cut)] if cut >= 2 else []
        test += [slice_segment(segment, cut, rows)] if rows - cut >= 2 else []
    if not train or not test:
        raise LogError(f"{dataset.duration_s:.1f} s of data are too short to be split at {test_fraction:.0%}")
    return dataclasses.replace(dataset, segments=tuple(train)), dataclasses.replace(dataset, segments=tuple(test))


def ranges(dataset: Dataset) -> Ranges:
    """Extremes of a set over all its segments; call it with the training set only, and store it with the model."""

    def extremes(rows: list[Array]) -> Array:
        every = np.concatenate(rows)
        return np.stack([every.min(axis=0), every.max(axis=0)], axis=-1)

    return Ranges(
        nu=extremes([segment.nu for segment in dataset.segments]),
        command=extremes([segment.command for segment in dataset.segments]),
        wind=extremes([segment.wind for segment in dataset.segments]),
    )


def still_motors(path: Path, segments: Sequence[Segment]) -> list[str]:
    """A line for the motor of a file whose command never changes, while that of the other does."""
    command = np.concatenate([segment.command for segment in segments])
    spread = np.ptp(command, axis=0)
    return [
        f"{path}: the command of the {name} motor is {command[0, motor]:g} throughout: is its column the right one?"
        for motor, name in enumerate(MOTORS)
        if spread[motor] < STILL_COMMAND <= spread[1 - motor]
    ]


def source_hash(paths: Sequence[Path]) -> str:
    """SHA-256 of the contents of files, in their order. LogError where one cannot be read."""
    digest = hashlib.sha256()
    for path in paths:
        try:
            with path.open("rb") as file:
                while block := file.read(1 << 20):
                    digest.update(block)
        except OSError as error:
            raise LogError(f"{path}: cannot be read ({error.strerror})") from None
    return digest.hexdigest()
