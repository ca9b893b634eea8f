"""What every solver hands back: plans held within their bounds and rolled out by the problem itself, and failures."""

from __future__ import annotations

import numpy as np

from asvhil.controller.solvers.problem import Solution, StationProblem
from asvhil.dynamics.arrays import Array


def bounded(inputs: Array, lower: Array, upper: Array) -> Array:
    """The inputs, each moved to its nearest bound where it is beyond it."""
    within: Array = np.minimum(np.maximum(inputs, lower), upper)
    return within


def rolled_out(problem: StationProblem, parameters: Array, inputs: Array) -> tuple[Array, float]:
    """States (stages + 1, n_state) and cost of inputs (stages, 2), so that costs of all solvers compare."""
    states, cost = problem.rollout(parameters, inputs.ravel())
    return np.array(states).reshape(problem.stages + 1, problem.n_state), float(cost)


def failure(problem: StationProblem, status: str) -> Solution:
    """No plan: zeros, and why."""
    return Solution(
        inputs=np.zeros((problem.stages, 2)),
        states=np.zeros((problem.stages + 1, problem.n_state)),
        cost=0.0,
        iterations=0,
        ok=False,
        status=status,
    )
