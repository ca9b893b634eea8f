"""Comparison of all solvers: time of a step, distance to the optimum, and closed-loop cost.

Each solver drives its own closed loop in virtual time, from the same start under the same seeds of gusts and sensors,
pinned to one core. Recorded problems are then solved by IPOPT from four starts: the best of these is the optimum.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from asvhil.backseat.build import build_backseat
from asvhil.config import Config, ControllerConfig, MpcWeights
from asvhil.controller.protocol import Controller
from asvhil.controller.solvers.choice import choose_solver
from asvhil.controller.solvers.fatrop import available as fatrop_available
from asvhil.controller.solvers.ipopt import Ipopt
from asvhil.controller.solvers.problem import Solution, Solver, StationProblem
from asvhil.controller.station_mpc import StationMpc
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.protocol import Dynamics
from asvhil.errors import AsvhilError, ConfigError
from asvhil.simplant.lockstep import Lockstep
from asvhil.simplant.plant import Truth
from asvhil.types import Control, Estimate, Station, Wind, record

SOLVERS = ("sqp", "ipopt", "fatrop", "torch-lqr")
REFERENCE_CAP = 500
LIMIT_CAPS = {"sqp": 200, "ipopt": REFERENCE_CAP, "fatrop": REFERENCE_CAP, "torch-lqr": 100}
AGREES = 0.005  # of the optimum's cost
SETTLED_STEPS = 50  # at the end of the run
BOOT_S = 30.0
STAGES = (2, 200)  # as mpc.stages may be

Tell = Callable[[str, int, int], None]  # what, how many of it are done, of how many


@record
class Step:
    """One step of a controller: its first problem and start, the cost of its plan, its time, and the true state."""

    parameters: Array
    start: Array
    cost: float
    ok: bool
    wall_ms: float
    cpu_ms: float
    truth: Truth


@record
class Problems:
    """Recorded problems with their warm starts, and the optimum of each (NaN where no start converged)."""

    problem: StationProblem
    parameters: list[Array]
    starts: list[Array]
    optima: Array


class Watch:
    """A solver that records the first call since `clear`."""

    def __init__(self, solver: Solver) -> None:
        self._solver = solver
        self.clear()

    def clear(self) -> None:
        self.first: tuple[Array, Array] | None = None

    def solve(self, parameters: Array, start: Array, iterations: int) -> Solution:
        if self.first is None:
            self.first = parameters.copy(), start.copy()
        return self._solver.solve(parameters, start, iterations)


class Stopwatch:
    """A controller that measures the time of each step of another; `last` is (control, wall ms, CPU ms)."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self.last: tuple[Control, float, float] | None = None

    def new_station(self) -> None:
        self._controller.new_station()

    def reset(self) -> None:
        self._controller.reset()

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control:
        wall_ns, cpu_ns = time.perf_counter_ns(), time.thread_time_ns()
        control = self._controller.step(estimate, wind, station)
        cpu_ns, wall_ns = time.thread_time_ns() - cpu_ns, time.perf_counter_ns() - wall_ns
        self.last = control, wall_ns * 1e-6, cpu_ns * 1e-6
        return control


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
            problem, run = _drive(config, model, name, steps, tell)
            chosen = np.unique(np.linspace(0, len(run) - 1, min(problems, len(run))).round().astype(int))
            recorded[name] = with_optima(problem, [run[i] for i in chosen], f"{name}: optima", tell)
            costs = np.array([run[i].cost for i in chosen])
            runs[name] = run, costs
        first = recorded[solvers[0]]
        rows = {}
        for name in solvers:
            run, costs = runs[name]
            row = _figures(config, run, costs, recorded[name].optima)
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
        choose_solver(_with_solver(config.controller, name))
    if "fatrop" in solvers and not fatrop_available():
        raise ConfigError("--solver fatrop: this build of CasADi comes without it; name the other solvers")
    return config


def starts_of(problem: StationProblem, warm: Array) -> list[Array]:
    """The four starts of the reference: the warm one, no thrust, and 0.7 of full thrust ahead and astern."""
    levels = (0.0, 0.7 * problem.upper, 0.7 * problem.lower)
    return [warm, *(np.full((problem.stages, 2), level) for level in levels)]


# --- parts of the study ------------------------------------------------------------------------------------


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


def _with_solver(config: ControllerConfig, name: str) -> ControllerConfig:
    return config.model_copy(update={"solver": name})


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


def _drive(config: Config, model: Dynamics, name: str, steps: int, tell: Tell) -> tuple[StationProblem, list[Step]]:
    """One closed loop under a solver: its problem, and its steps. AsvhilError where the boat is not held."""
    mpc, make_solver = choose_solver(_with_solver(config.controller, name))
    made: list[tuple[StationProblem, Watch]] = []

    def make(problem: StationProblem) -> Solver:
        made.append((problem, Watch(make_solver(problem))))
        return made[-1][1]

    watched = Stopwatch(StationMpc(model, mpc, 1.0 / config.daemon.control_hz, make))
    problem, watch = made[0]
    loop = Lockstep(config)
    loop.backseat = build_backseat(config, model=model, controller=watched)
    run: list[Step] = []
    for _ in range(round((BOOT_S + steps / config.daemon.control_hz) * config.daemon.tick_hz)):
        loop.tick()
        if watched.last is None:
            continue
        control, wall_ms, cpu_ms = watched.last
        parameters, start = watch.first or (np.array([]), np.array([]))
        watched.last = None
        watch.clear()
        run.append(
            Step(
                parameters=parameters,
                start=start,
                cost=control.cost,
                ok=control.ok,
                wall_ms=wall_ms,
                cpu_ms=cpu_ms,
                truth=loop.plant.truth,
            )
        )
        tell(f"{name}: closed loop", len(run), steps)
        if len(run) == steps:
            return problem, run
    raise AsvhilError(f"{name}: the boat was held for {len(run)} of {steps} steps only")


