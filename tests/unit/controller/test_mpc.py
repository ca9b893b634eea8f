"""The optimal control problem and the controller around it: equations, frames, state, and closed loops."""

import dataclasses
import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asvhil.config import MpcConfig, MpcWeights, load_config
from asvhil.controller.solvers.choice import choose_solver
from asvhil.controller.solvers.problem import StationProblem
from asvhil.controller.solvers.sqp import Sqp
from asvhil.controller.station_mpc import StationMpc, shift_matrix
from asvhil.dynamics.arrays import namespace_of
from asvhil.dynamics.integrate import advance, integrate, substeps
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.types import Control, Estimate, Station, Wind

MODEL = SimplifiedDynamics(load_config("sitl").vehicle.vessel)
GRID_S = np.concatenate([[0.0], np.cumsum(np.linspace(0.2, 0.8, 20))])
ORIGIN = Station(n_m=0.0, e_m=0.0, psi_rad=0.0)
LIGHT = MpcWeights(heading=200.0)  # for tests of how weights are chosen, whatever the shipped ones are
HEAVY = MpcWeights(heading=1500.0, slew=4.0)


class TanhModel:
    """A tiny network without motor states that is trained for forward Euler, as a learnt model would be."""

    name = "tanh"
    n_motor = 0
    input_lower, input_upper = -1.0, 1.0
    max_step_s = 0.2
    euler = True

    def __init__(self) -> None:
        rng = np.random.default_rng(3)
        self._w1, self._b1 = 0.3 * rng.normal(size=(6, 7)), np.zeros(6)
        self._w2, self._b2 = 0.05 * rng.normal(size=(3, 6)), np.zeros(3)

    def derivative(self, x, a, wind):
        xp = namespace_of(x)
        hidden = xp.tanh(xp.affine(self._w1, self._b1, xp.concat([x, a, wind])))
        port, starboard = xp.component(a, 0), xp.component(a, 1)
        drive = xp.stack([0.8 * (port + starboard), 0.0 * port, 0.3 * (port - starboard)])
        return drive - 0.5 * x + xp.affine(self._w2, self._b2, hidden)

    def command_of_input(self, a):
        return a

    def input_of_command(self, command):
        return command


def estimate(s, disturbance=(0.0, 0.0, 0.0)) -> Estimate:
    n_m, e_m, psi_rad, u_mps, v_mps, r_radps, *motor = (float(part) for part in s)
    return Estimate(
        t_ns=0,
        n_m=n_m,
        e_m=e_m,
        psi_rad=psi_rad,
        u_mps=u_mps,
        v_mps=v_mps,
        r_radps=r_radps,
        motor=tuple(motor),
        std=(0.1,) * 6,
        disturbance=disturbance,
        valid=True,
    )


def air(vn_mps: float, ve_mps: float, valid: bool = True) -> Wind:
    return Wind(t_ns=0, vn_mps=vn_mps, ve_mps=ve_mps, std_mps=0.0, valid=valid)


def sail(controller, model, s, wind, station=ORIGIN, seconds=60.0) -> list[np.ndarray]:
    """The states every 0.2 s of a boat that is the model, under the controller."""
    path = [np.array(s, dtype=float)]
    still = np.zeros(3)
    for _ in range(round(seconds / 0.2)):
        control = controller.step(estimate(path[-1]), air(*wind), station)
        assert control.ok
        a = np.array(model.input_of_command(control.command))
        path.append(advance(model, path[-1], a, np.array(wind), still, 0.2, 1 if model.euler else 4))
    return path


# --- integration -----------------------------------------------------------------------------------------


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
    same_states, _, same_cost = (np.array(part).ravel() for part in problem.linearised(p, inputs.ravel()))
    assert same_states == pytest.approx(states, abs=1e-10)
    assert same_cost[0] == pytest.approx(cost[0], rel=1e-12)


@pytest.mark.parametrize("model", [MODEL, TanhModel()], ids=["sd", "tanh"])
def test_sensitivities_match_finite_differences(model):
    config = MpcConfig(stages=5, first_step_s=0.2, last_step_s=0.8)
    problem = StationProblem(model, config)
    n = problem.n_state
    s = np.array([-5.0, 2.0, 0.4, 0.5, -0.1, 0.1, *[0.2] * model.n_motor])
    p = problem.pack(s, (2.0, -3.0), (0.02, -0.03, 0.01), 0.0, (0.0, 0.0), config.near)
    u = np.full(10, 0.3)
    states, blocks, _ = (np.array(part).ravel() for part in problem.linearised(p, u))
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


