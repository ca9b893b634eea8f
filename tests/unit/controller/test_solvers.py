"""All solvers on one problem statement: the same optimum, bounds, failures, and bits; and the choice among them."""

import json
import subprocess
import sys
from importlib.util import find_spec

import casadi as ca
import numpy as np
import pytest

from asvhil.backseat.build import build_controller, build_model
from asvhil.config import Config, MpcConfig, MpcWeights, load_config
from asvhil.controller.solvers import fatrop as fatrop_module
from asvhil.controller.solvers.choice import choose_solver
from asvhil.controller.solvers.fatrop import Fatrop
from asvhil.controller.solvers.ipopt import Ipopt
from asvhil.controller.solvers.nlp import NlpSolver, transcribe
from asvhil.controller.solvers.problem import StationProblem
from asvhil.controller.solvers.sqp import Sqp
from asvhil.controller.solvers.torch_lqr import TorchLqr, box_qp
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.errors import ConfigError
from asvhil.types import Estimate, Station
from tests.support.paths import ROOT

# Weights under which the optimum is one valley: here solvers are compared, not starts.
CONFIG = MpcConfig(last_step_s=0.2, near=MpcWeights(heading=200.0, sideways=0.7))
MODEL = SimplifiedDynamics(load_config("sitl").vehicle.vessel)
PROBLEM = StationProblem(MODEL, CONFIG)
CAP = 300
MAKERS = {
    "sqp": lambda: Sqp(PROBLEM),
    "ipopt": lambda: Ipopt(PROBLEM, (CAP,)),
    "fatrop": lambda: Fatrop(PROBLEM, (CAP,)),
    "torch-lqr": lambda: TorchLqr(PROBLEM, batched=True),
}
if not fatrop_module.available():
    MAKERS["fatrop"] = lambda: pytest.skip("this build of CasADi comes without fatrop")
STATES = {
    "start of the six tests": (-14.0, -3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    "abeam": (0.5, 3.0, 0.2, 0.1, -0.1, 0.0, 0.1, 0.1),
    "on station": (0.2, -0.3, 0.05, -0.1, 0.05, 0.02, 0.0, 0.1),
}
SOLVERS: dict[str, object] = {}
QUIET = {"print_level": 0, "sb": "yes"}


def pack(state, weights=CONFIG.far):
    return PROBLEM.pack(state, (1.0, 3.0), (0.01, -0.02, 0.002), 0.02, (0.1, -0.1), weights)


def level(share: float) -> np.ndarray:
    return np.full((20, 2), share)


@pytest.fixture(params=list(MAKERS))
def name(request) -> str:
    return request.param


@pytest.fixture
def solver(name):
    if name not in SOLVERS:
        SOLVERS[name] = MAKERS[name]()
    return SOLVERS[name]


@pytest.fixture(scope="module")
def optima() -> dict[tuple[str, bool], float]:
    """The best of three converged IPOPT starts for each state, far and near."""
    reference, best = Ipopt(PROBLEM, (CAP,)), {}
    for state in STATES:
        for near in (False, True):
            p = pack(STATES[state], CONFIG.near if near else CONFIG.far)
            found = [reference.solve(p, level(share), CAP) for share in (0.0, 0.7, -0.2)]
            assert all(f.status == "converged" for f in found)
            best[state, near] = min(f.cost for f in found)
    return best


# --- the line search of the default ------------------------------------------------------------------------


def searched(monkeypatch, cost_at) -> tuple[list[float], float | None]:
    """Lengths that the search tries on a cost of the step's length (slope -1 at the start), and the one it takes."""
    solver, tried = Sqp(PROBLEM), []

    def cost_of(u: np.ndarray, *, linearise: bool) -> float:
        tried.append(float(u[0]))
        assert linearise == (len(tried) == 1)  # the full step, in case that it is taken
        return cost_at(tried[-1])

    monkeypatch.setattr(solver, "_cost_of", cost_of)
    step = np.zeros(2 * PROBLEM.stages)
    step[0] = 1.0
    taken = solver._search(np.zeros_like(step), step, -1.0, 0.0, linearise=True)
    assert taken is None or taken[2] == (len(tried) == 1)
    return tried, None if taken is None else float(taken[0][0])


def test_a_step_too_long_is_cut_to_the_minimum_of_the_parabola(monkeypatch):
    # -a + 1.25 a^2 has its minimum at 0.4; the full step costs more than the start.
    tried, taken = searched(monkeypatch, lambda a: -a + 1.25 * a**2)
    assert tried == [1.0, taken] and taken == pytest.approx(0.4)


def test_a_step_with_enough_decrease_is_taken_in_full(monkeypatch):
    assert searched(monkeypatch, lambda a: -a + 0.7 * a**2) == ([1.0], 1.0)


def test_a_step_with_too_little_decrease_is_shortened(monkeypatch):
    tried, taken = searched(monkeypatch, lambda a: -a + 0.9 * a**2)  # a tenth of what the slope promises
    assert len(tried) == 2 and taken == pytest.approx(1.0 / 1.8)


@pytest.mark.parametrize("beyond", [np.nan, np.inf, 1e9])
def test_a_cost_that_is_not_finite_shortens_the_step_to_a_quarter(monkeypatch, beyond):
    tried, taken = searched(monkeypatch, lambda a: beyond if a > 0.1 else -a)
    assert tried == [1.0, 0.25, 0.0625] and taken == 0.0625


def test_without_descent_the_search_ends(monkeypatch):
    tried, taken = searched(monkeypatch, lambda a: 1e-9)
    assert taken is None and len(tried) < 10


# --- the same optimum --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("state", "near"),
    [
        ("start of the six tests", False),
        pytest.param("abeam", True, marks=pytest.mark.thorough),
        ("on station", True),
        *(
            pytest.param(state, near, marks=pytest.mark.thorough)
            for state, near in (("start of the six tests", True), ("abeam", False), ("on station", False))
        ),
    ],
)
def test_all_solvers_find_the_same_optimum(solver, optima, state, near):
    p = pack(STATES[state], CONFIG.near if near else CONFIG.far)
    found = [solver.solve(p, level(share), CAP) for share in (0.0, 0.7)]
    assert all(f.ok for f in found)
    assert min(f.cost for f in found) == pytest.approx(optima[state, near], rel=0.005)


