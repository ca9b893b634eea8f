"""The figures of two runs side by side, and what has to be known before they are compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from asvhil.logs.summary import WAYS

NOTHING = "-"

Table = list[list[str]]
Figures = Mapping[str, Any]

RUNS: tuple[tuple[str, str], ...] = (("vehicle", "vehicle"), ("controller", "controller"))
COMPARED: tuple[tuple[str, int, tuple[str, ...]], ...] = (
    ("duration (s)", 1, ("duration_s",)),
    ("scored from (s)", 1, ("settled_from_s",)),
    *(
        row
        for way in WAYS
        for row in (
            (f"distance, {way}, mean (m)", 3, (way, "distance_m", "mean")),
            (f"heading error, {way}, magnitude (deg)", 2, (way, "heading_deg", "abs_mean")),
            (f"penalty score, {way}", 2, (way, "penalty_score")),
            (f"VRX's score, {way}", 3, (way, "vrx_score")),
            (f"longest docking window, {way} (s)", 0, ("docking", way, "longest_s")),
        )
    ),
    ("energy", 4, ("energy",)),
    ("energy from the battery (Wh)", 2, ("energy_wh",)),
    ("reversals per minute", 2, ("reversals_per_min",)),
    ("change of command per second", 3, ("change_per_s",)),
    ("wind, mean (m/s)", 2, ("wind", "estimated", "speed_mps", "mean")),
    ("step, 99 % (ms)", 1, ("step_ms", "p99")),
)


def run_notes(figures: Figures) -> list[str]:
    """What is wrong with the log of a run, a line each."""
    cut = [] if figures["damage"] is None else [f"{figures['damage']}; what is before that is reported"]
    return [*figures["warnings"], *cut]


def unscored(figures: Figures) -> list[str]:
    """Why a run has no scores, in a line; none of one that has."""
    if any(figures[way] is not None and figures[way]["penalty_score"] is not None for way in WAYS):
        return []
    if not figures["holds"]:
        return [f"no station was held in these {figures['duration_s']:.1f} s: no scores"]
    from_s = figures["settled_from_s"]
    held = any(hold["to_s"] >= from_s for hold in figures["holds"])
    what = "the boat's position is not known in a hold" if held else "no station was held"
    return [f"{what} from {from_s:.0f} s on: no scores"]


def comparison_notes(first: tuple[str, Figures], second: tuple[str, Figures]) -> list[str]:
    """What is wrong with each of two logs, which has no scores, and how far their figures are of one kind."""
    notes = []
    for name, figures in (first, second):
        lines = [*run_notes(figures), *unscored(figures)]
        notes += [line if name in line else f"{name}: {line}" for line in lines]
    (_, a), (_, b) = first, second
    if a["vehicle"] != b["vehicle"]:
        notes.append(f"the boats differ, {a['vehicle']} and {b['vehicle']}: so do the figures, whatever steers them")
    from_s = [figure_text(figures["settled_from_s"], 1) for figures in (a, b)]
    if from_s[0] != from_s[1]:
        notes.append(f"the windows differ: scored from {from_s[0]} s and from {from_s[1]} s on")
    return notes


def comparison_rows(first: tuple[str, Figures], second: tuple[str, Figures]) -> Table:
    """The names and figures of two runs side by side, and their difference."""
    (name_a, a), (name_b, b) = first, second
    rows: Table = [["", name_a, name_b, "difference"]]
    rows += [[label, a[key], b[key], NOTHING if a[key] == b[key] else "another"] for label, key in RUNS]
    for label, digits, path in COMPARED:
        x, y = _at(a, path), _at(b, path)
        if x is not None or y is not None:
            apart = NOTHING if x is None or y is None else f"{y - x:+.{digits}f}"
            rows.append([label, figure_text(x, digits), figure_text(y, digits), apart])
    return rows


def _at(figures: Any, path: Sequence[str]) -> float | None:
    for key in path:
        if figures is None:
            return None
        figures = figures[key]
    return None if figures is None else float(figures)


def figure_text(value: float | None, digits: int) -> str:
    """A figure for people, a dash where there is none."""
    return NOTHING if value is None else f"{value:.{digits}f}"
