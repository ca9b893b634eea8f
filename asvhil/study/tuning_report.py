"""Searches of controllers as text, and their figure."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asvhil.logs.figure import save_figure
from asvhil.study.statistics import in_digits, plus_minus

SETS = {"training": "the winds of the search", "held_out": "winds and seeds that the search did not see"}


def markdown(study: Mapping[str, Any]) -> str:
    """A table over all controllers, and the values that were found for each."""
    searches = study["controllers"]
    settings = next(iter(searches.values()))["settings"]
    from_s, to_s = settings["window_s"]
    lines = [
        f"CMA-ES with seed {settings['seed']}; a candidate is scored over [{from_s:g}, {to_s:g}] s by the geometric "
        f"mean of 1 + ps, less 1 (typical ps), over {_cases(settings['training'])}. Held out: "
        f"{_cases(settings['held_out'])}. Means of ps with half of their 95 % interval. The search has no bounds: the "
        "first range sets the step of its first generation.",
        "",
        "| controller | candidates | winds | typical ps, config | tuned | mean ps, config | tuned |",
        "|" + " --- |" * 7,
    ]
    for name, search in searches.items():
        count = sum(map(len, search["generations"]))
        for key, words in SETS.items():
            old, new = search["config"][key], search["tuned"][key]
            lines.append(
                f"| {name} | {count} | {words} | {in_digits(old['typical_ps'])} | {in_digits(new['typical_ps'])} "
                f"| {plus_minus(old)} | {plus_minus(new)} |"
            )
    for name, search in searches.items():
        lines += ["", f"### {name}", "", "| key | start | tuned | first range | in it |", "|" + " --- |" * 5]
        start, best = search["generations"][0][0]["values"], search["best"]["values"]
        for key, (low, high) in search["settings"]["first_ranges"].items():
            inside = "yes" if low <= best[key] <= high else "no"
            lines.append(f"| {key} | {start[key]:g} | {best[key]:g} | {low:g} to {high:g} | {inside} |")
    return "\n".join(lines) + "\n"


def _cases(cases: Mapping[str, Any]) -> str:
    winds = ", ".join(f"{speed:g} m/s toward {toward:g}°" for speed, toward in cases["winds_mps_toward_deg"])
    seeds = ", ".join(map(str, cases["seeds"]))
    return f"{winds}, each with plant.seed {seeds}"


def draw(study: Mapping[str, Any], path: Path) -> None:
    """The candidates and the best so far of each search; the typical ps before and after, on both sets of winds."""
    figure = Figure(figsize=(11.0, 4.4), layout="constrained")
    course, bars = figure.subplots(1, 2)
    searches = study["controllers"]
    for number, (name, search) in enumerate(searches.items()):
        scores = [
            np.nan if one["typical_ps"] is None else one["typical_ps"]
            for generation in search["generations"]
            for one in generation
        ]
        at = np.arange(1, len(scores) + 1)
        course.plot(at, scores, ".", color=f"C{number}", alpha=0.4)
        course.plot(at, np.fmin.accumulate(np.array(scores, dtype=float)), color=f"C{number}", label=name)
    course.set_xlabel("candidate")
    course.set_ylabel("typical ps, winds of the search")
    course.set_yscale("log")
    course.legend(fontsize="small")
    at = np.arange(len(searches))
    for number, (key, which) in enumerate((key, which) for key in SETS for which in ("config", "tuned")):
        heights = [search[which][key]["typical_ps"] or 0.0 for search in searches.values()]
        words = f"{key.replace('_', ' ')}, {which}"
        bars.bar(at + 0.2 * (number - 1.5), heights, 0.18, label=words)
    bars.set_xticks(at, list(searches))
    bars.set_ylabel("typical ps")
    bars.legend(fontsize="small")
    for axes in (course, bars):
        axes.grid(alpha=0.3)
    save_figure(figure, path)
