"""Gauss-Newton SQP with condensing: the default solver. A box QP by daqp a step, then a search on the true cost."""

from __future__ import annotations

import math
from collections.abc import Sequence

import daqp
import numpy as np

from asvhil.controller.solvers.graphs import LIMITED, POSE_AND_VELOCITY
from asvhil.controller.solvers.outcome import bounded, failure
from asvhil.controller.solvers.problem import Solution, StationProblem
from asvhil.dynamics import ordered
from asvhil.dynamics.arrays import Array, is_finite
from asvhil.dynamics.buffers import bind

ARMIJO = 0.25  # least part of the decrease predicted by the slope: longer steps zigzag
SHORTEST_STEP = 1.0 / 64.0
SHORTENED_TO = (0.25, 0.8)  # least and most of a step's length that is tried after it
TOLERANCE = 3e-4  # stop when the slope predicts a decrease of less than this part of the cost
USUAL = 3  # steps that suffice for a plan warm-started in each tick; more are taken only for a large decrease
COARSE = 1e-3  # the tolerance of further steps
DAMPING = 1e-9  # of the Hessian's mean diagonal: keeps it definite if an input has no weight
SIDES = 8  # QPs a step at most, to find beyond which soft limits it leads
QP_SOLVED = 1  # daqp's exit flag for an optimal solution
# Of full thrust: what a step of the inputs is rounded to, a hundredth of a pulse's resolution, and how near to the
# middle between two such values the answer of another machine may lie beyond it.
GRID, DOUBT = 2.0**-16, 2.0**-28


