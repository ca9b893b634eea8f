"""Pictures of runs, drawn with matplotlib off screen."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from asvhil.study.metrics import settled_from_s
from asvhil.study.runlog import RunLog

PORT_COLOUR, STARBOARD_COLOUR, TRUTH_COLOUR, ESTIMATE_COLOUR = "tab:red", "tab:green", "black", "tab:blue"


def draw_run(run: RunLog, path: Path, title: str) -> None:
    """One sheet: the track with predicted paths, and errors, wind and motor commands over time."""
    figure = Figure(figsize=(13.0, 8.0), layout="constrained")
    figure.suptitle(title)
    grid = figure.add_gridspec(4, 2, width_ratios=(1.15, 1.0))
    _draw_track(figure.add_subplot(grid[:, 0]), run)
    distance = figure.add_subplot(grid[0, 1])
    heading = figure.add_subplot(grid[1, 1], sharex=distance)
    _draw_errors(distance, heading, run)
    _draw_wind(figure.add_subplot(grid[2, 1], sharex=distance), run)
    _draw_motors(figure.add_subplot(grid[3, 1], sharex=distance), run)
    figure.savefig(path, dpi=110)


def _draw_track(axes: Axes, run: RunLog) -> None:
    for _, plan in run.plans:
        axes.plot(plan[:, 2], plan[:, 1], color="tab:orange", linewidth=0.8, alpha=0.7)
    if run.plans:
        axes.plot([], [], color="tab:orange", label="predicted path, every 10 s")
    if run.truth is not None:
        axes.plot(run.truth.rows[:, 2], run.truth.rows[:, 1], color=TRUTH_COLOUR, linewidth=1.0, label="truth")
    rows = run.measured.rows
    axes.plot(rows[:, 2], rows[:, 1], color=ESTIMATE_COLOUR, linewidth=0.8, alpha=0.8, label="estimate")
    if len(rows):
        axes.plot(rows[0, 2], rows[0, 1], "o", color=ESTIMATE_COLOUR, label="start")
    if run.station is not None:
        station = run.station
        axes.plot(station.e_m, station.n_m, "x", color="tab:red", markersize=10, label="station")
        axes.annotate(
            "",
            xy=(station.e_m + 2.0 * np.sin(station.psi_rad), station.n_m + 2.0 * np.cos(station.psi_rad)),
            xytext=(station.e_m, station.n_m),
            arrowprops={"arrowstyle": "->", "color": "tab:red"},
        )
    if len(run.wind):
        toward = np.angle(np.exp(1j * run.wind[:, 2]).mean())
        x, y = 0.08, 0.92
        axes.annotate(
            f"wind {run.wind[:, 1].mean():.1f} m/s",
            xy=(x + 0.06 * np.sin(toward), y + 0.06 * np.cos(toward)),
            xytext=(x - 0.02 * np.sin(toward), y - 0.02 * np.cos(toward)),
            xycoords="axes fraction",
            arrowprops={"arrowstyle": "->", "color": "tab:purple"},
            color="tab:purple",
        )
    axes.set_xlabel("east (m)")
    axes.set_ylabel("north (m)")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right", fontsize="small")


def _draw_errors(distance: Axes, heading: Axes, run: RunLog) -> None:
    tracks = (("truth", run.truth, TRUTH_COLOUR), ("estimate", run.measured, ESTIMATE_COLOUR))
    for name, track, colour in tracks:
        if track is None or run.station is None:
            continue
        errors = track.errors(run.station, run.held_from_s or 0.0)
        distance.plot(errors.t_s, errors.distance_m, color=colour, linewidth=0.9, label=name)
        heading.plot(errors.t_s, errors.heading_deg, color=colour, linewidth=0.9)
    for axes in (distance, heading):
        axes.axvline(settled_from_s(run.duration_s), color="grey", linestyle=":", linewidth=0.9)
        axes.grid(alpha=0.3)
    distance.set_ylabel("distance (m)")
    distance.set_ylim(bottom=0.0)
    if distance.lines:
        distance.legend(fontsize="small")
    heading.set_ylabel("heading error (deg)")


def _draw_wind(axes: Axes, run: RunLog) -> None:
    if len(run.wind):
        axes.plot(run.wind[:, 0], run.wind[:, 1], color="tab:purple", linewidth=0.9)
        twin = axes.twinx()
        toward_deg = np.degrees(np.unwrap(run.wind[:, 2]))
        twin.plot(run.wind[:, 0], toward_deg, color="tab:brown", linewidth=0.7, alpha=0.7)
        twin.set_ylabel("toward (deg)", color="tab:brown")
    axes.set_ylabel("wind (m/s)", color="tab:purple")
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)


def _draw_motors(axes: Axes, run: RunLog) -> None:
    for column, name, colour in ((1, "port", PORT_COLOUR), (2, "starboard", STARBOARD_COLOUR)):
        axes.step(run.command[:, 0], run.command[:, column], where="post", color=colour, linewidth=0.7, label=name)
    axes.set_ylabel("motor command")
    axes.set_ylim(-1.05, 1.05)
    axes.set_xlabel("time (s)")
    axes.grid(alpha=0.3)
    if len(run.command):
        axes.legend(loc="upper right", fontsize="small")
