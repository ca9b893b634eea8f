"""The solver study as a Markdown table and a figure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from asvhil.logs.figure import save_figure

LABELS = {
    "sqp": "own SQP (default)",
    "ipopt": "CasADi IPOPT (the paper's second)",
    "fatrop": "CasADi fatrop",
    "torch-lqr": "iLQR on torch autodiff (the paper's first)",
    "mpc.torch": "mpc.torch itself, same problems",
}
HEAD = (
    "| solver | first step ms | median ms | p99 ms | CPU median ms | CPU p99 ms | gap % | gap p95 % | times the first "
    "row's | times faster than iLQR on torch | closed-loop cost | distance at the end m | limit within 0.5 % |"
)


def solver_table(study: dict[str, Any]) -> str:
    """A row for each solver; `gap` is the mean cost above the best of four converged starts, where it was.

    Ratios are of median wall times of a step.
    """
    rows = study["solvers"]
    base_ms = next(iter(rows.values()))["step_ms"]["median"]
    torch_ms = rows["torch-lqr"]["step_ms"]["median"] if "torch-lqr" in rows else None
    lines = [HEAD, "|" + " --- |" * (HEAD.count("|") - 1)]
    for name, row in rows.items():
        time, gap, limit = row["step_ms"], row["gap"], row.get("limit")
        cpu = row.get("step_cpu_ms")
        cells = [
            LABELS.get(name, name),
            f"{time['first']:.1f}",
            f"{time['median']:.2f}",
            f"{time['p99']:.1f}",
            f"{cpu['median']:.2f}" if cpu else "",
            f"{cpu['p99']:.1f}" if cpu else "",
            f"{100.0 * gap['mean']:.2f}" if gap["problems"] else "",
            f"{100.0 * gap['p95']:.2f}" if gap["problems"] else "",
            f"{time['median'] / base_ms:.1f}",
            f"{torch_ms / time['median']:.1f}" if torch_ms else "",
            f"{row['closed_loop_cost']:.0f}" if "closed_loop_cost" in row else "",
            f"{row['distance_end_m']:.2f}" if "distance_end_m" in row else "",
            f"{100.0 * limit['agree_share']:.0f} % of {limit['problems']}" if limit else "",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    wind = study["wind"]
    lines += [
        "",
        f"Model {study['model']}, T = {study['horizon_s']:g} s in {study['stages']} stages, {study['steps']} steps "
        f"from the start of the approach on, wind {wind['speed_mps']:g} m/s toward {wind['toward_deg']:g} degrees "
        f"with gusts and sensor noise, seed {study['seed']}, one core, "
        f"config {study['config_hash']}.",
    ]
    return "\n".join(lines) + "\n"


def draw_solvers(study: dict[str, Any], path: Path) -> None:
    """Time of a step (median to p99) over the gap to the optimum, one mark a solver."""
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    axes = figure.add_subplot()
    for name, row in study["solvers"].items():
        time, gap = row["step_ms"], row["gap"]
        if not gap["problems"]:
            continue
        gap_percent = 100.0 * max(gap["mean"], 0.0)
        (line,) = axes.plot([time["median"], time["p99"]], [gap_percent] * 2, linewidth=1.5, alpha=0.6)
        axes.plot(time["median"], gap_percent, "o", color=line.get_color(), label=LABELS.get(name, name))
    axes.axvline(200.0, color="grey", linestyle=":", linewidth=1.0)
    axes.annotate("control period", (200.0, 1.0), xycoords=("data", "axes fraction"), rotation=90, va="top", ha="right")
    axes.set_xscale("log")
    axes.set_yscale("symlog", linthresh=0.01)
    axes.set_ylim(0.0, 3.0 * axes.get_ylim()[1])
    axes.set_xlabel("time of a step, median to 99th percentile (ms)")
    axes.set_ylabel("mean cost above the optimum (%)")
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small")
    save_figure(figure, path)
