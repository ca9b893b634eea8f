"""The default controller on boats that have changed, with the unchanged boat's model and with one trained on each."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from asvhil.config import load_config
from asvhil.study.boat_bounds import STARTS, bounds_of_boats
from asvhil.study.circumstances import circumstances
from asvhil.study.comparison import run_setups
from asvhil.study.rows import FROM_S, ROWS, TO_S, Keys, title
from asvhil.study.runner import Run
from asvhil.study.six_tests import MAIN, cost_figures
from asvhil.study.statistics import count_of_seeds, in_digits, mean_ci95, other_code, plus_minus

UNCHANGED, OWN = "model of the unchanged boat", "model trained on it"
ASKED = {UNCHANGED: 1.35, OWN: 1.15}  # of the regret across the wind


def study_changed_boats(
    run: Run,
    *,
    unchanged: Keys,
    own: Mapping[str, Path],
    rows: Iterable[str] = tuple(ROWS),
    seeds: Iterable[int] = (1, 2, 3),
    starts: int = STARTS,
    window_s: tuple[float, float] = (FROM_S, TO_S),
    base: str = "sitl",
    overrides: Keys = (),
) -> dict[str, Any]:
    """Scores and regrets of the default controller on each boat in each row, by either model.

    `unchanged` are the controller's config keys with the model of the unchanged boat, `own` the model that was trained
    on each boat, by the boat's name. The regret is the ratio to the bound of that boat in that wind.
    """
    rows, seeds = list(rows), list(seeds)
    known = circumstances(base, overrides)
    setups: dict[str, Keys] = {}
    for boat, model in own.items():
        of = {UNCHANGED: unchanged, OWN: (*unchanged, f"controller.model={model.resolve()}")}
        setups |= {_setup(boat, name): (*keys, *known[boat]) for name, keys in of.items()}
    scores, held, finished = run_setups(run, setups, rows, seeds, window_s, base=base)
    bounds = bounds_of_boats(run, [known[boat] for boat in own], rows, starts, base, overrides)
    return {
        "window_s": list(window_s),
        "seeds": seeds,
        "base": base,
        "vehicle": load_config(base, overrides).vehicle.name,
        "boats": {
            boat: {
                row: {
                    "bound": bounds[known[boat], row],
                    "models": {
                        model: _figures(
                            list(scores[_setup(boat, model), row].values()),
                            held[_setup(boat, model), row],
                            bounds[known[boat], row],
                        )
                        for model in ASKED
                    },
                }
                for row in rows
            }
            for boat in own
        },
        "cost": cost_figures(finished),
    }


def _setup(boat: str, model: str) -> str:
    return f"{boat}, {model}"


def _figures(ps: list[float], held: float, bound: float | None) -> dict[str, Any]:
    """A run without its motors for a part of the window has no score, and the boat was not held."""
    score = mean_ci95(ps) if held >= 1.0 else None
    regret = None if bound is None or score is None else score["mean"] / bound
    return {"ps": score, "by_seed": ps, "held": held, "regret": regret}


def worst_regrets(study: Mapping[str, Any], model: str) -> dict[str, float | None]:
    """The greatest regret of each boat across the wind by one model; None where it was let go in a row, NaN where
    there is no row across the wind.
    """
    found: dict[str, float | None] = {}
    for boat, rows in study["boats"].items():
        cells = [cell["models"][model] for cell in rows.values() if cell["bound"] is not None]
        regrets = [cell["regret"] for cell in cells]
        found[boat] = None if None in regrets else max(regrets, default=math.nan)
    return found


def markdown(study: Mapping[str, Any]) -> str:
    """The worst regrets, and a table for each boat."""
    from_s, to_s = study["window_s"]
    about = (
        f"{MAIN} on boats that are not the one that its model was trained on, {count_of_seeds(study['seeds'])}, scored "
        f"against the truth over [{from_s:g}, {to_s:g}] s: means with half of their 95 % interval. Regret: the score "
        "over the bound of that boat in that steady wind, across the wind alone; along it the bound is zero."
    )
    heads = ["boat", *(f"{model}, worst regret (asked: {asked:g})" for model, asked in ASKED.items())]
    lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * len(heads)]
    worst = {model: worst_regrets(study, model) for model in ASKED}
    for boat in study["boats"]:
        lines.append(f"| {boat} | " + " | ".join(_regret(worst[model][boat], ASKED[model]) for model in ASKED) + " |")
    parts = [about, *other_code(study["cost"]["runs_of_other_code"]), "\n".join(lines)]
    heads = ["test", "bound", *(f"{model}{word}" for model in ASKED for word in ("", ", regret"))]
    for boat, rows in study["boats"].items():
        lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * len(heads)]
        for row, cell in rows.items():
            told = []
            for model in ASKED:
                one = cell["models"][model]
                told += ["let go" if one["ps"] is None else plus_minus(one["ps"]), in_digits(one["regret"])]
            lines.append("| " + " | ".join([title(row), in_digits(cell["bound"]), *told]) + " |")
        parts += [f"### {boat[0].upper()}{boat[1:]}", "\n".join(lines)]
    return "\n\n".join(parts) + "\n"


def _regret(worst: float | None, asked: float) -> str:
    if worst is None:
        return "**let go**"
    return "-" if math.isnan(worst) else f"{worst:.2f}" if worst <= asked else f"**{worst:.2f}**"
