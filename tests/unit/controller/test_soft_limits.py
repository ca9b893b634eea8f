"""Soft limits of heading, speed and yaw rate: cost, gradient and plans of every solver, and what a controller does."""

import math

import numpy as np
import pytest

from asvhil.backseat.build import build_controller, build_model
from asvhil.config import MpcConfig, SoftLimits, load_config
from asvhil.controller.solvers import fatrop as fatrop_module
from asvhil.controller.solvers import sqp as sqp_module
from asvhil.controller.solvers.fatrop import Fatrop
from asvhil.controller.solvers.ipopt import Ipopt
from asvhil.controller.solvers.problem import StationProblem
from asvhil.controller.solvers.sqp import Sqp
from asvhil.controller.solvers.torch_lqr import TorchLqr
from asvhil.errors import ConfigError
from asvhil.types import Estimate, Station
from tests.unit.controller.test_sqp import MODEL, STATES, captured_qp
from tests.unit.controller.test_sqp import PROBLEM as UNLIMITED

WITHOUT = MpcConfig().near
# So much weight that what depends on the limits shows.
SOFT = WITHOUT.model_copy(update={"soft": 300.0})
CONFIG = MpcConfig(soft_limits=SoftLimits(), near=SOFT)
PROBLEM = StationProblem(MODEL, CONFIG)
SOLVER = Sqp(PROBLEM)
MOVES = (0.25, -0.2)


def pack(name: str, weights=SOFT, problem=PROBLEM, moves=(0.0, 0.0)):
    return problem.pack(STATES[name], (1.0, 3.0), (0.01, -0.02, 0.002), 0.02, (0.1, -0.1), weights, 0.0, moves)


def cost_of(p, u) -> float:
    return float(PROBLEM.rollout(p, u)[1])


def errors_of(p, u):
    states = np.array(PROBLEM.rollout(p, u)[0]).reshape(PROBLEM.stages + 1, -1)[1:]
    return states[:, :6] - PROBLEM.targets(p, states)


@pytest.mark.parametrize("moves", [(0.0, 0.0), MOVES], ids=["station at rest", "station that moves"])
@pytest.mark.parametrize("name", STATES)
def test_the_cost_adds_the_squared_excess_as_a_share_of_each_limit(name, moves):
    u = np.random.default_rng(7).uniform(-0.3, 0.9, size=40)
    with_limits, without = (pack(name, weights, moves=moves) for weights in (SOFT, WITHOUT))
    excess = 0.0
    for step_s, (_, _, psi, surge, sway, r) in zip(PROBLEM.steps_s, errors_of(with_limits, u), strict=True):
        for error, most in ((psi, math.radians(17.0)), (surge, 0.3), (sway, 0.3), (r, math.radians(3.0))):
            excess += step_s * max(abs(error) / most - 1.0, 0.0) ** 2
    assert excess > 1.0
    assert cost_of(with_limits, u) - cost_of(without, u) == pytest.approx(300.0 * excess, rel=1e-9)


@pytest.mark.parametrize("moves", [(0.0, 0.0), MOVES], ids=["station at rest", "station that moves"])
@pytest.mark.parametrize("name", STATES)
def test_the_gradient_is_that_of_the_true_cost(monkeypatch, name, moves):
    monkeypatch.setattr("tests.unit.controller.test_sqp.SOLVER", SOLVER)
    p, u = pack(name, moves=moves), np.random.default_rng(6).uniform(-0.3, 0.9, size=40)
    _, gradient, _, _ = captured_qp(monkeypatch, p, u.reshape(-1, 2))
    for j in range(0, 40, 3):
        e = np.zeros(40)
        e[j] = 1e-5
        slope = (cost_of(p, u + e) - cost_of(p, u - e)) / 2e-5
        assert 2.0 * gradient[j] == pytest.approx(slope, rel=1e-4, abs=1e-3)


def test_the_hessian_counts_an_excess_where_there_is_one(monkeypatch):
    """Gauss-Newton: J'WJ of the residuals, with the Jacobian by finite differences."""
    monkeypatch.setattr("tests.unit.controller.test_sqp.SOLVER", SOLVER)
    p, u = pack("turned and moving"), np.full(40, 0.2)
    hessian, _, _, _ = captured_qp(monkeypatch, p, u.reshape(-1, 2))
    weights, _, _, slew = PROBLEM.unpack_cost(p)
    limits = np.array([math.radians(17.0), 0.3, 0.3, math.radians(3.0)])

    def residuals(inputs):
        errors = errors_of(p, inputs)
        over = np.sign(errors[:, 2:]) * np.maximum(np.abs(errors[:, 2:]) - limits, 0.0)
        root = np.sqrt(300.0 * PROBLEM.steps_s)[:, None]
        return np.concatenate([(np.sqrt(weights) * errors).ravel(), (root * over / limits).ravel()])

    step = 1e-6
    jacobian = np.array([(residuals(u + step * e) - residuals(u - step * e)) / (2 * step) for e in np.eye(40)]).T
    difference = np.eye(40) - np.eye(40, k=-2)
    expected = jacobian.T @ jacobian + slew * difference.T @ difference
    assert np.abs(hessian - expected).max() < 1e-3 * np.abs(expected).max()


