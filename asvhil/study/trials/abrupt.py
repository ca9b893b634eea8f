"""Abrupt sensor faults during station keeping: error of the estimate, flags, and whether the station is kept."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asvhil.config import load_config
from asvhil.geo import wrap_rad
from asvhil.simplant.lockstep import Lockstep
from asvhil.study.trials.estimation import estimate_rows, record_run, rms, share_invalid, truth_rows
from asvhil.types import Outputs

BEFORE_S = 5.0  # the error before the fault that movements are counted from
AFTER_S = 40.0
CALM_S = 10.0  # a recovered estimate stays within the limits for this long
MOVE_M, MOVE_DEG = 0.5, 3.0


def run_abrupt(
    base: str, overrides: tuple[str, ...], start_s: float, duration_s: float, after_s: float = AFTER_S
) -> dict[str, Any]:
    """The effect of one fault, which is in the config, on the estimate during station keeping.

    Movement is that of the error (estimate less truth) against its mean over the 5 s before. `recovery_s` counts from
    the end of the fault until the movement is within 0.5 m and 3 degrees for 10 s; None where it is not by the end,
    `after_s` after that of the fault.
    Flags are those that operators get: the notes that are not ok, and quantities that have lost their source or
    taken another one; each with the time since the start of the fault at which it came up.
    """
    config = load_config(base, overrides)
    hz = config.daemon.tick_hz
    run = record_run(config, "station", start_s + duration_s + after_s)
    rows, truth = estimate_rows(run.outputs, run.origin), truth_rows(run.truth)
    e = rows - truth
    e[:, 4] = np.degrees((e[:, 4] + math.pi) % math.tau - math.pi)
    start, end, before = round(start_s * hz), round((start_s + duration_s) * hz), round((start_s - BEFORE_S) * hz)
    e -= e[before:start].mean(axis=0)
    place_m, heading_deg = np.hypot(e[:, 0], e[:, 1]), np.abs(e[:, 4])
    wind_mps = np.hypot(e[:, 6], e[:, 7])
    good = (place_m <= MOVE_M) & (heading_deg <= MOVE_DEG)
    return {
        "moved_m": float(place_m[start:end].max()),
        "moved_deg": float(heading_deg[start:end].max()),
        "moved_after_m": float(place_m[end:].max()),
        "moved_after_deg": float(heading_deg[end:].max()),
        "wind_moved_mps": float(wind_mps[start:end].max()),
        "recovery_s": recovery_s(good[end:], hz),
        "flags": _flags(run.outputs, start, end, hz),
        "false_flags": sorted({flag for made in run.outputs[before:start] for flag in bad_notes(made)}),
        "invalid": share_invalid(run.outputs[start:end]),
        "held": all(made.phase == "hold" for made in run.outputs[start:]),
    }


def bad_notes(made: Outputs) -> set[str]:
    """The subjects of the notes that are not ok."""
    return {note.subject for note in made.health.notes if not note.ok}


def _flags(outputs: Sequence[Outputs], start: int, end: int, hz: float) -> dict[str, float]:
    """Each flag that was not up at the start and came up while the fault lasted, and after how long (s)."""
    notes, sources = bad_notes(outputs[start - 1]), dict(outputs[start - 1].health.sources)
    found: dict[str, float] = {}
    for number, made in enumerate(outputs[start:end]):
        changed = {f"source of {quantity}" for quantity, name in made.health.sources if name != sources.get(quantity)}
        for flag in (bad_notes(made) - notes) | changed:
            found.setdefault(flag, number / hz)
    return found


def recovery_s(good: NDArray[np.bool_], hz: float) -> float | None:
    calm = round(CALM_S * hz)
    for number in range(len(good) - calm + 1):
        if good[number : number + calm].all():
            return number / hz
    return None


def run_survival(base: str, overrides: tuple[str, ...], window_s: tuple[float, float], lost_m: float) -> dict[str, Any]:
    """A station kept while sensors fail: the largest distance of the truth in the window, and whether it was lost.

    A boat is lost if it was farther off than `lost_m`, or if its motors were released or in a fail-safe at the end.
    """
    config = load_config(base, overrides)
    at = config.supervisor.station
    loop = Lockstep(config)
    n_m, e_m = loop.plant.origin.to_ned(at.lat_deg, at.lon_deg) if at is not None else (0.0, 0.0)
    heading_rad = math.radians(at.heading_deg) if at is not None else 0.0
    first = round(window_s[0] * config.daemon.tick_hz)
    distances, headings, phases = [], [], []
    for _ in range(round(window_s[1] * config.daemon.tick_hz)):
        _, outputs = loop.tick()
        truth = loop.plant.truth
        distances.append(math.hypot(truth.n_m - n_m, truth.e_m - e_m))
        headings.append(math.degrees(wrap_rad(truth.psi_rad - heading_rad)))
        phases.append(str(outputs.phase))
    distance, heading = np.array(distances[first:]), np.array(headings[first:])
    held = phases[first:].count("hold") / len(phases[first:])
    lost = bool(distance.max() > lost_m) or "standby" in phases[first:] or phases[-1] != "hold"
    return {
        "max_distance_m": float(distance.max()),
        "mean_distance_m": float(distance.mean()),
        "heading_rms_deg": rms(heading),
        "held": held,
        "lost": lost,
    }
