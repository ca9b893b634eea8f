"""The approach from far off: random starts in a strong wind, each to be brought to the station and kept there."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from asvhil.config import Config, load_config
from asvhil.geo import LocalFrame, wrap_rad
from asvhil.simplant.lockstep import Lockstep
from asvhil.study.rows import refuse_own
from asvhil.study.runner import Job, Progress, Result, run_jobs
from asvhil.study.statistics import other_code
from asvhil.study.trial import run_key
from asvhil.types import record

START_M = 60.0
WIND_MPS = 6.0
DURATION_S = 180.0
SETTLED_S = 60.0  # the last of the run: the boat is to be at the station
LOST_M = 5.0
CHATTER_S = 10.0  # no more than one change of stage in any span of this length
KEEPING = ("keep_heading", "keep_position")
TRACK_S = 1.0  # from one point of a track to the next


@record
class Start:
    """Where the boat is set down about the station, and the wind; radians, clockwise from north."""

    seed: int
    bearing_rad: float  # from the station to the boat
    psi_rad: float
    toward_rad: float  # of the wind


@record
class Outcome:
    """One run against the truth. Times are seconds since the motors were taken; None where it never came to it."""

    start: Start
    handover_s: float | None
    reached_s: float | None  # first within r_h of the station
    end_m: float
    settled_m: float  # mean distance over the last SETTLED_S
    settled_max_m: float
    settled_heading_deg: float  # mean absolute heading error over the same
    changes: tuple[tuple[float, str], ...]  # (time, stage entered), the first stage among them
    track_m: tuple[tuple[float, float], ...]  # north and east of the station, TRACK_S apart

    @property
    def lost(self) -> bool:
        """Never near the station, or on the mean not there over the last seconds."""
        return self.reached_s is None or self.settled_m > LOST_M

    @property
    def chatters(self) -> int:
        """Changes of stage that came too soon after the one before, or after the start."""
        return sum(b - a < CHATTER_S - 1e-6 for (a, _), (b, _) in pairwise(self.changes))


def draw_starts(runs: int, seed: int) -> list[Start]:
    """Random bearings, headings and wind directions; the same for the same seed."""
    rng = np.random.default_rng(seed)
    angles = rng.uniform(-math.pi, math.pi, (runs, 3)).tolist()
    return [
        Start(seed=seed * 1000 + i, bearing_rad=bearing, psi_rad=psi, toward_rad=toward)
        for i, (bearing, psi, toward) in enumerate(angles)
    ]


def start_overrides(start: Start) -> tuple[str, ...]:
    """The config keys that set a start."""
    return (
        f"plant.seed={start.seed}",
        f"plant.start_n_m={START_M * math.cos(start.bearing_rad)!r}",
        f"plant.start_e_m={START_M * math.sin(start.bearing_rad)!r}",
        f"plant.start_heading_deg={math.degrees(start.psi_rad)!r}",
        f"plant.weather.wind.speed_mps={WIND_MPS}",
        f"plant.weather.wind.toward_deg={math.degrees(start.toward_rad)!r}",
        "controller.procedure.enabled=true",
    )


def run_start(start: Start, overrides: tuple[str, ...] = (), duration_s: float = DURATION_S) -> Outcome:
    """One run of the simulated boat in lockstep, sensors and gusts on. ConfigError where an override is wrong."""
    config = load_config("sitl", (*start_overrides(start), *overrides))
    station_n_m, station_e_m, station_rad = _station(config)
    loop = Lockstep(config)
    begin_ns: int | None = None
    stage, changes = "", []
    handover_s = reached_s = None
    tail: list[tuple[float, float]] = []
    track: list[tuple[float, float]] = []
    distance_m = math.inf
    ticks = round(duration_s * config.daemon.tick_hz)
    for tick in range(ticks):
        _, outputs = loop.tick()
        truth = loop.plant.truth
        offset_m = (truth.n_m - station_n_m, truth.e_m - station_e_m)
        distance_m = math.hypot(*offset_m)
        if tick % round(TRACK_S * config.daemon.tick_hz) == 0:
            track.append((round(offset_m[0], 2), round(offset_m[1], 2)))
        if outputs.control is not None:
            begin_ns = outputs.t_ns if begin_ns is None else begin_ns
            t_s = (outputs.t_ns - begin_ns) * 1e-9
            if outputs.control.stage != stage:
                stage = outputs.control.stage
                changes.append((t_s, stage))
                if handover_s is None and stage in KEEPING:
                    handover_s = t_s
            if reached_s is None and distance_m < config.controller.procedure.r_h_m:
                reached_s = t_s
        if tick >= ticks - SETTLED_S * config.daemon.tick_hz:
            tail.append((distance_m, abs(wrap_rad(truth.psi_rad - station_rad))))
    settled = np.array(tail)
    return Outcome(
        start=start,
        handover_s=handover_s,
        reached_s=reached_s,
        end_m=distance_m,
        settled_m=float(settled[:, 0].mean()),
        settled_max_m=float(settled[:, 0].max()),
        settled_heading_deg=math.degrees(float(settled[:, 1].mean())),
        changes=tuple(changes),
        track_m=tuple(track),
    )


def study_approach(
    store: Path,
    runs: int = 100,
    seed: int = 1,
    *,
    overrides: tuple[str, ...] = (),
    duration_s: float = DURATION_S,
    workers: int | None = None,
    tell: Callable[[Progress], None] = lambda progress: None,
) -> tuple[dict[str, Any], list[Outcome]]:
    """Figures of `runs` random starts as a JSON-ready tree, and the runs themselves.

    Runs that the store holds are not run again (`runner.run_jobs`). ConfigError for an override of what a start sets.
    """
    starts = draw_starts(runs, seed)
    load_config("sitl", overrides)  # so that what is wrong in them is named first
    refuse_own(overrides, start_overrides(starts[0]))
    jobs = [_job(start, overrides, duration_s) for start in starts]
    finished = run_jobs(run_named_start, jobs, store, workers=workers, tell=tell)
    outcomes = [_outcome(result) for result in finished.results]
    figures = {
        "seed": seed,
        "duration_s": duration_s,
        "overrides": list(overrides),
        **summarise_approach(outcomes),
        "runs_of_other_code": finished.outdated,
    }
    return figures, outcomes


def run_named_start(start: dict[str, Any], overrides: tuple[str, ...], duration_s: float) -> Result:
    """`run_start` for another process: JSON-ready in and out."""
    return dataclasses.asdict(run_start(Start(**start), overrides, duration_s))


def summarise_approach(outcomes: list[Outcome]) -> dict[str, Any]:
    """Counts and times over outcomes, and those that were lost or chattered, one by one."""
    return {
        "runs": len(outcomes),
        "start_m": START_M,
        "wind_mps": WIND_MPS,
        "lost": sum(outcome.lost for outcome in outcomes),
        "started_over": sum(any(stage == "recover" for _, stage in outcome.changes) for outcome in outcomes),
        "changes_too_soon": sum(outcome.chatters for outcome in outcomes),
        "changes_per_10_s_max": max((_densest(outcome) for outcome in outcomes), default=0),
        "changes_per_run_max": max((len(outcome.changes) - 1 for outcome in outcomes), default=0),
        "handover_s": _spread([outcome.handover_s for outcome in outcomes if outcome.handover_s is not None]),
        "reached_s": _spread([outcome.reached_s for outcome in outcomes if outcome.reached_s is not None]),
        "end_m": _spread([outcome.end_m for outcome in outcomes]),
        "settled_m": _spread([outcome.settled_m for outcome in outcomes]),
        "settled_max_m": _spread([outcome.settled_max_m for outcome in outcomes]),
        "settled_heading_deg": _spread([outcome.settled_heading_deg for outcome in outcomes]),
        "bad": [_row(outcome) for outcome in outcomes if outcome.lost or outcome.chatters],
    }


def markdown(figures: dict[str, Any]) -> str:
    """What was asked, and what came of it."""

    def spread(key: str, digits: int = 1) -> str:
        row = figures[key]
        return "-" if row is None else " / ".join(f"{row[part]:.{digits}f}" for part in ("min", "median", "max"))

    lines = [
        f"{figures['runs']} random starts {figures['start_m']:g} m off, any bearing, heading and wind direction, "
        f"{figures['wind_mps']:g} m/s with gusts and sensor noise, {figures['duration_s']:g} s each.",
        "",
        "| | asked | reached |",
        "| --- | --- | --- |",
        f"| lost | none | {figures['lost']} |",
        f"| most changes of stage in {CHATTER_S:g} s | at most 1 | {figures['changes_per_10_s_max']} |",
        f"| changes too soon after another | none | {figures['changes_too_soon']} |",
        f"| most changes of stage in a run | | {figures['changes_per_run_max']} |",
        f"| runs that started over | | {figures['started_over']} |",
        f"| hand-over to the keeper (s), min / median / max | | {spread('handover_s')} |",
        f"| within r_h of the station (s) | | {spread('reached_s')} |",
        f"| mean distance over the last {SETTLED_S:g} s (m) | | {spread('settled_m', 2)} |",
        f"| largest distance over the last {SETTLED_S:g} s (m) | | {spread('settled_max_m', 2)} |",
        f"| mean magnitude of the heading error over the same (°) | | {spread('settled_heading_deg', 2)} |",
    ]
    for line in other_code(figures["runs_of_other_code"]):
        lines += ["", line]
    for row in figures["bad"]:
        lines += ["", f"Lost or too soon: {json.dumps(row)}"]
    return "\n".join(lines) + "\n"


def _job(start: Start, overrides: tuple[str, ...], duration_s: float) -> Job:
    config = load_config("sitl", (*start_overrides(start), *overrides))
    key = f"approach {run_key(config)} {duration_s:g}"
    return Job(key=key, group="approach", arguments=(dataclasses.asdict(start), overrides, duration_s))


def _outcome(result: Result) -> Outcome:
    """A run as JSON has kept it."""
    return Outcome(
        **{
            **result,
            "start": Start(**result["start"]),
            "changes": tuple((t_s, stage) for t_s, stage in result["changes"]),
            "track_m": tuple((n_m, e_m) for n_m, e_m in result["track_m"]),
        }
    )


def _station(config: Config) -> tuple[float, float, float]:
    station, plant = config.supervisor.station, config.plant
    assert station is not None  # engage: auto has one
    frame = LocalFrame(lat_deg=plant.origin_lat_deg, lon_deg=plant.origin_lon_deg)
    return *frame.to_ned(station.lat_deg, station.lon_deg), math.radians(station.heading_deg)


def _densest(outcome: Outcome) -> int:
    """The most changes in any half-open span of CHATTER_S; the first stage is no change."""
    times = [t_s for t_s, _ in outcome.changes[1:]]
    return max((sum(0.0 <= b - a < CHATTER_S - 1e-6 for b in times) for a in times), default=0)


def _spread(values: Iterable[float]) -> dict[str, float] | None:
    array = np.array(list(values))
    if not array.size:
        return None
    return {"min": float(array.min()), "median": float(np.median(array)), "max": float(array.max())}


def _row(outcome: Outcome) -> dict[str, Any]:
    start = outcome.start
    return {
        "seed": start.seed,
        "bearing_deg": math.degrees(start.bearing_rad),
        "heading_deg": math.degrees(start.psi_rad),
        "wind_toward_deg": math.degrees(start.toward_rad),
        "end_m": outcome.end_m,
        "changes": [[t_s, stage] for t_s, stage in outcome.changes],
    }
