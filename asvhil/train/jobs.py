"""What `asvhil train` and `asvhil evaluate` do: read the data, train or score, write the files, return the figures."""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from asvhil.config import VesselConfig
from asvhil.dynamics.hull import figures_apart
from asvhil.dynamics.protocol import Dynamics
from asvhil.dynamics.weights import TrainedModel, read_model, save_model
from asvhil.errors import AsvhilError, ConfigError, ModelError, OtherHullError
from asvhil.files import is_there
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import config_of
from asvhil.train.at_rest import AtRest, at_rest
from asvhil.train.choice import best_of
from asvhil.train.dataset import (
    Dataset,
    dataset_from_csv,
    dataset_from_logs,
    find_columns,
    truth_from_log,
)
from asvhil.train.evaluate import Case, evaluate, predict, windows_of
from asvhil.train.log_series import read_log_series
from asvhil.train.options import FitOptions, chosen_options
from asvhil.train.origin import DataOrigin, once, origin_of
from asvhil.train.progress import TrainingProgress
from asvhil.train.records import source_hash

DT_S = 0.2


def is_csv(paths: Sequence[Path]) -> bool:
    """Whether the files are CSV rather than MCAP logs. ConfigError for none, a mixture, or others."""
    kinds = {path.suffix.lower() for path in paths}
    if kinds not in ({".csv"}, {".mcap"}):
        raise ConfigError(f"data: MCAP logs or CSV files are expected, all of one kind, not {_list(paths)}")
    return kinds == {".csv"}


def training_data(paths: Sequence[Path], columns: str | None, dt_s: float, *, smoothed: bool = True) -> Dataset:
    """Data for training, smoothed if asked for; CSV files need the name or path of a column map."""
    if is_csv(paths):
        return dataset_from_csv(paths, find_columns(_required(columns)), dt_s, smoothed=smoothed)
    _refuse_columns(columns)
    return dataset_from_logs(paths, dt_s, "smoothed" if smoothed else "measured")


def test_cases(paths: Sequence[Path], columns: str | None, dt_s: float, *, truth: bool) -> list[Case]:
    """Segments to predict, from causal measurements; scored against the truth of a simulated log if asked for."""
    cases = []
    for path in paths:
        if is_csv([path]):
            seen = dataset_from_csv([path], find_columns(_required(columns)), dt_s)
            reference = seen
        else:
            seen = dataset_from_logs([path], dt_s, "measured")
            reference = truth_from_log(path, dt_s) if truth else seen
        for number, (given, wanted) in enumerate(zip(seen.segments, reference.segments, strict=True)):
            name = path.name if len(seen.segments) == 1 else f"{path.name} part {number + 1}"
            cases.append(Case(name=name, seen=given, reference=wanted))
    return cases


def check_test(paths: Sequence[Path], *, horizon_s: float, every_s: float, least: int) -> None:
    """ConfigError or LogError where logs to test on are damaged, too short, or move in fewer than `least` windows.

    A training of hours must not end with a test that nothing can be told by.
    """
    cases = test_cases(paths, None, DT_S, truth=False)
    moving = sum(window.moving for window in windows_of(cases, horizon_s, every_s, DT_S))
    if moving < least:
        names = ", ".join(map(str, paths))
        found = f"{moving} stretches of {horizon_s:g} s in motion, and {least} or more are needed"
        raise ConfigError(f"data: the test ({names}) has {found}: drive it for longer")


def simulated_vessel(paths: Sequence[Path]) -> VesselConfig | None:
    """The vessel whose equations the logs obey; None for CSV files, a real boat, and where no vessel has them.

    A log of the simulated boat holds its truth. The vessel of a real boat's config is a guess, and no reference; a wind
    load or motors of the plant's own are in no vessel.
    """
    if is_csv(paths) or not len(read_log_series(paths[0]).truth.t_s):
        return None
    config = config_of(LogFile(paths[0]), paths[0], known_only=True)
    return config.plant_vessel if config.plant.wind_load is None and config.plant.motors is None else None


