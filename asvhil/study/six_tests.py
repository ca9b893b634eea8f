"""The paper's six tests, their mirrors and diagonals: all controllers over several seeds, resumable, on all cores."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from asvhil.backseat.build import model_file
from asvhil.config import load_config
from asvhil.config.mean_wind import station_heading_deg
from asvhil.config.registry import CONTROLLERS, ControllerKind
from asvhil.controller.solvers.choice import choose_solver
from asvhil.errors import ConfigError
from asvhil.study.boat_bounds import bound_job
from asvhil.study.bound import run_named_bound
from asvhil.study.rows import FROM_S, ROWS, TO_S, along_the_wind, refuse_own, row_overrides, trial_job, wind_of
from asvhil.study.runner import Finished, Run
from asvhil.study.statistics import mean_ci95, mean_of_all
from asvhil.study.trials.trial import run_named_trial

OURS = ("LagNet-MPC", "NNSEM-MPC")
# It knows the equations and parameters of the boat, as nobody does of a real one: shown apart, not compared.
REFERENCE = "SD-MPC (true physics)"
WORK = ("reversals_per_min_most", "change_per_s")  # of `metrics.motor_figures`
MAIN = "LagNet-MPC"  # the default controller


def labelled() -> dict[str, ControllerKind]:
    """The controllers that keep a station, by their names in the tables; loaded plug-ins included."""
    return {kind.label or kind.name: kind for kind in CONTROLLERS if kind.keeps_station}


def controller_overrides(label: str, models: Path | None, base: str, overrides: tuple[str, ...]) -> tuple[str, ...]:
    """The config keys that set a controller, with the model file of its kind from a folder where it holds one.

    There, VEHICLE-KIND.npz comes before KIND.npz. ConfigError where there is no such folder, or where a model is needed
    and neither the folder nor the shipped ones have it.
    """
    check_models(models)
    controller = labelled()[label]
    chosen = (*overrides, f"controller.name={controller.name}")
    if controller.model and models is not None:
        vehicle = load_config(base, overrides).vehicle.name
        for file in (models / f"{vehicle}-{controller.model}.npz", models / f"{controller.model}.npz"):
            if file.is_file():
                chosen = (*chosen, f"controller.model={file.resolve()}")
                break
    model_file(load_config(base, chosen))
    return chosen


def check_models(models: Path | None) -> None:
    """ConfigError where the folder does not exist: otherwise the shipped models would be used unnoticed."""
    if models is not None and not models.is_dir():
        raise ConfigError(f"--models {models}: no such folder")
    if models is not None and not any(models.glob("*.npz")):
        raise ConfigError(f"--models {models}: holds no model file (KIND.npz)")


def available(
    labels: Iterable[str], models: Path | None, base: str, overrides: tuple[str, ...]
) -> tuple[dict[str, tuple[str, ...]], list[str]]:
    """{label: config keys} of the controllers that can run, and a line for each that has no model.

    ConfigError where the folder of models does not exist, or a config key is wrong.
    """
    check_models(models)
    load_config(base, overrides)
    found: dict[str, tuple[str, ...]] = {}
    left_out = []
    for label in labels:
        try:
            found[label] = controller_overrides(label, models, base, overrides)
        except ConfigError as error:
            model = labelled()[label].model
            if not model:
                raise
            left_out.append(f"{label} is left out: {error}; give --models DIR with {model}.npz in it")
    return found, left_out


def with_solvers(
    controllers: Mapping[str, tuple[str, ...]], solvers: Iterable[str], base: str
) -> dict[str, tuple[str, ...]]:
    """Each controller that solves the MPC's problem with each of these solvers. ConfigError where one cannot."""
    found = {}
    for label, keys in controllers.items():
        for solver in solvers:
            if not labelled()[label].solves:
                raise ConfigError(f"--solver {solver}: {label} solves no problem; choose an MPC with --controller")
            found[f"{label}, {solver}"] = (*keys, f"controller.solver={solver}")
            choose_solver(load_config(base, found[f"{label}, {solver}"]).controller)
    return found


