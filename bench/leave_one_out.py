"""Training recipes on the records of a real boat, judged on each record by a model that was trained on all others.

    python -m bench.leave_one_out RUN.csv ... --columns NAME --vehicle NAME [-o FOLDER] [--recipe NAME] [--json FILE]

Each record is left out in turn: errors of rollouts over it of 50 s, or, where it is too short for one, of the longest
multiple of 5 s that it holds. A record's score is its errors as shares of ASKED, mean over u, v and r; a recipe's is
the geometric mean of its records', which differ by a factor of 20, so that no record decides alone. What is recommended
is the recipe with the lowest score; where the interval of its ratio to a plainer one (one that stands before it here)
holds 1, the plainer one. Runs are kept in FOLDER and not made again.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from asvhil.errors import AsvhilError, LogError
from asvhil.study.made_of import made_of
from asvhil.study.runner import Job, run_into
from asvhil.study.statistics import mean_ci95
from asvhil.train.evaluate import HOLD
from asvhil.train.jobs import DT_S, evaluate_command, train_command
from asvhil.train.options import chosen_options
from bench.ending import end_in_words

HORIZONS_S = tuple(float(seconds) for seconds in range(50, 5, -5))
EVERY_S = 2.0
ASKED = {"u": 0.13, "v": 0.09, "r": 0.05}  # m/s, m/s, rad/s: the first of the three further records'
LONG: Mapping[str, Any] = {"horizon": 10.0, "batch": 32, "width": 24, "moving_share": 0.5, "validation_share": 0.0}
RECIPES: dict[str, tuple[str, Mapping[str, Any]]] = {  # the plainer ones first
    "fitted SD": ("sd", {}),
    "LagNet, plain": ("lagnet", {}),
    "LagNet, nothing held back": ("lagnet", {"validation_share": 0.0}),
    "LagNet, half in motion": ("lagnet", {"moving_share": 0.5, "validation_share": 0.0}),
    "LagNet, four networks": ("lagnet", {"members": 4}),
    "LagNet, windows of 10 s": ("lagnet", {**LONG, "iterations": 4000}),
    "LagNet, robust from SD": (
        "lagnet",
        {**LONG, "iterations": 1500, "members": 2, "from_sd": True, "weight_decay": 1e-5, "robust": 0.03},
    ),
}


def left_out(recipe: str, out: str, others: tuple[str, ...], columns: str, vehicle: str) -> dict[str, Any]:
    """Train by a recipe on the other records and score the one left out; None where it holds no rollout of 10 s."""
    kind, options = RECIPES[recipe]
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "model.npz"
        train_command(
            kind,
            [Path(path) for path in others],
            model,
            columns=columns,
            vehicle=vehicle,
            options=chosen_options(kind, DT_S, **options),
        )
        for horizon_s in HORIZONS_S:
            try:
                found = evaluate_command([model], [Path(out)], columns=columns, horizon_s=horizon_s, every_s=EVERY_S)
            except LogError:
                continue
            (model_row,) = (row for name, row in found["rows"].items() if name != HOLD)
            return {"horizon_s": horizon_s, "model": model_row["all"], "hold": found["rows"][HOLD]["all"]}
    return {"horizon_s": None}


def recommended(scores: Mapping[str, Mapping[str, float]]) -> str:
    """The recipe with the lowest mean score, or a plainer one that is not told from it; scores by recipe and record."""
    best = min(scores, key=lambda name: _mean_log(scores[name].values())["mean"])
    for name in scores:
        if name == best:
            break
        behind = _mean_log(scores[name][record] / scores[best][record] for record in scores[best])
        if behind["ci95"] is None or behind["mean"] <= behind["ci95"]:
            return name
    return best


def _mean_log(values: Iterable[float]) -> dict[str, Any]:
    return mean_ci95([math.log(value) for value in values])


def _mean_ratio(scores: Mapping[str, float], others: Mapping[str, float]) -> dict[str, float | None]:
    """The geometric mean of the ratios to another recipe's scores, and the ends of its 95 % interval."""
    log = _mean_log(scores[record] / others[record] for record in others)
    ends = [None if log["ci95"] is None else math.exp(log["mean"] + sign * log["ci95"]) for sign in (-1.0, 1.0)]
    return {"ratio": math.exp(log["mean"]), "from": ends[0], "to": ends[1]}


