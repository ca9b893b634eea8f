"""A heading that follows the weather, against a fixed one across the wind: how still a boat lies, and for what thrust.

    python -m bench.weather_heading [-o docs/results] [--seeds 51 55] [--json FILE] [--quick] [--confirm N]
        [--set KEY=VALUE]

The simulated WAM-V with the default controller, the receiver's slow error off and not looked for. Three kinds of runs:
`bow` in a steady wind with gusts, without and with a current across it, without and with waves; `fixed`, of the first
seed, in the same weather with the heading across the wind; `veer`, where the wind turns by 90 degrees in 5 minutes. The
figures are of the true boat from 60 s on; the turn is that of the station's heading from 90 s on, when the first one is
over. The runs are kept in weather-heading.jsonl in the folder of -o, and not made again.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from contextlib import ExitStack
from pathlib import Path
from statistics import fmean
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from asvhil.config import Config, load_config
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.rigid_body import RigidBody
from asvhil.files import write_text
from asvhil.geo import ned_to_body
from asvhil.logs.metrics import motor_figures
from asvhil.machine_code.compiler import use_compiler
from asvhil.simplant.lockstep import Lockstep
from asvhil.study.made_of import made_of, mark_of, run_files
from asvhil.study.page import write_page
from asvhil.study.runner import Job, run_jobs
from asvhil.study.safety_cases import CHOP
from asvhil.study.trials.trial import NO_SLOW_ERROR, run_key
from asvhil.types import Phase
from bench.ending import end_in_words
from bench.off_station import off_station
from bench.weather_heading_figure import draw

WINDS_MPS, CURRENTS_MPS, VEERING_MPS = (2, 4, 6, 8, 10), (0.0, 0.2, 0.4), (2, 6, 10)
TOWARD_DEG, CURRENT_TOWARD_DEG, ACROSS_DEG = 90.0, 0.0, 0.0
FROM_S, TURNED_S, MINUTE_S = 60.0, 90.0, 60.0
TO_S = {"bow": 150.0, "fixed": 120.0, "veer": 420.0}
VEER_FROM_S, VEER_S, VEER_DEG = 90.0, 300.0, 90.0
ASKED_RATIO, ASKED_TURN_DEG, ASKED_VEER_M = 1.0 / 20.0, 10.0, 1.5
Run = dict[str, Any]


def asked_mean_m(wind_mps: float) -> float:
    """The mean distance (m) that is asked for in a wind."""
    return 0.5 if wind_mps <= 6.0 else 0.9


def cases(seeds: range, *, quick: bool = False) -> list[Run]:
    """What is run, in the order in which it is."""
    winds, currents = ((6,), (0.4,)) if quick else (WINDS_MPS, CURRENTS_MPS)
    weathers = [
        {"wind_mps": wind, "current_mps": current, "waves": waves}
        for wind in winds
        for current in currents
        for waves in ((True,) if quick else (False, True))
    ]
    veers = [{"wind_mps": wind, "current_mps": 0.0, "waves": True} for wind in (() if quick else VEERING_MPS)]
    found = [{"kind": "fixed", "seed": seeds[0]} | weather for weather in weathers]
    for seed in seeds:
        found += [{"kind": "bow", "seed": seed} | weather for weather in weathers]
        found += [{"kind": "veer", "seed": seed} | weather for weather in veers]
    return found


def config_of(case: Run, overrides: tuple[str, ...] = ()) -> Config:
    """The config of a case."""
    settings = (
        f"plant.seed={case['seed']}",
        f"plant.weather.wind.speed_mps={case['wind_mps']}",
        f"plant.weather.wind.toward_deg={TOWARD_DEG}",
        f"plant.weather.current.speed_mps={case['current_mps']}",
        f"plant.weather.current.toward_deg={CURRENT_TOWARD_DEG}",
        f"supervisor.station.heading_deg={ACROSS_DEG}",
        f"supervisor.heading.policy={'fixed' if case['kind'] == 'fixed' else 'bow'}",
    )
    return load_config("sitl", (*NO_SLOW_ERROR, *(CHOP if case["waves"] else ()), *settings, *overrides))


def run(case: Run, overrides: tuple[str, ...] = (), to_s: float | None = None, from_s: float = FROM_S) -> Run:
    """A case with its figures: distance (m), thrust squared (N^2), turns and heading errors (deg), share held."""
    config = config_of(case, overrides)
    loop, end_s = Lockstep(config), TO_S[case["kind"]] if to_s is None else to_s
    rows, turned, commands = [], [], []
    for tick in range(round(end_s * config.daemon.tick_hz)):
        t_s = tick / config.daemon.tick_hz
        if case["kind"] == "veer":
            share = min(max((t_s - VEER_FROM_S) / VEER_S, 0.0), 1.0)
            loop.plant.weather.set_wind(case["wind_mps"], TOWARD_DEG + share * VEER_DEG)
        _, outputs = loop.tick()
        station, frame = outputs.station, loop.backseat.frame
        if t_s < from_s:
            continue
        if station is None or frame is None or outputs.phase is not Phase.HOLD:
            break
        port_n, starboard_n = loop.plant.truth.thrust_n
        distance_m, off_deg = off_station(loop, station, frame)
        rows.append((distance_m, 0.5 * (port_n**2 + starboard_n**2), off_deg))
        if t_s >= max(TURNED_S, from_s):
            turned.append(station.psi_rad)
        if outputs.control is not None:
            commands.append((t_s, *outputs.control.command, 1.0))
    held = len(rows) / (round(end_s * config.daemon.tick_hz) - round(from_s * config.daemon.tick_hz))
    if not rows:
        return case | {"held": 0.0}
    distance, thrust_n2, off = np.array(rows).T
    motors = motor_figures(np.array(commands))
    return case | {
        "mean_m": float(distance.mean()),
        "max_m": float(distance.max()),
        "thrust_n2": float(thrust_n2.mean()),
        "turn_deg": turn_deg(np.array(turned), config.daemon.tick_hz),
        "off_deg": float(np.abs(off).mean()),
        "reversals_per_min": motors["reversals_per_min_most"],
        "held": held,
    }


def turn_deg(psi_rad: Array, hz: float) -> float:
    """The largest span (deg) of a heading, sampled at hz, within any minute; of less than one, within all there is."""
    heading, minute = np.degrees(np.unwrap(psi_rad)), round(MINUTE_S * hz)
    starts = range(0, max(len(heading) - minute, 0) + 1, max(1, round(hz)))
    return max((float(np.ptp(heading[start : start + minute])) for start in starts if len(heading)), default=0.0)


def floor_n2(config: Config) -> float:
    """The least thrust squared (N^2, mean of both motors) that holds the boat with its bow to the mean weather.

    Of the headings at which the side force on the boat at rest changes its sign, the one with the force from ahead; the
    motors then bear the force along and the yaw moment. Without gusts.
    """
    vessel, weather = config.believed_vessel, config.plant.weather
    body, force_n = RigidBody(vessel), 2.0 * vessel.motor_arm_m
    m_u = vessel.mass_kg + vessel.added_mass_surge_kg
    m_r = vessel.inertia_yaw_kgm2 + vessel.added_inertia_yaw_kgm2

    def pushed(psi_rad: float) -> tuple[float, float, float]:
        wind, water = (
            ned_to_body(psi_rad, at.speed_mps * math.cos(way), at.speed_mps * math.sin(way))
            for at in (weather.wind, weather.current)
            for way in (math.radians(at.toward_deg),)
        )
        u_dot, v_dot, r_dot = body.acceleration(-water[0], -water[1], 0.0, *body.wind_forces(*wind))
        return m_u * u_dot, v_dot, m_r * r_dot

    headings = np.radians(np.arange(0.0, 360.0, 0.05)).tolist()
    pushes = [pushed(psi_rad) for psi_rad in headings]
    from_ahead = [
        (0.5 * x_n) ** 2 + (n_nm / force_n) ** 2
        for (x_n, before, n_nm), (_, after, _) in zip(pushes, [*pushes[1:], pushes[0]], strict=True)
        if x_n < 0.0 and before * after <= 0.0
    ]
    return min(from_ahead)


def table(runs: list[Run], overrides: tuple[str, ...] = ()) -> list[str]:
    """Of each weather the mean over the seeds, the worst seed, the thrust beside the fixed heading's, and the floor."""
    heads = (
        *("wind (m/s)", "current (m/s)", "waves", "seeds", "mean distance, worst seed (m)", "thrust squared (N²)"),
        *("of the fixed heading's", "floor of that", "turn in a minute, worst (°)", "heading off (°)"),
        "fixed: mean distance (m)",
    )
    rows = [f"| {' | '.join(heads)} |", "| --- " * len(heads) + "|"]
    weathers: dict[tuple[Any, ...], dict[str, list[Run]]] = {}
    for one in runs:
        if one["kind"] != "veer":
            of = weathers.setdefault((one["wind_mps"], one["current_mps"], one["waves"]), {"bow": [], "fixed": []})
            of[one["kind"]].append(one)
    for (wind_mps, current_mps, waves), of in sorted(weathers.items()):
        bow = [one for one in of["bow"] if one["held"] == 1.0]
        if not bow:
            continue
        fixed = [one for one in of["fixed"] if one["held"] == 1.0]
        thrust_n2 = fmean(one["thrust_n2"] for one in bow)
        ratios = ["driven off" if of["fixed"] else "", ""]
        if fixed:
            fixed_n2 = fmean(one["thrust_n2"] for one in fixed)
            ratios = [f"1/{fixed_n2 / part:.0f}" for part in (thrust_n2, floor_n2(config_of(bow[0], overrides)))]
        means = [one["mean_m"] for one in bow]
        cells = [f"{wind_mps}", f"{current_mps}", "yes" if waves else "no", f"{len(bow)}"]
        cells += [f"{fmean(means):.2f}, {max(means):.2f}", f"{thrust_n2:.0f}", *ratios]
        cells += [f"{max(one['turn_deg'] for one in bow):.1f}", f"{fmean(one['off_deg'] for one in bow):.1f}"]
        cells += [f"{fmean(one['mean_m'] for one in fixed):.2f}" if fixed else ""]
        rows.append(f"| {' | '.join(cells)} |")
    return [*rows, *_veers([one for one in runs if one["kind"] == "veer"])]


