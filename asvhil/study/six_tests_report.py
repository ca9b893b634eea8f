"""The six tests as Markdown tables with verdicts, and as a figure like the paper's."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from asvhil.logs.figure import save_figure
from asvhil.study.comparison import held_words
from asvhil.study.rows import along_the_wind, title
from asvhil.study.six_tests import MAIN, OURS, REFERENCE, labelled
from asvhil.study.statistics import count_of_seeds, in_digits, other_code, plus_minus
from asvhil.study.trials.trial import ARRIVED_M, FIRST_STEPS

CUT = 2.2  # end of the axis, in times the highest bar of an MPC: a controller that fails must not set the scale


def report(study: Mapping[str, Any]) -> str:
    """All tables and the verdict of each row."""
    from_s, to_s = study["window_s"]
    rows = list(study["rows"])
    error = "with its slow error, as shipped" if study["slow_error"] else "without a slow error"
    weather = f"gusts and sensor noise, the receiver {error}" if study["noise"] else "no gusts and no sensor noise"
    bounded = [row for row in rows if study["bounds"].get(row)]
    parts = [
        f"Window [{from_s:g}, {to_s:g}] s, {count_of_seeds(study['seeds'])}, {weather}; errors against the truth.",
        "Penalty score ps = e_d + s_d + |e_h| + s_h (m, degrees): mean ± half of the 95 % interval, lowest in bold; "
        "in brackets mean distance, magnitude of the mean heading error, and s_h, the spread of the heading.",
        _table(study, _score, rows),
        *held_words(_not_held(study), "no winner of its row"),
        *_words(study),
    ]
    if study["noise"]:
        words = "The same by the boat's own estimate, as a real boat is scored, receiver and all:"
        parts += [words, _table(study, lambda cell, best: plus_minus(cell["measured"]["penalty_score"]), rows)]
    parts += [
        "VRX's score, the mean of d + 0.75^d |dψ| (m, rad), against the truth:",
        _table(study, lambda cell, best: plus_minus(cell["truth"]["vrx_score"], 3), rows),
    ]
    owned = [row for row in rows if any(cell["own_regret"]["mean"] is not None for cell in study["rows"][row].values())]
    if owned:
        words = (
            "Regret by each run's own wind: ps over the bound of the mean wind that the run had, held steady; mean of "
            "the runs."
        )
        parts += [words, _table(study, lambda cell, best: plus_minus(cell["own_regret"], 3), owned)]
    if bounded:
        words = (
            "Regret: ps over the bound of the mean wind, held steady (`asvhil study bound`). In gusts ps can be below "
            "that bound. Along the wind the bound is zero."
        )
        parts += [words, _table(study, lambda cell, best: in_digits(cell["regret"], 3), bounded)]
    parts += [
        "Maximum distance to the station within the window, over all seeds (m).",
        _table(study, lambda cell, best: in_digits(cell["truth"]["max_distance_m"]), rows),
        f"The way in: seconds until the boat is first within {ARRIVED_M:g} m of the station.",
        _table(study, lambda cell, best: plus_minus(cell["arrived_s"], 1), rows),
        "Energy: mean squared thrust of a motor (1000 N²).",
        _table(study, _energy, rows),
        "Reversals a minute of the motor that has more of them, and mean magnitude of the change of a command per "
        "second (of full thrust):",
        _table(study, _work, rows),
        f"Time of a tick that computes a command (ms), mean of the first {FIRST_STEPS}, as the paper gives it; of the "
        "whole backseat, on this machine.",
        _table(study, lambda cell, best: plus_minus(cell["first_steps_ms"], 1), rows),
        *study.get("left_out", []),
        _cost(study),
    ]
    return "\n\n".join(parts) + "\n"


def verdict_line(row: str, verdict: Mapping[str, Any]) -> str:
    """The verdict of a row as text: the best controller, and its margin."""
    winner, behind = verdict["winner"], verdict["behind"]
    barred = f"; barred: {', '.join(verdict['barred'])}" if verdict["barred"] else ""
    if winner is None:
        return f"{title(row)}: no controller to compare{barred}."
    baseline = verdict["kind"] == "baseline" and winner in labelled()  # one of several solvers is none
    text = f"{title(row)}: {'**a baseline wins**: ' if baseline else ''}"
    text += f"{winner} has the lowest mean ps, {plus_minus(verdict['penalty_score'])}"
    told = []
    if MAIN in behind:
        told.append(f"{MAIN} is {plus_minus(behind[MAIN])} higher")
    rest = [label for label in behind if label != MAIN]
    baselines = [label for label in rest if label not in OURS]
    for label in dict.fromkeys([*rest[:1], *baselines[:1]]):
        told.append(f"{label} is {plus_minus(behind[label])} higher")
    return f"{'; '.join([text, *told])}{barred}."


def draw_bars(study: Mapping[str, Any], path: Path) -> None:
    """Bars of ps grouped by test with their 95 % intervals; the bound as a line across each group.

    Rows along the wind have a scale of their own. Bars beyond the axis are cut and labelled with their value.
    """
    rows = list(study["rows"])
    groups = [
        part for part in ([r for r in rows if along_the_wind(r)], [r for r in rows if not along_the_wind(r)]) if part
    ]
    figure = Figure(figsize=(16.0, 6.0), layout="constrained")
    panels = figure.subplots(1, len(groups), width_ratios=[len(part) for part in groups], squeeze=False)[0]
    for axes, part in zip(panels, groups, strict=True):
        _draw_group(axes, study, part)
    panels[0].set_ylabel("penalty score (m, degrees), 95 % interval")
    handles, labels = panels[-1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=5, fontsize="small")
    save_figure(figure, path)


def _draw_group(axes: Axes, study: Mapping[str, Any], rows: Sequence[str]) -> None:
    labels = _labels(study)
    lines = [study["rows"][row] for row in rows]
    scores: list[list[Any]] = [
        [line[label]["truth"]["penalty_score"] if label in line else None for label in labels] for line in lines
    ]
    ours = [part["mean"] for line in scores for label, part in zip(labels, line, strict=True) if part and label in OURS]
    top = CUT * max(ours or [part["mean"] for line in scores for part in line if part])
    width = 0.84 / len(labels)
    for number, label in enumerate(labels):
        look: dict[str, Any] = {"color": f"C{number}", "label": label}
        if label == REFERENCE:
            look = {"facecolor": "none", "edgecolor": "black", "hatch": "///", "label": f"{label}, reference"}
        column = [(place, line[number]) for place, line in enumerate(scores) if line[number] is not None]
        at = np.array([place for place, _ in column]) - 0.42 + (number + 0.5) * width
        means = np.array([part["mean"] for _, part in column])
        halves = np.array([part["ci95"] or 0.0 for _, part in column])
        axes.bar(at, np.minimum(means, top), width, **look)
        whole = means <= top
        axes.errorbar(at[whole], means[whole], halves[whole], fmt="none", ecolor="black", capsize=2, linewidth=0.8)
        for x, mean in zip(at[~whole], means[~whole], strict=True):
            axes.text(x, 0.985 * top, f"{mean:.0f}", rotation=90, ha="center", va="top", fontsize=7)
    limits = [(place, study["bounds"][row]) for place, row in enumerate(rows) if study["bounds"].get(row)]
    for number, (place, limit) in enumerate(limits):
        name = "physical bound" if number == 0 else ""
        axes.hlines(limit, place - 0.45, place + 0.45, color="black", linestyle="--", linewidth=1.0, label=name)
    axes.set_ylim(0.0, top)
    axes.set_xticks(range(len(rows)), [title(row).replace(" (", "\n(") for row in rows], fontsize=8)
    axes.grid(axis="y", alpha=0.3)


def _labels(study: Mapping[str, Any]) -> list[str]:
    """Controllers in the order of the study, the reference last."""
    names = list(dict.fromkeys(name for line in study["rows"].values() for name in line))
    return [name for name in names if name != REFERENCE] + [name for name in names if name == REFERENCE]


def _table(study: Mapping[str, Any], text_of: Callable[[Mapping[str, Any], bool], str], rows: Sequence[str]) -> str:
    """A table of tests by controllers."""
    labels = _labels(study)
    heads = [f"*{label}, reference*" if label == REFERENCE else label for label in labels]
    lines = ["| test | " + " | ".join(heads) + " |", "| --- |" + " --- |" * len(heads)]
    for row in rows:
        line, best = study["rows"][row], study["verdicts"][row]["winner"]
        texts = [text_of(line[label], label == best) if label in line else "" for label in labels]
        lines.append(f"| {title(row)} | " + " | ".join(texts) + " |")
    return "\n".join(lines)


def _score(cell: Mapping[str, Any], best: bool) -> str:
    truth = cell["truth"]
    text = plus_minus(truth["penalty_score"])
    text = f"**{text}**" if best else text
    parts = [f"{in_digits(truth['e_d_m']['mean'])} m"]
    parts += [f"{in_digits(truth[name]['mean'])}°" for name in ("abs_e_h_deg", "s_h_deg")]
    return f"{text} ({', '.join(parts)})"


def _energy(cell: Mapping[str, Any], best: bool) -> str:
    energy = cell["energy_n2"]
    thousands = {"mean": energy["mean"] * 1e-3, "ci95": None if energy["ci95"] is None else energy["ci95"] * 1e-3}
    return plus_minus(thousands)


def _work(cell: Mapping[str, Any], best: bool) -> str:
    motors = cell["motors"]
    return f"{in_digits(motors['reversals_per_min_most']['mean'], 1)}, {in_digits(motors['change_per_s']['mean'])}"


def _not_held(study: Mapping[str, Any]) -> list[dict[str, Any]]:
    return [
        {"row": row, "controller": label, "held": cell["held"]}
        for row, line in study["rows"].items()
        for label, cell in line.items()
        if cell["held"] < 1.0
    ]


def _words(study: Mapping[str, Any]) -> list[str]:
    verdicts = study["verdicts"]
    won = [row for row, verdict in verdicts.items() if verdict["winner"] == MAIN]
    lost = [row for row, verdict in verdicts.items() if verdict["kind"] == "baseline"]
    text = ""
    if MAIN in _labels(study):
        text = f"{MAIN} has the lowest mean ps in {len(won)} of {len(verdicts)} rows. "
        text += f"Baselines have it in {len(lost)}: {', '.join(lost)}. " if lost else "No baseline has it in any. "
    text += "Differences are those of runs with the same seed, with half of their 95 % interval:"
    return [text, "\n".join(f"- {verdict_line(row, verdict)}" for row, verdict in verdicts.items())]


def _cost(study: Mapping[str, Any]) -> str:
    cost = study["cost"]
    spent = ", ".join(f"{label} {seconds / 60.0:.1f}" for label, seconds in cost["process_s"].items())
    text = f"Minutes of one process: {spent}; on {cost['processes']} processes {cost['minutes']:.1f} in all."
    return " ".join([text, *other_code(cost["runs_of_other_code"])])
