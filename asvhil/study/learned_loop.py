"""Learned models in closed loop against physics models with the true parameters and with wrong ones, under
circumstances that are kind to wrong models and others that are not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from asvhil.config import VesselConfig, load_config
from asvhil.study.boat_bounds import STARTS, bounds_of_boats
from asvhil.study.circumstances import AS_SHIPPED, circumstances
from asvhil.study.comparison import Held, Scores, compare, run_setups, vessel_override
from asvhil.study.robustness import crude_vessel
from asvhil.study.rows import FROM_S, ROWS, TO_S, Keys, title
from asvhil.study.runner import Run
from asvhil.study.six_tests import MAIN, cost_figures
from asvhil.study.statistics import count_of_seeds, in_digits, mean_ci95, other_code, plus_minus

LEARNED = (MAIN, "NNSEM-MPC", "SD-MPC (fitted)")
TRUE = "SD-MPC (true)"
CRUDE = "SD-MPC (crude)"
OFF = 0.3
OFF_NAME = "SD-MPC (30 % off, pattern"
PATTERNS = 4
COEFFICIENTS = (  # all that the physics model has but its geometry and the motors' lag; thrust is the whole curve's
    "mass_kg",
    "added_mass_surge_kg",
    "added_mass_sway_kg",
    "inertia_yaw_kgm2",
    "added_inertia_yaw_kgm2",
    "surge_drag_n_per_mps",
    "surge_drag_n_per_mps2",
    "sway_drag_n_per_mps",
    "sway_drag_n_per_mps2",
    "yaw_drag_nm_per_radps",
    "yaw_drag_nm_per_radps2",
    "wind_surge_n_per_mps2",
    "wind_sway_n_per_mps2",
    "wind_yaw_nm_per_mps2",
    "thrust_curve",
)


def signs(pattern: int) -> dict[str, float]:
    """1.3 or 0.7 for each coefficient: alternating along an order that the pattern's number, as a seed, draws."""
    order = np.random.default_rng(pattern).permutation(len(COEFFICIENTS)).tolist()
    return {COEFFICIENTS[place]: 1.0 + (OFF if i % 2 == 0 else -OFF) for i, place in enumerate(order)}


def off_vessel(vessel: VesselConfig, pattern: int) -> VesselConfig:
    """The vessel with every coefficient 30 % off."""
    update: dict[str, Any] = {}
    for name, factor in signs(pattern).items():
        if name == "thrust_curve":
            update[name] = tuple((command, factor * thrust_n) for command, thrust_n in vessel.thrust_curve)
        else:
            update[name] = factor * getattr(vessel, name)
    return vessel.model_copy(update=update)


def off_name(pattern: int) -> str:
    return f"{OFF_NAME} {pattern})"


def study_learned_loop(
    run: Run,
    *,
    learned: Mapping[str, Keys],
    under: Iterable[str] = (AS_SHIPPED,),
    rows: Iterable[str] = tuple(ROWS),
    seeds: Iterable[int] = (1, 2, 3, 4, 5),
    patterns: int = PATTERNS,
    starts: int = STARTS,
    window_s: tuple[float, float] = (FROM_S, TO_S),
    base: str = "sitl",
    overrides: Keys = (),
) -> dict[str, Any]:
    """Each of `learned` (all its config keys, by name) beside SD-MPC with the physics of the simulated boat, a crude
    guess and, as shipped, each wrong pattern of those of the config, in each row, under each circumstance of `under` by
    name.

    `starts` are those of the search for each bound, which regrets are ratios to.
    """
    rows, seeds, numbers = list(rows), list(seeds), range(1, patterns + 1)
    known = circumstances(base, overrides)
    vessel = load_config(base, overrides).vehicle.vessel
    physics = (*overrides, "controller.name=sd-mpc")
    beliefs = {CRUDE: crude_vessel(vessel)} | {off_name(n): off_vessel(vessel, n) for n in numbers}
    wrong = {name: (*physics, vessel_override(believed)) for name, believed in beliefs.items()}
    setups: dict[str, Keys] = {}
    names: dict[str, list[str]] = {}
    for under_what in under:
        keys = known[under_what]
        true = (*physics, vessel_override(load_config(base, (*overrides, *keys)).plant_vessel))
        tried = [*learned, TRUE, *(wrong if under_what == AS_SHIPPED else [CRUDE])]
        names[under_what] = tried
        controllers = {**learned, TRUE: true, **wrong}
        setups |= {_setup(under_what, name): (*controllers[name], *keys) for name in tried}
    scores, held, finished = run_setups(run, setups, rows, seeds, window_s, base=base)
    bounds = bounds_of_boats(run, [known[name] for name in under], rows, starts, base, overrides)
    return {
        "window_s": list(window_s),
        "seeds": list(seeds),
        "patterns": {str(n): signs(n) for n in numbers},
        "under": {
            name: {row: _cell(name, row, names[name], scores, held, bounds[known[name], row]) for row in rows}
            for name in under
        },
        "cost": cost_figures(finished),
    }


