"""Draw what the motors' work buys, from the table of a campaign: `python -m bench.effort_front effort.parquet PNG`."""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path
from statistics import fmean

import pyarrow.parquet as pq
from matplotlib.figure import Figure

from bench.ending import end_in_words

EFFORTS = ("precise", "normal", "gentle")
AXES = (
    ("reversals_per_min", "reversals per minute of the motor with more"),
    ("saturated_share", "share of the time at full thrust"),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", type=Path, help="the Parquet file of `asvhil campaign effort`")
    parser.add_argument("picture", type=Path, help="the PNG file to write")
    asked = parser.parse_args()
    draw(asked.table, asked.picture)


def draw(table: Path, picture: Path) -> None:
    """A panel for each measure of the motors' work, a line for each wind speed, a point for each variant."""
    points: dict[float, dict[str, list[dict[str, float]]]] = defaultdict(lambda: defaultdict(list))
    for row in pq.read_table(table).to_pylist():
        points[row["wind_speed"]][row["variant"]].append(row)
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    for panel, (column, label) in zip(figure.subplots(1, len(AXES)), AXES, strict=True):
        for number, (speed_mps, variants) in enumerate(sorted(points.items())):
            means = {
                name: [fmean(run[key] for run in runs) for key in (column, "ps")] for name, runs in variants.items()
            }
            line = sorted(mean for name, mean in means.items() if name not in EFFORTS or name == "precise")
            panel.plot(*zip(*line, strict=True), "o-", color=f"C{number}", markersize=4, label=f"{speed_mps:g} m/s")
            for name in EFFORTS:
                panel.plot(*means[name], "s", color=f"C{number}", markersize=8, fillstyle="none")
                panel.annotate(name, means[name], textcoords="offset points", xytext=(6, 6), fontsize="small")
        panel.set_xlabel(label)
        panel.set_ylabel("penalty score")
        panel.grid(alpha=0.3)
        panel.legend(title="wind across", fontsize="small")
    figure.savefig(picture, dpi=110)


if __name__ == "__main__":
    end_in_words(main)
