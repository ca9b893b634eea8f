"""Models of the default controller's kind trained on boats that have changed, as `asvhil collect` and `train` do it."""

from __future__ import annotations

import hashlib
import json
import re
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from asvhil.collect import collect
from asvhil.config import load_config
from asvhil.config.mean_wind import parse_wind
from asvhil.dynamics.weights import read_model
from asvhil.errors import AsvhilError, ConfigError
from asvhil.study.circumstances import CHANGES, SECOND_BOAT, circumstances
from asvhil.study.rows import Keys
from asvhil.study.runner import Job, Run
from asvhil.study.six_tests import MAIN, labelled
from asvhil.train.jobs import DT_S, train_command
from asvhil.train.options import chosen_options

BOATS = (SECOND_BOAT, *CHANGES)
# As for the shipped model (docs/models.md), in winds that are in no test.
WINDS = ("0@0", "1.5@-120", "2@60", "4@20", "5@-70", "7@150", "8@-20", "9@110", "10@-150")
DURATION_S = 500.0
OPTIONS: Mapping[str, Any] = {"still": True, "rest_weight": 0.01}
LOPSIDED: Mapping[str, Any] = {"mirror": False}  # a boat with a weaker motor is not its own mirror image
QUICK: Mapping[str, Any] = {"iterations": 20, "rest_weight": None}  # a short drive has no long spans of drift
QUICK_S = 60.0


def model_of_boat(folder: Path, boat: str, base: str = "sitl", overrides: Keys = (), *, quick: bool = False) -> Path:
    """The model that was trained on a boat; for a quick run one of a quick training too. ConfigError for none."""
    path = _path(folder, boat, base, overrides)
    if quick and not path.is_file() and (short := _path(folder, boat, base, overrides, quick=True)).is_file():
        return short
    if not path.is_file():
        raise ConfigError(f"{path}: no model of this boat; `asvhil study boat-models -o {folder}` trains it")
    return path


def train_boats(
    run: Run, boats: Iterable[str], folder: Path, base: str = "sitl", overrides: Keys = (), *, quick: bool = False
) -> dict[str, Any]:
    """Drive the manoeuvres on each boat that has no model in the folder, and train one; the figures of all."""
    known, boats = circumstances(base, overrides), list(boats)
    paths = {boat: _path(folder, boat, base, overrides, quick=quick) for boat in boats}
    jobs = [
        Job(
            key=boat,
            group="models",
            arguments=(base, (*overrides, *known[boat]), str(path), boat == SECOND_BOAT, quick),
        )
        for boat, path in paths.items()
        if not path.is_file()
    ]
    if jobs:
        folder.mkdir(parents=True, exist_ok=True)
        run(train_on_boat, jobs)
    models = {boat: read_model(path) for boat, path in paths.items()}
    return {
        "boats": {
            boat: {"file": paths[boat].name, "seed": model.seed, "figures": _small(model.figures)}
            for boat, model in models.items()
        }
    }


def train_on_boat(base: str, overrides: Keys, output: str, lopsided: bool, quick: bool) -> dict[str, Any]:
    """Drive the manoeuvres in each wind on the simulated boat of a config, train a model on the logs, and write it.

    AsvhilError where a run of manoeuvres has not come to its end.
    """
    options = {**OPTIONS, **(LOPSIDED if lopsided else {}), **(QUICK if quick else {})}
    winds = [parse_wind(wind) for wind in (WINDS[:3] if quick else WINDS)]
    kind = labelled()[MAIN].model
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.mcap"
        runs = collect(load_config(base, overrides), "lockstep", QUICK_S if quick else DURATION_S, winds, log)
        if not runs[-1].complete:
            raise AsvhilError(f"{Path(output).stem}: manoeuvres not complete: {runs[-1].reason}")
        logs = [run.log for run in runs]
        found = train_command(kind, logs, Path(output), options=chosen_options(kind, DT_S, **options))
    return {name: found[name] for name in ("data_s", "seed", "wall_s")}


def markdown(study: Mapping[str, Any]) -> str:
    """The models and their errors as a table."""
    lines = ["| boat | file | validation error |", "| --- | --- | --- |"]
    for boat, one in study["boats"].items():
        lines.append(f"| {boat} | {one['file']} | {one['figures']['best_validation']:.4f} |")
    return "\n".join(lines) + "\n"


def _path(folder: Path, boat: str, base: str, overrides: Keys, *, quick: bool = False) -> Path:
    """Where the model of a boat is: of quick trainings, and of other keys of the boat, under names of their own."""
    vehicle = load_config(base, overrides).vehicle.name
    name = re.sub(r"[^a-z0-9]+", "-", boat.lower()).strip("-")
    of_boat = [key for key in overrides if key.startswith(("vehicle", "plant"))]
    other = f"-{hashlib.sha256(json.dumps(of_boat).encode()).hexdigest()[:8]}" if of_boat else ""
    return folder / f"{vehicle}-{name}{other}{'-quick' if quick else ''}-{labelled()[MAIN].model}.npz"


def _small(figures: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in figures.items() if name != "curve"}
