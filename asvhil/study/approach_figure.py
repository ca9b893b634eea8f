"""A figure of the approaches of a study: tracks relative to the station, and the distance over time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from asvhil.logs.figure import save_figure
from asvhil.study.trials.approach import LOST_M, TRACK_S, Outcome

BROUGHT_COLOUR, LOST_COLOUR = "tab:blue", "tab:red"


def draw_tracks(outcomes: Sequence[Outcome], path: Path) -> None:
    """Draw the tracks, north up, with the station in the middle; lost boats in red, starts as dots."""
    figure = Figure(figsize=(13.0, 6.5), layout="constrained")
    plane, over_time = figure.subplots(1, 2)
    for outcome in sorted(outcomes, key=lambda outcome: outcome.lost):
        north_m, east_m = np.array(outcome.track_m).T
        colour = LOST_COLOUR if outcome.lost else BROUGHT_COLOUR
        plane.plot(east_m, north_m, color=colour, linewidth=0.7, alpha=0.6)
        plane.plot(east_m[0], north_m[0], "o", color=colour, markersize=3)
        t_s = TRACK_S * np.arange(len(north_m))
        over_time.plot(t_s, np.hypot(north_m, east_m), color=colour, linewidth=0.7, alpha=0.6)
        if outcome.handover_s is not None:
            at = min(round(outcome.handover_s / TRACK_S), len(north_m) - 1)
            over_time.plot(t_s[at], np.hypot(north_m[at], east_m[at]), "|", color="black", markersize=6)
    plane.plot(0.0, 0.0, "x", color="black", markersize=10, label="station")
    lost = sum(outcome.lost for outcome in outcomes)
    plane.plot([], [], color=BROUGHT_COLOUR, label=f"brought and kept: {len(outcomes) - lost}")
    plane.plot([], [], color=LOST_COLOUR, label=f"lost: {lost}")
    plane.set_xlabel("east of the station (m)")
    plane.set_ylabel("north of the station (m)")
    plane.set_aspect("equal", adjustable="datalim")
    plane.legend(loc="lower right", fontsize="small")
    over_time.axhline(LOST_M, color="grey", linestyle=":", linewidth=1.0, label=f"{LOST_M:g} m")
    over_time.plot([], [], "|", color="black", label="hand-over to the keeper")
    over_time.set_xlabel("time (s)")
    over_time.set_ylabel("distance to the station (m)")
    over_time.set_ylim(bottom=0.0)
    over_time.legend(loc="upper right", fontsize="small")
    for axes in (plane, over_time):
        axes.grid(alpha=0.3)
    save_figure(figure, path)
