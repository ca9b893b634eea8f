"""The summary of a campaign as text, and its figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from asvhil.logs.figure import save_figure
from asvhil.study.campaigns.table import Row
from asvhil.study.statistics import in_digits, other_code, plus_minus

SHOWN = 3  # parameters whose scores are drawn
UNITS = {
    "ps": "penalty score",
    "vrx_score": "VRX's score",
    "distance_mean_m": "mean distance (m)",
    "distance_max_m": "largest distance (m)",
    "heading_abs_deg": "mean heading error (deg)",
    "energy_n2": "mean squared thrust (N²)",
    "reversals_per_min": "reversals per minute of the motor that reverses more",
    "saturated_share": "share of the time of the motor that is at its limit longer",
    "change_per_s": "mean change of a command per second",
}


def markdown(study: Mapping[str, Any]) -> str:
    """All figures; those that depend on the machine are under Cost, at the end."""
    spec = study["campaign"]
    from_s, to_s = spec["window_s"]
    design = spec["design"]
    kind = {"grid": "a grid", "lhs": "a Latin hypercube", "sobol": "a scrambled Sobol sequence"}[design["kind"]]
    about = (
        f"{study['runs']} runs of {spec['config']}: {kind} over {', '.join(spec['parameters'])}; scored by "
        f"{UNITS[study['score']]} against the truth over [{from_s:g}, {to_s:g}] s. Intervals are of 95 %."
    )
    let_go = study["let_go"]
    if let_go:
        about += f" In {let_go} run{'s' if let_go != 1 else ''} the controller did not have the motors all the time."
    parts = [about, _summaries(study), _sensitivity(study), _worst(study), _failures(study), _cost(study)]
    return "\n\n".join(part for part in parts if part) + "\n"


def _summaries(study: Mapping[str, Any]) -> str:
    head = ["| | runs | mean | median | 95th percentile | held throughout |", "|" + " --- |" * 6]
    lines = []
    for name, summary in {
        "all": study["all"],
        **{name: cell["summary"] for name, cell in study["variants"].items()},
    }.items():
        if summary is None:
            lines.append(f"| {name} | 0 | - | - | - | - |")
            continue
        held = summary["held"]
        low, high = (100.0 * end for end in held["ci95"])
        lines.append(
            f"| {name} | {summary['runs']} | {plus_minus(summary)} | {_percentile(summary['median'])} "
            f"| {_percentile(summary['p95'])} | {100.0 * held['share']:.1f} % ({low:.1f} to {high:.1f}) |"
        )
    first = next(iter(study["variants"]), "")
    behind = [
        f"{name}: {plus_minus(cell['behind_first'])} behind {first} at the same points and seeds."
        for name, cell in study["variants"].items()
        if cell["behind_first"] is not None
    ]
    return "\n".join(["### Scores", "", *head, *lines, *(["", *behind] if behind else [])])


def _percentile(cell: Mapping[str, Any]) -> str:
    low, high = cell["ci95"]
    return f"{cell['value']:.2f} ({in_digits(low)} to {in_digits(high)})"


def _sensitivity(study: Mapping[str, Any]) -> str:
    if not study["sensitivity"]:
        return ""
    lines = [
        "### What moves the score",
        "",
        "Share of the variance of the score's ranks that a parameter explains by itself, the chance of as much where "
        "it does nothing (Kruskal-Wallis), and the partial rank correlation, which has a sign.",
        "",
        "| parameter | share | chance | partial rank correlation |",
        "|" + " --- |" * 4,
    ]
    for name, cell in study["sensitivity"].items():
        interval = cell["prcc_ci95"]
        ends = "" if interval is None else f" ({interval[0]:.2f} to {interval[1]:.2f})"
        chance = "-" if cell["p"] is None else f"{cell['p']:.2g}"
        lines.append(f"| {name} | {cell['share']:.2f} | {chance} | {in_digits(cell['prcc'])}{ends} |")
    return "\n".join(lines)


def _worst(study: Mapping[str, Any]) -> str:
    if not study["worst"]:
        return ""
    score = study["score"]
    lines = ["### Worst runs", "", f"| run | {score} | seed | values | log |", "|" + " --- |" * 5]
    for one in study["worst"]:
        lines.append(f"| {one['run']} | {one[score]:.2f} | {one['seed']} | {_values(one)} | `{one['log']}` |")
    return "\n".join([*lines, "", "`asvhil report LOG --picture FILE` draws one, `asvhil replay LOG` replays it."])


def _failures(study: Mapping[str, Any]) -> str:
    if not study["failed"]:
        return ""
    lines = [f"- run {one['run']} (seed {one['seed']}, {_values(one)}): {one['error']}" for one in study["failures"]]
    more = study["failed"] - len(lines)
    rest = [f"- {more} more, in the table's column `error`"] if more else []
    words = f"{study['failed']} of {study['runs']} runs failed; the other figures are without them."
    return "\n".join(["### Failures", "", words, "", *lines, *rest])


def _values(one: Mapping[str, Any]) -> str:
    variant = [one["variant"]] if "variant" in one else []
    return ", ".join([*variant, *(f"{name} {_short(value)}" for name, value in one["values"].items())])


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _cost(study: Mapping[str, Any]) -> str:
    cost = study["cost"]
    overhead = "not known" if cost["overhead_s"] is None else f"{1e3 * cost['overhead_s']:.1f} ms"
    rate = "-" if cost["runs_per_core_hour"] is None else f"{cost['runs_per_core_hour']:.0f}"
    words = (
        f"{cost['run_s']:.2f} s a run on one process and {overhead} around it: {rate} runs per core-hour. A million "
        f"such runs would take {cost['million_core_hours']:.0f} core-hours."
    )
    other = other_code(cost["runs_of_other_code"])
    if cost["logs_of_other_bits"]:
        other.append(f"{cost['logs_of_other_bits']} logs of worst runs have another score than the table.")
    return "\n".join(["### Cost", "", " ".join([words, *other])])


def draw(study: Mapping[str, Any], rows: Sequence[Row], path: Path) -> None:
    """Shares and partial rank correlations of the parameters, and the score over the most decisive of them."""
    score = study["score"]
    known = [row for row in rows if row[score] is not None]
    names = [name for name in study["sensitivity"] if name != "variant"] or list(study["campaign"]["parameters"])
    shown = names[:SHOWN]
    figure = Figure(figsize=(4.4 * (1 + len(shown)), 4.4), layout="constrained")
    axes = figure.subplots(1, 1 + len(shown), squeeze=False)[0]
    _draw_bars(axes[0], study["sensitivity"])
    groups = list(study["variants"]) or [""]
    for panel, name in zip(axes[1:], shown, strict=True):
        labels = sorted({str(row[name]) for row in known})
        is_text = any(isinstance(row[name], str) for row in known)
        for group in groups:
            part = [row for row in known if row["variant"] == group]
            x = [labels.index(str(row[name])) if is_text else row[name] for row in part]
            panel.plot(x, [row[score] for row in part], ".", markersize=4, alpha=0.6, label=group)
        if is_text:
            panel.set_xticks(range(len(labels)), labels, rotation=20, ha="right")
        panel.set_xlabel(name)
        panel.set_ylabel(UNITS[score])
        panel.grid(alpha=0.3)
        if groups != [""]:
            panel.legend(fontsize="small")
    save_figure(figure, path)


def _draw_bars(panel: Axes, cells: Mapping[str, Mapping[str, Any]]) -> None:
    at = np.arange(len(cells))
    panel.barh(at - 0.2, [cell["share"] for cell in cells.values()], 0.4, label="share of the variance")
    known = [(i, cell) for i, cell in zip(at, cells.values(), strict=True) if cell["prcc"] is not None]
    panel.barh([i + 0.2 for i, _ in known], [cell["prcc"] for _, cell in known], 0.4, label="partial rank correlation")
    for i, cell in known:
        if cell["prcc_ci95"] is not None:
            panel.plot(cell["prcc_ci95"], [i + 0.2] * 2, color="black", linewidth=1.0)
    panel.set_yticks(at, list(cells))
    panel.invert_yaxis()
    panel.set_xlim(-1.0, 1.0)
    panel.set_xticks([-1.0, -0.5, 0.0, 0.5, 1.0])
    panel.axvline(0.0, color="black", linewidth=0.8)
    panel.grid(alpha=0.3, axis="x")
    panel.legend(fontsize="small", loc="lower right")