class Sqp:
    """Improves a start on the true cost of a `StationProblem`; works in buffers of its own, so one per thread.

    Equal calls give bit-identical results: nothing is carried from one call to the next. They do so on every machine:
    costs, gradients and states come from CasADi, whose operations have one order. The QP's matrix and its solution come
    from BLAS and daqp, whose last bits depend on the processor, so the inputs after a step are rounded; where the
    rounding itself could depend on these bits, the QP is solved again in one order of operations.
    """

    def __init__(self, problem: StationProblem) -> None:
        n, stages, width = problem.n_state, problem.stages, 2 * problem.stages
        self._problem = problem
        self._p, self._u = np.zeros(problem.n_parameters), np.zeros(width)
        self._x, self._cost = np.zeros((stages + 1) * n), np.zeros(1)
        self._reached = self._x.reshape(-1, n)[1:]  # after each stage
        self._blocks = np.zeros(stages * n * (n + 2))
        self._gradient = np.zeros(width)  # half of the cost's
        self._roll = bind(problem.rollout, [self._p, self._u], [self._x, self._cost])
        linearised = [self._x, self._blocks, self._cost, self._gradient]
        self._linearise = bind(problem.linearised, [self._p, self._u], linearised)
        # Row block k holds d s_k / d U over d a_k / d U, so that one product with [dF/ds | dF/da] gives d s_k+1 / d U.
        self._gains = np.zeros((stages + 1, n + 2, width))
        for k in range(stages):
            self._gains[k, n:, 2 * k : 2 * k + 2] = np.eye(2)
        blocks = self._blocks.reshape(stages, n, n + 2)
        self._chain = [(blocks[k], self._gains[k], self._gains[k + 1, :n]) for k in range(stages)]
        self._weighted_gains = self._gains[1:, :POSE_AND_VELOCITY]
        difference = np.eye(width) - np.eye(width, k=-2)
        self._smoothing = difference.T @ difference
        self._lower, self._upper = np.full(width, problem.lower), np.full(width, problem.upper)
        self._ones = np.ones((stages, POSE_AND_VELOCITY))
        self._moves = False  # the station
        self._no_rows = np.zeros((0, width))
        self._inequality = np.zeros(width, dtype=np.int32)

    def solve(self, parameters: Array, start: Array, iterations: int) -> Solution:
        """The best plan found from `start` (stages, 2), clipped into the bounds, in at most `iterations` QPs.

        A QP that fails ends the work and keeps the last good plan; `ok` is False where no QP was solved at all,
        or where anything is not finite. `status` says which.
        """
        problem = self._problem
        if not (is_finite(parameters) and is_finite(start)):
            return failure(problem, "the parameters or the start are not finite")
        lower, upper = problem.bounds(parameters)
        self._lower, self._upper = lower.ravel(), upper.ravel()
        u = bounded(np.asarray(start, dtype=float).ravel(), self._lower, self._upper)
        self._p[:] = parameters
        self._moves = problem.moves(self._p)
        weights, _, _, slew = problem.unpack_cost(self._p)
        soft = problem.soft_weights(self._p)
        root = np.sqrt(weights)
        smoothing = slew * self._smoothing

        cost, linearised = self._cost_of(u, linearise=True), True
        if not math.isfinite(cost):
            return failure(problem, "the prediction from the start is not finite")
        states = self._x.copy()
        solved, status = 0, "iteration cap"
        while solved < iterations:
            if not linearised:
                self._cost_of(u, linearise=True)
            step, slope = self._step(u, root, soft, smoothing)
            if step is None:
                status = "the QP failed"
                break
            solved += 1
            if -slope <= (TOLERANCE if solved <= USUAL else COARSE) * cost:
                status = "converged"
                break
            taken = self._search(u, step, slope, cost, linearise=solved < iterations)
            if taken is None:
                status = "no descent along the step"
                break
            u, cost, linearised = taken
            states[:] = self._x
        return Solution(
            inputs=u.reshape(-1, 2),
            states=states.reshape(problem.stages + 1, problem.n_state),
            cost=cost,
            iterations=solved,
            ok=solved > 0 and is_finite(states),
            status=status,
        )

    def _cost_of(self, u: Array, *, linearise: bool) -> float:
        """Cost of the inputs; leaves their states in the buffer, and if wanted the sensitivities and the gradient."""
        self._u[:] = u
        if linearise:
            self._linearise()
        else:
            self._roll()
        return float(self._cost[0])

    def _step(self, u: Array, root: Array, soft: Array | None, smoothing: Array) -> tuple[Array | None, float]:
        """The step of a QP within the bounds and the cost's slope along it, where u was linearised; None: it failed."""
        for block, gains, next_gains in self._chain:
            np.dot(block, gains, out=next_gains)
        jacobian = self._jacobian(root)
        hessian = _damped(jacobian.T @ jacobian + smoothing)
        if not (is_finite(hessian) and is_finite(self._gradient)):
            return None, 0.0
        lower, upper = self._lower - u, self._upper - u
        if soft is None:
            step, multipliers = self._solved(hessian, self._gradient, lower, upper)
            beyond = None
        else:
            step, multipliers, beyond = self._softly(hessian, soft, lower, upper)
        if step is None:
            return None, 0.0
        after, in_doubt = _rounded(u + step)
        if in_doubt:
            try:
                after, _ = _rounded(u + self._in_order(root, soft, beyond, smoothing, lower, upper, multipliers))
            except ordered.SingularMatrix:
                return None, 0.0
        step = bounded(after, self._lower, self._upper) - u
        return step, 2.0 * float(np.add.reduce(self._gradient * step))

    def _solved(self, hessian: Array, gradient: Array, lower: Array, upper: Array) -> tuple[Array | None, Array]:
        """The solution of a box QP and its multipliers; None where daqp has none."""
        step, _, flag, answer = daqp.solve(hessian, gradient, self._no_rows, upper, lower, self._inequality)
        return (step if flag == QP_SOLVED and is_finite(step) else None), answer["lam"]

    def _softly(self, hessian: Array, soft: Array, lower: Array, upper: Array) -> tuple[Array | None, Array, Array]:
        """The same with soft limits, and on which side each state is beyond its own after it: 1, -1 or 0 (stages, 4).

        The cost of an excess is quadratic on either side of a limit. A QP takes each state to be on the side that it
        had in the last one, until all are where they were taken to be (a semismooth Newton method). If that does not
        end, the QP with the states as they are now has the cost's gradient, and so a step that lowers it.
        """
        errors, rows = self._limited()
        most = np.array(self._problem.soft_limits)
        now = _sides(errors, most)
        smooth = self._gradient - self._pull(rows, soft, errors, now)
        beyond, first = now, None
        for _ in range(SIDES):
            of_excess = np.abs(beyond) * soft
            matrix = hessian + rows.T @ (of_excess.ravel()[:, None] * rows)
            step, multipliers = self._solved(matrix, smooth + self._pull(rows, soft, errors, beyond), lower, upper)
            if step is None:
                break
            first = first or (step, multipliers, beyond)
            after = _sides(errors + (rows @ step).reshape(errors.shape), most)
            if np.array_equal(after, beyond):
                return step, multipliers, beyond
            beyond = after
        return first or (None, multipliers, beyond)

    def _pull(self, rows: Array, soft: Array, errors: Array, beyond: Array) -> Array:
        """Half of the gradient by the inputs of the cost of an excess, of states on these sides of their limits."""
        pull: Array = rows.T @ (soft * _excess(errors, np.array(self._problem.soft_limits), beyond)).ravel()
        return pull

    def _limited(self) -> tuple[Array, Array]:
        """The errors that have a soft limit (stages, 4), and the Jacobian of them all in one column by the inputs."""
        errors = self._reached[:, :POSE_AND_VELOCITY] - self._problem.targets(self._p, self._reached)
        jacobian = self._jacobian(self._ones).reshape(len(errors), POSE_AND_VELOCITY, -1)
        return errors[:, LIMITED], jacobian[:, LIMITED].reshape(-1, jacobian.shape[-1])

    def _jacobian(self, root: Array) -> Array:
        """Of the weighted states after each stage, all in one column, by the inputs (6 * stages, 2 * stages)."""
        weighted: Array = root[:, :, None] * self._weighted_gains
        if self._moves:
            # The station's velocity in body axes, to which the boat's is relative, turns with the boat.
            moves = self._problem.targets(self._p, self._reached)[:, 3:5, None]
            turns = self._weighted_gains[:, 2]
            weighted[:, 3] -= root[:, 3, None] * moves[:, 1] * turns
            weighted[:, 4] += root[:, 4, None] * moves[:, 0] * turns
        return weighted.reshape(-1, weighted.shape[-1])

    def _in_order(
        self,
        root: Array,
        soft: Array | None,
        beyond: Array | None,
        smoothing: Array,
        lower: Array,
        upper: Array,
        multipliers: Array,
    ) -> Array:
        """The step of the QP in one order of operations, with the bounds active that have a multiplier."""
        for block, gains, next_gains in self._chain:
            next_gains[:] = ordered.product(block, gains)
        jacobian = self._jacobian(root)
        hessian = _damped(ordered.product(jacobian.T, jacobian) + smoothing)
        gradient = self._gradient
        if soft is not None and beyond is not None:
            errors, rows = self._limited()
            most = np.array(self._problem.soft_limits)
            now = _sides(errors, most)
            change = _excess(errors, most, beyond) - _excess(errors, most, now)
            gradient = gradient + ordered.product(rows.T, (soft * change).ravel())
            hessian = hessian + ordered.product(rows.T, (np.abs(beyond) * soft).ravel()[:, None] * rows)
        step: Array = np.where(multipliers > 0.0, upper, np.where(multipliers < 0.0, lower, 0.0))
        free = multipliers == 0.0
        pull = gradient + ordered.product(hessian, step)
        step[free] = ordered.solve(hessian[np.ix_(free, free)], -pull[free])
        return step

    def _search(
        self, u: Array, step: Array, slope: float, cost: float, *, linearise: bool
    ) -> tuple[Array, float, bool] | None:
        """The inputs after the first of ever shorter steps that lowers the true cost enough, their cost, and whether
        they are linearised.

        Where that is what comes next, the full step is linearised at once, since most are taken: the linearisation
        has the same cost to the last bit.

        The next length is the minimum of the parabola through what is known (Nocedal and Wright 2006, eq. 3.58): where
        the heading oscillates, the Gauss-Newton step is several times too long, and halving would be inaccurate.
        """
        length = 1.0
        least, most = SHORTENED_TO
        while length >= SHORTEST_STEP:
            trial = bounded(u + length * step, self._lower, self._upper)
            trial_cost = self._cost_of(trial, linearise=linearise)
            if trial_cost <= cost + ARMIJO * length * slope:  # False for NaN
                return trial, trial_cost, linearise
            linearise = False
            bend = trial_cost - cost - slope * length
            share = -0.5 * slope * length / bend if bend < np.inf else 0.0  # False for NaN too
            length *= min(max(share, least), most)
        return None