def study_six_tests(
    run: Run,
    *,
    controllers: Mapping[str, tuple[str, ...]],
    rows: Iterable[str] = tuple(ROWS),
    seeds: Iterable[int] = (1, 2, 3, 4, 5),
    noise: bool = True,
    window_s: tuple[float, float] = (FROM_S, TO_S),
    base: str = "sitl",
    bounds: Mapping[str, float] | None = None,
    slow_error: bool = False,
    own_starts: int = 0,
) -> dict[str, Any]:
    """The table of all runs.

    `controllers` as `available` gives them. `bounds` are penalty scores by wind (`bound.read_bounds`). With
    `slow_error` the receiver has its slow error. With `own_starts`, starts of each search, the bound of each run's own
    mean wind across the station's heading is found as well. ConfigError where a config key of a controller is one that
    the rows set.
    """
    rows, seeds = list(rows), list(seeds)
    headings_deg = {}
    for label, keys in controllers.items():
        headings_deg[label] = station_heading_deg(load_config(base, keys))
        refuse_own(keys, row_overrides(next(iter(ROWS)), 1, noise=noise, slow_error=slow_error))
    names = [(row, label, seed) for seed in seeds for row in rows for label in controllers]
    jobs = [
        trial_job(
            label,
            base,
            (
                *controllers[label],
                *row_overrides(row, seed, noise=noise, heading_deg=headings_deg[label], slow_error=slow_error),
            ),
            window_s,
        )
        for row, label, seed in names
    ]
    finished = run(run_named_trial, jobs)
    runs = [
        {"row": row, "controller": label, "seed": seed, **result}
        for (row, label, seed), result in zip(names, finished.results, strict=True)
    ]
    if own_starts:
        _add_own_bounds(run, runs, controllers, headings_deg, base, own_starts)
    return {
        "window_s": list(window_s),
        "seeds": sorted(set(seeds)),
        "noise": noise,
        "slow_error": noise and slow_error,
        "base": base,
        **tabulate(runs, bounds or {}),
        "cost": cost_figures(finished),
    }


def _add_own_bounds(
    run: Run,
    runs: Sequence[dict[str, Any]],
    controllers: Mapping[str, tuple[str, ...]],
    headings_deg: Mapping[str, float],
    base: str,
    starts: int,
) -> None:
    """`own_bound` of each run in a row across the wind: that of the mean wind that it had, rounded to what moves it."""
    across = [one for one in runs if not along_the_wind(one["row"])]
    jobs = []
    for one in across:
        label, wind = one["controller"], one["wind"]
        toward_deg = math.remainder(wind["toward_deg"] - headings_deg[label], 360.0)
        jobs.append(bound_job(base, controllers[label], round(wind["speed_mps"], 1), round(toward_deg), starts))
    for one, found in zip(across, run(run_named_bound, jobs).results if jobs else [], strict=True):
        one["own_bound"] = found["penalty_score"]


def cost_figures(finished: Finished) -> dict[str, Any]:
    """Computing time: seconds of one process by group, and minutes of all processes together."""
    total_s = sum(finished.group_s.values())
    return {
        "process_s": {group: round(spent, 1) for group, spent in finished.group_s.items()},
        "processes": finished.processes,
        "minutes": round(total_s / finished.processes / 60.0, 2),
        "runs_of_other_code": finished.outdated,
    }


def tabulate(runs: Sequence[Mapping[str, Any]], bounds: Mapping[str, float]) -> dict[str, Any]:
    """{"rows": {row: {controller: figures}}, "verdicts": {row: ...}} of all runs.

    Each figure is {"mean", "ci95"} over the seeds, against the truth and as measured; regret is the mean ps over the
    bound of the row's wind, None without one or where the bound is zero.
    """
    cells: dict[str, dict[str, list[Mapping[str, Any]]]] = {}
    for run in runs:
        cells.setdefault(run["row"], {}).setdefault(run["controller"], []).append(run)
    rows: dict[str, dict[str, Any]] = {}
    for row, line in cells.items():
        limit = bounds.get(wind_of(row), 0.0)
        rows[row] = {label: _cell(part, limit) for label, part in line.items()}
    return {
        "bounds": {row: bounds[wind_of(row)] for row in rows if wind_of(row) in bounds},
        "rows": rows,
        "verdicts": {row: verdict(line) for row, line in cells.items()},
    }


