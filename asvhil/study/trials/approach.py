"""One approach from far off in a strong wind, and station keeping after it."""

from __future__ import annotations

import dataclasses
import math
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
TRACK_S = 1.0  # from one point of a track to the next


@record
class Start:
    """Initial position relative to the station, heading, and wind; radians, clockwise from north."""

    seed: int
    bearing_rad: float  # from the station to the boat
    psi_rad: float
    toward_rad: float  # of the wind


@record
class Outcome:
    """One run against the truth. Times are seconds since the motors were taken; None if it did not happen."""

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
        """Whether the boat was never near the station, or not near it on average in the last seconds."""
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


def run_named_start(start: dict[str, Any], overrides: tuple[str, ...], duration_s: float) -> dict[str, Any]:
    """`run_start` for other processes, with JSON types in and out."""
    return dataclasses.asdict(run_start(Start(**start), overrides, duration_s))


def _station(config: Config) -> tuple[float, float, float]:
    station, plant = config.supervisor.station, config.plant
    assert station is not None  # engage: auto has one
    frame = LocalFrame(lat_deg=plant.origin_lat_deg, lon_deg=plant.origin_lon_deg)
    return *frame.to_ned(station.lat_deg, station.lon_deg), math.radians(station.heading_deg)