def test_a_growing_grid_gives_the_same_optimum_too(name):
    """Stages of one and of two substeps; every solver counts them alike."""
    problem = StationProblem(MODEL, MpcConfig(stages=10))
    p = problem.pack(STATES["abeam"], (1.0, 3.0), (0.01, -0.02, 0.002), 0.02, (0.1, -0.1), CONFIG.far)
    makers = {"sqp": Sqp, "ipopt": Ipopt, "fatrop": Fatrop, "torch-lqr": lambda q: TorchLqr(q, batched=True)}
    if name == "fatrop" and not fatrop_module.available():
        pytest.skip("this build of CasADi comes without fatrop")
    assert set(problem.substep_counts) == {1, 2}
    start = Sqp(problem).solve(p, np.zeros((10, 2)), 100).inputs  # one basin
    best = Ipopt(problem).solve(p, start, CAP).cost
    assert makers[name](problem).solve(p, start, CAP).cost == pytest.approx(best, rel=0.002)


def test_the_programme_is_the_problem_whichever_way_it_is_written():
    """At a rolled-out plan the gaps are closed and the cost is that of the rollout; off it, a gap opens."""
    p, u = pack(STATES["abeam"], CONFIG.near), np.random.default_rng(2).uniform(-0.3, 1.0, size=(20, 2))
    states, cost = PROBLEM.rollout(p, u.ravel())
    states = np.array(states).reshape(21, 8)
    for carry in (False, True):
        programme = transcribe(PROBLEM, carry)
        symbols = programme.symbols
        evaluate = ca.Function("evaluate", [symbols["x"], symbols["p"]], [symbols["f"], symbols["g"]])
        x = np.zeros(symbols["x"].numel())
        x[programme.state_at], x[programme.input_at] = states, u
        if carry:
            x[programme.carried_at] = np.concatenate([[[0.1, -0.1]], u])
        f, g = evaluate(x, p)
        assert float(f) == pytest.approx(float(cost), rel=1e-12)
        assert np.abs(np.array(g)).max() < 1e-12
        x[programme.state_at[7, 1]] += 0.1
        assert np.abs(np.array(evaluate(x, p)[1])).max() == pytest.approx(0.1, rel=0.01)


# --- what every solver promises ----------------------------------------------------------------------------


@pytest.mark.parametrize("cap", [2, CAP])
def test_bounds_hold_and_states_and_cost_belong_to_the_inputs(name, solver, cap):
    p = pack(STATES["start of the six tests"], CONFIG.near)
    for share in (0.0, 5.0):  # the second start is out of bounds
        found = solver.solve(p, level(share), cap)
        assert found.ok and found.iterations <= cap
        assert found.inputs.shape == (20, 2) and found.states.shape == (21, 8)
        assert found.inputs.min() >= MODEL.input_lower and found.inputs.max() <= MODEL.input_upper
        states, cost = PROBLEM.rollout(p, found.inputs.ravel())
        assert found.cost == pytest.approx(float(cost), rel=1e-12)
        assert found.states.ravel() == pytest.approx(np.array(states).ravel(), abs=1e-12)


