"""Box-constrained iterative LQR on torch autodiff: the paper's first solver, after mpc.torch (Amos et al. 2018).

Control-limited differential dynamic programming (Tassa et al. 2014) with dynamics of first order: linearise along the
path, go back through the stages with a box QP for each input, roll the feedback out with a line search. Importing this
module imports torch; nothing else of the controller does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from asvhil.controller.solvers.graphs import LIMITED, POSE_AND_VELOCITY
from asvhil.controller.solvers.outcome import bounded, failure, rolled_out
from asvhil.controller.solvers.problem import Solution, StationProblem
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.integrate import advance
from asvhil.types import record

SEARCH_DECAY, SEARCH_STEPS = 0.2, 10  # as in mpc.torch
TOLERANCE = 1e-7  # stop where an iteration gains less than this part of the cost
DAMPING = 1e-9
QP_STEPS, QP_TOLERANCE, QP_ARMIJO, QP_DECAY = 20, 1e-9, 0.1, 0.1


@record
class Terms:
    """The numbers of one problem: cost (J is the sum of squares, unhalved) and what the dynamics are driven by."""

    parameters: Array
    weights: Array  # (stages, 6) of the states after each stage
    soft: Array | None  # (stages, 4) of the excess of psi, u, v and r over their soft limits
    previous: Array  # (2,)
    slew: float
    wind: Tensor
    push: Tensor


class TorchLqr:
    """Solves a `StationProblem` on the torch form of its model. No memory from one call to the next.

    `batched` differentiates all stages at once, rather than each by itself as mpc.torch does: the same, faster.
    """

    def __init__(self, problem: StationProblem, batched: bool = False) -> None:
        self._problem = problem
        counts = np.array(problem.substep_counts)
        # Stages in one batch must have as many substeps.
        alike = [np.flatnonzero(counts == count) for count in sorted(set(counts.tolist()))]
        self._groups = alike if batched else [np.array([k]) for k in range(problem.stages)]
        self._steps_s = torch.tensor(problem.steps_s, dtype=torch.float64)[:, None]

    def solve(self, parameters: Array, start: Array, iterations: int) -> Solution:
        """The best plan found from `start` (stages, 2), clipped into the bounds, in at most `iterations` LQR steps.

        `ok` is False where anything is not finite. `status` says which.
        """
        problem, n = self._problem, self._problem.n_state
        if not (np.isfinite(parameters).all() and np.isfinite(start).all()):
            return failure(problem, "the parameters or the start are not finite")
        weights, _, previous, slew = problem.unpack_cost(parameters)
        terms = Terms(
            parameters=np.asarray(parameters, dtype=float),
            weights=weights,
            soft=problem.soft_weights(parameters),
            previous=previous,
            slew=slew,
            wind=torch.tensor(parameters[n : n + 2], dtype=torch.float64),
            push=torch.tensor(parameters[n + 2 : n + 5], dtype=torch.float64),
        )
        self._bounds = problem.bounds(parameters)
        inputs = bounded(np.asarray(start, dtype=float).reshape(-1, 2), *self._bounds)
        states, cost = rolled_out(problem, parameters, inputs)
        if not (np.isfinite(cost) and np.isfinite(states).all()):
            return failure(problem, "the prediction from the start is not finite")
        done, status = 0, "iteration cap"
        while done < iterations:
            blocks = self._linearise(terms, states, inputs)
            if not np.isfinite(blocks).all():
                return failure(problem, "the linearisation is not finite")
            moves, gains = self._backward(terms, states, inputs, blocks)
            done += 1
            found = self._search(terms, states, inputs, cost, moves, gains)
            if found is None:
                status = "no descent along the step"
                break
            gained = cost - found[2]
            states, inputs, cost = found
            if gained <= TOLERANCE * cost:
                status = "converged"
                break
        states, cost = rolled_out(problem, parameters, inputs)
        return Solution(
            inputs=inputs,
            states=states,
            cost=cost,
            iterations=done,
            ok=bool(np.isfinite(states).all() and np.isfinite(cost)),
            status=status,
        )

    def _linearise(self, terms: Terms, states: Array, inputs: Array) -> Array:
        """[dF/ds | dF/da] (stages, n, n + 2) by one backward pass of autograd for each row."""
        n = self._problem.n_state
        blocks = np.empty((self._problem.stages, n, n + 2))
        for stages in self._groups:
            s = torch.tensor(states[stages], dtype=torch.float64, requires_grad=True)
            a = torch.tensor(inputs[stages], dtype=torch.float64, requires_grad=True)
            count = self._problem.substep_counts[int(stages[0])]
            model, step_s = self._problem.model, self._steps_s[stages]
            after = advance(model, s, a, terms.wind, terms.push, step_s, count)
            for i in range(n):
                rows = torch.autograd.grad(
                    after[:, i].sum(), (s, a), retain_graph=i < n - 1, allow_unused=True, materialize_grads=True
                )
                blocks[stages, i, :n], blocks[stages, i, n:] = rows[0].numpy(), rows[1].numpy()
        return blocks

    def _backward(self, terms: Terms, states: Array, inputs: Array, blocks: Array) -> tuple[Array, Array]:
        """Moves (stages, 2) and gains (stages, 2, n + 2) over z = (s, the input before): the Riccati recursion."""
        problem, n = self._problem, self._problem.n_state
        moves, gains = np.zeros((problem.stages, 2)), np.zeros((problem.stages, 2, n + 2))
        targets = problem.targets(terms.parameters, states[1:])
        errors = states[1:, :POSE_AND_VELOCITY] - targets
        weights, pulls = terms.weights, terms.weights * errors
        if terms.soft is not None:
            excess = problem.excess(errors)
            weights = weights.copy()
            weights[:, LIMITED] += terms.soft * (excess != 0.0)
            pulls[:, LIMITED] += terms.soft * excess
        # d error / d state: a station's velocity in body axes depends on the heading.
        slopes = np.tile(np.eye(POSE_AND_VELOCITY), (problem.stages, 1, 1))
        slopes[:, 3, 2], slopes[:, 4, 2] = -targets[:, 4], targets[:, 3]
        before = np.concatenate([terms.previous[None], inputs[:-1]])
        value_x, value_xx = np.zeros(n + 2), np.zeros((n + 2, n + 2))
        carried = slice(POSE_AND_VELOCITY)
        slew = terms.slew * np.eye(2)
        a_z, b_z = np.zeros((n + 2, n + 2)), np.zeros((n + 2, 2))
        b_z[n:] = np.eye(2)
        for k in reversed(range(problem.stages)):
            # The cost of the state after this stage belongs to the value there. All of it halved.
            value_x[carried] += slopes[k].T @ pulls[k]
            value_xx[carried, carried] += slopes[k].T @ (weights[k][:, None] * slopes[k])
            a_z[:n, :n], b_z[:n] = blocks[k, :, :n], blocks[k, :, n:]
            change = terms.slew * (inputs[k] - before[k])
            q_x, q_u = a_z.T @ value_x, b_z.T @ value_x + change
            q_x[n:] -= change
            q_xx, q_uu, q_ux = a_z.T @ value_xx @ a_z, b_z.T @ value_xx @ b_z + slew, b_z.T @ value_xx @ a_z
            q_xx[n:, n:] += slew
            q_ux[:, n:] -= slew
            q_uu += (DAMPING * np.trace(q_uu) + 1e-12) * np.eye(2)
            lower, upper = (bound[k] - inputs[k] for bound in self._bounds)
            move, free = box_qp(q_uu, q_u, lower, upper)
            gain = np.zeros((2, n + 2))
            if free.any():
                gain[free] = -np.linalg.solve(q_uu[np.ix_(free, free)], q_ux[free])
            moves[k], gains[k] = move, gain
            value_x = q_x + gain.T @ (q_uu @ move + q_u) + q_ux.T @ move
            value_xx = q_xx + gain.T @ q_uu @ gain + gain.T @ q_ux + q_ux.T @ gain
            value_xx = 0.5 * (value_xx + value_xx.T)
        return moves, gains

    def _search(
        self, terms: Terms, states: Array, inputs: Array, cost: float, moves: Array, gains: Array
    ) -> tuple[Array, Array, float] | None:
        """The first of the shrinking steps that does not raise the cost: states, inputs and cost."""
        length = 1.0
        for _ in range(SEARCH_STEPS):
            found = self._forward(terms, states, inputs, length * moves, gains)
            if found[2] <= cost:  # False for NaN
                return found
            length *= SEARCH_DECAY
        return None

    def _forward(
        self, terms: Terms, states: Array, inputs: Array, moves: Array, gains: Array
    ) -> tuple[Array, Array, float]:
        """The path under moves and feedback about (states, inputs), inputs within their bounds, and its cost."""
        problem, n = self._problem, self._problem.n_state
        new_states, new_inputs = np.empty_like(states), np.empty_like(inputs)
        new_states[0] = states[0]
        off = np.zeros(n + 2)
        with torch.no_grad(), np.errstate(over="ignore", invalid="ignore"):  # a diverging path is rejected
            for k in range(problem.stages):
                off[:n] = new_states[k] - states[k]
                new_inputs[k] = bounded(inputs[k] + moves[k] + gains[k] @ off, *(bound[k] for bound in self._bounds))
                off[n:] = new_inputs[k] - inputs[k]
                s, a = torch.from_numpy(new_states[k]), torch.from_numpy(new_inputs[k])
                count = problem.substep_counts[k]
                after = advance(problem.model, s, a, terms.wind, terms.push, float(problem.steps_s[k]), count)
                new_states[k + 1] = after.numpy()
        errors = new_states[1:, :POSE_AND_VELOCITY] - problem.targets(terms.parameters, new_states[1:])
        changes = np.diff(np.concatenate([terms.previous[None], new_inputs]), axis=0)
        cost = float((terms.weights * errors**2).sum() + terms.slew * (changes**2).sum())
        if terms.soft is not None:
            cost += float((terms.soft * problem.excess(errors) ** 2).sum())
        return new_states, new_inputs, cost


def box_qp(hessian: Array, gradient: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """min x'Hx/2 + g'x within bounds by projected Newton steps (Tassa et al. 2014): x, and which of it is free."""
    x = np.clip(np.zeros(gradient.size), lower, upper)
    free = np.ones(gradient.size, dtype=bool)

    def objective(at: Array) -> float:
        return float(0.5 * at @ hessian @ at + gradient @ at)

    for _ in range(QP_STEPS):
        slope = hessian @ x + gradient
        free = ~(((x <= lower) & (slope > 0.0)) | ((x >= upper) & (slope < 0.0)))
        if not free.any():
            break
        step = np.zeros(x.size)
        step[free] = -np.linalg.solve(hessian[np.ix_(free, free)], slope[free])
        if np.abs(step).max() < QP_TOLERANCE:
            break
        length, value = 1.0, objective(x)
        trial = np.clip(x + step, lower, upper)
        while objective(trial) > value + QP_ARMIJO * slope @ (trial - x) and length > 1e-9:
            length *= QP_DECAY
            trial = np.clip(x + length * step, lower, upper)
        x = trial
    return x, free


def build(problem: StationProblem, caps: Sequence[int]) -> TorchLqr:
    """The solver of a problem; it needs nothing prepared for its caps."""
    return TorchLqr(problem)
