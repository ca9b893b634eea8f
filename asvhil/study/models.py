"""The paper's model table on the simulated boat: prediction errors of each learned model, and of the parts of LagNet.

Data sets and test runs are logs of `asvhil collect` in lockstep. Models in the output folder are used again,
so an interrupted study continues to the same figures: every model is scored as read back from its file, and a file of
other data, options or seeds is refused.
"""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from asvhil.config import MpcConfig
from asvhil.controller.station_mpc import StationMpc
from asvhil.dynamics.integrate import advance, substeps
from asvhil.dynamics.protocol import Dynamics
from asvhil.dynamics.weights import TrainedModel, read_model, save_model
from asvhil.errors import ModelError
from asvhil.files import write_text
from asvhil.study.model_jobs import IN_WAVES, TrainingJob, chosen_jobs
from asvhil.study.model_logs import Logs, Tell, wave_figures
from asvhil.study.page import write_page
from asvhil.train.evaluate import HOLD, Case, Window, absolute_errors, predict, windows_of
from asvhil.train.jobs import DT_S, test_cases, training_data
from asvhil.train.options import FitOptions
from asvhil.train.origin import DataOrigin, origin_of
from asvhil.train.progress import TrainingProgress
from asvhil.train.records import Dataset
from asvhil.types import Estimate, Station, Wind, record

HORIZON_S, EVERY_S = 50.0, 20.0
MPC_TICKS = 60
BY_ADJOINT = ("node", "knode")


@record
class _Sea:
    """Training and test data of one sea, and where they come from."""

    datasets: tuple[Dataset, ...]
    cases: Sequence[Case]
    windows: Sequence[Window]
    origin: DataOrigin


def mpc_tick_ms(model: Dynamics, ticks: int = MPC_TICKS) -> float:
    """Median time of a control tick while the model keeps its own station, from the paper's start, in 3 m/s of wind."""
    mpc = StationMpc(model, MpcConfig(), DT_S)
    s = np.concatenate([[-14.0, -3.0, 0.0, 0.0, 0.0, 0.0], np.zeros(model.n_motor)])
    wind, count = np.array([3.0, 0.0]), substeps(DT_S, model.max_step_s)
    station, air = Station(n_m=0.0, e_m=0.0, psi_rad=0.0), Wind(t_ns=0, vn_mps=3.0, ve_mps=0.0, std_mps=0.0, valid=True)
    times_s = []
    for tick in range(ticks):
        n_m, e_m, psi_rad, u_mps, v_mps, r_radps, *motor = s.tolist()
        estimate = Estimate(
            t_ns=round(tick * DT_S * 1e9),
            n_m=n_m,
            e_m=e_m,
            psi_rad=psi_rad,
            u_mps=u_mps,
            v_mps=v_mps,
            r_radps=r_radps,
            motor=tuple(motor),
            std=(0.1,) * 6,
            disturbance=(0.0, 0.0, 0.0),
            valid=True,
        )
        begin_s = time.perf_counter()
        control = mpc.step(estimate, air, station)
        times_s.append(time.perf_counter() - begin_s)
        a = np.array(model.input_of_command(control.command))
        s = np.asarray(advance(model, s, a, wind, np.zeros(3), DT_S, count))
    return 1e3 * float(np.median(times_s))


def study_models(
    train: Sequence[Sequence[Path]],
    test: Sequence[Path],
    out: Path,
    *,
    known: Sequence[TrainingJob],
    only: Sequence[str] = (),
    waves: Logs | None = None,
    tick_ms: Callable[[Dynamics], float] = mpc_tick_ms,
    tell: Tell | None = None,
    mark: str = "",
) -> dict[str, Any]:
    """Train jobs on every data set and score them against the true state; writes models.json, .md and .png.

    `only` names some of the `known` jobs, none of them all. Jobs in waves need the logs that `waves` holds, and are
    left out without. `tick_ms` is the time of a model's control tick, `mark` what the page was made of. Raises
    ConfigError for an unknown name, LogError or ModelError where the logs, or a model in the folder, are not suitable.
    """
    chosen = [job for job in chosen_jobs(known, only) if waves is not None or not job.waves]
    seas = {False: _sea(train, test)}
    if waves is not None and any(job.waves for job in chosen):
        seas[True] = _sea(waves.train, waves.test)
    rows: dict[str, tuple[_Sea, list[TrainedModel]]] = {}
    for job in chosen:
        sea = seas[job.waves]
        for number in range(len(sea.datasets)):
            nnsem_s = _nnsem_s(known, sea, number, out) if job.kind in BY_ADJOINT else None
            for row, models in _trained(job, sea, number, out, nnsem_s, tell).items():
                rows.setdefault(row, (sea, []))[1].extend(models)
    table = [_row(name, models, sea, tick_ms) for name, (sea, models) in rows.items()]
    table += [_row(f"{HOLD}{IN_WAVES if rough else ''}", [None], sea, tick_ms) for rough, sea in seas.items()]
    result = {"horizon_s": HORIZON_S, "reference": "truth", **_extent(seas[False]), "rows": table}
    if True in seas:
        result["waves"] = {**_extent(seas[True]), **wave_figures()}
    out.mkdir(parents=True, exist_ok=True)
    write_text(out / "models.json", json.dumps(result, indent=1, sort_keys=True) + "\n")
    write_page(out / "models.md", markdown(table), mark)
    calm = {name: models[0] for name, (sea, models) in rows.items() if sea is seas[False]}
    _draw(calm, seas[False], out / "models.png")
    return result