def with_optima(problem: StationProblem, steps: list[Step], what: str, tell: Tell) -> Problems:
    reference = Ipopt(problem, (REFERENCE_CAP,))
    optima = np.full(len(steps), np.nan)
    for i, step in enumerate(steps):
        found = [reference.solve(step.parameters, s, REFERENCE_CAP) for s in starts_of(problem, step.start)]
        optima[i] = min((f.cost for f in found if f.status == "converged"), default=np.nan)
        tell(what, i + 1, len(steps))
    return Problems(
        problem=problem,
        parameters=[step.parameters for step in steps],
        starts=[step.start for step in steps],
        optima=optima,
    )


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
    return {"problems": len(chosen), "agree_share": float((gaps <= AGREES).mean()), **_gap_figures(gaps)}


def _limit_solver(config: ControllerConfig, name: str, problem: StationProblem) -> Solver:
    if name == "torch-lqr":
        from asvhil.controller.solvers.torch_lqr import TorchLqr

        return TorchLqr(problem, batched=True)  # the same result, faster
    return choose_solver(_with_solver(config, name))[1](problem)


def _figures(config: Config, run: list[Step], costs: Array, optima: Array) -> dict[str, Any]:
    """Times, gaps and the closed loop of one run."""
    known = np.isfinite(optima)
    settled = [step.truth for step in run[-SETTLED_STEPS:]]
    return {
        "step_ms": _time_figures(np.array([step.wall_ms for step in run])),
        "step_cpu_ms": _time_figures(np.array([step.cpu_ms for step in run])),
        "failed": sum(not step.ok for step in run),
        "gap": _gap_figures(costs[known] / optima[known] - 1.0) | {"problems": int(known.sum())},
        "closed_loop_cost": _closed_loop_cost(run, config.controller.mpc.far, 1.0 / config.daemon.control_hz),
        "distance_end_m": float(np.mean([math.hypot(truth.n_m, truth.e_m) for truth in settled])),
    }


def _closed_loop_cost(run: list[Step], weights: MpcWeights, period_s: float) -> float:
    """The stage cost of the truth over the run, with the weights of the approach; the station is the plant's origin."""
    total = 0.0
    for step in run:
        truth = step.truth
        total += weights.position * (truth.n_m**2 + truth.e_m**2) + weights.heading * truth.psi_rad**2
        total += weights.velocity * (truth.u_mps**2 + truth.v_mps**2 + truth.r_radps**2)
    return period_s * total


def _time_figures(values: Array) -> dict[str, float]:
    return {
        "first": float(values[0]),
        "median": float(np.median(values)),
        "p99": float(np.percentile(values, 99)),
        "max": float(values.max()),
    }


def _gap_figures(gaps: Array) -> dict[str, float]:
    if not gaps.size:
        return {"mean": math.nan, "median": math.nan, "p95": math.nan, "max": math.nan}
    return {
        "mean": float(gaps.mean()),
        "median": float(np.median(gaps)),
        "p95": float(np.percentile(gaps, 95)),
        "max": float(gaps.max()),
    }


def peer_row(config: Config, peer: Sequence[str], model_file: str, recorded: Problems, tell: Tell) -> Any:
    """mpc.torch on the problems and warm starts of the torch-lqr run. AsvhilError where the command fails."""
    tell("mpc.torch: recorded problems", 0, len(recorded.parameters))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "problems.npz"
        np.savez(
            file,
            config=config.canonical_json(),
            model_file=model_file,
            parameters=np.array(recorded.parameters),
            starts=np.array(recorded.starts),
            lqr_iterations=config.controller.torch_lqr.iterations,
        )
        try:
            done = subprocess.run([*peer, str(file)], capture_output=True, text=True, errors="replace", check=False)
        except OSError as error:
            raise AsvhilError(f"{peer[0]}: cannot be run ({error.strerror})") from None
    lines = done.stdout.strip().splitlines()
    if done.returncode or not lines:
        raise AsvhilError(f"{peer[0]}: failed ({(done.stderr.strip().splitlines() or ['no output'])[-1]})")
    ms, cost = _peer_output(peer[0], lines[-1], len(recorded.parameters))
    known = np.isfinite(recorded.optima)
    gaps = cost[known] / recorded.optima[known] - 1.0
    tell("mpc.torch: recorded problems", len(recorded.parameters), len(recorded.parameters))
    return {"step_ms": _time_figures(ms), "gap": _gap_figures(gaps) | {"problems": int(known.sum())}}


def _peer_output(name: str, line: str, count: int) -> tuple[Array, Array]:
    """Times (ms) and costs, one of each problem. AsvhilError where the peer's last line is something else."""
    try:
        found = json.loads(line)
        ms, cost = np.array(found["ms"], dtype=float), np.array(found["cost"], dtype=float)
    except (ValueError, KeyError, TypeError):
        ms = cost = np.empty(0)
    if not ms.shape == cost.shape == (count,) or not count:
        words = f'{{"ms": [...], "cost": [...]}} of {count} problems is expected in its last line'
        raise AsvhilError(f"{name}: {words}, not {line[:40]}")
    return ms, cost
