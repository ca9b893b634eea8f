"""One run as arrays, from its log: estimates, commands, and the simulated true state where it was logged."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from asvhil.config import Config
from asvhil.config.ports import AUTOPILOT
from asvhil.dynamics.arrays import Array
from asvhil.errors import LogError
from asvhil.geo import LocalFrame, wrap_rad
from asvhil.io.mavlink.frames import Parser, decode, dialect, message_id
from asvhil.io.sensors.dropped import dropped_of
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.metrics import PoseErrors, score, settled_from_s
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import config_of
from asvhil.types import Outputs, Phase, Station, record

MOVING_PHASES = (Phase.HOLD,)


@record
class PoseTrack:
    """Poses over time: rows of (t_s since the first tick, n_m, e_m, psi_rad)."""

    rows: Array

    def errors(self, station: Station, from_s: float) -> PoseErrors:
        """Errors to a station of all rows from a time on."""
        rows = self.rows[self.rows[:, 0] >= from_s]
        distance = np.hypot(rows[:, 1] - station.n_m, rows[:, 2] - station.e_m)
        heading = np.degrees([wrap_rad(psi - station.psi_rad) for psi in rows[:, 3]])
        return PoseErrors(t_s=rows[:, 0], distance_m=distance, heading_deg=np.asarray(heading, dtype=float))


@record
class RunLog:
    """The data of a run for its summary and its picture. Times are seconds since the first tick."""

    config: Config
    metadata: dict[str, dict[str, str]]
    duration_s: float
    ticks: int
    measured: PoseTrack
    truth: PoseTrack | None
    station: Station | None  # the last one held
    held_from_s: float | None
    wind: Array  # rows of (t_s, speed m/s, direction the wind blows toward, rad)
    wind_origin: str | None  # of the last of them: "sensor", or "disturbance" where none has measured it
    pwm: Array  # rows of (t_s, port us, starboard us), NaN where released
    command: Array  # rows of (t_s, port, starboard) in [-1, 1], one per solution
    plans: list[tuple[float, Array]]  # (t_s, rows of t, n, e, psi)
    phases_s: dict[str, float]
    step_ms: Array
    overruns: int
    counters: dict[str, int]
    sources: dict[str, str]  # the one in use for each quantity at the end, empty where none was heard
    source_shares: dict[str, dict[str, float]]  # of the time since one was first heard; empty name: none was
    dropped: dict[str, dict[str, int]]  # by sensor link and cause
    notes: dict[str, str]


def read_run(path: Path, plan_every_s: float = 10.0) -> RunLog:
    """Read a log into arrays. LogError where the file is no asvhil log or holds no tick."""
    log = LogFile(path)
    config = config_of(log, path, known_only=True)
    tick_s = 1.0 / config.daemon.tick_hz
    start_ns: int | None = None
    last: Outputs | None = None
    measured: list[tuple[float, ...]] = []
    wind: list[tuple[float, ...]] = []
    wind_origin: str | None = None
    pwm: list[tuple[float, ...]] = []
    command: list[tuple[float, ...]] = []
    plans: list[tuple[float, Array]] = []
    phases: Counter[str] = Counter()
    used: dict[str, Counter[str]] = {}
    truth_frames: list[tuple[int, Any]] = []
    parser = Parser()
    station: Station | None = None
    held_from_s: float | None = None
    ticks = 0
    for inputs, recorded in log.ticks():
        start_ns = inputs.t_ns if start_ns is None else start_ns
        t_s = (inputs.t_ns - start_ns) * 1e-9
        for frame in inputs.frames:
            if frame.port == AUTOPILOT:
                for data in parser.receive(frame.peer, frame.data):
                    if message_id(data) == dialect.MAVLINK_MSG_ID_SIM_STATE:
                        truth_frames.append((frame.t_ns, decode(data)))
        if recorded is None:
            continue
        ticks += 1
        last = outputs = decode_outputs(recorded, path)
        phases[outputs.phase] += 1
        for quantity, source in outputs.health.sources:
            if source or quantity in used:
                used.setdefault(quantity, Counter())[source] += 1
        estimate = outputs.estimate
        if estimate is not None:
            measured.append((t_s, estimate.n_m, estimate.e_m, estimate.psi_rad))
        if outputs.wind is not None:
            vn, ve = outputs.wind.vn_mps, outputs.wind.ve_mps
            wind.append((t_s, float(np.hypot(vn, ve)), float(np.arctan2(ve, vn))))
            wind_origin = outputs.wind.origin
        pulses = outputs.pwm_us or (np.nan, np.nan)
        pwm.append((t_s, *pulses))
        if outputs.phase in MOVING_PHASES:
            station = outputs.station
            held_from_s = t_s if held_from_s is None else held_from_s
        if outputs.control is not None:
            command.append((t_s, *outputs.control.command))
            if outputs.control.plan and (not plans or t_s - plans[-1][0] >= plan_every_s):
                plans.append((t_s, np.array(outputs.control.plan)))
    if last is None or start_ns is None:
        raise LogError(f"{path}: holds no tick with outputs")
    truth = _truth(truth_frames, start_ns, last.origin_deg)
    timing = list(log.timing())
    return RunLog(
        config=config,
        metadata=log.metadata,
        duration_s=(last.t_ns - start_ns) * 1e-9,
        ticks=ticks,
        measured=PoseTrack(rows=_rows(measured, 4)),
        truth=truth,
        station=station,
        held_from_s=held_from_s,
        wind=_rows(wind, 3),
        wind_origin=wind_origin,
        pwm=_rows(pwm, 3),
        command=_rows(command, 3),
        plans=plans,
        phases_s={phase: round(count * tick_s, 3) for phase, count in sorted(phases.items())},
        step_ms=np.array([row.step_ns * 1e-6 for row in timing]),
        overruns=sum(row.overrun for row in timing),
        counters=dict(last.health.counters),
        sources=dict(last.health.sources),
        source_shares={quantity: _shares(counts) for quantity, counts in used.items()},
        dropped=dropped_of(last.health.counters),
        notes={note.subject: note.text for note in last.health.notes},
    )


def summarise(run: RunLog, wall_s: float | None = None) -> dict[str, Any]:
    """The figures of a run as a JSON-ready tree; parts that the run has no data for are None."""
    from_s = settled_from_s(run.duration_s)
    held_s = run.held_from_s if run.held_from_s is not None else 0.0
    tracks = {"truth": run.truth, "measured": run.measured}
    scores = {
        name: score(track.errors(run.station, held_s), from_s) if track is not None and run.station else None
        for name, track in tracks.items()
    }
    wind = run.wind[run.wind[:, 0] >= from_s] if len(run.wind) else run.wind
    vector = wind[:, 1] * np.exp(1j * wind[:, 2]) if len(wind) else np.array([])
    settled_command = run.command[run.command[:, 0] >= from_s] if len(run.command) else run.command
    steps = run.step_ms
    return {
        "controller": run.config.controller.name,
        "seed": run.config.plant.seed,
        "config_hash": run.config.content_hash(),
        "duration_s": run.duration_s,
        "settled_from_s": from_s,
        **scores,
        "wind": {
            "configured_speed_mps": run.config.plant.weather.wind.speed_mps,
            "configured_toward_deg": run.config.plant.weather.wind.toward_deg,
            "estimated_speed_mps": {"mean": float(wind[:, 1].mean()), "std": float(wind[:, 1].std())}
            if len(wind)
            else None,
            "origin": run.wind_origin,
            "estimated_toward_deg": float(np.degrees(np.angle(vector.mean()))) if len(vector) else None,
        },
        # Mean squared command of both motors, as a measure of energy that needs no power curve of a motor.
        "energy": float((settled_command[:, 1:] ** 2).mean()) if len(settled_command) else None,
        "ticks": run.ticks,
        "overruns": run.overruns,
        "step_ms": {
            "p50": float(np.percentile(steps, 50)),
            "p99": float(np.percentile(steps, 99)),
            "max": float(steps.max()),
        }
        if len(steps)
        else None,
        "realtime_factor": run.duration_s / wall_s if wall_s else None,
        "phases": run.phases_s,
        "counters": run.counters,
        "sources": run.sources,
        "source_shares": run.source_shares,
        "dropped": run.dropped,
        "notes": run.notes,
    }


def _shares(counts: Counter[str]) -> dict[str, float]:
    """Of their sum, the greatest first."""
    return {name: count / counts.total() for name, count in counts.most_common()}


def _truth(frames: list[tuple[int, Any]], start_ns: int, origin_deg: tuple[float, float] | None) -> PoseTrack | None:
    if not frames or origin_deg is None:
        return None
    local = LocalFrame(lat_deg=origin_deg[0], lon_deg=origin_deg[1])
    rows: list[tuple[float, ...]] = [
        ((t_ns - start_ns) * 1e-9, *local.to_ned(m.lat_int * 1e-7, m.lon_int * 1e-7), m.yaw)
        for t_ns, m in frames
        if m is not None
    ]
    return PoseTrack(rows=_rows(rows, 4))


def _rows(rows: list[tuple[float, ...]], width: int) -> Array:
    return np.array(rows, dtype=float).reshape(-1, width)
