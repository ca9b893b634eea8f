"""A station that moves at 0.3 m/s: how far off it the boat is, with its velocity known to the controller and not.

    python -m bench.moving_station [--seeds 31 35] [--controllers lagnet-mpc nnsem-mpc] [--json FILE] [--set KEY=VALUE]

The simulated WAM-V in a wind toward north, with gusts and noise, the receiver's slow error off and not looked for. The
station's heading is along the wind or across it, and so is its course. The figures are of the true boat, from `--from`
seconds on, to the station of the same tick. Runs that `--json` holds already are not made again.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from asvhil.backseat.build import build_backseat, build_controller, build_model
from asvhil.config import load_config
from asvhil.controller.protocol import Controller
from asvhil.logs.metrics import motor_figures
from asvhil.machine_code.compiler import use_compiler
from asvhil.simplant.lockstep import Lockstep
from asvhil.study.trials.trial import NO_SLOW_ERROR
from asvhil.types import Control, Estimate, Phase, Station, Wind, changed
from bench.ending import end_in_words
from bench.off_station import off_station

ANGLES_DEG = {"along": 0.0, "across": 90.0}


class Unaware:
    """A controller that is given where its station is in each step, and not that it moves: as it was before."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control:
        return self._controller.step(estimate, wind, changed(station, vn_mps=0.0, ve_mps=0.0))

    def new_station(self) -> None:
        self._controller.new_station()

    def reset(self) -> None:
        self._controller.reset()


def run(case: dict[str, Any], overrides: tuple[str, ...], window_s: tuple[float, float]) -> dict[str, Any]:
    """Mean, standard deviation and largest distance (m), heading error (deg) and the motors' work of one case."""
    settings = (
        f"controller.name={case['controller']}",
        f"plant.seed={case['seed']}",
        f"plant.weather.wind.speed_mps={case['wind_mps']}",
        "plant.weather.wind.toward_deg=0",
        f"supervisor.station.heading_deg={ANGLES_DEG[case['heading']]}",
        f"supervisor.station.speed_mps={case['speed_mps']}",
        f"supervisor.station.course_deg={ANGLES_DEG[case['course']]}",
    )
    config = load_config("sitl", (*NO_SLOW_ERROR, *settings, *overrides))
    loop = Lockstep(config)
    if not case["known"]:
        model = build_model(config)
        loop.backseat = build_backseat(config, model=model, controller=Unaware(build_controller(config, model)))
    distances, headings, commands, held, moving = [], [], [], 0, 0
    from_s, to_s = window_s
    for tick in range(round(to_s * config.daemon.tick_hz)):
        _, outputs = loop.tick()
        t_s, station, frame = tick / config.daemon.tick_hz, outputs.station, loop.backseat.frame
        if t_s < from_s:
            continue
        held += outputs.phase is Phase.HOLD
        if station is None or frame is None:
            continue
        moving += station.moves
        distance_m, off_deg = off_station(loop, station, frame)
        distances.append(distance_m)
        headings.append(off_deg)
        if outputs.control is not None:
            commands.append((t_s, *outputs.control.command, 1.0))
    ticks = (to_s - from_s) * config.daemon.tick_hz
    motors = motor_figures(np.array(commands))
    return case | {
        "mean_m": fmean(distances),
        "std_m": float(np.std(distances)),
        "max_m": max(distances),
        "heading_mean_deg": fmean(headings),
        "heading_std_deg": float(np.std(headings)),
        "reversals_per_min": None if motors is None else motors["reversals_per_min_most"],
        "saturated_share": None if motors is None else motors["saturated_share"],
        "held": held / ticks,
        "moving": moving / ticks,
    }


def table(runs: list[dict[str, Any]]) -> list[str]:
    """Rows of a Markdown table: the mean over the seeds, and the worst of them."""
    rows = [
        "| controller | velocity | heading | course | mean (m) | worst seed (m) | largest (m) | heading error (deg) |"
    ]
    rows.append("| --- | --- | --- | --- | --- | --- | --- | --- |")
    cases: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for one in runs:
        cases.setdefault((one["controller"], one["known"], one["heading"], one["course"]), []).append(one)
    for (controller, known, heading, course), found in sorted(cases.items(), key=str):
        means = [one["mean_m"] for one in found]
        off = [f"{fmean(one[key] for one in found):.1f}" for key in ("heading_mean_deg", "heading_std_deg")]
        cells = [controller, "known" if known else "not known", heading, course, f"{fmean(means):.2f}"]
        cells += [f"{max(means):.2f}", f"{max(one['max_m'] for one in found):.2f}", f"{off[0]} ± {off[1]}"]
        rows.append(f"| {' | '.join(cells)} |")
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs=2, default=(31, 35), metavar=("FIRST", "LAST"))
    parser.add_argument("--controllers", nargs="+", default=["lagnet-mpc", "nnsem-mpc"])
    parser.add_argument("--known", nargs="+", default=["yes", "no"], choices=("yes", "no"))
    parser.add_argument("--headings", nargs="+", default=list(ANGLES_DEG), choices=ANGLES_DEG)
    parser.add_argument("--courses", nargs="+", default=list(ANGLES_DEG), choices=ANGLES_DEG)
    parser.add_argument("--wind", type=float, default=4.0, metavar="M/S")
    parser.add_argument("--speed", type=float, default=0.3, metavar="M/S", help="of the station")
    parser.add_argument("--from", type=float, default=90.0, dest="from_s", metavar="S")
    parser.add_argument("--to", type=float, default=240.0, dest="to_s", metavar="S")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    use_compiler()
    runs: list[dict[str, Any]] = []
    if asked.json is not None and asked.json.exists():
        runs = json.loads(asked.json.read_text(encoding="utf-8"))["runs"]
    first, last = asked.seeds
    cases = [
        {
            "controller": controller, "known": known == "yes", "heading": heading, "course": course,
            "seed": seed, "wind_mps": asked.wind, "speed_mps": asked.speed,
        }
        for seed in range(first, last + 1)
        for controller in asked.controllers
        for known in asked.known
        for heading in asked.headings
        for course in asked.courses
    ]  # fmt: skip
    for case in cases:
        if any(case.items() <= one.items() for one in runs):
            continue
        one = run(case, tuple(asked.set), (asked.from_s, asked.to_s))
        runs.append(one)
        print(" ".join(f"{key}={value:.3g}" if isinstance(value, float) else f"{value}" for key, value in one.items()))
        if asked.json is not None:
            window = json.dumps({"from_s": asked.from_s, "to_s": asked.to_s, "set": asked.set})[:-1]
            rows = ",\n".join(json.dumps(row) for row in runs)
            part = asked.json.with_suffix(".part")
            part.write_text(f'{window}, "runs": [\n{rows}\n]}}\n', encoding="utf-8")
            os.replace(part, asked.json)
    print("\n".join(table([one for one in runs if any(case.items() <= one.items() for case in cases)])))


if __name__ == "__main__":
    end_in_words(main)
