"""Closed loops of the solver study: each step's problem, start, plan cost and time, and the optima of the problems."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from asvhil.backseat.build import build_backseat
from asvhil.config import Config, ControllerConfig
from asvhil.controller.protocol import Controller
from asvhil.controller.solvers.choice import choose_solver
from asvhil.controller.solvers.ipopt import Ipopt
from asvhil.controller.solvers.problem import Solution, Solver, StationProblem
from asvhil.controller.station_mpc import StationMpc
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.protocol import Dynamics
from asvhil.errors import AsvhilError
from asvhil.simplant.lockstep import Lockstep
from asvhil.simplant.plant import Truth
from asvhil.types import Control, Estimate, Station, Wind, record

REFERENCE_CAP = 500
BOOT_S = 30.0
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


def starts_of(problem: StationProblem, warm: Array) -> list[Array]:
    """The four starts of the reference: the warm one, no thrust, and 0.7 of full thrust ahead and astern."""
    levels = (0.0, 0.7 * problem.upper, 0.7 * problem.lower)
    return [warm, *(np.full((problem.stages, 2), level) for level in levels)]


def with_solver(config: ControllerConfig, name: str) -> ControllerConfig:
    """The settings of a controller with another solver."""
    return config.model_copy(update={"solver": name})


def drive(config: Config, model: Dynamics, name: str, steps: int, tell: Tell) -> tuple[StationProblem, list[Step]]:
    """One closed loop under a solver: its problem, and its steps. AsvhilError where the boat is not held."""
    mpc, make_solver = choose_solver(with_solver(config.controller, name))
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
    """The problems of recorded steps, each solved to its optimum; `what` is told of the progress."""
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