def main() -> int:
    parser = argparse.ArgumentParser(prog="bench.leave_one_out", description=__doc__.splitlines()[0])
    parser.add_argument("records", nargs="+", type=Path, metavar="RUN.csv")
    parser.add_argument("--columns", required=True)
    parser.add_argument("--vehicle", required=True)
    parser.add_argument("--recipe", action="append", choices=list(RECIPES), help="repeatable; all by default")
    parser.add_argument("-o", "--output", type=Path, default=Path("runs/leave-one-out"))
    parser.add_argument("--workers", type=int)
    parser.add_argument("--confirm", type=int, default=0, help="stored trainings of older code to make again (0)")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    if len(given.records) < 3:
        raise AsvhilError("at least three records are expected: one is left out, and the others are trained on")
    chosen = given.recipe or list(RECIPES)
    code = hashlib.sha256(json.dumps(made_of(["train/jobs.py"]), sort_keys=True).encode()).hexdigest()[:12]
    names = [(recipe, record) for recipe in chosen for record in given.records]
    jobs = []
    for recipe, record in names:
        others = tuple(str(path) for path in given.records if path != record)
        digest = hashlib.sha256(b"".join(Path(path).read_bytes() for path in (str(record), *others))).hexdigest()[:12]
        key = f"left out {record.stem} {digest} {recipe} {json.dumps(RECIPES[recipe], sort_keys=True)}"
        arguments = (recipe, str(record), others, given.columns, given.vehicle)
        jobs.append(Job(key=key, group=recipe, arguments=arguments, code=code))
    run = run_into(
        given.output / "left-out.jsonl",
        workers=given.workers,
        confirm=given.confirm,
        tell=lambda now: print(f"{now.done} of {now.total}", file=sys.stderr, flush=True),
    )
    results = dict(zip(names, run(left_out, jobs).results, strict=True))
    figures = _figures(results, chosen, given.records)
    if given.json:
        given.json.write_text(json.dumps(figures, indent=1) + "\n")
    print(_markdown(figures))
    return 0


def _figures(results: Mapping[tuple[str, Path], Any], chosen: Sequence[str], records: Sequence[Path]) -> dict[str, Any]:
    errors: dict[str, dict[str, Any]] = {recipe: {} for recipe in chosen}
    hold: dict[str, Any] = {}
    horizons: dict[str, float] = {}
    for (recipe, record), result in results.items():
        if result["horizon_s"] is None:
            continue
        horizons[record.stem] = result["horizon_s"]
        errors[recipe][record.stem] = {axis: result["model"][f"mae_{axis}"] for axis in ASKED}
        hold[record.stem] = {axis: result["hold"][f"mae_{axis}"] for axis in ASKED}
    scores = {
        recipe: {record: sum(one[axis] / ASKED[axis] for axis in ASKED) / len(ASKED) for record, one in part.items()}
        for recipe, part in errors.items()
    }
    best = recommended(scores)
    return {
        "asked": ASKED,
        "horizon_s": horizons,
        "too_short": [record.stem for record in records if record.stem not in horizons],
        "errors": errors,
        "hold": hold,
        "scores": scores,
        "score": {recipe: math.exp(_mean_log(part.values())["mean"]) for recipe, part in scores.items()},
        "to_recommended": {recipe: _mean_ratio(part, scores[best]) for recipe, part in scores.items()},
        "recommended": best,
    }


def _markdown(figures: Mapping[str, Any]) -> str:
    recipes = list(figures["errors"])
    heads = ["record", "rollouts s", *recipes, "hold"]
    lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * len(heads)]
    for record, horizon_s in figures["horizon_s"].items():
        cells = [figures["errors"][recipe][record] for recipe in recipes] + [figures["hold"][record]]
        texts = [" / ".join(f"{cell[axis]:.3f}" for axis in ASKED) for cell in cells]
        lines.append(f"| {record} | {horizon_s:g} | " + " | ".join(texts) + " |")
    lines.append("| score | | " + " | ".join(f"{figures['score'][recipe]:.2f}" for recipe in recipes) + " | |")
    ratios = [figures["to_recommended"][recipe] for recipe in recipes]
    texts = [
        "" if one["from"] is None else f"{one['ratio']:.2f} ({one['from']:.2f} to {one['to']:.2f})" for one in ratios
    ]
    lines.append("| ratio to the recommended | | " + " | ".join(texts) + " | |")
    short = ", ".join(figures["too_short"])
    return "\n".join(
        [*lines, "", f"Recommended: {figures['recommended']}." + (f" Too short: {short}." if short else "")]
    )


if __name__ == "__main__":
    end_in_words(main)