def verdict(line: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, Any]:
    """Which controller has the lowest mean ps in a row, and by how much: differences of runs of the same seed.

    `behind` are the differences of the others' ps to the winner's; `kind` is "ours" or "baseline". The reference is
    left out, and so are those `barred`, which did not have the motors for the whole window.
    """
    barred = [label for label, part in line.items() if label != REFERENCE and any(run["held"] < 1.0 for run in part)]
    scores = {
        label: {run["seed"]: run["truth"]["penalty_score"] for run in part}
        for label, part in line.items()
        if label != REFERENCE and label not in barred
    }
    if not scores:
        return {"winner": None, "kind": None, "penalty_score": None, "behind": {}, "barred": barred}
    means = {label: sum(part.values()) / len(part) for label, part in scores.items()}
    winner = min(means, key=lambda label: means[label])
    behind = {
        label: mean_ci95([part[seed] - scores[winner][seed] for seed in sorted(part) if seed in scores[winner]])
        for label, part in sorted(scores.items(), key=lambda item: means[item[0]])
        if label != winner
    }
    return {
        "winner": winner,
        "kind": "ours" if winner in OURS else "baseline",
        "penalty_score": mean_ci95(list(scores[winner].values())),
        "behind": behind,
        "barred": barred,
    }


def _cell(runs: Sequence[Mapping[str, Any]], limit: float) -> dict[str, Any]:
    truth = _errors([run["truth"] for run in runs])
    ps = truth["penalty_score"]["mean"]
    return {
        "ps_by_seed": {str(run["seed"]): run["truth"]["penalty_score"] for run in runs},
        "truth": truth,
        "measured": _errors([run["measured"] for run in runs]),
        "regret": ps / limit if limit > 0.0 and ps is not None else None,
        "own_regret": _own_regret(runs),
        "first_steps_ms": mean_of_all([(run.get("control_tick_ms") or {}).get("first") for run in runs]),
        "arrived_s": mean_of_all([run.get("arrived_s") for run in runs]),
        "motors": {
            name: mean_of_all([run["motors"][name] for run in runs])
            for name in ("reversals_per_min_most", "change_per_s")
        },
        "energy_n2": mean_ci95([run["energy_n2"] for run in runs]),
        "held": min(run["held"] for run in runs),
    }


def _own_regret(runs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The mean over the seeds of each run's score over the bound of its own mean wind."""
    ratios = [
        run["truth"]["penalty_score"] / run["own_bound"]
        if run.get("own_bound") and run["truth"]["penalty_score"] is not None
        else None
        for run in runs
    ]
    return mean_of_all(ratios)


def _errors(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Means over seeds; of the heading error both as it is and its magnitude, of which the score is made.

    All are None where a run has none: as measured, of a run that had no estimate in the window.
    """
    distance, heading = [part["distance_m"] for part in parts], [part["heading_deg"] for part in parts]
    farthest = [part["max_settled"] for part in distance]
    return {
        "penalty_score": mean_of_all([part["penalty_score"] for part in parts]),
        "vrx_score": mean_of_all([part["vrx_score"] for part in parts]),
        "e_d_m": mean_of_all([part["mean"] for part in distance]),
        "s_d_m": mean_of_all([part["std"] for part in distance]),
        "e_h_deg": mean_of_all([part["mean"] for part in heading]),
        "abs_e_h_deg": mean_of_all([None if part["mean"] is None else abs(part["mean"]) for part in heading]),
        "s_h_deg": mean_of_all([part["std"] for part in heading]),
        "max_distance_m": None if None in farthest else max(farthest),
    }
