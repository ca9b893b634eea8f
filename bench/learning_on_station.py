"""Learning on station: what it gains on boats that are not the model's, and what it costs on the one that is.

    python -m bench.learning_on_station RUNS [--part PART] [--seeds 21 22] [--winds judging] [--case NAME]
        [--window 600 900] [--json FILE]

Part `gains`: each changed boat, and the unchanged one, in each wind with the shipped model as it is (frozen), with
learning, and with the right model, all with the default controller of the boat's config: penalty scores of minutes 10
to 15, or of another `--window` (s). The right model has the factors that the change is made of, exactly where it is a
change of thrust; that of the boat with another one's model is its own. Part `elsewhere`: the unchanged boat in rows of
the six tests, with faults and glitches, frozen and learning from the start on, over the tests' own window.

Runs are kept in the folder RUNS and not made again. The constants were chosen by the winds `tuning`; the page has those
of `judging`, which chose nothing.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from asvhil.config import VesselConfig, find_shipped, load_config
from asvhil.dynamics.weights import read_model, save_model
from asvhil.study.circumstances import TRUE_VESSEL
from asvhil.study.comparison import vessel_override
from asvhil.study.robustness import NO_SENSOR
from asvhil.study.rows import FROM_S, TO_S, row_overrides, trial_job
from asvhil.study.runner import Job, run_into
from asvhil.study.safety_cases import CHOP, MODERATE, heavy, weak, wind_keys
from asvhil.study.trials.trial import NO_SLOW_ERROR, run_named_trial
from bench.ending import end_in_words

Keys = tuple[str, ...]
WINDS: dict[str, tuple[tuple[float, float], ...]] = {  # m/s, toward degrees; the station's heading is north
    "tuning": ((3.0, 90.0), (6.0, 90.0)),
    "judging": ((5.0, 110.0), (6.0, -60.0), (4.0, 200.0)),
}
WINDOW_S = (600.0, 900.0)
LEARNING: Keys = ("learning.enabled=true",)
ARMS = ("frozen", "learning", "right")
ABOVE, GAIN, WORSE = 1.20, 0.85, 1.03  # frozen over right, from which on learning over frozen is to be at most; else
OTHER = "another boat's model"


def right_keys(factors: Sequence[float]) -> Keys:
    """The model with these factors, and nothing learned."""
    return (
        *LEARNING,
        "learning.adapt=false",
        "learning.responses=true",
        f"learning.start={[round(factor, 4) for factor in factors]}",
    )


def of_mass(vessel: VesselConfig, heavier: VesselConfig) -> tuple[float, ...]:
    """The factors of a boat with another mass and inertia: its responses."""
    return (1.0, 1.0, *(a / b for a, b in zip(_inertia(vessel), _inertia(heavier), strict=True)))


def _inertia(vessel: VesselConfig) -> tuple[float, float, float]:
    return (
        vessel.mass_kg + vessel.added_mass_surge_kg,
        vessel.mass_kg + vessel.added_mass_sway_kg,
        vessel.inertia_yaw_kgm2 + vessel.added_inertia_yaw_kgm2,
    )


def boats(folder: Path) -> dict[str, tuple[str, Keys, Keys, Keys]]:
    """Of each boat by its name: base, keys of all its runs, keys of the shipped model, and of the right one."""
    vessel = load_config("sitl").vehicle.vessel

    def plant(change: dict[str, Any]) -> Keys:
        return (vessel_override(vessel.model_copy(update=change), TRUE_VESSEL),)

    heavier = vessel.model_copy(update=heavy(vessel))
    borrowed = folder / "blueboat-as-bream.npz"
    own = read_model(find_shipped("blueboat-lagnet", "models", ".npz", "model"))
    save_model(borrowed, dataclasses.replace(own, vehicle="bream", hull={}))
    return {
        "as shipped": ("sitl", (), (), right_keys((1.0,) * 5)),
        "thrust x 0.7": ("sitl", plant(weak(vessel)), (), right_keys((0.7, 0.7, 1.0, 1.0, 1.0))),
        "mass + 40 %": ("sitl", plant(heavy(vessel)), (), right_keys(of_mass(vessel, heavier))),
        "port motor at 70 %": ("sitl", ("plant.motors={port_thrust: 0.7}",), (), right_keys((0.7, 1.0, 1.0, 1.0, 1.0))),
        OTHER: ("sitl-bream", (), (f"controller.model={borrowed}",), ()),
    }


def gains_jobs(
    folder: Path,
    winds: Sequence[tuple[float, float]],
    seeds: Sequence[int],
    only: Sequence[str],
    window_s: tuple[float, float],
) -> dict[tuple[str, str, int, str], Job]:
    """A run of each boat, wind, seed and arm."""
    jobs = {}
    for name, (base, own, shipped, right) in boats(folder).items():
        if only and name not in only:
            continue
        arms = {"frozen": shipped, "learning": (*shipped, *LEARNING), "right": right}
        if name == "as shipped":
            del arms["right"]  # it is the shipped one
        for seed in seeds:
            for speed_mps, toward_deg in winds:
                wind = f"{speed_mps:g} m/s toward {toward_deg:g}\u00b0"
                for arm, keys in arms.items():
                    all_keys = (*NO_SLOW_ERROR, *wind_keys(speed_mps, toward_deg, seed), *own, *keys)
                    jobs[name, wind, seed, arm] = trial_job(name, base, all_keys, window_s)
    return jobs


ELSEWHERE: dict[str, tuple[str, Keys]] = {  # row and keys
    "test 2": ("2", ()),
    "test 3": ("3", ()),
    "test 5": ("5", ()),
    "test 6": ("6", ()),
    "diagonal": ("diagonal", ()),
    "test 6, glitches": ("6", ("plant.glitches={from_s: 10}",)),
    "test 6, compass jumps": ("6", ("plant.faults=[{kind: heading-jump, from_s: 120, until_s: 140}]",)),
    "test 6, GNSS jumps": ("6", ("plant.faults=[{kind: gnss-jump, from_s: 120, until_s: 140}]",)),
    "test 6, anemometer stuck": ("6", ("plant.faults=[{kind: anemometer-stuck, from_s: 120, until_s: 180}]",)),
    "test 5, no wind sensor": ("5", NO_SENSOR),
    "test 5, chop": ("5", CHOP),
    "test 5, current of 0.3 m/s": ("5", MODERATE),
}


def elsewhere_jobs(seeds: Sequence[int], only: Sequence[str]) -> dict[tuple[str, str, int, str], Job]:
    """A run of each circumstance and seed, frozen and learning."""
    return {
        (name, "", seed, arm): trial_job(name, "sitl", (*row_overrides(row, seed), *keys, *added), (FROM_S, TO_S))
        for name, (row, keys) in ELSEWHERE.items()
        if not only or name in only
        for seed in seeds
        for arm, added in (("frozen", ()), ("learning", LEARNING))
    }


def table(jobs: dict[tuple[str, str, int, str], Job], runs: Path) -> list[dict[str, Any]]:
    """A row for each boat and wind: mean scores of the arms over the seeds, and the verdict."""
    finished = run_into(runs / "trials.jsonl", workers=0)(run_named_trial, list(jobs.values()))
    scores: dict[tuple[str, str], dict[str, list[float]]] = {}
    held: dict[tuple[str, str], float] = {}
    for (name, wind, _, arm), result in zip(jobs, finished.results, strict=True):
        scores.setdefault((name, wind), {}).setdefault(arm, []).append(result["truth"]["penalty_score"])
        held[name, wind] = min(held.get((name, wind), 1.0), result["held"])
    return [_row(name, wind, arms, held[name, wind]) for (name, wind), arms in scores.items()]


def _row(name: str, wind: str, arms: dict[str, list[float]], held: float) -> dict[str, Any]:
    means = {arm: sum(values) / len(values) for arm, values in arms.items()}
    to_right = means["frozen"] / means["right"] if "right" in means else None
    ratio = means["learning"] / means["frozen"]
    asked = GAIN if to_right is not None and to_right > ABOVE else WORSE
    return {
        "boat": name,
        "wind": wind,
        "ps": means,
        "by_seed": arms,
        "frozen_to_right": to_right,
        "learning_to_frozen": ratio,
        "asked_at_most": asked,
        "met": ratio <= asked,
        "held": held,
    }


def show(rows: Sequence[dict[str, Any]]) -> str:
    """The rows as a table of Markdown."""
    lines = [
        "| boat | wind | frozen | learning | right | frozen/right | learning/frozen | asked | met |",
        "|" + " --- |" * 9,
    ]
    for row in rows:
        ps = (f"{row['ps'][arm]:.2f}" if arm in row["ps"] else "" for arm in ARMS)
        to_right = "" if row["frozen_to_right"] is None else f"{row['frozen_to_right']:.2f}"
        met = "yes" if row["met"] else "**no**"
        figures = [to_right, f"{row['learning_to_frozen']:.3f}", f"at most {row['asked_at_most']:.2f}", met]
        lines.append("| " + " | ".join([row["boat"], row["wind"], *ps, *figures]) + " |")
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m bench.learning_on_station")
    parser.add_argument("runs", type=Path)
    parser.add_argument("--part", choices=("gains", "elsewhere"), default="gains")
    parser.add_argument("--winds", choices=tuple(WINDS), default="judging")
    parser.add_argument("--seeds", type=int, nargs="+", default=[21, 22])
    parser.add_argument("--case", action="append", default=[], help="one by its name; repeatable")
    parser.add_argument("--wind", type=int, action="append", default=[], help="one of --winds by its number from 1")
    parser.add_argument("--window", type=float, nargs=2, default=list(WINDOW_S), help="of part gains, s")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args(arguments)
    given.runs.mkdir(parents=True, exist_ok=True)
    if given.part == "gains":
        window_s = (given.window[0], given.window[1])
        winds = [wind for number, wind in enumerate(WINDS[given.winds], 1) if number in given.wind or not given.wind]
        jobs = gains_jobs(given.runs, winds, given.seeds, given.case, window_s)
    else:
        window_s = FROM_S, TO_S
        jobs = elsewhere_jobs(given.seeds, given.case)
    rows = table(jobs, given.runs)
    print(show(rows))
    if given.json is not None:
        figures = {"part": given.part, "winds": given.winds, "seeds": given.seeds, "window_s": window_s, "rows": rows}
        given.json.write_text(json.dumps(figures, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    end_in_words(lambda: main(sys.argv[1:]))
