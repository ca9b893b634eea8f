"""Prediction over the horizon of the MPC: integration, sensitivities, and plans shifted for a warm start."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.config import MpcConfig, MpcWeights
from asvhil.controller.plan_shift import shift_matrix
from asvhil.controller.solvers.problem import StationProblem
from asvhil.dynamics.integrate import advance, integrate, substeps
from tests.support.mpc_bench import GRID_S, MODEL, TanhModel

# --- integration ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("step_s", "count"), [(0.2, 1), (0.45, 1), (0.46, 2), (0.9, 2), (0.91, 3), (1e-6, 1)])
def test_substeps_are_never_longer_than_asked(step_s, count):
    assert substeps(step_s, 0.45) == count


def test_substeps_forgive_rounding():
    assert substeps(0.1 + 0.2, 0.3) == 1
    assert substeps(3 * 0.2, 0.2) == 3


def test_midpoint_and_euler_by_hand():
    x = np.array([1.0])
    assert integrate(lambda y: -y, x, 0.2, 2, euler=True)[0] == pytest.approx(0.9**2)
    assert integrate(lambda y: -y, x, 0.2, 2, euler=False)[0] == pytest.approx((1 - 0.1 + 0.005) ** 2)


def test_wind_and_disturbance_stay_fixed_to_the_earth():
    """Heading east, a push to the north is a push to port, and a wind to the north blows on the starboard side."""
    still = np.zeros(2)
    s = np.array([0.0, 0.0, math.pi / 2, 0.0, 0.0, 0.0, 0.0, 0.0])
    pushed = advance(MODEL, s, still, still, np.array([0.1, 0.0, 0.02]), 0.01, 1)
    assert pushed[3:6] == pytest.approx([0.0, -0.001, 0.0002], abs=2e-5)
    s[2] = math.pi / 6
    pushed = advance(MODEL, s, still, still, np.array([0.1, 0.2, 0.0]), 0.01, 1)
    assert pushed[3:5] == pytest.approx([0.00186603, 0.00123205], rel=1e-3)
    s[2] = math.pi / 2
    blown = advance(MODEL, s, still, np.array([6.0, 0.0]), np.zeros(3), 0.01, 1)
    assert blown[4] == pytest.approx(-36.0 / (254.5 + 381.75) * 0.01, rel=1e-2)
    assert blown[3] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("model", [MODEL, TanhModel()], ids=["sd", "tanh"])
def test_rollout_and_linearised_agree_with_plain_integration(model):
    config = MpcConfig(stages=8)
    problem = StationProblem(model, config)
    rng = np.random.default_rng(1)
    s = np.array([-5.0, 2.0, 0.4, 0.5, -0.1, 0.1, *[0.2] * model.n_motor])
    wind, push = (2.0, -3.0), (0.02, -0.03, 0.01)
    inputs = rng.uniform(model.input_lower, model.input_upper, size=(8, 2))
    p = problem.pack(s, wind, push, 0.05, (0.1, 0.0), config.near)
    states, cost = (np.array(part).ravel() for part in problem.rollout(p, inputs.ravel()))
    q, expected_cost, last = config.near, 0.0, np.array([0.1, 0.0])
    for k, step_s in enumerate(problem.steps_s):
        count = substeps(step_s, model.max_step_s)
        s = advance(model, s, inputs[k], np.array(wind), np.array(push), step_s, count)
        assert states[problem.n_state * (k + 1) :][: problem.n_state] == pytest.approx(s, abs=1e-10)
        heading_and_velocity = q.heading * (s[2] - 0.05) ** 2 + q.velocity * (s[3:6] @ s[3:6])
        offset2 = s[0] ** 2 + q.sideways * s[1] ** 2
        expected_cost += step_s * (q.position * offset2 + heading_and_velocity)
        expected_cost += q.slew * ((inputs[k] - last) @ (inputs[k] - last))
        last = inputs[k]
    expected_cost += q.terminal_position_s * offset2 + heading_and_velocity
    assert cost[0] == pytest.approx(expected_cost, rel=1e-12)
    same_states, _, same_cost, _ = (np.array(part).ravel() for part in problem.linearised(p, inputs.ravel()))
    assert np.array_equal(same_states, states) and same_cost[0] == cost[0]


@pytest.mark.parametrize("model", [MODEL, TanhModel()], ids=["sd", "tanh"])
def test_sensitivities_match_finite_differences(model):
    config = MpcConfig(stages=5, first_step_s=0.2, last_step_s=0.8)
    problem = StationProblem(model, config)
    n = problem.n_state
    s = np.array([-5.0, 2.0, 0.4, 0.5, -0.1, 0.1, *[0.2] * model.n_motor])
    p = problem.pack(s, (2.0, -3.0), (0.02, -0.03, 0.01), 0.0, (0.0, 0.0), config.near)
    u = np.full(10, 0.3)
    states, blocks, _, _ = (np.array(part).ravel() for part in problem.linearised(p, u))
    blocks = blocks.reshape(5, n, n + 2)
    for k in (0, 4):
        count = substeps(problem.steps_s[k], model.max_step_s)
        at = np.concatenate([states[n * k :][:n], u[2 * k : 2 * k + 2]])
        for j in range(n + 2):
            ahead, astern = at.copy(), at.copy()
            ahead[j] += 1e-6
            astern[j] -= 1e-6
            moved = [
                advance(model, x[:n], x[n:], p[n : n + 2], p[n + 2 : n + 5], problem.steps_s[k], count)
                for x in (ahead, astern)
            ]
            assert blocks[k][:, j] == pytest.approx((moved[0] - moved[1]) / 2e-6, abs=1e-6)


def test_the_grid_grows_from_first_to_last_step_to_eleven_seconds():
    problem = StationProblem(MODEL, MpcConfig())
    assert problem.steps_s[[0, -1]] == pytest.approx([0.2, 0.9])
    assert problem.times_s[[0, 1, -1]] == pytest.approx([0.0, 0.2, 11.0])


def test_a_grid_that_grows_faster_has_as_many_substeps():
    plain, grown = (StationProblem(MODEL, MpcConfig(), growth=growth) for growth in (1.0, 1.7))
    assert grown.steps_s[[0, -1]] == pytest.approx([0.2, 0.2 + 1.7 * 0.7])
    assert grown.substep_counts == plain.substep_counts
    equal = StationProblem(MODEL, MpcConfig(last_step_s=0.2), growth=1.7)
    assert equal.steps_s == pytest.approx(np.full(20, 0.2))


def test_a_state_of_the_wrong_length_is_refused():
    problem = StationProblem(MODEL, MpcConfig(stages=2))
    with pytest.raises(ValueError, match="7 entries, the model needs 8"):
        problem.pack((0.0,) * 7, (0.0, 0.0), (0.0, 0.0, 0.0), 0.0, (0.0, 0.0), MpcWeights())


# --- warm start -------------------------------------------------------------------------------------------------------


def test_shifting_by_the_first_of_equal_steps_moves_each_input_up_and_holds_the_last():
    shifted = shift_matrix(np.array([0.0, 0.2, 0.4, 0.6]), 0.2) @ np.array([1.0, 2.0, 3.0])
    assert shifted == pytest.approx([2.0, 3.0, 3.0])


def test_shifting_on_growing_steps_takes_means():
    # Steps .2, .4, .6: after .2 s the second new input covers .4-.8 of the old plan, half of it the last input.
    shifted = shift_matrix(np.array([0.0, 0.2, 0.6, 1.2]), 0.2) @ np.array([1.0, 2.0, 4.0])
    assert shifted == pytest.approx([2.0, 3.0, 4.0])


@given(elapsed_s=st.floats(0.0, 15.0), value=st.floats(-1.0, 1.0))
def test_shifting_keeps_a_constant_plan(elapsed_s, value):
    matrix = shift_matrix(GRID_S, elapsed_s)
    assert (matrix >= 0.0).all()
    assert matrix @ np.full(20, value) == pytest.approx(np.full(20, value), abs=1e-12)


def test_a_plan_goes_on_over_another_grid():
    # Steps of .2, .4 and .6 onto two of .6: the first new input is the mean over the first two old ones.
    onto = shift_matrix(np.array([0.0, 0.2, 0.6, 1.2]), 0.0, np.array([0.0, 0.6, 1.2]))
    assert onto @ np.array([1.0, 2.0, 4.0]) == pytest.approx([5.0 / 3.0, 4.0])
    assert shift_matrix(GRID_S, 0.0, GRID_S).tolist() == np.eye(20).tolist()