def test_a_state_of_the_wrong_length_is_refused():
    problem = StationProblem(MODEL, MpcConfig(stages=2))
    with pytest.raises(ValueError, match="7 entries, the model needs 8"):
        problem.pack((0.0,) * 7, (0.0, 0.0), (0.0, 0.0, 0.0), 0.0, (0.0, 0.0), MpcWeights())


# --- warm start ------------------------------------------------------------------------------------------


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


# --- the controller --------------------------------------------------------------------------------------


def test_it_runs_to_the_station_and_stays():
    path = sail(StationMpc(MODEL, MpcConfig(), 0.2), MODEL, (-14, -3, 0, 0, 0, 0, 0, 0), (3.0, 0.0), seconds=30.0)
    assert math.hypot(*path[-1][:2]) < 0.3
    assert abs(path[-1][2]) < math.radians(3.0)


def test_across_the_wind_it_finds_the_limit_cycle_and_does_not_drift():
    path = sail(StationMpc(MODEL, MpcConfig(), 0.2), MODEL, (-2, 0, 0, 0, 0, 0, 0, 0), (0.0, 3.0), seconds=60.0)
    settled = np.array(path[150:])
    assert np.hypot(settled[:, 0], settled[:, 1]).mean() < 0.6
    assert np.hypot(settled[:, 0], settled[:, 1]).max() < 1.0
    assert settled[:, 2].std() < math.radians(4.0)


def test_a_model_without_motor_states_drops_in():
    model = TanhModel()
    path = sail(
        StationMpc(model, MpcConfig(near=LIGHT, along=HEAVY), 0.2),
        model,
        (-8, 2, 0.3, 0, 0, 0),
        (1.0, 0.5),
        seconds=40.0,
    )
    assert np.mean([math.hypot(*s[:2]) for s in path[-50:]]) < 0.6  # over 10 s: it swings about the station


@settings(max_examples=8, deadline=None)
@given(n_m=st.floats(-500, 500), e_m=st.floats(-500, 500), psi_rad=st.floats(-7, 7))
def test_the_command_does_not_depend_on_where_the_station_is_or_points(n_m, e_m, psi_rad):
    """Everything moved and turned together: the same commands over three ticks, near and far."""
    c, s = math.cos(psi_rad), math.sin(psi_rad)
    turned = lambda x, y: (c * x - s * y, s * x + c * y)  # noqa: E731
    station = Station(n_m=n_m, e_m=e_m, psi_rad=psi_rad)
    plain, moved = (StationMpc(MODEL, MpcConfig(), 0.2) for _ in range(2))
    for x, y, psi, nu in ((-14.0, -3.0, 0.4, 0.5), (-3.0, 1.0, -0.2, 0.3), (-0.5, 0.2, 0.05, 0.1)):
        body = (nu, 0.05, -0.02, 0.2, 0.1)
        here = estimate((x, y, psi, *body), (0.02, 0.03, 0.001))
        dn, de = turned(x, y)
        there = estimate((n_m + dn, e_m + de, psi + psi_rad, *body), (*turned(0.02, 0.03), 0.001))
        first = plain.step(here, air(2.0, 3.0), ORIGIN)
        second = moved.step(there, air(*turned(2.0, 3.0)), station)
        assert first.ok and second.ok
        # The thrust curve's inverse steps over the dead band, so inputs are compared rather than commands.
        a, b = (MODEL.input_of_command(control.command) for control in (first, second))
        assert a == pytest.approx(b, abs=1e-6)
        assert second.plan[0][1:3] == pytest.approx((n_m + dn, e_m + de), abs=1e-9)


def test_a_whole_turn_more_of_heading_changes_nothing():
    commands = []
    for turns in (0, 1, -3):
        controller = StationMpc(MODEL, MpcConfig(), 0.2)
        s = (-6.0, 1.0, 0.3 + 2.0 * math.pi * turns, 0, 0, 0, 0, 0)
        commands.append(controller.step(estimate(s), None, ORIGIN).command)
    assert commands[1] == pytest.approx(commands[0], abs=1e-6)
    assert commands[2] == pytest.approx(commands[0], abs=1e-6)


