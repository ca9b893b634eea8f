"""Comparison of all solvers: time of a step, distance to the optimum, and closed-loop cost.

Each solver drives its own closed loop in virtual time, from the same start under the same seeds of gusts and sensors,
pinned to one core. Recorded problems are then solved by IPOPT from four starts: the best of these is the optimum.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from asvhil.config import Config, ControllerConfig
from asvhil.controller.solvers.choice import choose_solver
from asvhil.controller.solvers.fatrop import available as fatrop_available
from asvhil.controller.solvers.problem import Solver, StationProblem
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.protocol import Dynamics
from asvhil.errors import AsvhilError, ConfigError
from asvhil.study.solver_figures import figures, gap_figures
from asvhil.study.solver_peer import peer_row
from asvhil.study.solver_runs import REFERENCE_CAP, Problems, Step, Tell, drive, starts_of, with_optima, with_solver

SOLVERS = ("sqp", "ipopt", "fatrop", "torch-lqr")
LIMIT_CAPS = {"sqp": 200, "ipopt": REFERENCE_CAP, "fatrop": REFERENCE_CAP, "torch-lqr": 100}
AGREES = 0.005  # of the optimum's cost
STAGES = (2, 200)  # as mpc.stages may be


def study_solvers(
    config: Config,
    model: Dynamics,
    *,
    steps: int = 250,
    problems: int = 200,
    solvers: Sequence[str] = SOLVERS,
    limit_problems: int | None = None,
    horizon_s: float = 4.0,
    peer: Sequence[str] = (),
    peer_model_file: str = "",
    tell: Tell = lambda what, done, total: None,
) -> dict[str, Any]:
    """Figures of each solver as a JSON-ready tree, for a model and the plant and weather of a config.

    `problems` of the steps of each run are compared with the optimum; `limit_problems` (all of them where None) of the
    first run's are also solved by each solver to convergence. `peer` is a command that takes a problem file, such
    as tests/peers/mpc_torch_peer.py in its own environment; it needs `peer_model_file` where the model is learned.
    Where it fails, `peer_failed` says why, beside the figures of the others.
    """
    config = checked_study(config, solvers, horizon_s)
    failed = {}
    with one_core():
        runs: dict[str, tuple[list[Step], Array]] = {}
        recorded: dict[str, Problems] = {}
        for name in solvers:
            problem, run = drive(config, model, name, steps, tell)
            chosen = np.unique(np.linspace(0, len(run) - 1, min(problems, len(run))).round().astype(int))
            recorded[name] = with_optima(problem, [run[i] for i in chosen], f"{name}: optima", tell)
            costs = np.array([run[i].cost for i in chosen])
            runs[name] = run, costs
        first = recorded[solvers[0]]
        rows = {}
        for name in solvers:
            run, costs = runs[name]
            row = figures(config, run, costs, recorded[name].optima)
            row["limit"] = _limit(config.controller, name, first, limit_problems, tell)
            rows[name] = row
        if peer:
            try:
                rows["mpc.torch"] = peer_row(config, peer, peer_model_file, recorded["torch-lqr"], tell)
            except AsvhilError as error:  # the other figures are kept
                failed["peer_failed"] = str(error)
    return {
        "model": model.name,
        "horizon_s": horizon_s,
        "stages": config.controller.mpc.stages,
        "steps": steps,
        "wind": config.plant.weather.wind.model_dump(),
        "seed": config.plant.seed,
        "config_hash": config.content_hash(),
        "solvers": rows,
        **failed,
    }


def checked_study(config: Config, solvers: Sequence[str], horizon_s: float) -> Config:
    """The config of all runs. ConfigError, before any run, where a solver or the horizon is not possible."""
    config = at_horizon(config, horizon_s)
    for name in solvers:
        choose_solver(with_solver(config.controller, name))
    if "fatrop" in solvers and not fatrop_available():
        raise ConfigError("--solver fatrop: this build of CasADi comes without it; name the other solvers")
    return config


def at_horizon(config: Config, horizon_s: float) -> Config:
    """The config with a uniform grid, and without the slow error of GNSS (as `trial.NO_SLOW_ERROR`).

    ConfigError where the number of stages is out of range.
    """
    mpc = config.controller.mpc
    low, high = STAGES
    if not math.isfinite(horizon_s) or not low <= round(horizon_s / mpc.first_step_s) <= high:
        least_s, most_s = low * mpc.first_step_s, high * mpc.first_step_s
        raise ConfigError(f"--horizon {horizon_s:g}: {least_s:g} to {most_s:g} s are expected")
    stages = round(horizon_s / mpc.first_step_s)
    mpc = mpc.model_copy(update={"stages": stages, "last_step_s": mpc.first_step_s})
    gnss = config.plant.sensors.gnss.model_copy(update={"slow_bias_m": 0.0})
    fused = config.plant.sensors.fused_velocity.model_copy(update={"slow_bias_mps": 0.0})
    sensors = config.plant.sensors.model_copy(update={"gnss": gnss, "fused_velocity": fused})
    link = config.links.autopilot.model_copy(update={"position_source": "GLOBAL_POSITION_INT"})
    ekf = config.estimator.ekf.model_copy(update={"position_bias_std_m": 0.0})
    return config.model_copy(
        update={
            "controller": config.controller.model_copy(update={"mpc": mpc}),
            "links": config.links.model_copy(update={"autopilot": link}),
            "plant": config.plant.model_copy(update={"sensors": sensors}),
            "estimator": config.estimator.model_copy(update={"ekf": ekf}),
        }
    )


@contextmanager
def one_core() -> Iterator[None]:
    """Pin this process to one core, the last that it may use."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def _limit(
    config: ControllerConfig, name: str, recorded: Problems, count: int | None, tell: Tell
) -> dict[str, Any] | None:
    """The gap of a solver with many iterations, from the best of the four starts."""
    chosen = np.flatnonzero(np.isfinite(recorded.optima))
    if count is not None and len(chosen) > count:
        chosen = chosen[np.linspace(0, len(chosen) - 1, count).round().astype(int)]
    if not len(chosen):
        return None
    solver = _limit_solver(config, name, recorded.problem)
    costs = np.empty(len(chosen))
    for done, i in enumerate(chosen):
        starts = starts_of(recorded.problem, recorded.starts[i])
        found = [solver.solve(recorded.parameters[i], start, LIMIT_CAPS[name]) for start in starts]
        costs[done] = min((f.cost for f in found if f.ok), default=math.inf)
        tell(f"{name}: limit", done + 1, len(chosen))
    gaps = costs / recorded.optima[chosen] - 1.0
    return {"problems": len(chosen), "agree_share": float((gaps <= AGREES).mean()), **gap_figures(gaps)}


def _limit_solver(config: ControllerConfig, name: str, problem: StationProblem) -> Solver:
    if name == "torch-lqr":
        from asvhil.controller.solvers.torch_lqr import TorchLqr

        return TorchLqr(problem, batched=True)  # the same result, faster
    return choose_solver(with_solver(config, name))[1](problem)
