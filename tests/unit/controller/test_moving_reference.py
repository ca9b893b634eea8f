"""The MPC on a station that moves: cost, gradient and plans of every solver, and the laws of the baselines."""

import math

import numpy as np
import pytest

from asvhil.backseat.build import build_controller, build_model
from asvhil.config import load_config
from asvhil.controller.solvers.ipopt import Ipopt
from asvhil.controller.solvers.sqp import Sqp
from asvhil.controller.solvers.torch_lqr import TorchLqr
from asvhil.types import Control, Estimate, Station
from tests.unit.controller.test_sqp import CONFIG, PROBLEM, SOLVER, STATES, captured_qp, cost_of

MOVES = (0.25, -0.2)
# So much weight on the velocity that what depends on it shows.
NEAR, FAR = (weights.model_copy(update={"velocity": 200.0}) for weights in (CONFIG.near, CONFIG.far))


def pack(name: str, moves=MOVES, weights=NEAR):
    return PROBLEM.pack(STATES[name], (1.0, 3.0), (0.01, -0.02, 0.002), 0.02, (0.1, -0.1), weights, 0.0, moves)


@pytest.mark.parametrize("name", STATES)
def test_the_gradient_is_that_of_the_true_cost(monkeypatch, name):
    p, u = pack(name), np.random.default_rng(6).uniform(-0.3, 0.9, size=40)
    _, gradient, _, _ = captured_qp(monkeypatch, p, u.reshape(-1, 2))
    for j in range(0, 40, 3):
        e = np.zeros(40)
        e[j] = 1e-5
        slope = (cost_of(p, u + e) - cost_of(p, u - e)) / 2e-5
        assert 2.0 * gradient[j] == pytest.approx(slope, rel=1e-4, abs=1e-4)


def test_the_cost_is_that_of_the_errors_to_the_moving_station():
    p, u = pack("turned and moving"), np.full(40, 0.2)
    states = np.array(PROBLEM.rollout(p, u)[0]).reshape(PROBLEM.stages + 1, -1)
    weights, reference, previous, slew = PROBLEM.unpack_cost(p)
    cost = slew * (np.diff(np.concatenate([[previous], u.reshape(-1, 2)]), axis=0) ** 2).sum()
    for k, (x, y, psi, *nu) in enumerate(states[1:, :6]):
        t_s = PROBLEM.times_s[k + 1]
        c, s = math.cos(psi), math.sin(psi)
        u_e, v_e = nu[0] - (c * MOVES[0] + s * MOVES[1]), nu[1] - (c * MOVES[1] - s * MOVES[0])
        error = np.array([x - MOVES[0] * t_s, y - MOVES[1] * t_s, psi - reference, u_e, v_e, nu[2]])
        cost += float((weights[k] * error**2).sum())
    assert cost_of(p, u) == pytest.approx(cost, rel=1e-9)


def test_the_hessian_knows_that_the_velocity_turns_with_the_boat(monkeypatch):
    """Gauss-Newton: J'WJ of errors whose Jacobian is that of finite differences."""
    p, u = pack("turned and moving"), np.full(40, 0.2)
    hessian, _, _, _ = captured_qp(monkeypatch, p, u.reshape(-1, 2))
    weights, _, _, slew = PROBLEM.unpack_cost(p)

    def errors(inputs):
        states = np.array(PROBLEM.rollout(p, inputs)[0]).reshape(PROBLEM.stages + 1, -1)[1:]
        return (np.sqrt(weights) * (states[:, :6] - PROBLEM.targets(p, states))).ravel()

    step = 1e-5
    jacobian = np.array([(errors(u + step * e) - errors(u - step * e)) / (2 * step) for e in np.eye(40)]).T
    difference = np.eye(40) - np.eye(40, k=-2)
    expected = jacobian.T @ jacobian + slew * difference.T @ difference
    assert np.abs(hessian - expected).max() < 1e-4 * np.abs(expected).max()


@pytest.mark.parametrize("name", ["abeam"])
def test_all_solvers_agree(name):
    p, start = pack(name, weights=FAR), np.zeros((20, 2))
    costs = {
        "sqp": SOLVER.solve(p, start, 60).cost,
        "ipopt": Ipopt(PROBLEM, (200,)).solve(p, start, 200).cost,
        "torch-lqr": TorchLqr(PROBLEM, batched=True).solve(p, start, 60).cost,
    }
    assert max(costs.values()) <= 1.01 * min(costs.values()), costs


def test_a_station_at_rest_has_the_plan_that_it_had():
    """Velocities of zero are no other problem, to the last bit."""
    p = pack("abeam", moves=(0.0, 0.0))
    weights, reference, _, _ = PROBLEM.unpack_cost(p)
    u = np.full(40, 0.3)
    states = np.array(PROBLEM.rollout(p, u)[0]).reshape(PROBLEM.stages + 1, -1)
    expected = np.zeros((PROBLEM.stages, 6))
    expected[:, 2] = reference
    assert (PROBLEM.targets(p, states[1:]) == expected).all() and not PROBLEM.moves(p)
    assert Sqp(PROBLEM).solve(p, np.zeros((20, 2)), 4).ok and weights.shape == (PROBLEM.stages, 6)


def test_the_side_load_is_that_of_the_motion():
    calm = (0.0, 0.0), (0.0, 0.0, 0.0)
    assert PROBLEM.side_acceleration(*calm) == 0.0
    assert PROBLEM.side_acceleration(*calm, (0.0, 0.3)) < -1e-3 < 1e-3 < PROBLEM.side_acceleration(*calm, (0.0, -0.3))


def first_of(name: str, vn_mps: float) -> Control:
    """The first solution for a boat at 0.4 m/s north, on its station, in a calm."""
    config = load_config("sitl", (f"controller.name={name}", "controller.procedure.enabled=false"))
    controller = build_controller(config, build_model(config))
    at = Estimate(
        t_ns=0, n_m=5.0, e_m=1.0, psi_rad=0.0, u_mps=0.4, v_mps=0.0, r_radps=0.0,
        motor=(0.0, 0.0), std=(0.1,) * 6, disturbance=(0.0, 0.0, 0.0), valid=True,
    )  # fmt: skip
    return controller.step(at, None, Station(n_m=5.0, e_m=1.0, psi_rad=0.0, vn_mps=vn_mps))


@pytest.mark.parametrize("name", ["backstepping", "sliding-mode"])
def test_a_law_goes_on_with_its_station_and_stops_at_one_that_rests(name):
    assert min(first_of(name, 0.4).command) > 0.0 > max(first_of(name, 0.0).command)


def test_a_plan_goes_where_the_station_will_be():
    t_s, n_m, *_ = first_of("sd-mpc", 0.4).plan[-1]
    assert n_m == pytest.approx(5.0 + 0.4 * t_s, abs=0.1)
    assert first_of("sd-mpc", 0.0).plan[-1][1] < 5.0 + 0.3 * t_s
