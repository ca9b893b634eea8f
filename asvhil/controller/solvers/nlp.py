"""A StationProblem by multiple shooting, as a sparse nonlinear programme for the solvers that CasADi brings along.

The variables stand stage by stage, (s_0, a_0, s_1, a_1, ... s_N). With `carry_input` each state also holds the input
before it, which makes the cost of a change of input one of its stage alone, as stagewise solvers need it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from asvhil.controller.solvers.graphs import HEAD, POSE_AND_VELOCITY, excess_of, target_of
from asvhil.controller.solvers.outcome import bounded, failure, rolled_out
from asvhil.controller.solvers.problem import Solution, StationProblem
from asvhil.dynamics.arrays import Array
from asvhil.types import record


@record
class NonlinearProgram:
    """min f(x, p) under g(x, p) = 0, and where in x the states (N + 1, n), carried (N + 1, 2) and inputs (N, 2) are."""

    symbols: Mapping[str, Any]
    state_at: Any
    carried_at: Any
    input_at: Any


def transcribe(problem: StationProblem, carry_input: bool) -> NonlinearProgram:
    """The programme of a problem; its constraints are gap 0, the initial state, then gaps 1 .. N - 1."""
    n, stages = problem.n_state, problem.stages
    carry = 2 if carry_input else 0
    width = n + carry + 2
    first = width * np.arange(stages + 1)[:, None]
    state_at, carried_at = first + np.arange(n), first + n + np.arange(carry)
    input_at = first[:-1] + n + carry + np.arange(2)
    x, p = ca.SX.sym("x", stages * width + n + carry), ca.SX.sym("p", problem.n_parameters)
    wind, push, previous, reference, slew = p[n : n + 2], p[n + 2 : n + 5], p[n + 5 : n + 7], p[n + 7], p[n + 8]
    moves, soft = p[n + 9 : n + 11], p[n + HEAD - 1]

    def part(at: Any) -> Any:
        return x[int(at[0]) : int(at[-1]) + 1]

    start = ca.vertcat(p[:n], previous) if carry_input else p[:n]
    initial = x[: n + carry] - start
    cost, constraints = ca.SX(0.0), []
    for k, (step_s, count) in enumerate(zip(problem.steps_s, problem.substep_counts, strict=True)):
        state, a = part(state_at[k]), part(input_at[k])
        for _ in range(count):
            state = problem.substep(state, a, wind, push, float(step_s) / count)
        gap = part(state_at[k + 1]) - state
        constraints.append(ca.vertcat(gap, part(carried_at[k + 1]) - a) if carry_input else gap)
        if k == 0:
            constraints.append(initial)
        before_at = carried_at[k] if carry_input else input_at[k - 1]
        before = part(before_at) if carry_input or k else previous
        q = p[n + HEAD + POSE_AND_VELOCITY * k :][:POSE_AND_VELOCITY]
        reached = part(state_at[k + 1])[:POSE_AND_VELOCITY]
        pose = ca.vertcat(moves * float(problem.times_s[k + 1]), reference)
        error = reached - target_of(pose, moves, reached[2])
        cost += ca.dot(q, error**2) + slew * ca.sumsqr(a - before)
        if problem.soft_limits is not None:
            cost += soft * float(step_s) * ca.sumsqr(excess_of(error, problem.soft_limits))
    symbols = {"x": x, "p": p, "f": cost, "g": ca.vertcat(*constraints)}
    return NonlinearProgram(symbols=symbols, state_at=state_at, carried_at=carried_at, input_at=input_at)


class NlpSolver:
    """Solves a `StationProblem` by a solver of CasADi's, from a start that is rolled out first; no memory, no duals.

    `make(symbols, cap)` builds the solver for an iteration cap; `caps` are built at once, others when first asked for.
    """

    def __init__(
        self,
        problem: StationProblem,
        carry_input: bool,
        make: Callable[[dict[str, Any], int], ca.Function],
        caps: Sequence[int],
    ) -> None:
        self._problem, self._make = problem, make
        self._programme = programme = transcribe(problem, carry_input)
        self._solvers = {cap: make(dict(programme.symbols), cap) for cap in caps}
        size = programme.symbols["x"].numel()
        self._lower, self._upper = np.full(size, -np.inf), np.full(size, np.inf)

    def solve(self, parameters: Array, start: Array, iterations: int) -> Solution:
        """The plan found from `start` (stages, 2), clipped into the bounds; never dearer than the start.

        `ok` is False where the solver ends with an error or anything is not finite. `status` says which.
        """
        problem, programme = self._problem, self._programme
        if not (np.isfinite(parameters).all() and np.isfinite(start).all()):
            return failure(problem, "the parameters or the start are not finite")
        lower, upper = problem.bounds(parameters)
        self._lower[programme.input_at], self._upper[programme.input_at] = lower, upper
        inputs = bounded(np.asarray(start, dtype=float).reshape(-1, 2), lower, upper)
        states, cost = rolled_out(problem, parameters, inputs)
        if not (np.isfinite(cost) and np.isfinite(states).all()):
            return failure(problem, "the prediction from the start is not finite")
        solver = self._solvers.get(iterations)
        if solver is None:
            solver = self._solvers[iterations] = self._make(dict(programme.symbols), iterations)
        x0 = np.zeros(self._lower.size)
        x0[programme.state_at] = states
        x0[programme.input_at] = inputs
        if programme.carried_at.size:
            x0[programme.carried_at[0]] = problem.unpack_cost(parameters)[2]
            x0[programme.carried_at[1:]] = inputs
        try:
            found = solver(x0=x0, p=parameters, lbx=self._lower, ubx=self._upper, lbg=0.0, ubg=0.0)
        except RuntimeError:
            return failure(problem, "CasADi refused the problem")
        stats = solver.stats()
        converged, count = bool(stats["success"]), min(int(stats["iter_count"]), iterations)
        if not converged and count < iterations:
            return failure(problem, f"ended with {stats['return_status']}")
        found_inputs = bounded(np.array(found["x"]).ravel()[programme.input_at], lower, upper)
        if not np.isfinite(found_inputs).all():
            return failure(problem, "the solution is not finite")
        found_states, found_cost = rolled_out(problem, parameters, found_inputs)
        if found_cost <= cost and np.isfinite(found_states).all():  # False for NaN
            inputs, states, cost = found_inputs, found_states, found_cost
        return Solution(
            inputs=inputs,
            states=states,
            cost=cost,
            iterations=count,
            ok=True,
            status="converged" if converged else "iteration cap",
        )
