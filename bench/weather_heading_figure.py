"""The picture of the bench of headings that follow the weather: distance and thrust over the wind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from statistics import fmean
from typing import Any

from matplotlib.figure import Figure

from asvhil.logs.figure import save_figure

MARKERS = {False: "o", True: "^"}


def draw(runs: list[dict[str, Any]], floor_of: Callable[[dict[str, Any]], float], picture: Path) -> None:
    """A point for each run, beside what is asked for; `floor_of` gives the floor of thrust squared (N^2) of a run."""
    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    distance, thrust = figure.subplots(1, 2)
    currents = sorted({one["current_mps"] for one in runs})
    held = [one for one in runs if one["held"] == 1.0 and one["kind"] != "veer"]
    for number, current_mps in enumerate(currents):
        colour, beside = f"C{number}", 0.35 * (number - 0.5 * (len(currents) - 1))
        of = [one for one in held if one["current_mps"] == current_mps]
        for one in of:
            if one["kind"] == "bow":
                at, marker = one["wind_mps"] + beside, MARKERS[one["waves"]]
                distance.plot(at, one["mean_m"], marker, color=colour, markersize=4, alpha=0.6)
                thrust.plot(at, one["thrust_n2"], marker, color=colour, markersize=4, alpha=0.6)
        for wind_mps in sorted({one["wind_mps"] for one in of}):
            across = [one for one in of if one["kind"] == "fixed" and one["wind_mps"] == wind_mps]
            span = wind_mps + beside - 0.15, wind_mps + beside + 0.15
            if across:
                asked_n2 = fmean(one["thrust_n2"] for one in across) / 20.0
                thrust.plot(span, (asked_n2, asked_n2), color=colour, linewidth=2.0)
            calm = next(one for one in of if one["wind_mps"] == wind_mps)
            thrust.plot(span, (floor_of(calm),) * 2, color=colour, linewidth=1.5, linestyle=":")
        distance.plot([], [], "s", color=colour, label=f"current {current_mps:g} m/s")
    for waves, marker in MARKERS.items():
        distance.plot([], [], marker, color="black", label="with waves" if waves else "gusts alone")
    distance.plot((1.0, 7.0, 7.0, 11.0), (0.5, 0.5, 0.9, 0.9), color="grey", linestyle="--", label="asked")
    thrust.plot([], [], color="black", linewidth=2.0, label="1/20 of the fixed heading's")
    thrust.plot([], [], color="black", linestyle=":", label="floor of the mean weather")
    thrust.set_yscale("log")
    distance.set_ylabel("mean distance to the station (m)")
    thrust.set_ylabel("mean thrust squared of a motor (N²)")
    for panel in (distance, thrust):
        panel.set_xlabel("wind (m/s)")
        panel.grid(alpha=0.3)
        panel.legend(fontsize="small")
    save_figure(figure, picture)
