"""Tables like the paper's two of its field tests, and figures like its trajectories, of `study field-tests`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Wedge

from asvhil.logs.figure import save_figure
from asvhil.study.statistics import count_of_seeds, in_digits, other_code, plus_minus
from asvhil.supervisor.docking import DOCKING_RADIUS_M, DOCKING_SECTOR_DEG

TITLES = {"bream": "BREAM", "wamv": "WAM-V"}
RADII_M = {"bream": (15.0, 20.0), "wamv": (10.0, 20.0)}
ASKED_WORDS = {
    "distance_m": "mean distance at most {:g} m",
    "longest_s": "longest docking window at least {:g} s",
    "docking_distance_m": "distance inside at most {:g} m",
    "docking_heading_deg": "heading error inside at most {:g}°",
}
DOCKING_COLOUR, WAY_COLOUR = "tab:green", "tab:blue"


def markdown(study: Mapping[str, Any]) -> str:
    """Three tables for each boat: errors and wind beside the paper's, docking windows, and what was asked for."""
    parts = [
        f"{count_of_seeds(study['seeds'])}, {study['duration_s']:g} s each; from the hand-over to the keeper on. Means "
        "over the runs with half of their 95 % interval; standard deviations are means of those of the runs. "
        "*Measured* is by the boat's own receiver and compass, *true* by the simulated boat; wind is the one that "
        "blew, its direction that which it blows toward."
    ]
    for boat, title in TITLES.items():
        tests = {name: test for name, test in study["tests"].items() if test["boat"] == boat}
        if tests:
            parts += [f"### {title}", _errors(tests), _docking(tests), _verdicts(tests)]
    lost = [f"{name}: {words}" for name, test in study["tests"].items() if (words := _trouble(test))]
    parts += ["; ".join(lost) + "."] if lost else []
    return "\n\n".join([*parts, *other_code(study["runs_of_other_code"])]) + "\n"


