"""Open-loop rollouts of a model on recorded data: only the initial state, commands and wind are given. No torch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from asvhil.dynamics.arrays import Array
from asvhil.dynamics.integrate import integrate, substeps
from asvhil.dynamics.protocol import Dynamics
from asvhil.train.records import Segment

MOTOR_WARM_UP_S = 3.0  # a motor forgets its past within ten lags


def open_loop(model: Dynamics, segment: Segment, starts: NDArray[np.int64], steps: int, dt_s: float) -> Array:
    """Velocities (starts, steps + 1, 3) from the segment's own velocity at each start (row numbers) on.

    Motor states start from the commands before the window. Diverging values end as infinities or NaN.
    """
    commands = segment.command.tolist()
    inputs = np.array([model.input_of_command((port, starboard)) for port, starboard in commands])
    count = substeps(dt_s, model.max_step_s)

    def advance(x: Array, rows: NDArray[np.int64]) -> Array:
        a, wind = inputs[rows], segment.wind[rows]
        return np.asarray(integrate(lambda y: model.derivative(y, a, wind), x, dt_s, count, model.euler))

    warm_up = round(MOTOR_WARM_UP_S / dt_s) if model.n_motor else 0
    row = np.maximum(starts - warm_up, 0)
    motor = inputs[row][:, : model.n_motor]
    for k in range(warm_up, 0, -1):
        row = np.maximum(starts - k, 0)
        motor = advance(np.concatenate([segment.nu[row], motor], axis=1), row)[:, 3:]
    x = np.concatenate([segment.nu[starts], motor], axis=1)
    path = np.empty((len(starts), steps + 1, 3))
    path[:, 0] = x[:, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(steps):
            x = advance(x, starts + k)
            path[:, k + 1] = x[:, :3]
    return path


def measured(segment: Segment, starts: NDArray[np.int64], steps: int) -> Array:
    """The segment's own velocities over the same windows (starts, steps + 1, 3)."""
    rows: NDArray[np.int64] = starts[:, None] + np.arange(steps + 1)[None, :]
    return np.asarray(segment.nu[rows])


def spaced_starts(segment: Segment, steps: int, every: int) -> NDArray[np.int64]:
    """Starts of whole windows, `every` rows apart; none where the segment is too short."""
    return np.arange(0, max(0, len(segment.t_s) - steps), every, dtype=np.int64)
