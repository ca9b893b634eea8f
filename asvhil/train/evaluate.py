"""Evaluation of models: open-loop rollouts from several starts, scored against the truth or the measurement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asvhil.dynamics.arrays import Array
from asvhil.dynamics.protocol import Dynamics
from asvhil.errors import LogError
from asvhil.train.openloop import MOTOR_WARM_UP_S, measured, open_loop
from asvhil.train.records import Segment
from asvhil.train.windows import MOVING_MPS
from asvhil.types import record

HOLD = "hold the initial value"
AXES = ("u", "v", "r")


@record
class Case:
    """One segment to predict: the data that the model gets, and those that it is scored against."""

    name: str
    seen: Segment
    reference: Segment


@record
class Window:
    """The place of a rollout: the number of its case, its first row, and whether the boat moves in it."""

    case: int
    start: int
    moving: bool


def windows_of(cases: Sequence[Case], horizon_s: float, every_s: float, dt_s: float) -> list[Window]:
    """All whole windows, every_s apart; the first begins when the motor states are known. LogError if there is none."""
    steps, every = round(horizon_s / dt_s), max(1, round(every_s / dt_s))
    found = []
    for number, case in enumerate(cases):
        for start in range(round(MOTOR_WARM_UP_S / dt_s), len(case.seen.t_s) - steps, every):
            speed = np.hypot(*case.reference.nu[start : start + steps + 1, :2].T)
            found.append(Window(case=number, start=start, moving=bool(speed.mean() > MOVING_MPS)))
    if not found:
        longest_s = max((dt_s * len(case.seen.t_s) for case in cases), default=0.0)
        raise LogError(
            f"the data hold no stretch for a rollout of {horizon_s:g} s after {MOTOR_WARM_UP_S:g} s of lead-in:"
            f" the longest has {longest_s:.1f} s"
        )
    return found


def predict(model: Dynamics | None, cases: Sequence[Case], windows: Sequence[Window], steps: int, dt_s: float) -> Array:
    """Velocities (windows, steps + 1, 3) by a model, or the constant initial value if it is None."""
    paths = np.empty((len(windows), steps + 1, 3))
    for number, case in enumerate(cases):
        mine = [i for i, window in enumerate(windows) if window.case == number]
        starts = np.array([windows[i].start for i in mine], dtype=np.int64)
        if not mine:
            continue
        if model is None:
            paths[mine] = case.seen.nu[starts][:, None, :]
        else:
            paths[mine] = open_loop(model, case.seen, starts, steps, dt_s)
    return paths


def absolute_errors(paths: Array, cases: Sequence[Case], windows: Sequence[Window]) -> Array:
    """Mean absolute error of u, v (m/s) and r (rad/s) of each window (windows, 3), the start left out."""
    steps = paths.shape[1] - 1
    reference = np.concatenate(
        [measured(cases[window.case].reference, np.array([window.start]), steps) for window in windows]
    )
    errors: Array = np.abs(paths - reference)[:, 1:].mean(axis=1)
    return errors


def summary(errors: Array, windows: Sequence[Window]) -> dict[str, Any]:
    """MAE over all windows, over those in motion and over idle ones: means, and the spread between windows."""
    moving: NDArray[np.bool_] = np.array([window.moving for window in windows])
    return {
        "all": _row(errors),
        "moving": _row(errors[moving]),
        "idle": _row(errors[~moving]),
    }


def _row(errors: Array) -> dict[str, Any]:
    if not len(errors):
        return {"windows": 0}
    mean, spread = errors.mean(axis=0), errors.std(axis=0)
    return {
        "windows": len(errors),
        **{f"mae_{axis}": round(float(value), 5) for axis, value in zip(AXES, mean, strict=True)},
        **{f"std_{axis}": round(float(value), 5) for axis, value in zip(AXES, spread, strict=True)},
    }


def evaluate(
    models: Mapping[str, Dynamics], cases: Sequence[Case], dt_s: float, horizon_s: float = 50.0, every_s: float = 10.0
) -> dict[str, dict[str, Any]]:
    """The summary of every model by name, and of a constant initial value. LogError where no window fits."""
    windows = windows_of(cases, horizon_s, every_s, dt_s)
    steps = round(horizon_s / dt_s)
    table: dict[str, Dynamics | None] = {**models, HOLD: None}
    return {
        name: summary(absolute_errors(predict(model, cases, windows, steps, dt_s), cases, windows), windows)
        for name, model in table.items()
    }
