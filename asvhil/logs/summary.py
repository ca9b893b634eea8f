"""The figures of a run: of the whole, and of each hold, fail-safe and release apart."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import numpy as np

from asvhil.dynamics.corrected import FACTORS
from asvhil.estimator.learned_words import learned_text
from asvhil.logs.clock import jump_words, stall_words
from asvhil.logs.holds import PhaseSpan
from asvhil.logs.metrics import (
    MotionTrack,
    docking_figures,
    energy_figures,
    motor_figures,
    score,
    settled_from_s,
    wind_figures,
)
from asvhil.logs.reader import begin_words
from asvhil.logs.run import RunLog
from asvhil.types import Phase

WAYS = ("truth", "estimated", "measured")  # of knowing where the boat was


def summarise(run: RunLog, wall_s: float | None = None) -> dict[str, Any]:
    """The figures of a run as a JSON-ready tree; parts that the run has no data for are None.

    Errors are those while a station is held, each to the station of its tick. The scores of the whole are of all holds
    from `settled_from_s` on, those of a hold from its own `settled_from_s` on; docking windows and motors are of all of
    the holds.
    """
    from_s = settled_from_s(run.duration_s)
    simulated = is_simulated(run)
    weather = run.config.plant.weather.wind
    steps = run.step_ms[:, 1]
    return {
        "vehicle": run.config.vehicle.name,
        "controller": run.config.controller.name,
        "mode": mode_of(run),
        "damage": run.damage,
        "time_jumps": [{"tick": jump.tick, "at_s": jump.at_s, "by_s": jump.by_s} for jump in run.jumps],
        "stalls": [{"tick": stall.tick, "at_s": stall.at_s, "for_s": stall.for_s} for stall in run.stalls],
        "damaged_records": list(run.damaged_records),
        "warnings": [
            *run.damaged_records,
            *begin_words(run.first_tick),
            *jump_words(run.jumps),
            *stall_words(run.stalls),
        ],
        "simulated": simulated,
        "started": started(run),
        "seed": run.config.plant.seed if simulated else None,
        "config_hash": run.config.content_hash(),
        "duration_s": run.duration_s,
        "settled_from_s": from_s,
        **_of_holds(run, None, from_s),
        "wind": {
            "configured": {"speed_mps": weather.speed_mps, "toward_deg": weather.toward_deg} if simulated else None,
            "estimated": wind_figures(run.wind[run.wind[:, 0] >= from_s]),
            "origin": run.wind_origin,
        },
        "holds": [_hold(run, number, span) for number, span in enumerate(holds(run), 1)],
        "failsafes": [_event(span) for span in run.spans if span.phase is Phase.FAILSAFE],
        "releases": [
            {"at_s": span.from_s, "reason": span.reason, "code": span.code, "after": before.phase.value}
            for before, span in zip(run.spans, run.spans[1:], strict=False)
            if span.phase is Phase.STANDBY
        ],
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
        "learned": None
        if run.learned is None
        else {
            "factors": dict(zip(FACTORS, run.learned.factors, strict=True)),
            "learned_s": run.learned.learned_s,
            "text": learned_text(run.learned),
        },
    }


def holds(run: RunLog) -> list[PhaseSpan]:
    """The spans in which the controller had the motors."""
    return [span for span in run.spans if span.phase is Phase.HOLD]


def tracks(run: RunLog) -> dict[str, MotionTrack | None]:
    """The motion by each of `WAYS`."""
    return {"truth": run.truth, "estimated": run.estimated, "measured": run.measured}


def mode_of(run: RunLog) -> str:
    """`live` for a daemon's run in real time, or `lockstep`."""
    return run.metadata.get("run", {}).get("mode", "")


def is_simulated(run: RunLog) -> bool:
    """Whether the boat was a simulated one: in lockstep, or where a simulator told the truth."""
    return mode_of(run) == "lockstep" or run.truth is not None


def started(run: RunLog) -> str | None:
    """Date and time of the first tick, UTC; None in virtual time."""
    if mode_of(run) == "lockstep":
        return None
    return datetime.fromtimestamp(run.start_ns * 1e-9, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def _of_holds(run: RunLog, number: int | None, from_s: float) -> dict[str, Any]:
    """Scores from a time on, docking windows, motors and energy of one hold, of all where `number` is None."""
    held = {name: None if track is None else track.of_hold(number) for name, track in tracks(run).items()}
    scored = {name: None if track is None or not len(track.t_s) else track for name, track in held.items()}
    command = run.command[run.command[:, 3] > 0] if number is None else run.command[run.command[:, 3] == number]
    energy = run.energy if number is None else run.energy[run.energy[:, 3] == number]
    return {
        **{name: None if track is None else score(track.errors, from_s) for name, track in scored.items()},
        "docking": {name: None if track is None else docking_figures(track) for name, track in scored.items()},
        **motor_figures(command),
        **energy_figures(energy),
    }


def _hold(run: RunLog, number: int, span: PhaseSpan) -> dict[str, Any]:
    from_s = span.from_s + settled_from_s(span.to_s - span.from_s)
    wind = run.wind[(run.wind[:, 3] == number) & (run.wind[:, 0] >= from_s)]
    track = run.estimated.of_hold(number)
    # On its course a station is none of its own at each place; NaN, where there is none, is not equal to itself.
    stations = track.station[~track.moves & ~np.isnan(track.station).any(axis=1)]
    return {
        "number": number,
        **_event(span),
        "settled_from_s": from_s,
        "stations": max(len(np.unique(stations, axis=0)), 1),
        "stages": [
            {"stage": stage.stage, "from_s": stage.from_s, "to_s": stage.to_s}
            for stage in run.stages
            if stage.hold == number
        ],
        **_of_holds(run, number, from_s),
        "wind": wind_figures(wind),
    }


def _event(span: PhaseSpan) -> dict[str, Any]:
    return {
        "from_s": span.from_s,
        "to_s": span.to_s,
        "reason": span.reason,
        "code": span.code,
        "ended": span.ended,
    }
