"""One of the paper's field tests in lockstep: from beyond R_D to the station by the procedure, and kept there."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from asvhil.backseat.build import build_decoder
from asvhil.config import load_config
from asvhil.dynamics.arrays import Array
from asvhil.errors import AsvhilError
from asvhil.logs.metrics import MotionTrack, docking_figures, motor_figures, score, wind_figures
from asvhil.logs.run import RunLog, RunReader
from asvhil.logs.summary import tracks
from asvhil.simplant.lockstep import Lockstep
from asvhil.study.trials.approach import KEEPING
from asvhil.types import Phase

TRACE_S = 1.0  # between two points of a trajectory


def run_field_test(base: str, overrides: tuple[str, ...], duration_s: float, traces: bool) -> dict[str, Any]:
    """Figures of a run from the hand-over to the keeper on, by each way of knowing the motion; and its trajectory.

    `wind` is the one that blew, as the boat met it, over the same time. All but `handover_s` is None of a boat that
    was never handed over. AsvhilError for a config whose boat is never held.
    """
    config = load_config(base, overrides)
    loop = Lockstep(config)
    reader = RunReader(config, build_decoder(config))
    wind: list[tuple[float, ...]] = []
    for tick in range(round(duration_s * config.daemon.tick_hz)):
        reader.tick(*loop.tick())
        truth = loop.plant.truth
        speed_mps = math.hypot(truth.wind_n_mps, truth.wind_e_mps)
        wind.append((tick / config.daemon.tick_hz, speed_mps, math.atan2(truth.wind_e_mps, truth.wind_n_mps)))
    run = reader.run({"run": {"mode": "lockstep"}})
    if run.station is None or run.truth is None:
        raise AsvhilError(f"{base}: the boat was never held within {duration_s:g} s")
    handover_s = next((span.from_s for span in run.stages if span.stage in KEEPING), None)
    if handover_s is None:
        return {"handover_s": None}
    kept = {name: _from(track, handover_s) for name, track in tracks(run).items() if track is not None}
    command = run.command[run.command[:, 0] >= handover_s]
    found: dict[str, Any] = {
        "handover_s": handover_s,
        "recovered": sum(span.stage == "recover" for span in run.stages),
        "held": all(span.ended is None for span in run.spans if span.phase is Phase.HOLD),
        "ways": {name: {**score(track.errors, handover_s), "docking": _docking(track)} for name, track in kept.items()},
        **motor_figures(command[command[:, 3] > 0]),
        "wind": wind_figures(np.array([row for row in wind if row[0] >= handover_s])),
    }
    return found | ({"trace": _trace(run)} if traces else {})


def _from(track: MotionTrack, from_s: float) -> MotionTrack:
    return track.where((track.t_s >= from_s) & (track.hold > 0))


def _docking(track: MotionTrack) -> dict[str, Any]:
    """The longest docking window, and the errors inside all of them together; None of no window."""
    figures = docking_figures(track)
    windows = figures["windows"]
    length_s = np.array([window["length_s"] for window in windows])

    def inside(part: str, name: str) -> float | None:
        return float(np.average([window[part][name] for window in windows], weights=length_s)) if windows else None

    return {
        "windows": len(windows),
        "longest_s": figures["longest_s"],
        "share": figures["share"],
        "distance_m": inside("distance_m", "mean"),
        "heading_abs_deg": inside("heading_deg", "abs_mean"),
    }


def _trace(run: RunLog) -> dict[str, Any]:
    """The true way relative to the station, a point each TRACE_S, and the docking windows by the truth."""
    station, track = run.station, run.truth
    assert station is not None and track is not None
    t_s = np.arange(0.0, track.t_s[-1], TRACE_S)
    at = np.searchsorted(track.t_s, t_s)
    north, east = track.pose[at, 0] - station.n_m, track.pose[at, 1] - station.e_m
    windows = docking_figures(track)["windows"]
    return {
        "step_s": TRACE_S,
        "north_m": _rounded(north),
        "east_m": _rounded(east),
        "heading_deg": _rounded(np.degrees(track.pose[at, 2])),
        "windows_s": [[round(window["from_s"], 1), round(window["to_s"], 1)] for window in windows],
    }


def _rounded(values: Array) -> list[float]:
    return [round(value, 2) for value in values.tolist()]
