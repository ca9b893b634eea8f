"""Learned models in closed loop against physics models, with the true parameters and with wrong ones."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from asvhil.config import VesselConfig, load_config
from asvhil.study.comparison import compare, held_words, not_held, run_setups, vessel_override
from asvhil.study.rows import FROM_S, TO_S, title
from asvhil.study.runner import Run
from asvhil.study.six_tests import cost_figures
from asvhil.study.statistics import count_of_seeds, other_code, plus_minus

ROWS = ("2", "3")  # 6 m/s along the station's heading, 3 m/s against it
LEARNED = {"NNSEM-MPC": "nnsem-mpc", "LagNet-MPC": "lagnet-mpc"}
TRUE = "SD-MPC (true)"
OFF = 0.3
PATTERNS = 4
NO_WORSE = 1.2
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
    return f"SD-MPC (30 % off, pattern {pattern})"


def study_learned_loop(
    run: Run,
    *,
    learned: Mapping[str, tuple[str, ...]],
    rows: Iterable[str] = ROWS,
    seeds: Iterable[int] = (1, 2, 3, 4, 5),
    patterns: int = PATTERNS,
    window_s: tuple[float, float] = (FROM_S, TO_S),
    base: str = "sitl",
    overrides: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Each of `learned` (all its config keys, by name) against SD-MPC, with the true parameters and each wrong pattern.

    `no_worse` is within 20 % of the true one; `better_than_off` is below the mean over the patterns.
    """
    rows, seeds = list(rows), list(seeds)
    numbers = range(1, patterns + 1)
    physics = (*overrides, "controller.name=sd-mpc")
    vessel = load_config(base, overrides).vehicle.vessel
    setups = {**learned, TRUE: physics}
    setups |= {off_name(n): (*physics, vessel_override(off_vessel(vessel, n))) for n in numbers}
    scores, held, finished = run_setups(run, setups, rows, seeds, window_s, base=base)
    table: dict[str, Any] = {}
    for row in rows:
        true = scores[TRUE, row]
        wrong = [scores[off_name(n), row] for n in numbers]
        mean_off = {seed: sum(part[seed] for part in wrong) / len(wrong) for seed in seeds}
        whole_true = held[TRUE, row] >= 1.0
        whole_off = all(held[off_name(n), row] >= 1.0 for n in numbers)
        line = {}
        for name in learned:
            whole = held[name, row] >= 1.0
            own = scores[name, row]
            against_true, against_off = compare(own, true), compare(own, mean_off)
            line[name] = {
                "against_true": against_true,
                "against_off": against_off,
                "patterns_beaten": sum(sum(own.values()) < sum(part.values()) for part in wrong),
                "no_worse": whole and whole_true and against_true["ratio"] <= NO_WORSE,
                "better_than_off": whole and whole_off and against_off["ratio"] < 1.0,
            }
        off = {off_name(n): compare(part, true) for n, part in zip(numbers, wrong, strict=True)}
        table[row] = {"learned": line, "off": off}
    return {
        "window_s": list(window_s),
        "seeds": list(seeds),
        "patterns": {str(n): signs(n) for n in numbers},
        "rows": table,
        "not_held": not_held(held),
        "cost": cost_figures(finished),
    }


def markdown(study: Mapping[str, Any]) -> str:
    """A row for each controller in each wind, and the factors of each pattern."""
    patterns = study["patterns"]
    lines = [
        "| test | controller | ps | ratio to the true physics | ratio to 30 % off, mean | asked |",
        "|" + " --- |" * 6,
    ]
    for row, part in study["rows"].items():
        for name, cell in part["learned"].items():
            true, off = cell["against_true"], cell["against_off"]
            asked = (
                f"at most {NO_WORSE:g}: {_yes(cell['no_worse'])}; better than 30 % off: "
                f"{_yes(cell['better_than_off'])} ({cell['patterns_beaten']} of {len(patterns)} patterns)"
            )
            lines.append(
                f"| {title(row)} | {name} | {plus_minus(true['ps'])} | {true['ratio']:.3f} | {off['ratio']:.3f} "
                f"| {asked} |"
            )
        true_ps = next(iter(part["off"].values()))["against_ps"]
        lines.append(f"| {title(row)} | {TRUE} | {plus_minus(true_ps)} | 1 | | |")
        for name, cell in part["off"].items():
            lines.append(f"| {title(row)} | {name} | {plus_minus(cell['ps'])} | {cell['ratio']:.3f} | | |")
    heads = [f"pattern {number}" for number in patterns]
    factors = ["| coefficient | " + " | ".join(heads) + " |", "| --- |" + " --- |" * len(heads)]
    for name in COEFFICIENTS:
        factors.append(f"| {name} | " + " | ".join(f"{patterns[number][name]:.1f}" for number in patterns) + " |")
    from_s, to_s = study["window_s"]
    about = (
        f"Penalty scores against the truth over [{from_s:g}, {to_s:g}] s, {count_of_seeds(study['seeds'])}: "
        "means with half of their 95 % interval. All share solver, weights and horizon."
    )
    words = "Factors of the wrong parameters (of `thrust_curve`: of every thrust in it):"
    lost = held_words(study["not_held"], "nothing asked is met with them")
    other = other_code(study["cost"]["runs_of_other_code"])
    return "\n\n".join([about, "\n".join(lines), *lost, *other, words, "\n".join(factors)]) + "\n"


def _yes(met: bool) -> str:
    return "yes" if met else "**no**"