def test_noise_at_half_a_turn_does_not_flip_the_way_round():
    controller = StationMpc(MODEL, MpcConfig(), 0.2)
    headings = []
    for error_rad in (3.10, -3.12, 3.08, -3.10):
        control = controller.step(estimate((0, 0, error_rad, 0, 0, 0, 0, 0)), None, ORIGIN)
        headings.append(control.plan[8][3])  # on its way, after 2.5 s
    assert all(heading > 0.0 for heading in headings)  # all four plans turn back to port, through east


def test_the_same_calls_give_the_same_bits():
    def run() -> list[Control]:
        controller = StationMpc(MODEL, MpcConfig(), 0.2)
        s, controls = np.array([-12.0, -3.0, 0.5, 0.2, 0.0, 0.0, 0.0, 0.0]), []
        for _ in range(12):
            controls.append(controller.step(estimate(s), air(1.0, 3.0), ORIGIN))
            a = np.array(MODEL.input_of_command(controls[-1].command))
            s = advance(MODEL, s, a, np.array([1.0, 3.0]), np.zeros(3), 0.2, 1)
        return controls

    assert run() == run()


def test_reset_forgets_everything():
    controller = StationMpc(MODEL, MpcConfig(), 0.2)
    at = estimate((-6.0, 1.0, 0.3, 0, 0, 0, 0, 0))
    first = controller.step(at, air(3.0, 0.0), ORIGIN)
    for _ in range(3):
        controller.step(estimate((-1.0, 0.3, -0.1, 0, 0, 0, 0, 0)), None, ORIGIN)
    controller.reset()
    assert controller.step(at, air(3.0, 0.0), ORIGIN) == first


def test_the_plan_starts_at_the_boat_and_is_finite():
    station = Station(n_m=100.0, e_m=-50.0, psi_rad=3.0)
    control = StationMpc(MODEL, MpcConfig(), 0.2).step(estimate((95, -52, -3.0, 0.2, 0, 0, 0, 0)), None, station)
    assert len(control.plan) == 21
    assert control.plan[0] == pytest.approx((0.0, 95.0, -52.0, -3.0))
    assert control.plan[-1][0] == pytest.approx(11.0)
    assert all(math.isfinite(part) and type(part) is float for row in control.plan for part in row)
    assert all(-math.pi <= row[3] < math.pi for row in control.plan)


