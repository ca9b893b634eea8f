"""Pictures of learned models: an identification sheet like the paper's, and the curve of a training."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asvhil.dynamics.arrays import Array
from asvhil.logs.figure import save_figure
from asvhil.train.evaluate import Case

COLOURS = {"nnsem": "tab:red", "sd": "tab:green", "node": "gold", "knode": "tab:blue", "lagnet": "tab:purple"}
LABELS = ("u (m/s)", "v (m/s)", "r (rad/s)")


def draw_identification(case: Case, start: int, paths: Mapping[str, Array], dt_s: float, path: Path) -> None:
    """One window: measured and predicted u, v, r, then the commands and the wind. `paths` by model (steps + 1, 3)."""
    steps = max(len(part) for part in paths.values()) - 1
    rows = slice(start, start + steps + 1)
    t_s = dt_s * np.arange(steps + 1)
    figure = Figure(figsize=(9.0, 10.0), layout="constrained")
    axes = figure.subplots(5, 1, sharex=True)
    for i, label in enumerate(LABELS):
        axes[i].plot(t_s, case.seen.nu[rows, i], color="black", linewidth=1.0, label="measured")
        for name, predicted in paths.items():
            axes[i].plot(t_s, predicted[:, i], color=_colour(name), linewidth=1.2, label=name)
        axes[i].set_ylabel(label)
    axes[0].legend(loc="upper right", fontsize="small", ncols=3)
    for i, (name, colour) in enumerate((("port", "tab:red"), ("starboard", "tab:green"))):
        axes[3].step(t_s, case.seen.command[rows, i], where="post", color=colour, linewidth=1.0, label=name)
    for i, (name, colour) in enumerate((("ahead", "tab:blue"), ("to starboard", "tab:orange"))):
        axes[4].plot(t_s, case.seen.wind[rows, i], color=colour, linewidth=1.0, label=name)
    axes[3].set_ylabel("PWM command")
    axes[4].set_ylabel("true wind (m/s)")
    axes[4].set_xlabel(f"time (s) in {case.name}")
    for axis in axes[3:]:
        axis.legend(loc="upper right", fontsize="small")
    for axis in axes:
        axis.grid(alpha=0.3)
    save_figure(figure, path)


def draw_curve(figures: Mapping[str, Any], title: str, path: Path) -> None:
    """Training loss and validation error over iterations, out of a model's training figures."""
    rows = np.array(figures["curve"])
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.subplots()
    axes.semilogy(rows[:, 0], rows[:, 1], color="tab:blue", label="training loss")
    axes.semilogy(rows[:, 0], rows[:, 2], color="tab:orange", label="validation error")
    axes.set_xlabel("iteration")
    axes.set_title(title)
    axes.grid(alpha=0.3)
    axes.legend()
    save_figure(figure, path)


def _colour(name: str) -> str:
    """The paper's colour of the kind of model that a name begins with."""
    return next((colour for kind, colour in COLOURS.items() if name.startswith(kind)), "tab:gray")
