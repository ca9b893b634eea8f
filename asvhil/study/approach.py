"""Study of the approach from far off: random starts in a strong wind."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from asvhil.config import load_config
from asvhil.study.rows import refuse_own
from asvhil.study.runner import Job, Result, Run
from asvhil.study.statistics import other_code
from asvhil.study.trials.approach import (
    CHATTER_S,
    DURATION_S,
    SETTLED_S,
    START_M,
    WIND_MPS,
    Outcome,
    Start,
    draw_starts,
    run_named_start,
    start_overrides,
)
from asvhil.study.trials.trial import run_key


def study_approach(
    run: Run,
    runs: int = 100,
    seed: int = 1,
    *,
    overrides: tuple[str, ...] = (),
    duration_s: float = DURATION_S,
) -> tuple[dict[str, Any], list[Outcome]]:
    """Figures of `runs` random starts as a JSON-ready tree, and the runs themselves.

    ConfigError for an override of what a start sets.
    """
    starts = draw_starts(runs, seed)
    load_config("sitl", overrides)  # so that an error in them is reported first
    refuse_own(overrides, start_overrides(starts[0]))
    jobs = [_job(start, overrides, duration_s) for start in starts]
    finished = run(run_named_start, jobs)
    outcomes = [_outcome(result) for result in finished.results]
    figures = {
        "seed": seed,
        "duration_s": duration_s,
        "overrides": list(overrides),
        **summarise_approach(outcomes),
        "runs_of_other_code": finished.outdated,
    }
    return figures, outcomes


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
    """The figures as Markdown tables, with their limits."""

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
    """An outcome from its JSON form."""
    return Outcome(
        **{
            **result,
            "start": Start(**result["start"]),
            "changes": tuple((t_s, stage) for t_s, stage in result["changes"]),
            "track_m": tuple((n_m, e_m) for n_m, e_m in result["track_m"]),
        }
    )


def _densest(outcome: Outcome) -> int:
    """The most changes in any half-open span of CHATTER_S; the first stage does not count."""
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
