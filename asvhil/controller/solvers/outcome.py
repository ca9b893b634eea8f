"""Results of solvers: plans within their bounds, rolled out by the problem itself, and failures."""

from __future__ import annotations

import numpy as np

from asvhil.controller.solvers.problem import Solution, StationProblem
from asvhil.dynamics.arrays import Array


def bounded(inputs: Array, lower: Array, upper: Array) -> Array:
    """The inputs (stages, 2), clamped to their bounds."""
    within: Array = np.minimum(np.maximum(inputs, lower), upper)
    return within


def rolled_out(problem: StationProblem, parameters: Array, inputs: Array) -> tuple[Array, float]:
    """States (stages + 1, n_state) and cost of inputs (stages, 2), so that the costs of all solvers are comparable."""
    states, cost = problem.rollout(parameters, inputs.ravel())
    return np.array(states).reshape(problem.stages + 1, problem.n_state), float(cost)


def failure(problem: StationProblem, status: str) -> Solution:
    """The solution of a failed solver: zeros, not ok, and the reason."""
    return Solution(
        inputs=np.zeros((problem.stages, 2)),
        states=np.zeros((problem.stages + 1, problem.n_state)),
        cost=0.0,
        iterations=0,
        ok=False,
        status=status,
    )