def markdown(table: Sequence[Mapping[str, Any]]) -> str:
    """The table as Markdown: mean error, and its spread between networks."""
    lines = [
        "| model | u (m/s) | v (m/s) | r (rad/s) | networks | iterations | training CPU s | MPC tick ms |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in table:
        errors = " | ".join(f"{row[f'mae_{axis}']:.3f} ± {row[f'spread_{axis}']:.3f}" for axis in "uvr")
        rest = " | ".join(str(row[key]) for key in ("networks", "iterations", "cpu_s", "mpc_ms"))
        lines.append(f"| {row['model']} | {errors} | {rest} |")
    return "\n".join(lines) + "\n"


def _sea(train: Sequence[Sequence[Path]], test: Sequence[Path]) -> _Sea:
    cases = test_cases(test, None, DT_S, truth=True)
    return _Sea(
        datasets=tuple(training_data(paths, None, DT_S) for paths in train),
        cases=cases,
        windows=windows_of(cases, HORIZON_S, EVERY_S, DT_S),
        origin=origin_of([path for paths in train for path in paths]),
    )


def _extent(sea: _Sea) -> dict[str, Any]:
    return {
        "windows": len(sea.windows),
        "data_sets": len(sea.datasets),
        "data_s": [round(dataset.duration_s, 1) for dataset in sea.datasets],
    }


def _trained(
    job: TrainingJob, sea: _Sea, number: int, out: Path, nnsem_s: float | None, tell: Tell | None
) -> dict[str, list[TrainedModel]]:
    """The job's models on one data set, by row, as their files have them; trained first where a file is missing.

    With `nnsem_s` there is a second row: the networks as they were when that CPU time was over.
    """
    rows = [job.name] if nnsem_s is None else [job.name, f"{job.name}, NNSEM's time"]
    files = {row: _files(out, row, number, job.seeds) for row in rows}
    if not all(file.exists() for paths in files.values() for file in paths):
        _train(job, sea, number, files, nnsem_s, tell)
    return {row: [_read(file, job, sea, number, i + 1) for i, file in enumerate(files[row])] for row in rows}


def _train(
    job: TrainingJob,
    sea: _Sea,
    number: int,
    files: Mapping[str, Sequence[Path]],
    nnsem_s: float | None,
    tell: Tell | None,
) -> None:
    """Train and save the files of one data set, by row."""
    for file in (file for paths in files.values() for file in paths if file.exists()):
        _read(file, job, sea, number)  # raises rather than overwrite a file of another study
    from asvhil.train.fit import fit_many  # imports torch

    begin_s = time.process_time()
    early: list[TrainedModel] = []

    def note(progress: TrainingProgress) -> None:
        if tell is not None:
            tell(f"{job.name}, data set {number + 1}", progress.iteration / progress.iterations)
        if nnsem_s is not None and not early and time.process_time() - begin_s >= nnsem_s:
            early.extend(_timed(progress.models(), begin_s))

    models = fit_many(
        job.kind,
        sea.datasets[number],
        seeds=tuple(range(1, job.seeds + 1)),
        options=job.options,
        vehicle=sea.origin.vehicle,
        config_hash=sea.origin.config_hash,
        hull=sea.origin.hull,
        progress=note,
    )
    models = _timed(models, begin_s)
    for row, paths in files.items():
        for file, model in zip(paths, models if row == job.name else early or models, strict=True):
            save_model(file, model)


def _files(out: Path, row: str, number: int, seeds: int) -> list[Path]:
    return [out / "models" / f"{_slug(row)}-{number + 1}-{i + 1}.npz" for i in range(seeds)]


def _read(file: Path, job: TrainingJob, sea: _Sea, number: int, seed: int | None = None) -> TrainedModel:
    """A model of the folder. ModelError where it was trained on other data, or with other options, than its job."""
    model = read_model(file)
    wanted = json.loads(json.dumps(dataclasses.asdict(job.options)))
    # An option that is younger than the file was at its default; SD is fitted in one way only.
    found = json.loads(json.dumps(dataclasses.asdict(FitOptions()))) | model.figures.get("options", wanted)
    differing = [name for name in wanted if found[name] != wanted[name]]
    what = ""
    if (model.kind, model.vehicle) != (job.kind, sea.origin.vehicle):
        what = f"a {model.kind} of {model.vehicle!r}, not a {job.kind} of {sea.origin.vehicle!r}"
    elif model.data_hash != sea.datasets[number].source_hash:
        what = f"trained on other logs than those of data set {number + 1}"
    elif differing:
        what = f"trained with {differing[0]} {found[differing[0]]}, this study asks for {wanted[differing[0]]}"
    elif seed is not None and model.seed != seed:
        what = f"trained with seed {model.seed}, not {seed}"
    if what:
        raise ModelError(f"{file}: {what}; remove it to train it anew, or use another folder")
    return model


def _nnsem_s(known: Sequence[TrainingJob], sea: _Sea, number: int, out: Path) -> float | None:
    """CPU time that NNSEM took on a data set (s), whichever run of the study trained it; None where none did.

    Of networks trained side by side, what one alone takes is not known: the whole is its upper bound.
    """
    (job,) = chosen_jobs(known, ["nnsem"])
    file = _files(out, job.name, number, 1)[0]
    return float(_read(file, job, sea, number, 1).figures["cpu_s"]) if file.exists() else None


def _timed(models: Sequence[TrainedModel], begin_s: float) -> list[TrainedModel]:
    """The models with the CPU time that they took together in their figures."""
    spent_s = round(time.process_time() - begin_s, 1)
    return [dataclasses.replace(model, figures={**model.figures, "cpu_s": spent_s}) for model in models]


def _row(
    name: str,
    models: Sequence[TrainedModel | None],
    sea: _Sea,
    tick_ms: Callable[[Dynamics], float],
) -> dict[str, Any]:
    """Mean error over networks and windows, and the standard deviation between networks and between windows."""
    cases, windows, steps = sea.cases, sea.windows, round(HORIZON_S / DT_S)
    errors = np.array(
        [
            absolute_errors(
                predict(None if model is None else model.dynamics(), cases, windows, steps, DT_S), cases, windows
            )
            for model in models
        ]
    )
    mean, between = errors.mean(axis=(0, 1)), errors.mean(axis=1).std(axis=0)
    row: dict[str, Any] = {"model": name, "networks": len(models), "iterations": "", "cpu_s": "", "mpc_ms": ""}
    for i, axis in enumerate("uvr"):
        row[f"mae_{axis}"] = round(float(mean[i]), 4)
        row[f"spread_{axis}"] = round(float(between[i]), 4)
        row[f"spread_windows_{axis}"] = round(float(errors.mean(axis=0)[:, i].std()), 4)
    first = models[0]
    if first is not None:
        figures = [model.figures for model in models if model is not None]
        row["iterations"] = round(float(np.mean([part["iterations_run"] for part in figures])))
        row["cpu_s"] = round(float(np.mean([part["cpu_s"] for part in figures])), 1)
        row["mpc_ms"] = round(tick_ms(first.dynamics()), 2)
    return row


def _draw(models: Mapping[str, TrainedModel], sea: _Sea, path: Path) -> None:
    from asvhil.train.pictures import draw_identification

    window = next((window for window in sea.windows if window.moving), sea.windows[0])
    steps = round(HORIZON_S / DT_S)
    shown = {name: models[name] for name in ("nnsem", "sd", "node", "knode", "lagnet") if name in models}
    paths = {name: predict(model.dynamics(), sea.cases, [window], steps, DT_S)[0] for name, model in shown.items()}
    if paths:
        draw_identification(sea.cases[window.case], window.start, paths, DT_S, path)


def _slug(name: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in name).strip("-")
