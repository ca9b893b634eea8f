"""The paper's model table on the simulated boat: what each learned model predicts, what each part of LagNet brings.

Data sets and test runs are logs of `asvhil collect` in lockstep. Models that are trained already are taken from the
output folder, so an interrupted study goes on where it was.
"""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from asvhil.config import Config, MpcConfig, load_config
from asvhil.controller.station_mpc import StationMpc
from asvhil.dynamics.integrate import advance, substeps
from asvhil.dynamics.protocol import Dynamics
from asvhil.dynamics.weights import TrainedModel, read_model, save_model
from asvhil.train.evaluate import HOLD, Case, Window, absolute_errors, predict, windows_of
from asvhil.train.jobs import DT_S, origin_of, test_cases, training_data
from asvhil.train.options import OPTIONS, FitOptions, Progress
from asvhil.train.records import Dataset
from asvhil.types import Estimate, Station, Wind, record

TRAIN_SEEDS = (100, 200, 300)  # a data set each, of TRAIN_S in each of the winds
TRAIN_WINDS = ("3@0", "6@180")
TRAIN_S = 300.0
TEST_WINDS = ("6@0", "6@90", "6@180")
TEST_SEED, TEST_S = 9000, 130.0
HORIZON_S, EVERY_S = 50.0, 20.0
ODE_SEEDS = 1  # networks per data set that are trained by the adjoint, which takes its time
MPC_TICKS = 60

Drive = Callable[[Config, float, list[str], Path], list[Path]]
Tell = Callable[[str, float], None]  # what is being done, and its share done


@record
class Job:
    """One row of the table: its name, the kind and options behind it, and how many networks a data set trains."""

    name: str
    kind: str
    options: FitOptions
    seeds: int


def jobs(ode_iterations: int) -> tuple[Job, ...]:
    """The paper's models, LagNet, and LagNet with its parts added one by one."""
    lagnet = dataclasses.replace(OPTIONS["lagnet"], members=1)

    def variant(name: str, *frozen: str, mirror: bool = False) -> Job:
        options = dataclasses.replace(lagnet, frozen=frozen, mirror=mirror)
        return Job(name=name, kind="lagnet", options=options, seeds=3)

    def ode(kind: str) -> Job:
        options = dataclasses.replace(OPTIONS[kind], iterations=ode_iterations)
        return Job(name=kind, kind=kind, options=options, seeds=ODE_SEEDS)

    return (
        Job(name="sd", kind="sd", options=OPTIONS["sd"], seeds=1),
        Job(name="nnsem", kind="nnsem", options=OPTIONS["nnsem"], seeds=3),
        variant("lagnet: lag alone", "map", "skip"),
        variant("lagnet: map, lag", "skip"),
        variant("lagnet: map, lag, mirror", "skip", mirror=True),
        variant("lagnet: map, lag, mirror, skip (single)", mirror=True),
        Job(name="lagnet", kind="lagnet", options=OPTIONS["lagnet"], seeds=1),
        ode("node"),
        ode("knode"),
    )


def collect_logs(folder: Path, drive: Drive, config: str = "sitl", tell: Tell | None = None) -> tuple[Any, list[Path]]:
    """Training logs by data set and test logs; those in the folder already are not driven again."""
    folder.mkdir(parents=True, exist_ok=True)

    def run(name: str, seed: int, duration_s: float, wind: str) -> Path:
        path = folder / f"{name}.mcap"
        if not path.exists():
            if tell is not None:
                tell(f"collecting {name}", 0.0)
            settings = load_config(config, (f"plant.seed={seed}", f"controller.manoeuvres.seed={seed}"))
            partial = folder / f"{name}.part.mcap"
            (log,) = drive(settings, duration_s, [wind], partial)
            log.replace(path)
        return path

    train = [
        [run(f"train{seed}-{i}", seed + i, TRAIN_S, wind) for i, wind in enumerate(TRAIN_WINDS)] for seed in TRAIN_SEEDS
    ]
    test = [run(f"test{i}", TEST_SEED + i, TEST_S, wind) for i, wind in enumerate(TEST_WINDS)]
    return train, test


