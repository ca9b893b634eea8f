"""Every learned model says the same, value and Jacobian, on NumPy, CasADi and torch arrays, over the whole range."""

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asvhil.config import MpcConfig, SoftLimits, load_config
from asvhil.controller.solvers.problem import StationProblem
from asvhil.controller.station_mpc import StationMpc
from asvhil.dynamics.fitted_sd import PARAMETERS
from asvhil.dynamics.lagnet import ThrustMap
from asvhil.dynamics.protocol import Dynamics
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.dynamics.weights import load_model, read_model
from asvhil.types import Estimate, Station, Wind
from tests.support.dual import jacobian
from tests.support.model_samples import HALF, KINDS, points, sample
from tests.support.parts import one_in
from tests.support.paths import ROOT

COUNT = 400
TOLERANCE = 1e-9
SHIPPED = {path.stem: path for path in sorted((ROOT / "config" / "models").glob("*.npz"))}


def models() -> dict[str, Dynamics]:
    """One model of every kind with drawn weights, the physics, and all that are shipped."""
    drawn = {kind: sample(kind).dynamics() for kind in KINDS}
    shipped = {name: load_model(path) for name, path in SHIPPED.items()}
    return drawn | {"physics": SimplifiedDynamics(load_config("sitl").vehicle.vessel)} | shipped


MODELS = models()
every_model = pytest.mark.parametrize("name", MODELS)


def test_there_are_shipped_models_to_look_at() -> None:
    assert len(SHIPPED) >= 4


