"""Whether the angles of a CSV file are in the unit that its column map says: by a turn, and by the yaw rate."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from asvhil.dynamics.arrays import Array
from asvhil.errors import LogError
from asvhil.train.columns import AngleColumn

TURN = {"rad": 2.0 * np.pi, "deg": 360.0}
SLACK = 1.001  # of a turn: rounding
STEP_S = 2.0  # the heading is held against the yaw rate over steps of at least so long, which noise counts little in
TURNING_RAD = 0.1  # in such a step: less does not tell the unit
LEAST_STEPS = 5  # in which the boat turns
MOST = 3.0  # times what the yaw rate says, or as much less: degrees that are taken for radians turn 57 times as far


def check_within_turn(path: Path, column: AngleColumn | None, raw: Array, rows: Array) -> None:
    """LogError where an angle (N,) is beyond a turn of its unit."""
    beyond = _beyond_turn(column, raw)
    if column is not None and len(beyond):
        at = beyond[0]
        raise LogError(f"{_place(path, column, rows[at])}: {_beyond_words(column, raw[at])}")


def check_heading(path: Path, column: AngleColumn, raw: Array, rows: Array, table: Mapping[str, Array]) -> None:
    """LogError where a heading (N,) is in another unit than the map says.

    `table` has time (s), psi (rad) and r (rad/s) by the map. A heading beyond a turn is right where it goes on counting
    from turn to turn, and so changes as the yaw rate says. Where the boat hardly turns that cannot be told: then such a
    heading is taken in degrees alone, since one in radians beyond 2 pi is mostly in degrees.
    """
    beyond, turns = _beyond_turn(column, raw), _turns_by(table)
    why = ""
    if turns is None:
        why = "and the boat turns too little to tell" if column.unit == "rad" else ""
    elif turns > MOST:
        why = "and it does not change as r says"
    if len(beyond) and why:
        at = beyond[0]
        raise LogError(f"{_place(path, column, rows[at])}: {_beyond_words(column, raw[at])}; {why}")
    within = np.abs(raw).max() <= SLACK * TURN["rad"]
    if column.unit == "deg" and within and turns is not None and turns < 1.0 / MOST:
        reach = f"from {raw.min():g} to {raw.max():g} deg"
        raise LogError(
            f"{path}: column {column.column!r}: {reach}, which changes {turns:.2g} times as far as r says: unit rad?"
        )


def _beyond_turn(column: AngleColumn | None, raw: Array) -> NDArray[np.int64]:
    """The indices of angles beyond a turn."""
    if column is None:
        return np.empty(0, dtype=np.int64)
    return np.flatnonzero(np.abs(raw) > SLACK * TURN[column.unit]).astype(np.int64)


def _place(path: Path, column: AngleColumn, row: float) -> str:
    return f"{path}: row {row:.0f}, column {column.column!r}"


def _beyond_words(column: AngleColumn, value: float) -> str:
    turn = "2 pi): unit deg?" if column.unit == "rad" else "360): is the unit right?"
    return f"{value:g} is no angle in {column.unit} (beyond {turn}"


def _turned(table: Mapping[str, Array]) -> Array:
    """What the boat has turned since the first row (rad) by the yaw rate."""
    t_s, r = table["time"], table["r"]
    return np.concatenate([[0.0], np.cumsum(0.5 * (r[1:] + r[:-1]) * np.diff(t_s))])


def _turns_by(table: Mapping[str, Array]) -> float | None:
    """How many times as far as by the yaw rate the heading turns; None where the boat hardly turns.

    The median over steps in which it turns: few of them have a jump from one end of the circle to the other. Over a gap
    nobody knows the yaw rate.
    """
    t_s = table["time"]
    picks = np.unique(np.searchsorted(t_s, np.arange(t_s[0], t_s[-1], STEP_S)))
    by_rate, by_heading = np.diff(_turned(table)[picks]), np.diff(table["psi"][picks])
    turning = (np.abs(by_rate) > TURNING_RAD) & (np.diff(t_s[picks]) < 2.0 * STEP_S)
    if turning.sum() < LEAST_STEPS:
        return None
    return abs(float(np.median(by_heading[turning] / by_rate[turning])))