def study_models(
    train: Sequence[Sequence[Path]],
    test: Sequence[Path],
    out: Path,
    *,
    only: Sequence[str] = (),
    ode_iterations: int = 20000,
    mpc_ticks: int = MPC_TICKS,
    tell: Tell | None = None,
) -> dict[str, Any]:
    """Train every job on every data set and score it against the true state; writes models.json, .md and .png.

    `only` names jobs. Raises LogError or ModelError in one line where the logs will not do.
    """
    cases = test_cases(test, None, DT_S, truth=True)
    windows = windows_of(cases, HORIZON_S, EVERY_S, DT_S)
    datasets = [training_data(paths, None, DT_S) for paths in train]
    vehicle, config_hash = origin_of([path for paths in train for path in paths])
    rows: dict[str, list[TrainedModel]] = {}
    nnsem_s: list[float] = [np.inf] * len(datasets)
    for job in jobs(ode_iterations):
        if only and job.name not in only:
            continue
        for number, dataset in enumerate(datasets):
            name = f"{job.name}, data set {number + 1}"
            found = _trained(job, dataset, number, out, (vehicle, config_hash), nnsem_s[number], name, tell)
            if job.kind == "nnsem":
                # Of networks trained side by side, what one alone takes is not known: the whole is its upper bound.
                nnsem_s[number] = float(found[job.name][0].figures["cpu_s"])
            for row, models in found.items():
                rows.setdefault(row, []).extend(models)
    table = [_row(name, models, cases, windows, mpc_ticks) for name, models in rows.items()]
    table.append(_row(HOLD, [None], cases, windows, mpc_ticks))
    result = {
        "horizon_s": HORIZON_S,
        "reference": "truth",
        "windows": len(windows),
        "data_sets": len(datasets),
        "data_s": [round(dataset.duration_s, 1) for dataset in datasets],
        "rows": table,
    }
    out.mkdir(parents=True, exist_ok=True)
    (out / "models.json").write_text(json.dumps(result, indent=1, sort_keys=True) + "\n")
    (out / "models.md").write_text(markdown(table))
    _draw(rows, cases, windows, out / "models.png")
    return result


def markdown(table: Sequence[Mapping[str, Any]]) -> str:
    """The table as people read it: mean error, and its spread between networks."""
    lines = [
        "| model | u (m/s) | v (m/s) | r (rad/s) | networks | iterations | training CPU s | MPC tick ms |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in table:
        errors = " | ".join(f"{row[f'mae_{axis}']:.3f} ± {row[f'spread_{axis}']:.3f}" for axis in "uvr")
        rest = " | ".join(str(row[key]) for key in ("networks", "iterations", "cpu_s", "mpc_ms"))
        lines.append(f"| {row['model']} | {errors} | {rest} |")
    return "\n".join(lines) + "\n"


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


def _trained(
    job: Job,
    dataset: Dataset,
    number: int,
    out: Path,
    origin: tuple[str, str],
    nnsem_s: float,
    name: str,
    tell: Tell | None,
) -> dict[str, list[TrainedModel]]:
    """The job's models on one data set, by row: networks trained by the adjoint have a row at NNSEM's CPU time too."""
    rows = [job.name] if job.kind not in ("node", "knode") else [job.name, f"{job.name}, NNSEM's time"]
    files = {row: [out / "models" / f"{_slug(row)}-{number + 1}-{i + 1}.npz" for i in range(job.seeds)] for row in rows}
    if all(file.exists() for paths in files.values() for file in paths):
        return {row: [read_model(file) for file in paths] for row, paths in files.items()}
    from asvhil.train.fit import fit_many  # torch, only once it is needed

    begin_s = time.process_time()
    early: list[TrainedModel] = []

    def note(progress: Progress) -> None:
        if tell is not None:
            tell(name, progress.iteration / progress.iterations)
        if len(rows) > 1 and not early and time.process_time() - begin_s >= nnsem_s:
            early.extend(_timed(progress.models(), begin_s))

    vehicle, config_hash = origin
    models = fit_many(
        job.kind,
        dataset,
        seeds=tuple(range(1, job.seeds + 1)),
        options=job.options,
        vehicle=vehicle,
        config_hash=config_hash,
        progress=note,
    )
    found = {job.name: _timed(models, begin_s)}
    if len(rows) > 1:
        found[rows[1]] = early or found[job.name]
    for row, trained in found.items():
        for file, model in zip(files[row], trained, strict=True):
            save_model(file, model)
    return found


def _timed(models: Sequence[TrainedModel], begin_s: float) -> list[TrainedModel]:
    """The models with the CPU time that they took together in their figures."""
    spent_s = round(time.process_time() - begin_s, 1)
    return [dataclasses.replace(model, figures={**model.figures, "cpu_s": spent_s}) for model in models]


def _row(
    name: str,
    models: Sequence[TrainedModel | None],
    cases: Sequence[Case],
    windows: Sequence[Window],
    mpc_ticks: int,
) -> dict[str, Any]:
    """Mean error over networks and windows, and the standard deviation between networks and between windows."""
    steps = round(HORIZON_S / DT_S)
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
        row["mpc_ms"] = round(mpc_tick_ms(first.dynamics(), mpc_ticks), 2)
    return row


def _draw(
    rows: Mapping[str, Sequence[TrainedModel]], cases: Sequence[Case], windows: Sequence[Window], path: Path
) -> None:
    from asvhil.train.pictures import draw_identification

    window = next((window for window in windows if window.moving), windows[0])
    steps = round(HORIZON_S / DT_S)
    shown = {name: rows[name][0] for name in ("nnsem", "sd", "node", "knode", "lagnet") if name in rows}
    paths = {name: predict(model.dynamics(), cases, [window], steps, DT_S)[0] for name, model in shown.items()}
    if paths:
        draw_identification(cases[window.case], window.start, paths, DT_S, path)


def _slug(name: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in name).strip("-")