def inputs(name: str, count: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States, inputs and winds all over the model's range and half as far beyond it, its corners among them."""
    rng = np.random.default_rng(seed)
    model = MODELS[name]
    half = read_model(SHIPPED[name]).scaling.half if name in SHIPPED else HALF
    reach = np.concatenate([half[:3], np.ones(model.n_motor)])
    x = rng.uniform(-1.5, 1.5, (count, len(reach)))
    x[::4] = rng.choice([-1.0, 1.0], (len(x[::4]), len(reach)))
    x[1::8] *= 2.0  # where the products of LagNet are held
    a = rng.uniform(model.input_lower, model.input_upper, (count, 2))
    a[::5] = rng.choice([model.input_lower, model.input_upper], (len(a[::5]), 2))
    wind = rng.uniform(-1.5, 1.5, (count, 2)) * half[5:]
    return x * reach, a, wind


def casadi_function(name: str) -> ca.Function:
    model = MODELS[name]
    x, a, wind = ca.SX.sym("x", 3 + model.n_motor), ca.SX.sym("a", 2), ca.SX.sym("w", 2)
    x_dot = model.derivative(x, a, wind)
    jacobian = ca.jacobian(x_dot, ca.vertcat(x, a, wind))
    return ca.Function("f", [x, a, wind], [x_dot, ca.densify(jacobian)], {"cse": True})


@pytest.mark.parametrize("name", one_in(2, MODELS))
def test_numpy_and_casadi_agree_in_value_and_jacobian(name: str) -> None:
    model, function = MODELS[name], casadi_function(name)
    x, a, wind = inputs(name, COUNT, seed=2)
    batch = model.derivative(x, a, wind)
    for i in range(COUNT):
        value, slope = jacobian(model.derivative, x[i], a[i], wind[i])  # the NumPy code itself, on dual numbers
        theirs, their_slope = (np.asarray(part) for part in function(x[i], a[i], wind[i]))
        assert np.abs(model.derivative(x[i], a[i], wind[i]) - theirs[:, 0]).max() <= TOLERANCE
        assert np.abs(batch[i] - theirs[:, 0]).max() <= TOLERANCE
        assert np.abs(value - theirs[:, 0]).max() <= TOLERANCE
        assert np.abs(slope - their_slope).max() <= TOLERANCE


@every_model
def test_torch_and_casadi_agree_in_value_and_jacobian(name: str) -> None:
    import torch

    model, function = MODELS[name], casadi_function(name)
    x, a, wind = inputs(name, COUNT, seed=3)
    tensors = [torch.tensor(part, requires_grad=True) for part in (x, a, wind)]
    value = model.derivative(*tensors)
    wanted, slopes = function.map(COUNT)(x.T, a.T, wind.T)
    assert np.abs(value.detach().numpy() - np.asarray(wanted).T).max() <= TOLERANCE
    rows = value.shape[1]
    slopes = np.asarray(slopes).reshape(rows, COUNT, x.shape[1] + 4)
    for row in range(rows):
        grads = torch.autograd.grad(value[:, row].sum(), tensors, retain_graph=True, allow_unused=True)
        whole = [np.zeros(t.shape) if g is None else g.numpy() for g, t in zip(grads, tensors, strict=True)]
        assert np.abs(np.concatenate(whole, axis=1) - slopes[row]).max() <= TOLERANCE


def test_dual_numbers_give_the_slopes_of_the_school_book() -> None:
    x, a = np.array([0.7, -0.4]), np.array([2.0])

    def function(x: np.ndarray, a: np.ndarray) -> np.ndarray:
        return np.stack([np.tanh(x[0] * a[0]), abs(x[1]) * x[1] / 2.0, 1.0 - (x[0] - a[0]), -x[1] + 3.0])

    value, slope = jacobian(function, x, a)
    bend = 1.0 - math.tanh(1.4) ** 2
    np.testing.assert_allclose(value, [math.tanh(1.4), -0.08, 2.3, 3.4], atol=1e-15)
    np.testing.assert_allclose(slope, [[2 * bend, 0, 0.7 * bend], [0, 0.4, 0], [-1, 0, 1], [0, -1, 0]], atol=1e-15)


@pytest.mark.parametrize("kind", KINDS)
def test_mx_graphs_work_too(kind: str) -> None:
    model = sample(kind).dynamics()
    x, a, wind = ca.MX.sym("x", 3 + model.n_motor), ca.MX.sym("a", 2), ca.MX.sym("w", 2)
    function = ca.Function("f", [x, a, wind], [model.derivative(x, a, wind)])
    states, inputs, winds = points(kind, 3)
    value = np.asarray(function(states[0], inputs[0], winds[0]))[:, 0]
    assert np.abs(value - model.derivative(states[0], inputs[0], winds[0])).max() <= TOLERANCE


def test_the_scaling_is_what_the_file_says() -> None:
    # By hand: tanh of the scaled inputs, and rates of the scaled velocities.
    trained = sample("nnsem")
    w, centre, half = trained.weights, trained.scaling.centre, trained.scaling.half
    x, a, wind = (part[0] for part in points("nnsem", 1))
    z = (np.concatenate([x, a, wind]) - centre) / half
    by_hand = half[:3] * (w["w2"] @ np.tanh(w["w1"] @ z + w["b1"]) + w["b2"])
    np.testing.assert_allclose(trained.dynamics().derivative(x, a, wind), by_hand, atol=1e-12)


def test_the_sd_is_the_papers_by_hand() -> None:
    p = dict(zip(PARAMETERS, sample("sd").weights["parameters"], strict=True))
    u, v, r, port, starboard, w_u, w_v = 0.7, -0.2, 0.1, 0.5, -0.3, 3.0, 4.0
    wanted = [
        p["thrust_surge"] * 0.2 + p["mass_ratio"] * v * r - (p["drag_u"] + p["drag_uu"] * u) * u
        + p["wind_surge"] * (w_u - u) ** 2,
        -u * r / p["mass_ratio"] + (p["drag_v"] + p["drag_vv"] * 0.2) * 0.2 + p["wind_sway"] * (w_v - v) ** 2,
        p["thrust_yaw"] * 0.8 - p["munk_yaw"] * u * v - (p["drag_r"] + p["drag_rr"] * r) * r
        - p["wind_yaw"] * (w_u - u) * (w_v - v),
    ]  # fmt: skip
    model = sample("sd").dynamics()
    got = model.derivative(np.array([u, v, r]), np.array([port, starboard]), np.array([w_u, w_v]))
    np.testing.assert_allclose(got, wanted, atol=1e-12)


def test_lagnet_motors_follow_their_demands_and_nothing_else() -> None:
    model = sample("lagnet").dynamics()
    x_dot = model.derivative(np.array([0.5, 0.1, 0.2, 0.3, -0.1]), np.array([0.9, -0.2]), np.array([3.0, 1.0]))
    np.testing.assert_allclose(x_dot[3:], [0.6 / 0.42, -0.1 / 0.42], atol=1e-12)


def test_beyond_the_range_lagnet_stays_bounded() -> None:
    # Products of velocities would run away; held at twice the range they grow no more.
    model = sample("lagnet").dynamics()
    a, wind = np.array([1.0, 1.0]), np.array([5.0, -5.0])
    far, farther = (model.derivative(np.array([u, -u, u, 0.0, 0.0]), a, wind) for u in (1e3, 1e6))
    assert np.abs(farther - far).max() < 1e-6
    assert np.abs(far).max() < 100.0


@given(st.floats(-1.0, 1.0))
@settings(max_examples=200)
def test_the_thrust_map_is_inverted_by_its_table(command: float) -> None:
    weights = sample("lagnet").weights
    curve = ThrustMap(weights["map_gain"], weights["map_slope"], weights["map_centre"])
    assert curve.command(curve.thrust(command)) == pytest.approx(command, abs=1e-6)


def test_the_thrust_map_rises_through_zero_to_one() -> None:
    weights = sample("lagnet").weights
    curve = ThrustMap(weights["map_gain"], weights["map_slope"], weights["map_centre"])
    thrusts = [curve.thrust(command) for command in np.linspace(-1.0, 1.0, 101)]
    assert np.all(np.diff(thrusts) > 0.0)
    assert (curve.thrust(0.0), curve.thrust(1.0), curve.thrust(-1.0)) == (0.0, 1.0, curve.astern)
    assert curve.command(5.0) == 1.0 and curve.command(-5.0) == -1.0 and curve.command(0.0) == 0.0


def test_lagnet_inputs_are_thrusts_within_their_bounds() -> None:
    model = sample("lagnet").dynamics()
    assert model.input_of_command((0.0, 1.0)) == (0.0, 1.0)
    assert model.input_of_command((-1.0, -1.0)) == (model.input_lower, model.input_lower)
    assert model.command_of_input(model.input_of_command((0.37, -0.62))) == pytest.approx((0.37, -0.62), abs=1e-6)


@every_model
def test_the_linearisation_has_the_states_and_the_cost_of_the_prediction_to_the_last_bit(name: str) -> None:
    """The SQP takes either for the other."""
    model = MODELS[name]
    near = MpcConfig().near.model_copy(update={"soft": 5000.0})
    config = MpcConfig(stages=8, soft_limits=SoftLimits(), near=near)
    problem, rng = StationProblem(model, config), np.random.default_rng(6)
    x, _, wind = inputs(name, 20, 5)
    for state, air in zip(x, wind, strict=True):
        s, push, moves = (*rng.uniform(-5.0, 5.0, 3), *state), rng.uniform(-0.05, 0.05, 3), rng.uniform(-1.0, 1.0, 2)
        p = problem.pack(s, air, push, 0.05, (0.1, 0.0), config.near, moves_mps=moves)
        u = rng.uniform(model.input_lower, model.input_upper, 16)
        states, cost = (np.array(part) for part in problem.rollout(p, u))
        same_states, _, same_cost, _ = (np.array(part) for part in problem.linearised(p, u))
        assert np.array_equal(same_states, states, equal_nan=True)
        assert np.array_equal(same_cost, cost, equal_nan=True)


@pytest.mark.parametrize("kind", KINDS)
def test_every_model_drives_the_mpc(kind: str) -> None:
    model = sample(kind).dynamics()
    mpc = StationMpc(model, MpcConfig(stages=5, alternate_iterations=2), 0.2)
    estimate = Estimate(
        t_ns=0, n_m=-3.0, e_m=1.0, psi_rad=0.2, u_mps=0.1, v_mps=0.0, r_radps=0.0, motor=(0.0,) * model.n_motor,
        std=(0.1,) * 6, disturbance=(0.0, 0.0, 0.0), valid=True,
    )  # fmt: skip
    wind = Wind(t_ns=0, vn_mps=3.0, ve_mps=1.0, std_mps=0.1, valid=True)
    control = mpc.step(estimate, wind, Station(n_m=0.0, e_m=0.0, psi_rad=0.0))
    assert control.ok and all(-1.0 <= part <= 1.0 for part in control.command)