def train_command(
    kind: str,
    data: Sequence[Path],
    output: Path,
    *,
    columns: str | None = None,
    vehicle: str | None = None,
    seed: int = 1,
    options: FitOptions | None = None,
    dt_s: float = DT_S,
    smoothed: bool = True,
    tries: int = 1,
    resume: bool = False,
    progress: Callable[[TrainingProgress], None] | None = None,
) -> dict[str, Any]:
    """Train a model on logs or CSV files and write it, with its curve as a picture beside it; the figures.

    `options` are those of the kind by default. Of several `tries`, trained side by side from `seed` on, the best is
    kept (`choice.best_of`). An interrupted training leaves OUTPUT.checkpoint; `resume` goes on from there. Raises
    ConfigError, LogError or ModelError in one line.
    """
    options = options or chosen_options(kind, dt_s)
    if tries > 1 and kind == "sd":
        raise ConfigError("train: --tries does not apply to model sd, which has no random start")
    _check_output(output)
    csv = is_csv(data)
    data, left_out = once(data)
    if csv:
        origin = DataOrigin(vehicle=_named(vehicle, columns), config_hash="", hull={}, simulated=False)
    else:
        origin = origin_of(data)
        if vehicle is not None and vehicle != origin.vehicle:
            raise ConfigError(f"train: the logs come from vehicle {origin.vehicle!r}, not from {vehicle!r}")
    dataset = training_data(data, columns, dt_s, smoothed=smoothed)
    checkpoint = checkpoint_of(output)
    if not resume:
        checkpoint.unlink(missing_ok=True)
    elif not is_there(checkpoint):
        raise ModelError(f"{checkpoint}: no interrupted training to go on with; leave out --resume to start anew")
    from asvhil.train.fit import fit_many  # imports torch, so only after the data are checked

    start_s = time.perf_counter()
    models = fit_many(
        kind,
        dataset,
        seeds=tuple(range(seed, seed + tries)),
        options=options,
        vehicle=origin.vehicle,
        config_hash=origin.config_hash,
        hull=origin.hull,
        progress=progress,
        checkpoint=checkpoint,
    )
    wall_s = time.perf_counter() - start_s
    model = models[0] if tries == 1 else best_of(models)
    model = dataclasses.replace(model, figures={**model.figures, "smoothed": smoothed})
    check = at_rest(model.dynamics(), model.scaling.half[5:], simulated_vessel(data))
    save_model(output, model)
    checkpoint.unlink(missing_ok=True)  # only now: until the model is on the disk it is all that there is
    from asvhil.train.pictures import draw_curve

    picture, fault = picture_of(output), ""
    try:
        draw_curve(model.figures, f"{kind}, {origin.vehicle}", picture)
    except AsvhilError as error:  # the model is whole, and so are its figures
        fault = str(error)
    return {
        "kind": kind,
        "vehicle": origin.vehicle,
        "model": str(output),
        "picture": None if fault else str(picture),
        "picture_fault": fault,
        "data": [str(path) for path in data],
        "left_out": [str(path) for path in left_out],
        "data_s": round(dataset.duration_s, 1),
        "outliers": dataset.outliers,
        "missing_rows": dataset.missing,
        "notes": list(dataset.notes),
        "data_hash": dataset.source_hash,
        "seed": model.seed,
        "wall_s": round(wall_s, 2),
        "at_rest": {**check.figures(), "verdict": check.verdict()},
        **{name: value for name, value in model.figures.items() if name != "curve"},
    }


def trained_before(
    output: Path, kind: str, data: Sequence[Path], seeds: Sequence[int], options: FitOptions
) -> dict[str, Any] | None:
    """The figures of a model file that the same training has left, which is the same to the last bit; else None.

    That is a training of smoothed data at `DT_S`, which tried just these seeds.
    """
    try:
        model = read_model(output)
    except ModelError:
        return None
    found, wanted = model.figures, json.loads(json.dumps(dataclasses.asdict(options)))
    if (model.kind, model.dt_s, found.get("options"), found.get("smoothed")) != (kind, DT_S, wanted, True):
        return None
    tried = {int(seed) for seed in found.get("validation_of_seeds", [model.seed])}
    if tried != set(seeds) or model.data_hash != source_hash(data):
        return None
    figures = {name: value for name, value in model.figures.items() if name != "curve"}
    return {"kind": kind, "vehicle": model.vehicle, "model": str(output), "seed": model.seed, **figures}