def _veers(runs: list[Run]) -> list[str]:
    if not runs:
        return []
    rows = [
        "",
        "| veering wind (m/s) | largest distance of each seed (m) | mean (m) |",
        "| --- | --- | --- |",
    ]
    for wind_mps in sorted({one["wind_mps"] for one in runs}):
        of = [one for one in runs if one["wind_mps"] == wind_mps and one["held"] > 0.0]
        largest = ", ".join(f"{one['max_m']:.2f}" for one in of)
        rows.append(f"| {wind_mps} | {largest} | {fmean(one['mean_m'] for one in of):.2f} |")
    return rows


def verdicts(runs: list[Run]) -> list[str]:
    """Asked against reached, over all runs."""
    bow = [one for one in runs if one["kind"] == "bow"]
    held = [one for one in bow if one["held"] == 1.0]
    rows = ["| asked | reached |", "| --- | --- |", f"| held throughout | {len(held)} of {len(bow)} runs |"]
    for name, winds in (("to 6 m/s", (0.0, 6.0)), ("in 8 and 10 m/s", (6.5, 10.0))):
        of = [one for one in held if winds[0] <= one["wind_mps"] <= winds[1]]
        if of:
            most = asked_mean_m(winds[1])
            good, worst = sum(one["mean_m"] <= most for one in of), max(one["mean_m"] for one in of)
            rows.append(f"| mean distance at most {most} m {name} | {good} of {len(of)} runs, worst {worst:.2f} m |")
    fixed: dict[tuple[Any, ...], list[float]] = {}
    for one in runs:
        if one["kind"] == "fixed" and one["held"] == 1.0:
            fixed.setdefault((one["wind_mps"], one["current_mps"], one["waves"]), []).append(one["thrust_n2"])
    shares = [
        one["thrust_n2"] / fmean(fixed[key])
        for one in held
        if (key := (one["wind_mps"], one["current_mps"], one["waves"])) in fixed
    ]
    if shares:
        good = sum(share <= ASKED_RATIO for share in shares)
        worst = f"mean 1/{1.0 / fmean(shares):.0f}, worst 1/{1.0 / max(shares):.0f}"
        rows.append(f"| thrust squared at most 1/20 of the fixed heading's | {good} of {len(shares)} runs, {worst} |")
    if held:
        turns = [one["turn_deg"] for one in held]
        good = sum(turn <= ASKED_TURN_DEG for turn in turns)
        rows.append(f"| no turn of more than 10° in a minute | {good} of {len(turns)} runs, worst {max(turns):.1f}° |")
    veers = [one for one in runs if one["kind"] == "veer"]
    if veers:
        good = sum(one["held"] == 1.0 and one["max_m"] <= ASKED_VEER_M for one in veers)
        most = max(one.get("max_m", math.inf) for one in veers)
        rows.append(f"| a veer of 90° in 5 minutes within 1.5 m | {good} of {len(veers)} runs, worst {most:.2f} m |")
    return rows


