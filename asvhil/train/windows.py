"""From a dataset to training windows: checked, scaled, mirrored if asked for, and cut. No torch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from asvhil.dynamics.arrays import Array
from asvhil.dynamics.nnsem import Scaling
from asvhil.errors import ModelError
from asvhil.train.records import MOTORS, STILL_COMMAND, Dataset, Segment, ranges

SHORTEST_S = 60.0  # less data cannot train a model
MOVING_MPS = 0.2  # mean speed of a window in motion
OFF = 0.02  # commands below it are motors that are off
STILL_MPS, STILL_RADPS = 0.1, 0.02  # ranges of u and r below these are a boat at rest
MIRROR_NU = np.array([1.0, -1.0, -1.0])
MIRROR_WIND = np.array([1.0, -1.0])


def check(dataset: Dataset) -> None:
    """ModelError if the data cannot train a model: not finite, too short, or without motion."""
    if not dataset.segments:
        raise ModelError("the training data hold no usable segment")
    for number, segment in enumerate(dataset.segments):
        for name in ("nu", "command", "wind"):
            bad = ~np.isfinite(getattr(segment, name)).all(axis=1)
            if bad.any():
                where = f"in {int(bad.sum())} rows, first at {segment.t_s[int(np.argmax(bad))]:.1f} s"
                raise ModelError(f"training data, segment {number}: {name} is not finite {where}")
    duration_s = dataset.dt_s * sum(len(segment.t_s) for segment in dataset.segments)
    if duration_s < SHORTEST_S:
        raise ModelError(f"the training data last {duration_s:.1f} s: at least {SHORTEST_S:.0f} s are needed")
    spread = np.ptp(np.concatenate([segment.nu for segment in dataset.segments]), axis=0)
    if spread[0] < STILL_MPS or spread[2] < STILL_RADPS:
        raise ModelError(
            f"the training data hold no motion: u spans {spread[0]:.3f} m/s and r {spread[2]:.4f} rad/s"
            f" (at least {STILL_MPS} and {STILL_RADPS} are needed)"
        )
    command = np.concatenate([segment.command for segment in dataset.segments])
    still = [
        f"{name} motor ({values[0]:g})"
        for name, values in zip(MOTORS, command.T, strict=True)
        if np.ptp(values) < STILL_COMMAND
    ]
    if still:
        raise ModelError(
            f"the training data hold no motion of the motors: in none of the files the command of the"
            f" {' and the '.join(still)} ever changes; is its column or channel the right one?"
        )


def scaling_of(dataset: Dataset, *, symmetric: bool) -> Scaling:
    """Centres and half widths of (u, v, r, port, starboard, w_u, w_v); symmetric: about 0, alike for both motors.

    A wind that never changes is not scaled.
    """
    extremes = ranges(dataset)
    bounds = np.concatenate([extremes.nu, extremes.command, extremes.wind])
    if symmetric:
        reach = np.abs(bounds).max(axis=1)
        reach[3:5] = 1.0
        bounds = np.stack([-reach, reach], axis=1)
    half = 0.5 * (bounds[:, 1] - bounds[:, 0])
    still = half <= 0.0
    return Scaling(centre=np.where(still, 0.0, bounds.mean(axis=1)), half=np.where(still, 1.0, half))


def mirrored(segment: Segment) -> Segment:
    """The mirror image of a segment: port for starboard."""
    return Segment(
        t_s=segment.t_s,
        nu=segment.nu * MIRROR_NU,
        command=segment.command[:, ::-1],
        wind=segment.wind * MIRROR_WIND,
        psi=-segment.psi,
    )


class Windows:
    """All windows of the segments as indices into flat, scaled arrays.

    A window is `history` rows, whose commands alone are used, then `steps` + 1 rows from the initial state on.
    """

    def __init__(self, segments: tuple[Segment, ...], scaling: Scaling, steps: int, history: int) -> None:
        self.nu: Array = np.concatenate([(part.nu - scaling.centre[:3]) / scaling.half[:3] for part in segments])
        self.command: Array = np.concatenate(
            [(part.command - scaling.centre[3:5]) / scaling.half[3:5] for part in segments]
        )
        self.wind: Array = np.concatenate([(part.wind - scaling.centre[5:]) / scaling.half[5:] for part in segments])
        starts, moving, off, offset = [], [], [], 0
        for part in segments:
            count = len(part.t_s)
            rows = np.arange(history, max(history, count - steps))
            starts.append(offset + rows)
            travelled = np.concatenate([[0.0], np.cumsum(np.hypot(part.nu[:, 0], part.nu[:, 1]))])
            moving.append(travelled[rows + steps + 1] - travelled[rows] > MOVING_MPS * (steps + 1))
            driven = np.concatenate([[0], np.cumsum(np.abs(part.command).max(axis=1) > OFF)])
            off.append(driven[rows + steps] == driven[rows - history])
            offset += count
        self.starts: NDArray[np.int64] = np.concatenate(starts)
        self._moving: NDArray[np.int64] = np.flatnonzero(np.concatenate(moving))
        self.off: NDArray[np.int64] = np.flatnonzero(np.concatenate(off))
        self.steps, self.history = steps, history
        if not len(self.starts):
            raise ModelError(f"the training data have no stretch of {steps + history + 1} samples without a gap")

    def draw(
        self, rng: np.random.Generator, count: int, batch: int, moving_share: float, resting_share: float = 0.0
    ) -> NDArray[np.int64]:
        """Numbers of windows (count, batch), drawn uniformly; a share of each batch only from windows in motion.

        In a record in which the boat is at rest for most of the time, a uniform draw would train for little else. In
        one that is all manoeuvres it would hardly train for the boat that lies in the wind with its motors off, as at
        a station: so another share is drawn from such windows alone.
        """
        picks = rng.integers(len(self.starts), size=(count, batch))
        chosen = round(moving_share * batch)
        if chosen and len(self._moving):
            picks[:, :chosen] = rng.choice(self._moving, size=(count, chosen))
        chosen = min(round(resting_share * batch), batch)
        if chosen and len(self.off):
            picks[:, batch - chosen :] = rng.choice(self.off, size=(count, chosen))
        return picks