def test_the_plan_never_costs_more_than_its_start_and_a_stop_is_reported(name, solver):
    p = pack((-4.0, 2.0, 1.5, 0.8, 0.2, -0.2, 0.5, -0.2), CONFIG.near)
    start_cost = float(PROBLEM.rollout(p, level(0.1).ravel())[1])
    for cap in (1, 3):
        found = solver.solve(p, level(0.1), cap)
        assert (found.ok, found.iterations, found.status) == (True, cap, "iteration cap")
        assert found.cost <= start_cost


def test_equal_calls_agree_to_the_bit_whatever_was_solved_between(name, solver):
    p, q = pack(STATES["abeam"]), pack(STATES["start of the six tests"], CONFIG.near)
    first = solver.solve(p, level(0.3), 6)
    solver.solve(q, level(-0.2), 6)
    solver.solve(np.full_like(p, np.nan), level(0.0), 6)
    for other in (solver.solve(p, level(0.3), 6), MAKERS[name]().solve(p, level(0.3), 6)):
        assert np.array_equal(first.inputs, other.inputs)
        assert (first.cost, first.iterations, first.status) == (other.cost, other.iterations, other.status)


def test_what_is_not_finite_fails_and_says_so(solver):
    p, start = pack(STATES["abeam"]), np.zeros((20, 2))
    for i in (3, PROBLEM.n_state, PROBLEM.n_state + 6):  # state, wind, previous input
        bad = p.copy()
        bad[i] = np.nan
        found = solver.solve(bad, start, 6)
        assert (found.ok, found.status) == (False, "the parameters or the start are not finite")
    start[4, 1] = np.inf
    assert not solver.solve(p, start, 6).ok
    far_too_fast = p.copy()
    far_too_fast[3] = 1e200
    found = solver.solve(far_too_fast, np.zeros((20, 2)), 6)
    assert (found.ok, found.status) == (False, "the prediction from the start is not finite")
    assert np.isfinite(found.inputs).all() and np.isfinite(found.states).all() and np.isfinite(found.cost)


def test_an_end_that_is_no_solution_is_a_failure():
    """IPOPT is made to stop before its first step, and CasADi to refuse bounds that cross."""

    def hasty(symbols, cap):
        return ca.nlpsol("hasty", "ipopt", symbols, {"print_time": False, "ipopt": {"max_cpu_time": 1e-9, **QUIET}})

    hurried, crossed = NlpSolver(PROBLEM, False, hasty, ()), Ipopt(PROBLEM)
    crossed._lower[0], crossed._upper[0] = 1.0, -1.0
    statuses = []
    for solver in (hurried, crossed):
        found = solver.solve(pack(STATES["abeam"]), level(0.0), CAP)
        assert not found.ok and np.array_equal(found.inputs, np.zeros((20, 2)))
        statuses.append(found.status)
    assert statuses == ["ended with Maximum_CpuTime_Exceeded", "CasADi refused the problem"]


# --- the iterative LQR ---------------------------------------------------------------------------------------


def test_autograd_gives_the_sensitivities_of_casadi_stage_by_stage_and_batched():
    p, u = pack(STATES["abeam"]), np.random.default_rng(4).uniform(-0.3, 1.0, size=(20, 2))
    _, blocks, _, _ = PROBLEM.linearised(p, u.ravel())
    expected = np.array(blocks).reshape(20, 8, 10)
    for batched in (False, True):
        solver, seen = TorchLqr(PROBLEM, batched), []
        original = solver._linearise
        solver._linearise = lambda *args, f=original, s=seen: s.append(f(*args)) or s[-1]
        solver.solve(p, u, 1)
        assert seen[0] == pytest.approx(expected, abs=1e-12)


def test_batched_and_stage_by_stage_give_the_same_plan():
    p = pack(STATES["on station"], CONFIG.near)
    one, other = (TorchLqr(PROBLEM, batched).solve(p, level(0.0), 2) for batched in (False, True))
    assert one.inputs == pytest.approx(other.inputs, abs=1e-12)


def test_the_box_qp_finds_the_corner_the_edge_and_the_inside():
    hessian = np.array([[2.0, 1.0], [1.0, 3.0]])
    lower, upper = np.array([-1.0, -1.0]), np.array([1.0, 1.0])
    x, free = box_qp(hessian, np.array([-1.0, 0.5]), lower, upper)
    assert x == pytest.approx([0.7, -0.4]) and free.tolist() == [True, True]
    x, free = box_qp(hessian, np.array([-6.0, 0.5]), lower, upper)
    assert x == pytest.approx([1.0, -0.5]) and free.tolist() == [False, True]
    x, free = box_qp(hessian, np.array([-9.0, 9.0]), lower, upper)
    assert x == pytest.approx([1.0, -1.0]) and free.tolist() == [False, False]


