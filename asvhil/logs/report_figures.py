"""The figures of a report, each as a PNG."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from asvhil.controller.pwm import command_of_pulse
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.rigid_body import ThrustCurve
from asvhil.logs.figure import show_names
from asvhil.logs.picture import (
    PHASE_COLOURS,
    best_track,
    draw_commands,
    draw_errors,
    draw_motors,
    draw_pulses,
    draw_track,
    draw_wind,
    held_errors,
    shade_docking,
    shade_phases,
)
from asvhil.logs.run import RunLog
from asvhil.supervisor.docking import DOCKING_RATE_RADPS, DOCKING_SPEED_MPS
from asvhil.types import record

TICK_AXIS_S = 1.0  # of a run of one tick, which has no length
DPI = 90
WIDE = (11.0, 2.4)  # inches of a panel over time
ROSE_SECTORS = 16
ROSE_STEPS_MPS = (0.0, 1.0, 2.0, 4.0, 6.0, 9.0, math.inf)
MOTION_NAMES = ("u (m/s)", "v (m/s)", "r (rad/s)")


@record
class ReportFigure:
    """A figure: its name, which is the ending of its file's, what it shows, and the bytes of a PNG."""

    name: str
    caption: str
    png: bytes


def report_figures(run: RunLog, on_figure: Callable[[str], None] = lambda name: None) -> list[ReportFigure]:
    """All figures that a run has data for; `on_figure` is told the name of each before it is drawn."""
    wanted: list[tuple[str, str, Callable[[RunLog], Figure], bool]] = [
        ("track", "The way of the boat, with the stages of the procedure and predicted paths.", _track, True),
        ("errors", "Errors to the station of each tick, while one is held; docking windows shaded.", _errors, True),
        ("wind", f"Wind: where it came from, and over time ({_origin(run)}).", _wind, len(run.wind) > 0),
        ("docking", "Speed and rotation, with the limits of a docking window; docking windows shaded.", _motion, True),
        ("motors", "Commands of the controller, thrust by the boat's thrust curve, and pulses sent.", _motors, True),
        (
            "model",
            "Root mean square error of the model's prediction, one step and a horizon ahead.",
            _model,
            len(run.model_error) > 0,
        ),
        ("timing", "What each step took, and its share of the tick.", _timing, len(run.step_ms) > 0),
    ]
    figures = []
    for name, caption, draw, has_data in wanted:
        if has_data:
            on_figure(name)
            figures.append(_made(name, caption, draw, run))
    return figures


def compare_figure(runs: Sequence[tuple[str, RunLog]]) -> ReportFigure:
    """The errors of several runs over the time since their first hold, by the truth where it is known."""
    figure = Figure(figsize=(WIDE[0], 2 * WIDE[1]), layout="constrained")
    distance, heading = figure.subplots(2, 1, sharex=True)
    for name, run in runs:
        way, track = best_track(run)
        held = track.of_hold()
        if not len(held.t_s):
            continue
        t_s, off_m, off_deg = held_errors(held)
        distance.plot(t_s - t_s[0], off_m, linewidth=0.9, label=f"{name} ({way})")
        heading.plot(t_s - t_s[0], off_deg, linewidth=0.9)
    _over_time(distance, "distance (m)", legend=True)
    _over_time(heading, "heading error (deg)")
    heading.set_xlabel("time since the first hold (s)")
    return ReportFigure(name="compare", caption="Errors of both runs.", png=_png(figure))


def _made(name: str, caption: str, draw: Callable[[RunLog], Figure], run: RunLog) -> ReportFigure:
    return ReportFigure(name=name, caption=caption, png=_png(draw(run)))


def _png(figure: Figure) -> bytes:
    data = io.BytesIO()
    show_names(figure)
    figure.savefig(data, format="png", dpi=DPI)
    return data.getvalue()


def _panels(run: RunLog, count: int) -> tuple[Figure, list[Axes]]:
    """Panels over one time, with the phases shaded."""
    figure = Figure(figsize=(WIDE[0], count * WIDE[1]), layout="constrained")
    panels = list(np.atleast_1d(figure.subplots(count, 1, sharex=True)))
    for axes in panels:
        shade_phases(axes, run)
        axes.set_xlim(0.0, run.duration_s or TICK_AXIS_S)
    panels[-1].set_xlabel("time (s)")
    return figure, panels


def _over_time(axes: Axes, label: str, *, legend: bool = False) -> None:
    axes.set_ylabel(label)
    axes.grid(alpha=0.3)
    if legend and axes.lines:
        axes.legend(loc="upper right", fontsize="small")


def _track(run: RunLog) -> Figure:
    figure = Figure(figsize=(9.0, 7.5), layout="constrained")
    draw_track(figure.subplots(), run)
    return figure


def _errors(run: RunLog) -> Figure:
    figure, panels = _panels(run, 2)
    draw_errors(panels[0], panels[1], run, measured=True)
    names = [phase.value for phase in PHASE_COLOURS if phase.value in run.phases_s]
    if names:
        for name, colour in ((phase.value, colour) for phase, colour in PHASE_COLOURS.items()):
            if name in names:
                panels[0].fill_between([], [], [], color=colour, label=name)
        panels[0].legend(loc="upper right", fontsize="small", ncols=3)
    return figure