@pytest.mark.parametrize("field", ["n_m", "e_m", "psi_rad", "u_mps", "v_mps", "r_radps"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_the_command_is_always_finite(field, value):
    controller = StationMpc(MODEL, MpcConfig(), 0.2)
    good = estimate((-6.0, 1.0, 0.3, 0, 0, 0, 0, 0))
    before = controller.step(good, None, ORIGIN)
    control = controller.step(dataclasses.replace(good, **{field: value}), None, ORIGIN)
    assert (control.ok, control.command, control.plan) == (False, (0.0, 0.0), ())
    assert math.isfinite(control.cost)
    after = controller.step(good, None, ORIGIN)  # and the next good tick is good again
    assert before.ok and after.ok and math.isfinite(sum(after.command))


def test_after_a_failure_it_starts_afresh_with_an_alternate_even_near():
    controller = StationMpc(MODEL, MpcConfig(iterations=3), 0.2)
    near = estimate((-0.5, 0.1, 0.05, 0, 0, 0, 0, 0))
    settled = [controller.step(near, None, ORIGIN).iterations for _ in range(4)]
    assert settled[-1] <= 3
    controller.step(dataclasses.replace(near, n_m=math.nan), None, ORIGIN)
    assert controller.step(near, None, ORIGIN).iterations > 3
    assert controller.step(near, None, ORIGIN).iterations <= 3


@pytest.mark.parametrize("field", ["n_m", "u_mps", "v_mps", "r_radps"])
def test_a_finite_state_whose_prediction_overflows_is_not_ok(field):
    good = estimate((-6.0, 1.0, 0.3, 0, 0, 0, 0, 0))
    control = StationMpc(MODEL, MpcConfig(), 0.2).step(dataclasses.replace(good, **{field: 1e200}), None, ORIGIN)
    assert (control.ok, control.command, control.plan) == (False, (0.0, 0.0), ())


@pytest.mark.parametrize("where", ["motor", "disturbance", "wind", "station"])
def test_nan_in_any_other_input_is_not_ok(where):
    nan = math.nan
    good = estimate((-6.0, 1.0, 0.3, 0, 0, 0, 0, 0))
    wind, station = air(1.0, 1.0), ORIGIN
    if where == "motor":
        good = dataclasses.replace(good, motor=(0.0, nan))
    elif where == "disturbance":
        good = dataclasses.replace(good, disturbance=(0.0, nan, 0.0))
    elif where == "wind":
        wind = air(nan, 0.0)
    else:
        station = Station(n_m=0.0, e_m=nan, psi_rad=0.0)
    control = StationMpc(MODEL, MpcConfig(), 0.2).step(good, wind, station)
    assert (control.ok, control.command) == (False, (0.0, 0.0))


@pytest.mark.parametrize("motor", [(), (0.0,), (0.0, 0.0, 0.0)])
def test_the_wrong_number_of_motor_states_is_an_error_at_once(motor):
    wrong = dataclasses.replace(estimate((-6.0, 1.0, 0.3, 0, 0, 0, 0, 0)), motor=motor)
    with pytest.raises(ValueError, match=f"{len(motor)} motor states, model sd has 2"):
        StationMpc(MODEL, MpcConfig(), 0.2).step(wrong, None, ORIGIN)


def one_step(wind, disturbance=(0.0, 0.0, 0.0), **config) -> tuple[float, float]:
    at = estimate((-0.3, 0.0, 0.01, 0.1, 0, 0, 0, 0), disturbance)  # so close that no input is at its bound
    return StationMpc(MODEL, MpcConfig(**config), 0.2).step(at, wind, ORIGIN).command


def test_feedforward_switches_and_an_invalid_wind():
    still = one_step(None)
    windy = one_step(air(6.0, 0.0))
    assert windy != pytest.approx(still, abs=1e-3)
    assert one_step(air(math.nan, math.nan, valid=False)) == still
    assert one_step(air(6.0, 0.0), wind_feedforward=False) == still
    pushed = one_step(None, (0.1, 0.0, 0.0))
    assert pushed != pytest.approx(still, abs=1e-3)
    assert one_step(None, (0.1, 0.0, 0.0), disturbance_feedforward=False) == still


def test_weight_sets_change_with_hysteresis():
    """The same boat at 7 m is judged by the far weights on its way in, and by the near ones after being near."""
    seven = estimate((-7.0, 0.0, 0.3, 0, 0, 0, 0, 0))
    outbound = StationMpc(MODEL, MpcConfig(), 0.2)
    outbound.step(estimate((-3.0, 0.0, 0.3, 0, 0, 0, 0, 0)), None, ORIGIN)
    inbound = StationMpc(MODEL, MpcConfig(), 0.2)
    near_cost, far_cost = (c.step(seven, None, ORIGIN).cost for c in (outbound, inbound))
    assert near_cost > 1.2 * far_cost
    outbound.step(estimate((-11.0, 0.0, 0.3, 0, 0, 0, 0, 0)), None, ORIGIN)
    assert outbound.step(seven, None, ORIGIN).cost == pytest.approx(far_cost, rel=0.02)


def test_a_new_station_forgets_that_the_old_one_was_near():
    moved = Station(n_m=7.0, e_m=0.0, psi_rad=0.0)
    at = estimate((0.0, 0.0, 0.3, 0, 0, 0, 0, 0))
    controller = StationMpc(MODEL, MpcConfig(), 0.2)
    controller.step(at, None, ORIGIN)
    controller.new_station()
    near_first = controller.step(at, None, moved)
    fresh = StationMpc(MODEL, MpcConfig(), 0.2).step(at, None, moved)
    assert near_first.cost == pytest.approx(fresh.cost, rel=0.02)


def test_the_trim_counters_a_lasting_heading_error_only_when_near_and_is_bounded():
    """Seen through the cost at a boat that is held 0.2 rad off: it grows as the reference moves away, then stops."""
    frozen = {"trim_time_s": 1e9}
    held = estimate((0.0, 0.0, 0.2, 0, 0, 0, 0, 0))
    with_trim = StationMpc(MODEL, MpcConfig(trim_time_s=4.0), 0.2)
    without = StationMpc(MODEL, MpcConfig(**frozen), 0.2)
    ratio = [with_trim.step(held, None, ORIGIN).cost / without.step(held, None, ORIGIN).cost for _ in range(40)]
    waits = 10  # ticks: half of the trim's time
    assert ratio[waits - 1] == 1.0  # the headings of the way in are no lasting error
    assert ratio[waits + 5] > 1.05
    assert ratio[waits + 9] > ratio[waits + 2]
    assert ratio[-1] == pytest.approx(ratio[-5], rel=1e-3)  # 0.1 rad is reached after 10 ticks more
    away = estimate((-20.0, 0.0, 0.2, 0, 0, 0, 0, 0))
    far_trim, far_plain = (StationMpc(MODEL, MpcConfig(**k), 0.2) for k in ({"trim_time_s": 4.0}, frozen))
    for _ in range(5):
        assert far_trim.step(away, None, ORIGIN).cost == far_plain.step(away, None, ORIGIN).cost


def test_the_trim_waits_anew_after_each_time_far_off():
    held, away = estimate((0.0, 0.0, 0.2, 0, 0, 0, 0, 0)), estimate((-20.0, 0.0, 0.2, 0, 0, 0, 0, 0))
    left, stayed = (StationMpc(MODEL, MpcConfig(trim_time_s=4.0), 0.2) for _ in range(2))
    for tick in range(12):
        left.step(away if tick == 6 else held, None, ORIGIN)
        stayed.step(held, None, ORIGIN)
    assert left.trim_rad == 0.0 > stayed.trim_rad


def test_the_first_input_stays_close_to_the_last_one_applied_where_slew_is_dear():
    controller = StationMpc(MODEL, MpcConfig(far=MpcWeights(slew=1e6)), 0.2)
    command = controller.step(estimate((-14.0, 0, 0, 0, 0, 0, 0, 0)), None, ORIGIN).command
    assert MODEL.input_of_command(command) == pytest.approx((0.0, 0.0), abs=0.02)


def test_the_last_input_is_neutral_after_a_failure():
    controller = StationMpc(MODEL, MpcConfig(far=MpcWeights(slew=300.0)), 0.2)
    away = estimate((-14.0, 0, 0, 0, 0, 0, 0, 0))
    inputs = [MODEL.input_of_command(controller.step(away, None, ORIGIN).command)[0] for _ in range(15)]
    assert inputs[-1] > 2.0 * inputs[0] > 0.0
    controller.step(dataclasses.replace(away, e_m=math.nan), None, ORIGIN)
    again = MODEL.input_of_command(controller.step(away, None, ORIGIN).command)[0]
    assert again == pytest.approx(inputs[0], rel=0.1)


def test_building_is_quick_enough_for_a_daemon():
    """Counts operations rather than seconds, which a busy machine would spoil: 25 thousand take about 30 ms."""
    problem = StationProblem(MODEL, MpcConfig())
    assert isinstance(problem.linearised, ca.Function)
    assert problem.linearised.n_instructions() < 40_000


class NotedWeights:
    """A solver that notes the weights of the states after the first stage, and then solves."""

    def __init__(self) -> None:
        self.seen: list[np.ndarray] = []

    def __call__(self, problem: StationProblem) -> "NotedWeights":
        self._problem, self._solver = problem, Sqp(problem)
        return self

    def solve(self, parameters, start, iterations):
        self.seen.append(self._problem.unpack_cost(parameters)[0][0])
        return self._solver.solve(parameters, start, iterations)


@pytest.mark.parametrize(
    ("wind", "disturbance", "heading"),
    [
        (air(6.0, 0.0), (0.0, 0.0, 0.0), 1500.0),  # along the boat: nothing to carry sideways
        (air(0.0, 6.0), (0.0, 0.0, 0.0), 200.0),
        (air(-6.0, 0.0), (0.0, 0.05, 0.0), 200.0),  # an unseen push sideways counts as the wind does
        (None, (0.2, 0.0, 0.0), 1500.0),
        (None, (0.0, -0.01, 0.0), 850.0),  # half-way between the two limits
    ],
)
def test_heading_weighs_more_where_there_is_no_side_load_to_carry(wind, disturbance, heading):
    config = MpcConfig(near=LIGHT, along=HEAVY, side_load_mps2=(0.005, 0.015))
    noted = NotedWeights()
    controller = StationMpc(MODEL, config, 0.2, noted)
    assert controller.step(estimate(np.zeros(8), disturbance), wind, ORIGIN).ok
    assert noted.seen[0][2] == pytest.approx(0.2 * heading, rel=1e-6)


def test_a_gust_from_abeam_does_not_flip_the_weights():
    noted = NotedWeights()
    controller = StationMpc(MODEL, MpcConfig(near=LIGHT, along=HEAVY), 0.2, noted)
    for ve_mps in (0.0, 6.0, 0.0):
        controller.step(estimate(np.zeros(8)), air(3.0, ve_mps), ORIGIN)
    assert all(row[2] > 0.2 * 1450.0 for row in noted.seen)
    for _ in range(200):
        controller.step(estimate(np.zeros(8)), air(3.0, 6.0), ORIGIN)
    assert noted.seen[-1][2] == pytest.approx(0.2 * 200.0)


@pytest.mark.parametrize(("offset_m", "heading"), [(0.1, 1500.0), (0.4, 850.0), (0.7, 200.0)])
def test_off_the_station_heading_gives_way(offset_m, heading):
    noted = NotedWeights()
    controller = StationMpc(MODEL, MpcConfig(near=LIGHT, along=HEAVY, offset_m=(0.2, 0.6)), 0.2, noted)
    controller.step(estimate((0.0, offset_m, 0, 0, 0, 0, 0, 0)), None, ORIGIN)
    assert noted.seen[0][2] == pytest.approx(0.2 * heading, rel=1e-6)


LASTING = MpcConfig(near=LIGHT, along=HEAVY, offset_m=(0.4, 0.6), lasting_offset_m=(0.1, 0.3))


@pytest.mark.parametrize(("offset_m", "heading"), [(-0.05, 1500.0), (0.2, 850.0), (-0.2, 850.0), (0.35, 200.0)])
def test_heading_gives_way_to_an_offset_that_lasts(offset_m, heading):
    noted = NotedWeights()
    controller = StationMpc(MODEL, LASTING, 0.2, noted)
    controller.step(estimate((0.0, offset_m, 0, 0, 0, 0, 0, 0)), None, ORIGIN)
    assert noted.seen[0][2] == pytest.approx(0.2 * 1500.0, rel=0.03)  # not at once
    for _ in range(200):
        controller.step(estimate((0.0, offset_m, 0, 0, 0, 0, 0, 0)), None, ORIGIN)
    assert noted.seen[-1][2] == pytest.approx(0.2 * heading, rel=0.01)


@pytest.mark.parametrize(
    "offsets",
    [
        lambda k: (0.0, 0.3 * (-1) ** k),  # noise of the position
        lambda k: (0.3, 0.0),  # along the heading, where the motors push
        lambda k: (0.0, 0.35 if k < 5 else 0.0),  # a second of it
    ],
)
def test_heading_is_kept_where_no_offset_across_it_lasts(offsets):
    noted = NotedWeights()
    controller = StationMpc(MODEL, LASTING, 0.2, noted)
    for k in range(60):
        controller.step(estimate((*offsets(k), 0, 0, 0, 0, 0, 0)), None, ORIGIN)
    assert all(row[2] > 0.2 * 1490.0 for row in noted.seen)


def test_another_station_has_no_offset_yet():
    noted = NotedWeights()
    controller = StationMpc(MODEL, LASTING, 0.2, noted)
    for _ in range(100):
        controller.step(estimate((0.0, 0.35, 0, 0, 0, 0, 0, 0)), None, ORIGIN)
    controller.new_station()
    controller.step(estimate((0.0, -0.35, 0, 0, 0, 0, 0, 0)), None, ORIGIN)
    assert noted.seen[-1][2] == pytest.approx(0.2 * 1500.0, rel=0.03)


@pytest.mark.parametrize("name", ["side_load_mps2", "offset_m", "lasting_offset_m"])
def test_limits_must_rise(name):
    with pytest.raises(ValueError, match=f"{name} needs two rising"):
        MpcConfig(**{name: (0.9, 0.01)})


def test_a_slow_output_limits_what_each_stage_can_ask_for():
    """1 command per second, from +0.3 port and -0.5 starboard: free towards neutral, then one stage's time further."""
    problem = StationProblem(TanhModel(), MpcConfig(stages=3, last_step_s=0.8), command_rate_per_s=1.0)
    p = problem.pack((0, 0, 0, 0, 0, 0), (0, 0), (0, 0, 0), 0.0, (0.3, -0.5), MpcWeights())
    lower, upper = problem.bounds(p)
    assert problem.times_s[1:] == pytest.approx([0.2, 0.7, 1.5])
    assert lower.tolist() == pytest.approx(np.array([[-0.2, -0.7], [-0.7, -1.0], [-1.0, -1.0]]))
    assert upper.tolist() == pytest.approx(np.array([[0.5, 0.2], [1.0, 0.7], [1.0, 1.0]]))


def test_a_quick_output_limits_nothing_but_the_range():
    problem = StationProblem(MODEL, MpcConfig(stages=3), command_rate_per_s=20.0)
    p = problem.pack(np.zeros(8), (0, 0), (0, 0, 0), 0.0, (100.0, -30.0), MpcWeights())
    lower, upper = problem.bounds(p)
    assert (lower == MODEL.input_lower).all() and (upper == MODEL.input_upper).all()


@pytest.mark.parametrize("solver", ["sqp", "ipopt", "fatrop", "torch-lqr"])
def test_every_solver_keeps_to_the_slew_limit(solver):
    controller = load_config("sitl", (f"controller.solver={solver}",)).controller
    _, make_solver = choose_solver(controller)
    problem = StationProblem(TanhModel(), MpcConfig(stages=6), command_rate_per_s=0.5)
    p = problem.pack((-14, -3, 0, 0, 0, 0), (0, 0), (0, 0, 0), 0.0, (0.0, 0.0), MpcWeights(slew=0.0))
    solution = make_solver(problem).solve(p, np.zeros((6, 2)), 40)
    assert solution.ok
    assert np.abs(solution.inputs[0]).max() == pytest.approx(0.1, abs=1e-4)  # 0.2 s of 0.5 per second
    assert (np.abs(solution.inputs) <= 0.5 * problem.times_s[1:, None] + 1e-6).all()


def test_the_plan_begins_where_the_boat_will_be_after_the_delay():
    config = MpcConfig()
    moving = estimate((-5.0, 1.0, 0.2, 1.0, 0.0, 0.1, 0, 0))
    now = StationMpc(MODEL, config, 0.2).step(moving, None, ORIGIN)
    later = StationMpc(MODEL, config.model_copy(update={"delay_s": 0.4}), 0.2).step(moving, None, ORIGIN)
    still = np.zeros(2)
    s = np.array([-5.0, 1.0, 0.2, 1.0, 0.0, 0.1, 0, 0])
    expected = advance(MODEL, s, still, still, np.zeros(3), 0.4, substeps(0.4, MODEL.max_step_s))
    assert now.plan[0][1:] == pytest.approx((-5.0, 1.0, 0.2))
    assert later.plan[0][1:] == pytest.approx(expected[:3])
    assert later.plan[0][1] > -4.7


def test_the_unmodelled_lag_of_motors_is_a_dead_time_for_models_without_motor_states():
    lag = MpcConfig(unmodelled_lag_s=0.4)
    moving = estimate((-5.0, 1.0, 0.2, 1.0, 0.0, 0.1))
    without = StationMpc(TanhModel(), lag, 0.2).step(moving, None, ORIGIN)
    delayed = StationMpc(TanhModel(), MpcConfig(delay_s=0.4), 0.2).step(moving, None, ORIGIN)
    assert without.plan[0] == delayed.plan[0] != (0.0, -5.0, 1.0, 0.2)
    with_states = StationMpc(MODEL, lag, 0.2).step(estimate((-5.0, 1.0, 0.2, 1.0, 0.0, 0.1, 0, 0)), None, ORIGIN)
    assert with_states.plan[0][1:] == pytest.approx((-5.0, 1.0, 0.2))
