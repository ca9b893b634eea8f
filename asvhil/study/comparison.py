"""Comparison of two setups in the same rows and seeds: ratios and differences of their penalty scores."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from asvhil.config import VesselConfig, load_config
from asvhil.config.mean_wind import station_heading_deg
from asvhil.study.rows import ROWS, refuse_own, row_overrides, title, trial_job
from asvhil.study.runner import Finished, Run
from asvhil.study.statistics import mean_ci95
from asvhil.study.trials.trial import NO_SLOW_ERROR, run_named_trial

Scores = dict[tuple[str, str], dict[int, float]]  # (setup, row): {seed: ps}
Held = dict[tuple[str, str], float]  # (setup, row): least share of the window with the motors, over the seeds


def run_setups(
    run: Run,
    setups: Mapping[str, tuple[str, ...]],
    rows: Iterable[str],
    seeds: Iterable[int],
    window_s: tuple[float, float],
    *,
    base: str = "sitl",
) -> tuple[Scores, Held, Finished]:
    """ps against the truth by setup, row and seed, how long they had the motors, and the computing time.

    `setups` are config keys by name. ConfigError where a setup has a key that makes another run of a row: its wind or
    its seed.
    """
    rows, seeds = list(rows), list(seeds)
    headings_deg = {}
    for name, keys in setups.items():
        headings_deg[name] = station_heading_deg(load_config(base, keys))
        refuse_own(keys, (text for text in row_overrides(next(iter(ROWS)), 1) if text not in NO_SLOW_ERROR))
    names = [(setup, row, seed) for seed in seeds for row in rows for setup in setups]
    jobs = [
        trial_job(name, base, (*row_overrides(row, seed, heading_deg=headings_deg[name]), *setups[name]), window_s)
        for name, row, seed in names
    ]
    finished = run(run_named_trial, jobs)
    scores: Scores = {}
    held: Held = {}
    for (name, row, seed), result in zip(names, finished.results, strict=True):
        scores.setdefault((name, row), {})[seed] = result["truth"]["penalty_score"]
        held[name, row] = min(held.get((name, row), 1.0), result["held"])
    return scores, held, finished


def not_held(held: Held) -> list[dict[str, Any]]:
    """Setups without the motors for a part of the window, JSON-ready, for `held_words`."""
    return [{"row": row, "controller": name, "held": share} for (name, row), share in held.items() if share < 1.0]


def held_words(cells: Sequence[Mapping[str, Any]], verdict: str) -> list[str]:
    """Text for these setups, a line each, with the verdicts that they are excluded from; empty if there are none."""
    if not cells:
        return []
    lines = [f"- {title(cell['row'])}, {cell['controller']}: {cell['held']:.3f} at least" for cell in cells]
    head = f"Without the motors for a part of the window, so {verdict}; the least share with them:"
    return ["\n".join([head, "", *lines])]


def compare(tried: Mapping[int, float], against: Mapping[int, float]) -> dict[str, Any]:
    """Mean scores, the ratio of the means, and the difference of runs with the same seed with its interval."""
    seeds = sorted(tried)
    ps, against_ps = (mean_ci95([part[seed] for seed in seeds]) for part in (tried, against))
    return {
        "ps": ps,
        "against_ps": against_ps,
        "ratio": ps["mean"] / against_ps["mean"],
        "difference": mean_ci95([tried[seed] - against[seed] for seed in seeds]),
        "ps_by_seed": {str(seed): tried[seed] for seed in seeds},
        "against_by_seed": {str(seed): against[seed] for seed in seeds},
    }


def vessel_override(vessel: VesselConfig, key: str = "controller.vessel") -> str:
    """The override that sets a vessel: the one that sd-mpc assumes, or by `plant.vessel` the true one."""
    return f"{key}={json.dumps(vessel.model_dump(mode='json'))}"