@pytest.mark.skipif(find_spec("mpc") is None, reason="the package mpc is not installed: make test does it")
@pytest.mark.thorough
def test_it_takes_the_steps_of_the_package_mpc(tmp_path):
    config = load_config("sitl", ("controller.mpc.last_step_s=0.2",))
    cases = [pack(state, w) for state in list(STATES.values())[1:] for w in (CONFIG.far, CONFIG.near)]
    file = tmp_path / "problems.npz"
    np.savez(
        file,
        config=config.canonical_json(),
        model_file="",
        parameters=np.array(cases),
        starts=np.array([level(0.2)] * len(cases)),
        lqr_iterations=2,
    )
    script = ROOT / "tests" / "peers" / "mpc_torch_peer.py"
    done = subprocess.run([sys.executable, script, file], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    peer = json.loads(done.stdout.splitlines()[-1])
    ours = [TorchLqr(PROBLEM, batched=True).solve(p, level(0.2), 2) for p in cases]
    for mine, cost, inputs in zip(ours, peer["cost"], peer["inputs"], strict=True):
        assert mine.cost == pytest.approx(cost, rel=1e-6)
        assert mine.inputs == pytest.approx(np.array(inputs), abs=1e-6)


# --- the choice ----------------------------------------------------------------------------------------------


def sitl(solver: str, *overrides: str) -> Config:
    return load_config("sitl", (f"controller.solver={solver}", "controller.name=sd-mpc", *overrides))


@pytest.mark.parametrize(
    ("solver", "kind", "caps"),
    [("sqp", Sqp, ()), ("ipopt", Ipopt, (100, 0)), ("fatrop", Fatrop, (100, 0)), ("torch-lqr", TorchLqr, (2, 0))],
)
def test_the_config_chooses_the_solver_and_its_caps(solver, kind, caps):
    if kind is Fatrop and not fatrop_module.available():
        pytest.skip("this build of CasADi comes without fatrop")
    config = sitl(solver).controller
    mpc, make = choose_solver(config)
    assert isinstance(make(PROBLEM), kind)
    assert (mpc.iterations, mpc.alternate_iterations) == (
        (config.mpc.iterations, config.mpc.alternate_iterations) if solver == "sqp" else caps
    )
    assert mpc.near == config.mpc.near


def test_an_unknown_solver_is_refused_by_name():
    with pytest.raises(ConfigError, match=r"controller\.solver"):
        sitl("snopt")


def test_without_fatrop_or_torch_the_config_says_what_is_missing(monkeypatch):
    monkeypatch.setattr(fatrop_module, "available", lambda: False)
    with pytest.raises(ConfigError, match="without fatrop; use sqp or ipopt"):
        choose_solver(sitl("fatrop").controller)[1](PROBLEM)
    monkeypatch.setitem(sys.modules, "asvhil.controller.solvers.torch_lqr", None)
    with pytest.raises(ConfigError, match=r"install asvhil\[train\]"):
        choose_solver(sitl("torch-lqr").controller)


@pytest.mark.parametrize("solver", ["ipopt", "fatrop", "torch-lqr"])
def test_the_controller_drives_with_any_of_them_as_with_the_default(solver):
    if solver == "fatrop" and not fatrop_module.available():
        pytest.skip("this build of CasADi comes without fatrop")
    at = Estimate(
        t_ns=0,
        n_m=-14.0,
        e_m=-3.0,
        psi_rad=0.0,
        u_mps=0.0,
        v_mps=0.0,
        r_radps=0.0,
        motor=(0.0, 0.0),
        std=(0.1,) * 6,
        disturbance=(0.0, 0.0, 0.0),
        valid=True,
    )
    grid = "controller.mpc.last_step_s=0.2"
    controls = []
    for config in (sitl(solver, grid), sitl("sqp", grid)):
        controller = build_controller(config, build_model(config))
        controls.append(controller.step(at, None, Station(n_m=0.0, e_m=0.0, psi_rad=0.0)))
    assert controls[0].ok
    assert controls[0].command == pytest.approx(controls[1].command, abs=0.02)


def test_the_default_solver_imports_no_torch():
    code = (
        "import sys\n"
        "from asvhil.config import load_config\n"
        "from asvhil.backseat.build import build_backseat\n"
        "build_backseat(load_config('sitl'))\n"
        "sys.exit('torch' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0