def _motion(run: RunLog) -> Figure:
    figure, (speed, rate) = _panels(run, 2)
    name, track = best_track(run)
    for axes, values, limit, label in (
        (speed, track.speed_mps, DOCKING_SPEED_MPS, "speed (m/s)"),
        (rate, np.degrees(track.yaw_rate_radps), math.degrees(DOCKING_RATE_RADPS), "rotation (deg/s)"),
    ):
        axes.plot(track.t_s, values, color="black", linewidth=0.8, label=name)
        axes.axhline(limit, color="tab:green", linestyle=":", linewidth=1.0)
        _over_time(axes, label, legend=True)
    rate.axhline(-math.degrees(DOCKING_RATE_RADPS), color="tab:green", linestyle=":", linewidth=1.0)
    shade_docking((speed, rate), track)
    return figure


def _wind(run: RunLog) -> Figure:
    figure = Figure(figsize=(WIDE[0], 3.6), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=(1.0, 2.2))
    rose = figure.add_subplot(grid[0, 0], projection="polar")
    assert isinstance(rose, PolarAxes)
    _draw_rose(rose, run.wind[:, 1], run.wind[:, 2] + math.pi)
    over_time = figure.add_subplot(grid[0, 1])
    shade_phases(over_time, run)
    draw_wind(over_time, run)
    over_time.set_xlabel("time (s)")
    return figure


def _draw_rose(axes: PolarAxes, speed_mps: Array, from_rad: Array) -> None:
    """How often the wind came from each direction, by its speed."""
    width = math.tau / ROSE_SECTORS
    sector = np.round((from_rad % math.tau) / width).astype(int) % ROSE_SECTORS
    below = np.zeros(ROSE_SECTORS)
    for low, high in pairwise(ROSE_STEPS_MPS):
        chosen = (speed_mps >= low) & (speed_mps < high)
        if chosen.any():
            share = 100.0 * np.bincount(sector[chosen], minlength=ROSE_SECTORS) / len(speed_mps)
            label = f"{low:g} to {high:g} m/s" if math.isfinite(high) else f"over {low:g} m/s"
            axes.bar(width * np.arange(ROSE_SECTORS), share, width=0.9 * width, bottom=below, label=label)
            below += share
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    axes.set_xticks(np.radians([0.0, 90.0, 180.0, 270.0]), ["N", "E", "S", "W"])
    axes.set_rlabel_position(22.5)
    axes.yaxis.set_major_formatter("{x:g} %")
    axes.legend(loc="upper left", bbox_to_anchor=(-0.35, 1.15), fontsize="x-small")


def _motors(run: RunLog) -> Figure:
    figure, (command, thrust, pulses) = _panels(run, 3)
    draw_commands(command, run)
    draw_motors(thrust, _thrusts(run))
    _over_time(thrust, "thrust (N)")
    draw_pulses(pulses, run)
    return figure


def _thrusts(run: RunLog) -> Array:
    """Rows (t_s, port, starboard N) of the pulses that were sent, by the boat's thrust curve; NaN where released."""
    curve, pwm = ThrustCurve(run.config.vehicle.vessel.thrust_curve), run.config.vehicle.pwm
    rows = run.pwm.copy()
    sent = np.isfinite(rows[:, 1])
    pulses_us, at = np.unique(rows[sent, 1:], return_inverse=True)
    newtons = np.array([curve.thrust_n(command_of_pulse(pwm, int(pulse_us))) for pulse_us in pulses_us])
    if len(newtons):
        rows[sent, 1:] = newtons[at].reshape(-1, 2)
    return rows


def _model(run: RunLog) -> Figure:
    figure, panels = _panels(run, 3)
    for number, (axes, name) in enumerate(zip(panels, MOTION_NAMES, strict=True)):
        axes.plot(run.model_error[:, 0], run.model_error[:, 1 + number], linewidth=0.9, label="one step")
        axes.plot(run.model_error[:, 0], run.model_error[:, 4 + number], linewidth=0.9, label="horizon")
        _over_time(axes, name, legend=number == 0)
        axes.set_ylim(bottom=0.0)
    return figure


def _timing(run: RunLog) -> Figure:
    figure = Figure(figsize=WIDE, layout="constrained")
    over_time, spread = figure.subplots(1, 2, width_ratios=(2.2, 1.0))
    tick_ms = 1e3 / run.config.daemon.tick_hz
    over_time.plot(run.step_ms[:, 0], run.step_ms[:, 1], ".", color="black", markersize=1.5)
    over_time.axhline(tick_ms, color="tab:red", linestyle=":", linewidth=1.0)
    over_time.set_yscale("log")
    over_time.set_xlabel("time (s)")
    _over_time(over_time, "step (ms)")
    least, most = max(float(run.step_ms[:, 1].min()), 1e-3), float(run.step_ms[:, 1].max())
    spread.hist(run.step_ms[:, 1], bins=np.geomspace(least, max(most, 2.0 * least), 50), color="grey")
    spread.axvline(tick_ms, color="tab:red", linestyle=":", linewidth=1.0, label="a tick")
    spread.set_xscale("log")
    spread.set_yscale("log")
    spread.set_xlabel("step (ms)")
    spread.set_ylabel("ticks")
    spread.legend(fontsize="small")
    return figure


def _origin(run: RunLog) -> str:
    return "from the disturbance" if run.wind_origin == "disturbance" else "estimated from the sensor"