def evaluate_command(
    models: Sequence[Path],
    data: Sequence[Path],
    *,
    columns: str | None = None,
    horizon_s: float = 50.0,
    every_s: float = 10.0,
    truth: bool = False,
    figure: Path | None = None,
    beside: Mapping[str, Dynamics] = MappingProxyType({}),
) -> dict[str, Any]:
    """Open-loop errors of model files on logs or CSV files; with a figure, the first window in motion is drawn.

    `beside`: models by name that have no file, such as the physics of a config, to be scored and drawn as well.

    Raises ConfigError, LogError or ModelError in one line: among others where a model has another step than the
    first one, or belongs to another vehicle than the logs.
    """
    if not models:
        raise ConfigError("evaluate: no model is given")
    if not is_csv(data):
        _refuse_columns(columns)
    elif truth:
        raise ConfigError("evaluate: --truth goes with logs of the simulated boat: a CSV file has no truth")
    loaded = {path: read_model(path) for path in models}
    dt_s = loaded[models[0]].dt_s
    for option, seconds in (("--horizon", horizon_s), ("--every", every_s)):
        if round(seconds / dt_s) < 1:
            raise ConfigError(f"evaluate: {option} {seconds:g}: at least a step of the model, {dt_s:g} s, is expected")
    data, left_out = once(data)
    origin = None if is_csv(data) else origin_of(data)
    for path, model in loaded.items():
        _check(path, model, dt_s, origin)
    cases = test_cases(data, columns, dt_s, truth=truth)
    vessel = simulated_vessel(data)
    dynamics: dict[str, Dynamics] = {}
    checks: dict[str, AtRest] = {}
    kinds = [model.kind for model in loaded.values()]
    for path, model in loaded.items():
        name = model.kind if kinds.count(model.kind) == 1 else f"{model.kind} {path}"
        dynamics[name] = model.dynamics()
        checks[name] = at_rest(dynamics[name], model.scaling.half[5:], vessel)
    dynamics |= beside
    rows = evaluate(dynamics, cases, dt_s, horizon_s, every_s)
    if figure is not None:
        from asvhil.train.pictures import draw_identification

        windows = windows_of(cases, horizon_s, every_s, dt_s)
        window = next((window for window in windows if window.moving), windows[0])
        steps = round(horizon_s / dt_s)
        paths = {name: predict(model, cases, [window], steps, dt_s)[0] for name, model in dynamics.items()}
        draw_identification(cases[window.case], window.start, paths, dt_s, figure)
    return {
        "horizon_s": horizon_s,
        "every_s": every_s,
        "reference": "truth" if truth else "measured",
        "data": [str(path) for path in data],
        "left_out": [str(path) for path in left_out],
        "models": [str(path) for path in models],
        "rows": rows,
        "at_rest": {name: {**check.figures(), "verdict": check.verdict()} for name, check in checks.items()},
    }


def picture_of(output: Path) -> Path:
    """Where the curve of a training to this model file is drawn."""
    return output.with_suffix(".curve.png")


def checkpoint_of(output: Path) -> Path:
    """Where an unfinished training to this model file keeps its state."""
    return output.with_name(f"{output.name}.checkpoint")


def _check_output(output: Path) -> None:
    """ConfigError, before a training, where the model file cannot be written."""
    if output.suffix != ".npz":
        raise ConfigError(f"train: {output}: a model file ends in .npz")
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ModelError(f"{output}: cannot be written ({error.strerror})") from None


def _check(path: Path, model: TrainedModel, dt_s: float, origin: DataOrigin | None) -> None:
    if model.dt_s != dt_s:
        raise ModelError(f"{path}: this model has steps of {model.dt_s:g} s, the first one {dt_s:g} s")
    if origin is not None and model.vehicle != origin.vehicle:
        of = f"{model.vehicle!r}, the logs are of {origin.vehicle!r}"
        raise ModelError(f"{path}: this model was trained for vehicle {of}")
    apart = "" if origin is None else figures_apart(model.hull or {}, origin.hull)
    if apart:
        raise OtherHullError(f"{path}: this model was trained on another boat than that of the logs ({apart})")


def _refuse_columns(columns: str | None) -> None:
    if columns is not None:
        raise ConfigError("data: --columns goes with CSV files: a log of asvhil says itself what it holds")


def _named(vehicle: str | None, columns: str | None) -> str:
    """The vehicle of CSV files. ConfigError names each option that is missing, so that one answer completes them."""
    missing = [
        *(() if vehicle else ("--vehicle NAME (which boat they come from)",)),
        *(("--columns MAP (what each column is)",) if columns is None else ()),
    ]
    if missing or not vehicle:
        raise ConfigError(f"train: CSV files do not say all that is needed: give {' and '.join(missing)}")
    return vehicle


def _required(columns: str | None) -> str:
    if columns is None:
        raise ConfigError("data: CSV files need a column map (--columns)")
    return columns


def left_out_words(path: str | Path) -> str:
    """The line on a file that was given and is not read by itself."""
    return f"{path}: left out: it is read with the first segment of its log"


def _list(paths: Sequence[Path]) -> str:
    return ", ".join(path.name for path in paths) or "nothing"
