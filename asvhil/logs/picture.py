"""Pictures of runs, drawn with matplotlib off screen: one sheet, or panels for a report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from asvhil.dynamics.arrays import Array
from asvhil.logs.figure import save_figure
from asvhil.logs.metrics import MotionTrack, docking_windows, settled_from_s
from asvhil.logs.run import RunLog
from asvhil.types import Phase, Station

PORT_COLOUR, STARBOARD_COLOUR = "tab:red", "tab:green"
TRUTH_COLOUR, ESTIMATE_COLOUR, MEASURED_COLOUR, WIND_COLOUR = "black", "tab:blue", "tab:cyan", "tab:purple"
PLAN_COLOUR, DOCKING_COLOUR, STATION_COLOUR = "tab:orange", "tab:green", "tab:red"
PHASE_COLOURS = {Phase.PREPARE: "khaki", Phase.HOLD: "aliceblue", Phase.FAILSAFE: "lightcoral"}
STAGE_COLOURS = ("tab:blue", "tab:olive", "tab:pink", "tab:brown")  # of the procedure's stages, in their order
LEAST_M = 1e-3  # of a track that is drawn as it is
PLANS_MOST = 150  # predicted paths in one picture
ARROWS_MOST = 6  # stations with an arrow
LEAST_TOWARD_DEG = -45.0  # of a wind's median direction in a picture: one toward the north is drawn about 0


def draw_run(run: RunLog, path: Path, title: str) -> None:
    """One sheet: the track with predicted paths, and errors, wind and motor commands over time."""
    figure = Figure(figsize=(13.0, 8.0), layout="constrained")
    figure.suptitle(title)
    grid = figure.add_gridspec(4, 2, width_ratios=(1.15, 1.0))
    draw_track(figure.add_subplot(grid[:, 0]), run)
    distance = figure.add_subplot(grid[0, 1])
    heading = figure.add_subplot(grid[1, 1], sharex=distance)
    draw_errors(distance, heading, run)
    for axes in (distance, heading):
        axes.axvline(settled_from_s(run.duration_s), color="grey", linestyle=":", linewidth=0.9)
    draw_wind(figure.add_subplot(grid[2, 1], sharex=distance), run)
    motors = figure.add_subplot(grid[3, 1], sharex=distance)
    draw_commands(motors, run)
    motors.set_xlabel("time (s)")
    save_figure(figure, path)


def best_track(run: RunLog) -> tuple[str, MotionTrack]:
    """The truth where it is known, else the estimate; with its name."""
    return ("truth", run.truth) if run.truth is not None else ("estimated", run.estimated)


def draw_track(axes: Axes, run: RunLog) -> None:
    """The track relative to the last station, north up, by stage; relative to the local origin if none was held."""
    station = run.station or Station(n_m=0.0, e_m=0.0, psi_rad=0.0)
    every = math.ceil(len(run.plans) / PLANS_MOST) if run.plans else 1
    paths = [np.column_stack([plan[:, 2] - station.e_m, plan[:, 1] - station.n_m]) for _, plan in run.plans[::every]]
    if paths:
        axes.add_collection(LineCollection(paths, colors=PLAN_COLOUR, linewidths=0.8, alpha=0.7))
        axes.plot([], [], color=PLAN_COLOUR, label="predicted path")
    tracks = (("truth", run.truth, TRUTH_COLOUR), ("estimated", run.estimated, ESTIMATE_COLOUR))
    for name, track, colour in tracks:
        if track is None or not len(track.t_s):
            continue
        east_m, north_m = track.pose[:, 1] - station.e_m, track.pose[:, 0] - station.n_m
        axes.plot(east_m, north_m, color=colour, linewidth=0.9, label=name)
        axes.plot(east_m[0], north_m[0], "o", color=colour, markersize=4)
    _draw_stages(axes, run, station)
    if run.station is not None:
        _draw_stations(axes, run, station)
    if len(run.wind):
        toward_rad = float(np.angle(np.exp(1j * run.wind[:, 2]).mean()))
        _draw_wind_arrow(axes, toward_rad, float(run.wind[:, 1].mean()))
    axes.set_xlabel("east of the station (m)")
    axes.set_ylabel("north of the station (m)")
    _widen(axes)
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)
    if axes.lines:
        axes.legend(loc="lower right", fontsize="small")


def _widen(axes: Axes) -> None:
    """Limits for a track that has no extent, such as of one tick: equal axes have none for it."""
    box = axes.dataLim  # inverted and infinite where there are no data
    for low, high, set_limits in ((box.x0, box.x1, axes.set_xlim), (box.y0, box.y1, axes.set_ylim)):
        if low <= high < low + LEAST_M:
            set_limits(low - 0.5, high + 0.5)


def _draw_stages(axes: Axes, run: RunLog, station: Station) -> None:
    """The way in each stage of the procedure, beneath the track."""
    _, track = best_track(run)
    names = list(dict.fromkeys(span.stage for span in run.stages))
    for name, colour in zip(names, STAGE_COLOURS, strict=False):
        parts = []
        for span in run.stages:
            if span.stage == name:
                pose = track.pose[(track.t_s >= span.from_s) & (track.t_s <= span.to_s)]
                parts.append(np.column_stack([pose[:, 1] - station.e_m, pose[:, 0] - station.n_m]))
        axes.add_collection(LineCollection(parts, colors=colour, linewidths=5.0, alpha=0.25, zorder=1))
        axes.plot([], [], color=colour, linewidth=5.0, alpha=0.25, label=name.replace("_", " "))


def _draw_stations(axes: Axes, run: RunLog, last: Station) -> None:
    track = run.estimated.of_hold()
    if track.moves.any():
        way = np.where(track.moves[:, None], track.station[:, :2], np.nan)
        axes.plot(
            way[:, 1] - last.e_m,
            way[:, 0] - last.n_m,
            "--",
            color=STATION_COLOUR,
            linewidth=1.2,
            label="course of the station",
        )
    rests = ~track.moves
    rests[-1:] = True  # where it is at the end
    held = track.station[rests]
    stations = held[np.sort(np.unique(held, axis=0, return_index=True)[1])]
    for n_m, e_m, psi_rad in stations[-ARROWS_MOST:]:
        at = e_m - last.e_m, n_m - last.n_m
        tip = at[0] + 2.0 * math.sin(psi_rad), at[1] + 2.0 * math.cos(psi_rad)
        axes.annotate("", xy=tip, xytext=at, arrowprops={"arrowstyle": "->", "color": STATION_COLOUR})
    east_m, north_m = stations[:, 1] - last.e_m, stations[:, 0] - last.n_m
    axes.plot(east_m, north_m, "x", color=STATION_COLOUR, markersize=10, label="station")


def _draw_wind_arrow(axes: Axes, toward_rad: float, speed_mps: float) -> None:
    dx, dy = 0.05 * math.sin(toward_rad), 0.05 * math.cos(toward_rad)
    axes.annotate(
        "",
        xy=(0.1 + dx, 0.9 + dy),
        xytext=(0.1 - dx, 0.9 - dy),
        xycoords="axes fraction",
        arrowprops={"arrowstyle": "-|>", "color": WIND_COLOUR, "linewidth": 2.0},
    )
    axes.text(0.1, 0.82, f"wind {speed_mps:.1f} m/s", transform=axes.transAxes, ha="center", color=WIND_COLOUR)


def draw_errors(distance: Axes, heading: Axes, run: RunLog, *, measured: bool = False) -> None:
    """Errors to the station while it is held, with the docking windows shaded."""
    readings = run.measured if measured else None
    tracks = (
        ("measured", readings, MEASURED_COLOUR),
        ("truth", run.truth, TRUTH_COLOUR),
        ("estimated", run.estimated, ESTIMATE_COLOUR),
    )
    for name, track, colour in tracks:
        if track is None or not (held := track.of_hold()).hold.any():
            continue
        t_s, off_m, off_deg = held_errors(held)
        distance.plot(t_s, off_m, color=colour, linewidth=0.9, label=name)
        heading.plot(t_s, off_deg, color=colour, linewidth=0.9)
    shade_docking((distance, heading), best_track(run)[1])
    for axes in (distance, heading):
        axes.grid(alpha=0.3)
    distance.set_ylabel("distance (m)")
    distance.set_ylim(bottom=0.0)
    if distance.lines:
        distance.legend(fontsize="small")
    heading.set_ylabel("heading error (deg)")


def held_errors(held: MotionTrack) -> tuple[Array, Array, Array]:
    """Times (s), distances (m) and heading errors (deg) of the samples of holds, with no line between two holds."""
    errors = held.errors
    rows = np.column_stack((errors.t_s, errors.distance_m, errors.heading_deg))
    t_s, off_m, off_deg = parted(rows, held.hold).T
    return t_s, off_m, off_deg


def parted(rows: Array, numbers: Array) -> Array:
    """Rows (k, n) that begin with a time, and a number of each: where that changes a line through them has a gap.

    A row of NaN stands there, at the time of the row before, where a step ends.
    """
    at = np.flatnonzero(np.diff(numbers)) + 1
    gaps = np.full((len(at), rows.shape[1]), np.nan)
    gaps[:, 0] = rows[at - 1, 0]
    return np.insert(rows, at, gaps, axis=0)


def shade_docking(panels: Sequence[Axes], track: MotionTrack) -> None:
    """Shade the docking windows of a track over time."""
    spans = [(window["from_s"], window["length_s"]) for window in docking_windows(track)]
    for number, axes in enumerate(panels):
        if spans:
            axes.broken_barh(
                spans,
                (0.0, 1.0),
                transform=axes.get_xaxis_transform(),
                color=DOCKING_COLOUR,
                alpha=0.15,
                label="docking window" if number == 0 else None,
            )


def shade_phases(axes: Axes, run: RunLog) -> None:
    """Shade the phases of a run over time; standby stays white."""
    for span in run.spans:
        if span.phase in PHASE_COLOURS:
            axes.axvspan(span.from_s, span.to_s, color=PHASE_COLOURS[span.phase], zorder=0)


def draw_wind(axes: Axes, run: RunLog) -> None:
    """Speed of the wind, and the direction that it blows toward, over time."""
    if len(run.wind):
        axes.plot(run.wind[:, 0], run.wind[:, 1], color=WIND_COLOUR, linewidth=0.9)
        twin = axes.twinx()
        toward_deg = np.degrees(np.unwrap(run.wind[:, 2]))
        toward_deg -= 360.0 * np.floor((np.median(toward_deg) - LEAST_TOWARD_DEG) / 360.0)
        twin.plot(run.wind[:, 0], toward_deg, color="tab:brown", linewidth=0.7, alpha=0.7)
        twin.set_ylabel("toward (deg)", color="tab:brown")
    axes.set_ylabel("wind (m/s)", color=WIND_COLOUR)
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)


def draw_commands(axes: Axes, run: RunLog) -> None:
    """The commands of the motors over time; none between two holds."""
    draw_motors(axes, parted(run.command, run.command[:, 3]))
    axes.set_ylabel("motor command")
    axes.set_ylim(-1.05, 1.05)


def draw_pulses(axes: Axes, run: RunLog) -> None:
    """The pulses that were sent over time; none where the motors were released."""
    draw_motors(axes, run.pwm)
    axes.set_ylabel("pulse (us)")


def draw_motors(axes: Axes, rows: Array) -> None:
    """Steps of both motors, of rows (t_s, port, starboard); NaN where there is none."""
    for column, name, colour in ((1, "port", PORT_COLOUR), (2, "starboard", STARBOARD_COLOUR)):
        axes.step(rows[:, 0], rows[:, column], where="post", color=colour, linewidth=0.7, label=name)
    axes.grid(alpha=0.3)
    if len(rows):
        axes.legend(loc="upper right", fontsize="small")
