"""The approach from far off: random starts in a strong wind, each to be brought to the station and kept there."""

from __future__ import annotations

import math
import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise
from typing import Any

import numpy as np

from asvhil.config import Config, load_config
from asvhil.geo import LocalFrame, wrap_rad
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import record

START_M = 60.0
WIND_MPS = 6.0
DURATION_S = 180.0
SETTLED_S = 60.0  # the last of the run: the boat is to be at the station
LOST_M = 5.0
CHATTER_S = 10.0  # no more than one change of stage in any span of this length
KEEPING = ("keep_heading", "keep_position")


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
    distance_m = math.inf
    ticks = round(duration_s * config.daemon.tick_hz)
    for tick in range(ticks):
        _, outputs = loop.tick()
        truth = loop.plant.truth
        distance_m = math.hypot(truth.n_m - station_n_m, truth.e_m - station_e_m)
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
    )


def study_approach(
    runs: int = 100,
    seed: int = 1,
    progress: Callable[[int, int], None] | None = None,
    *,
    overrides: tuple[str, ...] = (),
    duration_s: float = DURATION_S,
    workers: int = 2,
) -> dict[str, Any]:
    """Figures of `runs` random starts as a JSON-ready tree; `progress(done, runs)` after each."""
    outcomes = []
    for outcome in _each(draw_starts(runs, seed), overrides, duration_s, workers):
        outcomes.append(outcome)
        if progress is not None:
            progress(len(outcomes), runs)
    return {"seed": seed, "duration_s": duration_s, "overrides": list(overrides), **summarise_approach(outcomes)}


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


def _each(starts: list[Start], overrides: tuple[str, ...], duration_s: float, workers: int) -> Iterator[Outcome]:
    """Outcomes in the order of the starts."""
    if workers == 1:
        yield from (run_start(start, overrides, duration_s) for start in starts)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        yield from pool.map(run_start, starts, [overrides] * len(starts), [duration_s] * len(starts))


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
