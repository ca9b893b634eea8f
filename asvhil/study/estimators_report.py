"""The comparison of estimators as Markdown tables, with limits and figures reached, and as a figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from asvhil.logs.figure import save_figure
from asvhil.study.estimators import ASKED, LOST_M, RAW_RATIO, RECOVERY_S
from asvhil.study.statistics import count_of_seeds
from asvhil.study.trials.abrupt import MOVE_DEG, MOVE_M
from asvhil.study.trials.estimation import KINDS, TRUTH_COLUMNS

NAMES = {"ekf": "EKF", "fir": "FIR fusion", "raw": "raw"}
COLUMNS = {  # metric: (head of its column, digits)
    "position_m": ("position (m)", 2),
    "position_spread_m": ("about its mean (m)", 2),
    "velocity_mps": ("velocity (m/s)", 3),
    "u_mps": ("u (m/s)", 3),
    "v_mps": ("v (m/s)", 3),
    "heading_deg": ("heading (°)", 2),
    "yaw_rate_radps": ("yaw rate (rad/s)", 4),
    "wind_speed_mps": ("wind speed (m/s)", 2),
    "wind_direction_deg": ("wind direction (°)", 1),
}
COLOURS = {"truth": "black", "ekf": "tab:blue", "fir": "tab:orange", "raw": "0.65"}
SHOWN = "gusty"
SHOWN_S = 40.0


def report(study: Mapping[str, Any]) -> str:
    """All tables."""
    parts = [
        _about_errors(study),
        *(_error_table(name, activities) for name, activities in study["errors"].items()),
        "### Asked and reached",
        "Of the EKF; the last columns tell how many times larger the error of the others is "
        f"(asked: FIR fusion above 1, raw at least {RAW_RATIO:g}).",
        *(_verdict_table(name, lines) for name, lines in study["verdicts"].items()),
        "### Abrupt faults",
        _about_faults(study),
        *(_abrupt_table(name, faults) for name, faults in study["abrupt"].items()),
    ]
    if study["survival"]["runs"]:
        parts += ["### A station kept through glitches", _survival_words(study["survival"])]
    parts.append(_cost(study))
    return "\n\n".join(parts) + "\n"


def _about_errors(study: Mapping[str, Any]) -> str:
    from_s, to_s = study["window_s"]
    return (
        f"Root mean square errors against the truth over [{from_s:g}, {to_s:g}] s, mean of "
        f"{count_of_seeds(study['seeds'])}. One run in lockstep is recorded, and the very same inputs go to each "
        "estimator. Position and velocity are lengths of error vectors where no axis is named; wind is held against "
        "the wind of that instant, gusts included. The slow error of the receiver is in `position`; `about its mean` "
        "is without its constant part."
    )


def _about_faults(study: Mapping[str, Any]) -> str:
    return (
        "One fault while the boat keeps station in 6 m/s of wind (six-test 2, gusts on, slow GNSS error off): the "
        "largest movement of the estimate's error against its mean over the 5 s before, while the fault lasts and "
        "after it; the delay of the first flag that names the sensor; and how long after the end the estimate is back "
        f"to stay. Worst of {count_of_seeds(study['abrupt_seeds'])}. Asked: at most {MOVE_M:g} m and {MOVE_DEG:g}° "
        f"while it lasts, a flag that names the sensor, recovery within {RECOVERY_S:g} s. The row `none` is the same "
        "measurement without a fault."
    )


def _error_table(name: str, activities: Mapping[str, Any]) -> str:
    heads = [head for head, _ in COLUMNS.values()]
    lines = [
        f"### {name}",
        "",
        f"| run | estimator | {' | '.join(heads)} | not valid |",
        "| --- " * (len(heads) + 3) + "|",
    ]
    for activity, conditions in activities.items():
        for condition, cell in conditions.items():
            for kind in KINDS:
                found = cell["errors"][kind]
                texts = [_mean(found[metric], digits) for metric, (_, digits) in COLUMNS.items()]
                label = f"{activity}, {condition}" if kind == KINDS[0] else ""
                name_ = f"**{NAMES[kind]}**" if kind == KINDS[0] else NAMES[kind]
                lines.append(f"| {label} | {name_} | {' | '.join(texts)} | {100.0 * cell['invalid'][kind]:.0f} % |")
    return "\n".join(lines)


def _verdict_table(name: str, verdicts: Sequence[Mapping[str, Any]]) -> str:
    lines = [
        f"| {name} | figure | asked at most | reached | FIR fusion | raw | met |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for line in verdicts:
        head, digits = COLUMNS[line["metric"]]
        reached = "none" if line["ekf"] is None else f"{line['ekf']:.{digits}f}"
        limit, times = "yes" if line["met"] else "**no**", "yes" if line["better"] else "**no**"
        lines.append(
            f"| {line['activity']}, {line['condition']} | {head} | {line['asked']:g} | {reached} "
            f"| {_times(line['ratio_fir'])} | {_times(line['ratio_raw'])} | {limit}; better: {times} |"
        )
    return "\n".join(lines)


def _abrupt_table(name: str, faults: Mapping[str, Any]) -> str:
    lines = [
        f"| {name} | moves (m) | moves (°) | after it (m) | after it (°) | wind moves (m/s) | flag after (s) | flags "
        "| recovery (s) | not valid | held | met |",
        "| --- " * 12 + "|",
    ]
    for label, cell in faults.items():
        recovery = "not within 30" if cell["recovery_s"] is None else f"{cell['recovery_s']:.1f}"
        delay = "" if cell["flag_delay_s"] is None else f"{cell['flag_delay_s']:.1f}"
        missed = [
            word for word, key in (("moves", "still"), ("flag", "named"), ("recovery", "recovered")) if not cell[key]
        ]
        met = "yes" if not missed else f"**no: {', '.join(missed)}**"
        lines.append(
            f"| {label} | {cell['moved_m']:.2f} | {cell['moved_deg']:.1f} | {cell['moved_after_m']:.2f} "
            f"| {cell['moved_after_deg']:.1f} | {cell['wind_moved_mps']:.1f} | {delay} | {', '.join(cell['flags'])} "
            f"| {recovery} | {100.0 * cell['invalid']:.0f} % | {'yes' if cell['held'] else 'no'} | {met} |"
        )
    return "\n".join(lines)


def _survival_words(survival: Mapping[str, Any]) -> str:
    runs = survival["runs"]
    from_s, to_s = survival["window_s"]
    distances = [run["mean_distance_m"] for run in runs.values()]
    headings = [run["heading_rms_deg"] for run in runs.values()]
    lost = f"seeds {', '.join(survival['lost'])}" if survival["lost"] else "none"
    return (
        f"BREAM, six-test {survival['row']}, all kinds of sensor fault one after the other at random times, "
        f"{count_of_seeds(list(runs))}, window [{from_s:g}, {to_s:g}] s. Lost (farther than {LOST_M:g} m, or the "
        f"motors given back): {lost}. Largest distance of all {survival['max_distance_m']:.1f} m, mean distance "
        f"{np.mean(distances):.2f} m, heading error {np.mean(headings):.1f}° RMS."
    )


def _mean(figure: Mapping[str, Any] | None, digits: int) -> str:
    return "none" if figure is None else f"{figure['mean']:.{digits}f}"


def _times(ratio: float | None) -> str:
    return "none" if ratio is None else f"{ratio:.2f}"


def _cost(study: Mapping[str, Any]) -> str:
    cost = study["cost"]
    text = f"{cost['minutes']:.1f} minutes on {cost['processes']} processes."
    if cost["runs_of_other_code"]:
        text += f" {cost['runs_of_other_code']} runs were made by another version of the code."
    return text


def draw_estimators(study: Mapping[str, Any], path: Path) -> None:
    """Draw a column for each set of sensors: curves of surge, heading error and wind; bars of velocity and heading."""
    sets = list(study["errors"])
    figure = Figure(figsize=(8.0 * len(sets), 13.0), layout="constrained")
    panels = figure.subplots(5, len(sets), squeeze=False)
    for column, name in enumerate(sets):
        condition = SHOWN if SHOWN in study["traces"][name] else next(iter(study["traces"][name]))
        _draw_curves(list(panels[:3, column]), study["traces"][name][condition])
        panels[0, column].set_title(f"{name}: {condition}, keeping station")
        _draw_bars(panels[3, column], study["errors"][name], "velocity_mps", ASKED[name].get("velocity_mps"))
        _draw_bars(panels[4, column], study["errors"][name], "heading_deg", ASKED[name].get("heading_deg"))
    save_figure(figure, path, dpi=100)


def _draw_curves(panels: Sequence[Axes], traces: Mapping[str, Any]) -> None:
    t_s = np.array(traces["t_s"])
    shown = t_s <= t_s[0] + SHOWN_S
    rows = {name: np.array(traces[name], dtype=float)[shown] for name in ("truth", *KINDS)}
    at = {name: number for number, name in enumerate(TRUTH_COLUMNS)}
    for name in ("raw", "fir", "ekf", "truth"):
        look: dict[str, Any] = {"color": COLOURS[name], "linewidth": 1.4 if name in ("truth", "ekf") else 0.9}
        look["label"] = NAMES.get(name, name)
        panels[0].plot(t_s[shown], rows[name][:, at["u_mps"]], **look)
        wind = np.hypot(rows[name][:, at["wn_mps"]], rows[name][:, at["we_mps"]])
        panels[2].plot(t_s[shown], wind, **look)
        if name != "truth":
            off = rows[name][:, at["psi_rad"]] - rows["truth"][:, at["psi_rad"]]
            panels[1].plot(t_s[shown], np.degrees((off + np.pi) % (2.0 * np.pi) - np.pi), **look)
    for axes, label in zip(panels, ("surge u (m/s)", "heading error (deg)", "wind speed (m/s)"), strict=True):
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
    panels[0].legend(fontsize="small", ncols=4)
    panels[2].set_xlabel("time (s)")


def _draw_bars(axes: Axes, activities: Mapping[str, Any], metric: str, asked: float | None) -> None:
    cells = [(f"{a},\n{c}", cell["errors"]) for a, conditions in activities.items() for c, cell in conditions.items()]
    width = 0.8 / len(KINDS)
    for number, kind in enumerate(KINDS):
        figures = [
            (place, cell[kind][metric]) for place, (_, cell) in enumerate(cells) if cell[kind][metric] is not None
        ]
        at = np.array([place for place, _ in figures]) - 0.4 + (number + 0.5) * width
        halves = [figure["ci95"] or 0.0 for _, figure in figures]
        means = [figure["mean"] for _, figure in figures]
        axes.bar(at, means, width, color=COLOURS[kind], label=NAMES[kind])
        axes.errorbar(at, means, halves, fmt="none", ecolor="black", capsize=2, linewidth=0.8)
    if asked is not None:
        axes.axhline(asked, color="tab:red", linestyle="--", linewidth=1.0, label="asked of the EKF")
    axes.set_xticks(range(len(cells)), [label for label, _ in cells], fontsize=7)
    axes.set_ylabel(f"RMSE {COLUMNS[metric][0]}")
    axes.set_ylim(bottom=0.0)
    axes.grid(axis="y", alpha=0.3)
    axes.legend(fontsize="x-small")