def _setup(under_what: str, controller: str) -> str:
    return f"{controller}, {under_what}"


def _cell(
    under_what: str, row: str, names: list[str], scores: Scores, held: Held, bound: float | None
) -> dict[str, Any]:
    """Scores of all controllers in one row, and how the main one, the first, compares.

    Runs that had not the motors all the time are the worst of all: such a controller has no score.
    """
    of = {name: scores[_setup(under_what, name), row] for name in names}
    whole = [name for name in names if held[_setup(under_what, name), row] >= 1.0]
    cell: dict[str, Any] = {
        "bound": bound,
        "controllers": {
            name: {
                "ps": mean_ci95(list(of[name].values())) if name in whole else None,
                "by_seed": {str(seed): value for seed, value in of[name].items()},
                "held": held[_setup(under_what, name), row],
            }
            for name in names
        },
        "verdict": None,
    }
    main = names[0]
    if main not in whole:
        return cell
    own = mean_ci95(list(of[main].values()))["mean"]
    best = min((name for name in whole if name != TRUE), key=lambda name: sum(of[name].values()))
    against = compare(of[main], of[best])["difference"]
    cell["verdict"] = {
        "best": best,
        "lowest": best == main or against["mean"] <= (against["ci95"] or 0.0),
        "below_crude": CRUDE not in whole or own < mean_ci95(list(of[CRUDE].values()))["mean"],
        "below_off": [
            n
            for n in names
            if n.startswith(OFF_NAME) and (n not in whole or own < mean_ci95(list(of[n].values()))["mean"])
        ],
        "to_true": compare(of[main], of[TRUE])["ratio"] if TRUE in whole else None,
        "regret": None if bound is None else own / bound,
    }
    return cell


def markdown(study: Mapping[str, Any]) -> str:
    """A table for each circumstance, a row for each wind, and the factors of each pattern."""
    patterns = study["patterns"]
    from_s, to_s = study["window_s"]
    about = (
        f"Penalty scores against the truth over [{from_s:g}, {to_s:g}] s, {count_of_seeds(study['seeds'])}: "
        "means with half of their 95 % interval. All share solver, weights and horizon, as they are set for learned "
        "models. True: the physics of the simulated boat itself, which nobody has of a real one; crude: a guess from "
        f"mass, arm and thrust curve; 30 % off: every coefficient, in {len(patterns)} patterns (lowest and highest "
        f"score; as shipped alone). The verdict is on {MAIN}: whether it is the lowest but for the true physics, or "
        "within the interval of the difference to the lowest; whether it is below the crude guess, and below how many "
        "patterns; its ratio to the true physics, and to the bound of that boat in that wind. Let go: without the "
        "motors for a part of the window, which is no score."
    )
    parts = [about]
    for name, rows in study["under"].items():
        learned = [one for one in next(iter(rows.values()))["controllers"] if one in LEARNED]
        heads = [
            "test",
            *learned,
            "true",
            "crude",
            "30 % off",
            "lowest",
            "below crude",
            "below off",
            "to true",
            "regret",
        ]
        lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * len(heads)]
        lines += [_line(row, cell, learned, len(patterns)) for row, cell in rows.items()]
        parts += [f"### {name[0].upper()}{name[1:]}", "\n".join(lines)]
    heads = [f"pattern {number}" for number in patterns]
    factors = ["| coefficient | " + " | ".join(heads) + " |", "| --- |" + " --- |" * len(heads)]
    for name in COEFFICIENTS:
        factors.append(f"| {name} | " + " | ".join(f"{patterns[number][name]:.1f}" for number in patterns) + " |")
    words = "### Factors of the wrong parameters\n\nOf `thrust_curve`: of every thrust in it."
    return "\n\n".join([*parts, *other_code(study["cost"]["runs_of_other_code"]), words, "\n".join(factors)]) + "\n"


def _line(row: str, cell: Mapping[str, Any], learned: Iterable[str], patterns: int) -> str:
    def score(name: str) -> str:
        figure = cell["controllers"][name]["ps"]
        return "let go" if figure is None else plus_minus(figure)

    off = [part["ps"] for name, part in cell["controllers"].items() if name.startswith(OFF_NAME)]
    means = sorted(math.inf if figure is None else figure["mean"] for figure in off)
    ends = (means[0], means[-1]) if means else ()
    spread = " to ".join("let go" if math.isinf(mean) else f"{mean:.2f}" for mean in ends) or "-"
    verdict = cell["verdict"]
    told = ["-"] * 5
    if verdict is not None:
        told = [
            "yes" if verdict["lowest"] else f"**no**, {verdict['best']}",
            _yes(verdict["below_crude"]),
            f"{len(verdict['below_off'])} of {patterns}" if off else "-",
            in_digits(verdict["to_true"]),
            in_digits(verdict["regret"]),
        ]
    return "| " + " | ".join([title(row), *map(score, learned), score(TRUE), score(CRUDE), spread, *told]) + " |"


def _yes(met: bool) -> str:
    return "yes" if met else "**no**"
