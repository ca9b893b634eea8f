"""The SQP solver against finite differences, a dense QP, IPOPT, and inputs that ought to fail."""

import casadi as ca
import daqp
import numpy as np
import pytest

from asvhil.config import MpcConfig, load_config
from asvhil.controller.solvers import sqp as sqp_module
from asvhil.controller.solvers.graphs import HEAD
from asvhil.controller.solvers.problem import StationProblem
from asvhil.controller.solvers.sqp import Sqp
from asvhil.dynamics.integrate import substeps
from asvhil.dynamics.rigid_body import SimplifiedDynamics

CONFIG = MpcConfig()
MODEL = SimplifiedDynamics(load_config("sitl").vehicle.vessel)
PROBLEM = StationProblem(MODEL, CONFIG)
SOLVER = Sqp(PROBLEM)
STATES = {
    "start of the six tests": (-14.0, -3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    "abeam": (0.5, 3.0, 0.2, 0.1, -0.1, 0.0, 0.1, 0.1),
    "turned and moving": (-4.0, 2.0, 1.5, 0.8, 0.2, -0.2, 0.5, -0.2),
    "on station": (0.2, -0.3, 0.05, -0.1, 0.05, 0.02, 0.0, 0.1),
}


def pack(state, weights=CONFIG.far, wind=(1.0, 3.0)):
    return PROBLEM.pack(state, wind, (0.01, -0.02, 0.002), 0.02, (0.1, -0.1), weights)


def starts():
    return [np.full((20, 2), level) for level in (0.0, 0.7 * MODEL.input_upper, 0.7 * MODEL.input_lower)]


def cost_of(p, u) -> float:
    return float(PROBLEM.rollout(p, u)[1])


@pytest.fixture(scope="module")
def ipopt():
    """IPOPT on the same problem by multiple shooting with the same integrator: a second opinion."""
    n, stages = PROBLEM.n_state, PROBLEM.stages
    p, inputs, states = ca.SX.sym("p", PROBLEM.n_parameters), ca.SX.sym("U", 2 * stages), ca.SX.sym("S", n * stages)
    gaps, cost, state = [], 0, p[:n]
    for k, step_s in enumerate(PROBLEM.steps_s):
        a = inputs[2 * k : 2 * k + 2]
        last = inputs[2 * k - 2 : 2 * k] if k else p[n + 5 : n + 7]
        count = substeps(step_s, MODEL.max_step_s)
        for _ in range(count):
            state = PROBLEM.substep(state, a, p[n : n + 2], p[n + 2 : n + 5], step_s / count)
        gaps.append(state - states[n * k : n * k + n])
        state = states[n * k : n * k + n]
        q = p[n + HEAD + 6 * k :][:6]
        cost += ca.dot(q, (state[:6] - ca.vertcat(0, 0, p[n + 7], 0, 0, 0)) ** 2) + p[n + 8] * ca.sumsqr(a - last)
    nlp = {"x": ca.vertcat(inputs, states), "p": p, "f": cost, "g": ca.vertcat(*gaps)}
    solver = ca.nlpsol("ipopt", "ipopt", nlp, {"print_time": False, "ipopt": {"print_level": 0, "max_iter": 200}})

    def best_of_three(p_value) -> float:
        costs = []
        for start in starts():
            rolled = np.array(PROBLEM.rollout(p_value, start.ravel())[0]).ravel()[n:]
            found = solver(
                x0=np.concatenate([start.ravel(), rolled]),
                p=p_value,
                lbx=[PROBLEM.lower] * (2 * stages) + [-np.inf] * (n * stages),
                ubx=[PROBLEM.upper] * (2 * stages) + [np.inf] * (n * stages),
                lbg=0.0,
                ubg=0.0,
            )
            if solver.stats()["success"]:
                costs.append(float(found["f"]))
        assert costs
        return min(costs)

    return best_of_three


@pytest.mark.parametrize("name", STATES)
def test_the_cost_is_within_half_a_percent_of_ipopt(ipopt, name):
    for weights in (CONFIG.far, CONFIG.near):
        p = pack(STATES[name], weights)
        best = min(SOLVER.solve(p, start, 40).cost for start in starts())
        assert best <= 1.005 * ipopt(p)


def captured_qp(monkeypatch, p, start):
    """Hessian, gradient and bounds of the first QP that the solver poses."""
    seen = []

    def spy(hessian, gradient, rows, upper, lower, sense):
        seen.append((hessian.copy(), gradient.copy(), lower.copy(), upper.copy()))
        return daqp.solve(hessian, gradient, rows, upper, lower, sense)

    with monkeypatch.context() as patch:
        patch.setattr(sqp_module, "daqp", Spy(spy))
        SOLVER.solve(p, start, 1)
    return seen[0]


class Spy:
    def __init__(self, solve) -> None:
        self.solve = solve


@pytest.mark.parametrize("name", STATES)
def test_the_gradient_matches_finite_differences_of_the_true_cost(monkeypatch, name):
    p, u = pack(STATES[name], CONFIG.near), np.random.default_rng(5).uniform(-0.3, 0.9, size=40)
    _, gradient, _, _ = captured_qp(monkeypatch, p, u.reshape(-1, 2))
    for j in range(0, 40, 3):
        e = np.zeros(40)
        e[j] = 1e-5
        slope = (cost_of(p, u + e) - cost_of(p, u - e)) / 2e-5
        assert 2.0 * gradient[j] == pytest.approx(slope, rel=1e-5, abs=1e-3)


def test_the_hessian_is_that_of_the_residuals(monkeypatch):
    """J'J built column by column from finite differences of the residual vector."""
    p, u = pack(STATES["turned and moving"], CONFIG.near), np.full(40, 0.2)
    hessian, _, _, _ = captured_qp(monkeypatch, p, u.reshape(-1, 2))
    weights, _, _, slew = PROBLEM.unpack_cost(p)

    def residuals(inputs):
        states = np.array(PROBLEM.rollout(p, inputs)[0]).reshape(21, 8)[1:, :6]
        moves = np.diff(np.concatenate([[0.1, -0.1], inputs]).reshape(-1, 2), axis=0)
        return np.concatenate([(np.sqrt(weights) * states).ravel(), np.sqrt(slew) * moves.ravel()])

    columns = [(residuals(u + 1e-5 * e) - residuals(u - 1e-5 * e)) / 2e-5 for e in np.eye(40)]
    jacobian = np.array(columns).T
    assert hessian == pytest.approx(jacobian.T @ jacobian, rel=1e-4, abs=1e-3 * np.abs(hessian).max())


def test_the_qp_solution_satisfies_the_kkt_conditions(monkeypatch):
    p = pack(STATES["start of the six tests"])
    hessian, gradient, lower, upper = captured_qp(monkeypatch, p, np.zeros((20, 2)))
    x, _, flag, _ = daqp.solve(hessian, gradient, np.zeros((0, 40)), upper, lower, np.zeros(40, dtype=np.int32))
    assert flag == 1
    pull = hessian @ x + gradient
    at_upper, at_lower = x > upper - 1e-9, x < lower + 1e-9
    assert at_upper.any()
    scale = np.abs(gradient).max()
    assert np.abs(pull[~at_upper & ~at_lower]).max() < 1e-6 * scale
    assert (pull[at_upper] < 1e-6 * scale).all()
    assert (pull[at_lower] > -1e-6 * scale).all()


@pytest.mark.parametrize("name", STATES)
def test_bounds_hold_and_the_states_and_cost_belong_to_the_inputs(name):
    p = pack(STATES[name], CONFIG.near)
    for start in (*starts(), np.full((20, 2), 5.0)):  # the last one starts out of bounds
        found = SOLVER.solve(p, start, 10)
        assert found.ok
        assert found.inputs.min() >= MODEL.input_lower
        assert found.inputs.max() <= MODEL.input_upper
        states, cost = PROBLEM.rollout(p, found.inputs.ravel())
        assert found.cost == float(cost)
        assert np.array_equal(found.states.ravel(), np.array(states).ravel())


def test_more_iterations_never_cost_more():
    p = pack(STATES["turned and moving"], CONFIG.near)
    costs = [SOLVER.solve(p, starts()[0], count).cost for count in (1, 2, 4, 8, 16)]
    assert costs == sorted(costs, reverse=True)
    assert costs[0] < cost_of(p, np.zeros(40))


def test_equal_calls_agree_to_the_bit_whatever_was_solved_between():
    p, q = pack(STATES["abeam"]), pack(STATES["start of the six tests"], CONFIG.near)
    first = SOLVER.solve(p, starts()[1], 7)
    SOLVER.solve(q, starts()[2], 5)
    SOLVER.solve(np.full_like(p, np.nan), starts()[0], 3)
    again, fresh = SOLVER.solve(p, starts()[1], 7), Sqp(PROBLEM).solve(p, starts()[1], 7)
    for other in (again, fresh):
        assert np.array_equal(first.inputs, other.inputs)
        assert (first.cost, first.iterations, first.status) == (other.cost, other.iterations, other.status)


def other_machine(monkeypatch, off: float):
    """QPs are answered with an error of up to `off`, as by another BLAS or another daqp."""
    rng = np.random.default_rng(1)

    def solve(hessian, *rest):
        step, value, flag, answer = daqp.solve(hessian, *rest)
        return step + rng.uniform(-off, off, step.size), value, flag, answer

    monkeypatch.setattr(sqp_module, "daqp", Spy(solve))


def plans() -> list:
    rng = np.random.default_rng(2)
    found = []
    for weights in (CONFIG.far, CONFIG.near):
        for state in STATES.values():
            p = pack(state, weights)
            found += [SOLVER.solve(p, rng.uniform(-0.5, 0.9, (20, 2)), 12) for _ in range(8)]
    return found


def test_last_bits_of_blas_and_daqp_change_no_bit_of_a_plan(monkeypatch):
    here = plans()
    other_machine(monkeypatch, 0.5 * sqp_module.DOUBT)
    for mine, theirs in zip(here, plans(), strict=True):
        assert np.array_equal(mine.inputs, theirs.inputs) and np.array_equal(mine.states, theirs.states)
        assert (mine.cost, mine.iterations, mine.status) == (theirs.cost, theirs.iterations, theirs.status)


def test_without_the_second_solution_they_would(monkeypatch):
    here = plans()
    other_machine(monkeypatch, 0.5 * sqp_module.DOUBT)
    monkeypatch.setattr(sqp_module, "DOUBT", 0.0)
    assert any(not np.array_equal(mine.inputs, theirs.inputs) for mine, theirs in zip(here, plans(), strict=True))


def test_the_solution_in_order_is_that_of_daqp(monkeypatch):
    off = []

    def spy(hessian, gradient, rows, upper, lower, sense):
        found = daqp.solve(hessian, gradient, rows, upper, lower, sense)
        weights, _, _, slew = PROBLEM.unpack_cost(SOLVER._p)
        exact = SOLVER._in_order(np.sqrt(weights), None, None, slew * SOLVER._smoothing, lower, upper, found[3]["lam"])
        off.append(np.abs(found[0] - exact).max())
        return found

    monkeypatch.setattr(sqp_module, "daqp", Spy(spy))
    plans()
    assert len(off) > 100
    assert max(off) < 0.1 * sqp_module.DOUBT


def test_a_converged_plan_is_left_alone():
    p = pack(STATES["on station"], CONFIG.near)
    found = SOLVER.solve(p, starts()[0], 60)
    for _ in range(5):  # steps past the usual ones end early: a plan is followed to its end over several calls
        found = SOLVER.solve(p, found.inputs, 60)
        assert found.status == "converged"
    again = SOLVER.solve(p, found.inputs, 60)
    assert (again.iterations, again.status, again.ok) == (1, "converged", True)
    assert np.array_equal(again.inputs, found.inputs)


def test_what_is_not_finite_fails_and_says_so():
    p = pack(STATES["abeam"])
    bad = p.copy()
    bad[3] = np.nan
    start = np.zeros((20, 2))
    found = SOLVER.solve(bad, start, 3)
    assert (found.ok, found.status) == (False, "the parameters or the start are not finite")
    start[4, 1] = np.inf
    assert not SOLVER.solve(p, start, 3).ok
    far_too_fast = p.copy()
    far_too_fast[3] = 1e200
    found = SOLVER.solve(far_too_fast, np.zeros((20, 2)), 3)
    assert (found.ok, found.status) == (False, "the prediction from the start is not finite")
    assert np.isfinite(found.inputs).all() and np.isfinite(found.states).all() and np.isfinite(found.cost)


@pytest.mark.parametrize(("good", "ok"), [(0, False), (2, True)])
def test_a_failing_qp_keeps_the_last_good_plan(monkeypatch, good, ok):
    """Not ok where no QP was solved; after some, the plan they gave."""
    p, calls = pack(STATES["start of the six tests"]), []

    def failing(*args):
        calls.append(1)
        x, value, flag, info = daqp.solve(*args)
        return (x, value, flag, info) if len(calls) <= good else (np.full(40, np.nan), value, -1, info)

    monkeypatch.setattr(sqp_module, "daqp", Spy(failing))
    found = SOLVER.solve(p, starts()[0], 5)
    assert (found.ok, found.iterations, found.status) == (ok, good, "the QP failed")
    assert np.isfinite(found.inputs).all() and np.isfinite(found.cost)
    if good:
        monkeypatch.undo()
        assert np.array_equal(found.inputs, SOLVER.solve(p, starts()[0], good).inputs)