def job_of(case: Run, overrides: tuple[str, ...]) -> Job:
    """A case as a job of the runner; each kind of runs takes its own time."""
    config = config_of(case, overrides)
    return Job(key=f"{case['kind']} {run_key(config)}", group=case["kind"], arguments=(case, overrides))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "-o", type=Path, dest="out", metavar="FOLDER", help="write the page, its JSON and its runs there"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="the figures; by default beside the page")
    parser.add_argument("--seeds", type=int, nargs=2, default=(51, 55), metavar=("FIRST", "LAST"))
    parser.add_argument("--kinds", nargs="+", default=list(TO_S), choices=TO_S)
    parser.add_argument("--quick", action="store_true", help="one weather, the first seed")
    parser.add_argument("--workers", type=int, metavar="N", help="processes; as many as cores by default")
    parser.add_argument(
        "--confirm", type=int, default=0, metavar="N", help="so many stored runs of other code are run again"
    )
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    asked = parser.parse_args()
    overrides = tuple(asked.set)
    wanted = cases(range(asked.seeds[0], asked.seeds[0 if asked.quick else 1] + 1), quick=asked.quick)
    wanted = [case for case in wanted if case["kind"] in asked.kinds]
    use_compiler()
    with ExitStack() as stack:
        folder = asked.out or Path(stack.enter_context(TemporaryDirectory()))
        done = run_jobs(
            run,
            [job_of(case, overrides) for case in wanted],
            folder / "weather-heading.jsonl",
            workers=asked.workers,
            confirm=asked.confirm,
            tell=lambda now: print(f"{now.done} of {now.total}", file=sys.stderr, flush=True),
        )
    text = "\n".join([*verdicts(done.results), "", *table(done.results, overrides)]) + "\n"
    print(text)
    file = asked.json or (None if asked.out is None else asked.out / "weather-heading.json")
    if file is not None:
        rows = ",\n".join(json.dumps(row) for row in done.results)
        write_text(file, f'{{"set": {json.dumps(asked.set)}, "runs": [\n{rows}\n]}}\n')
    if asked.out is not None:
        parts = made_of(("simplant/lockstep.py",), run_files("sitl", overrides))
        draw(done.results, lambda one: floor_n2(config_of(one, overrides)), asked.out / "weather-heading.png")
        text += "\n![Distance and thrust of each run](weather-heading.png)\n"
        mark = mark_of(parts, done.outdated, done.again, done.changed)
        write_page(asked.out / "weather-heading.md", text, mark)


if __name__ == "__main__":
    end_in_words(main)