def _sides(errors: Array, most: Array) -> Array:
    """Beyond which limit each error is: 1 above the upper one, -1 below the lower one, 0 between them."""
    return (errors > most).astype(float) - (errors < -most)


def _excess(errors: Array, most: Array, sides: Array) -> Array:
    """By how much each error is beyond its limit, taken to be on one of its `_sides`; negative if it is not there."""
    excess: Array = np.abs(sides) * errors - sides * most
    return excess


def _damped(hessian: Array) -> Array:
    """A Hessian that is definite even if an input has no weight; changed in place."""
    diagonal = hessian.reshape(-1)[:: len(hessian) + 1]
    diagonal += DAMPING * (np.add.reduce(diagonal) / len(hessian)) + 1e-12
    return hessian


def _rounded(inputs: Array) -> tuple[Array, bool]:
    """The inputs on the grid, and whether any is so near to the middle between two of its points that it may be the
    other one elsewhere.
    """
    scaled = inputs / GRID
    nearest = np.rint(scaled)
    return nearest * GRID, bool(np.abs(scaled - nearest).max() > 0.5 - DOUBT / GRID)


def build(problem: StationProblem, caps: Sequence[int]) -> Sqp:
    """The solver of a problem; it needs nothing prepared for its caps."""
    return Sqp(problem)
