"""Pictures of runs, drawn with matplotlib off screen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from asvhil.logs.figure import save_figure
from asvhil.logs.metrics import settled_from_s
from asvhil.logs.run import RunLog
from asvhil.types import Station

PORT_COLOUR, STARBOARD_COLOUR = "tab:red", "tab:green"
TRUTH_COLOUR, ESTIMATE_COLOUR, WIND_COLOUR = "black", "tab:blue", "tab:purple"


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
    save_figure(figure, path)


def _draw_track(axes: Axes, run: RunLog) -> None:
    """The track relative to the station, north up; relative to the local origin if no station was held."""
    station = run.station or Station(n_m=0.0, e_m=0.0, psi_rad=0.0)
    for _, plan in run.plans:
        axes.plot(plan[:, 2] - station.e_m, plan[:, 1] - station.n_m, color="tab:orange", linewidth=0.8, alpha=0.7)
    if run.plans:
        axes.plot([], [], color="tab:orange", label="predicted path, every 10 s")
    tracks = (("truth", run.truth, TRUTH_COLOUR), ("estimated", run.estimated, ESTIMATE_COLOUR))
    for name, track, colour in tracks:
        if track is None or not len(track.t_s):
            continue
        east_m, north_m = track.pose[:, 1] - station.e_m, track.pose[:, 0] - station.n_m
        axes.plot(east_m, north_m, color=colour, linewidth=0.9, label=name)
        axes.plot(east_m[0], north_m[0], "o", color=colour, markersize=4)
    if run.station is not None:
        axes.plot(0.0, 0.0, "x", color="tab:red", markersize=10, label="station")
        tip = 2.0 * np.sin(station.psi_rad), 2.0 * np.cos(station.psi_rad)
        axes.annotate("", xy=tip, xytext=(0.0, 0.0), arrowprops={"arrowstyle": "->", "color": "tab:red"})
    if len(run.wind):
        toward_rad = np.angle(np.exp(1j * run.wind[:, 2]).mean())
        dx, dy = 0.05 * np.sin(toward_rad), 0.05 * np.cos(toward_rad)
        axes.annotate(
            "",
            xy=(0.1 + dx, 0.9 + dy),
            xytext=(0.1 - dx, 0.9 - dy),
            xycoords="axes fraction",
            arrowprops={"arrowstyle": "-|>", "color": WIND_COLOUR, "linewidth": 2.0},
        )
        text = f"wind {run.wind[:, 1].mean():.1f} m/s"
        axes.text(0.1, 0.82, text, transform=axes.transAxes, ha="center", color=WIND_COLOUR)
    axes.set_xlabel("east of the station (m)")
    axes.set_ylabel("north of the station (m)")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)
    if axes.lines:
        axes.legend(loc="lower right", fontsize="small")


def _draw_errors(distance: Axes, heading: Axes, run: RunLog) -> None:
    tracks = (("truth", run.truth, TRUTH_COLOUR), ("estimated", run.estimated, ESTIMATE_COLOUR))
    for name, track, colour in tracks:
        if track is None or run.station is None:
            continue
        errors = track.of_hold().errors
        distance.plot(errors.t_s, errors.distance_m, color=colour, linewidth=0.9, label=name)
        heading.plot(errors.t_s, errors.heading_deg, color=colour, linewidth=0.9)
    drawn = bool(distance.lines)
    for axes in (distance, heading):
        axes.axvline(settled_from_s(run.duration_s), color="grey", linestyle=":", linewidth=0.9)
        axes.grid(alpha=0.3)
    distance.set_ylabel("distance (m)")
    distance.set_ylim(bottom=0.0)
    if drawn:
        distance.legend(fontsize="small")
    heading.set_ylabel("heading error (deg)")


def _draw_wind(axes: Axes, run: RunLog) -> None:
    if len(run.wind):
        axes.plot(run.wind[:, 0], run.wind[:, 1], color=WIND_COLOUR, linewidth=0.9)
        twin = axes.twinx()
        toward_deg = np.degrees(np.unwrap(run.wind[:, 2]))
        twin.plot(run.wind[:, 0], toward_deg, color="tab:brown", linewidth=0.7, alpha=0.7)
        twin.set_ylabel("toward (deg)", color="tab:brown")
    axes.set_ylabel("wind (m/s)", color=WIND_COLOUR)
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