@pytest.mark.parametrize("moves", [(0.0, 0.0), MOVES], ids=["station at rest", "station that moves"])
def test_all_solvers_agree(moves):
    p, start = pack("abeam", CONFIG.far.model_copy(update={"soft": 30.0}), moves=moves), np.zeros((20, 2))
    costs = {
        "sqp": SOLVER.solve(p, start, 60).cost,
        "ipopt": Ipopt(PROBLEM, (200,)).solve(p, start, 200).cost,
        "torch-lqr": TorchLqr(PROBLEM, batched=True).solve(p, start, 60).cost,
    }
    if fatrop_module.available():
        costs["fatrop"] = Fatrop(PROBLEM, (200,)).solve(p, start, 200).cost
    assert max(costs.values()) <= 1.01 * min(costs.values()), costs


@pytest.mark.parametrize("name", STATES)
def test_without_a_weight_the_plan_is_that_without_limits_to_the_last_bit(name):
    start = np.full((20, 2), 0.3)
    found = SOLVER.solve(pack(name, WITHOUT), start, 6)
    plain = Sqp(UNLIMITED).solve(pack(name, WITHOUT, UNLIMITED), start, 6)
    assert np.array_equal(found.inputs, plain.inputs) and found.cost == plain.cost


@pytest.mark.parametrize("moves", [(0.0, 0.0), MOVES], ids=["station at rest", "station that moves"])
@pytest.mark.parametrize("name", STATES)
def test_a_step_in_one_order_of_operations_is_the_same_step(monkeypatch, name, moves):
    """What another machine would round otherwise is solved in order: here each step, and none."""
    p, start, plans = pack(name, moves=moves), np.zeros((20, 2)), []
    for doubt in (sqp_module.GRID, 0.0):
        monkeypatch.setattr(sqp_module, "DOUBT", doubt)
        plans.append(SOLVER.solve(p, start, 1).inputs)
    assert np.abs(plans[0] - plans[1]).max() <= sqp_module.GRID


def test_a_search_for_the_sides_that_does_not_end_takes_a_step_that_lowers_the_cost(monkeypatch):
    p, start = pack("abeam"), np.zeros((20, 2))
    before = cost_of(p, start.ravel())
    settled = SOLVER.solve(p, start, 1).cost
    monkeypatch.setattr(sqp_module, "SIDES", 1)
    assert settled < SOLVER.solve(p, start, 1).cost < before


def most_deg_per_s(*overrides: str) -> float:
    """The highest yaw rate of the plan of a boat that lies 2 m beside its station, in a calm."""
    config = load_config("sitl", ("controller.procedure.enabled=false", *overrides))
    controller = build_controller(config, build_model(config))
    at = Estimate(
        t_ns=0, n_m=0.0, e_m=2.0, psi_rad=0.0, u_mps=0.0, v_mps=0.0, r_radps=0.0,
        motor=(0.0, 0.0), std=(0.1,) * 6, disturbance=(0.0, 0.0, 0.0), valid=True,
    )  # fmt: skip
    for _ in range(4):
        control = controller.step(at, None, Station(n_m=0.0, e_m=0.0, psi_rad=0.0))
    assert control.ok
    plan = np.array(control.plan)
    return float(np.degrees(np.abs(np.diff(plan[:, 3]) / np.diff(plan[:, 0]))).max())


def test_a_boat_beside_its_station_plans_a_turn_within_the_limit():
    limits = "controller.mpc.soft_limits={}"
    soft = "controller.mpc.near.soft=5000"
    assert most_deg_per_s() > 6.0
    assert most_deg_per_s(limits, soft, "controller.mpc.along.soft=5000") < 4.0


@pytest.mark.parametrize("key", ["heading_deg", "speed_mps", "yaw_rate_degps"])
def test_a_limit_of_zero_is_refused_by_name(key):
    with pytest.raises(ConfigError, match=rf"controller\.mpc\.soft_limits\.{key}"):
        load_config("sitl", (f"controller.mpc.soft_limits={{{key}: 0}}",))


@pytest.mark.parametrize("weights", ["near", "along", "weather", "far", "position_only"])
def test_a_soft_weight_without_limits_is_refused_by_name(weights):
    with pytest.raises(ConfigError, match=rf"{weights}\.soft has no effect without soft_limits"):
        load_config("sitl", (f"controller.mpc.{weights}.soft=100",))


def test_limits_without_a_soft_weight_are_refused():
    with pytest.raises(ConfigError, match=r"soft_limits have no effect .* near\.soft"):
        load_config("sitl", ("controller.mpc.soft_limits={}", "controller.mpc.weather=null"))