def _errors(tests: Mapping[str, Mapping[str, Any]]) -> str:
    lines = [
        "| test | wind sensor | target (°) | distance, measured (m) | std | true (m) | paper (m) "
        "| heading error, measured (°) | std | paper (°) | wind (m/s) | std | paper | toward (°) | std | paper |",
        "|" + " --- |" * 16,
    ]
    for name, test in tests.items():
        paper, ways, wind = test["paper"], test["ways"], test["wind"]
        measured, truth = ways["measured"], ways["truth"]
        cells = [
            name,
            "yes" if test["sensor"] else "no",
            f"{test['heading_deg']:g}",
            *([plus_minus(measured["distance_m"]["mean"]), _mean(measured["distance_m"]["std"])] if measured else "--"),
            plus_minus(truth["distance_m"]["mean"]) if truth else "-",
            _pair(paper["distance_m"]),
            *([plus_minus(measured["error_deg"]["mean"]), _mean(measured["error_deg"]["std"])] if measured else "--"),
            _pair(paper["error_deg"]),
            plus_minus(wind["speed_mps"]["mean"]),
            _mean(wind["speed_mps"]["std"]),
            _pair(paper["wind_speed_mps"]),
            plus_minus(wind["toward_deg"]["mean"], 0),
            _mean(wind["toward_deg"]["std"], 0),
            _pair(paper["wind_toward_deg"]),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _docking(tests: Mapping[str, Mapping[str, Any]]) -> str:
    lines = [
        "| docking windows | longest, measured (s) | shortest of the runs' | true (s) | of the time | distance inside, "
        "measured (m) | true (m) | heading error inside, measured (°) | true (°) | reversals per min |",
        "|" + " --- |" * 10,
    ]
    for name, test in tests.items():
        measured, truth = test["ways"]["measured"], test["ways"]["truth"]
        if measured is None:
            continue
        cells = [
            name,
            plus_minus(measured["longest_s"], 0),
            in_digits(measured["longest_s"]["worst"], 0),
            plus_minus(truth["longest_s"], 0),
            _mean(measured["docking_share"]),
            plus_minus(measured["docking_distance_m"]),
            plus_minus(truth["docking_distance_m"]),
            plus_minus(measured["docking_heading_deg"]),
            plus_minus(truth["docking_heading_deg"]),
            _mean(test["reversals_per_min"], 1),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _verdicts(tests: Mapping[str, Mapping[str, Any]]) -> str:
    first = next(iter(tests.values()))["verdicts"]
    asked = [ASKED_WORDS[name].format(verdict["asked"]) for name, verdict in first.items()]
    lines = [f"| asked | {' | '.join(asked)} |", "|" + " --- |" * (len(asked) + 1)]
    for name, test in tests.items():
        words = [
            f"{in_digits(part['reached'])}, {'reached' if part['met'] else '**not reached**'}"
            for part in test["verdicts"].values()
        ]
        lines.append(f"| {name} | {' | '.join(words)} |")
    return "\n".join(lines)


def _trouble(test: Mapping[str, Any]) -> str:
    words = {"never_there": "never handed over to the keeper", "let_go": "let go", "recovered": "started over"}
    return ", ".join(f"{test[key]} {text}" for key, text in words.items() if test[key])


def _mean(figure: Mapping[str, Any], digits: int = 2) -> str:
    return in_digits(figure["mean"], digits)


def _pair(values: tuple[float, float]) -> str:
    return f"{values[0]:g} ± {values[1]:g}"


def draw_field_tests(study: Mapping[str, Any], traces: Mapping[str, Any], path: Path) -> None:
    """The true way of the first run of each test, and its distance over time, with the docking windows shaded."""
    tests = {name: test for name, test in study["tests"].items() if traces.get(name) is not None}
    columns = max(1, min(5, len(tests)))
    bands = max(1, math.ceil(len(tests) / columns))
    figure = Figure(figsize=(3.4 * columns, 5.6 * bands), layout="constrained")
    grid = figure.add_gridspec(2 * bands, columns, height_ratios=(2.0, 1.0) * bands)
    for number, (name, test) in enumerate(tests.items()):
        band, column = divmod(number, columns)
        plane = figure.add_subplot(grid[2 * band, column])
        over_time = figure.add_subplot(grid[2 * band + 1, column])
        _draw_way(plane, test, traces[name])
        _draw_distance(over_time, traces[name])
        wind = test["paper"]["wind_speed_mps"][0]
        plane.set_title(f"{name}: heading {test['heading_deg']:g}°, {wind:g} m/s", fontsize="medium")
    save_figure(figure, path)


def _draw_way(axes: Axes, test: Mapping[str, Any], trace: Mapping[str, Any]) -> None:
    north, east = np.array(trace["north_m"]), np.array(trace["east_m"])
    t_s = trace["step_s"] * np.arange(len(north))
    # A compass angle counts clockwise from north, that of a wedge against it from east.
    towards = 90.0 - test["heading_deg"]
    half = 0.5 * DOCKING_SECTOR_DEG
    axes.add_patch(
        Wedge((0.0, 0.0), DOCKING_RADIUS_M, towards - half, towards + half, color=DOCKING_COLOUR, alpha=0.12)
    )
    for radius_m, style in zip(RADII_M[test["boat"]], (":", "--"), strict=True):
        axes.add_patch(Circle((0.0, 0.0), radius_m, fill=False, linestyle=style, color="grey", linewidth=0.8))
    axes.plot(east, north, color=WAY_COLOUR, linewidth=0.8)
    axes.plot(east[0], north[0], "o", color=WAY_COLOUR, markersize=4)
    for from_s, to_s in trace["windows_s"]:
        inside = (t_s >= from_s) & (t_s <= to_s)
        axes.plot(east[inside], north[inside], color=DOCKING_COLOUR, linewidth=3.0, alpha=0.5)
    toward_rad = math.radians(test["paper"]["wind_toward_deg"][0])
    dx, dy = 0.07 * math.sin(toward_rad), 0.07 * math.cos(toward_rad)
    axes.annotate(
        "",
        xy=(0.12 + dx, 0.88 + dy),
        xytext=(0.12 - dx, 0.88 - dy),
        xycoords="axes fraction",
        arrowprops={"arrowstyle": "-|>", "color": "tab:purple"},
    )
    axes.set_xlim(-34.0, 34.0)
    axes.set_ylim(-34.0, 34.0)
    axes.set_aspect("equal")
    axes.set_xlabel("east (m)")
    axes.set_ylabel("north (m)")
    axes.grid(alpha=0.3)


def _draw_distance(axes: Axes, trace: Mapping[str, Any]) -> None:
    distance = np.hypot(trace["north_m"], trace["east_m"])
    axes.plot(trace["step_s"] * np.arange(len(distance)), distance, color=WAY_COLOUR, linewidth=0.9)
    spans = [(from_s, to_s - from_s) for from_s, to_s in trace["windows_s"]]
    if spans:
        axes.broken_barh(spans, (0.0, 1.0), transform=axes.get_xaxis_transform(), color=DOCKING_COLOUR, alpha=0.2)
    axes.set_ylim(0.0, 15.0)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("distance (m)")
    axes.grid(alpha=0.3)
