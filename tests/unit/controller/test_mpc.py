"""The optimal control problem and the controller around it: equations, frames, state, and closed loops."""

import dataclasses
import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asvhil.backseat.build import build_model
from asvhil.config import MpcConfig, MpcWeights, load_config
from asvhil.controller.solvers.choice import choose_solver
from asvhil.controller.solvers.motor_limits import MotorLimits
from asvhil.controller.solvers.problem import StationProblem
from asvhil.controller.station_mpc import StationMpc
from asvhil.dynamics.integrate import advance, substeps
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.types import Control, Station
from tests.support.mpc_bench import HEAVY, LIGHT, MODEL, ORIGIN, TanhModel, air, estimate, sail


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
        StationMpc(model, MpcConfig(effort="precise", near=LIGHT, along=HEAVY), 0.2),
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
    return StationMpc(MODEL, MpcConfig(least_thrust=0.0, **config), 0.2).step(at, wind, ORIGIN).command


def test_feedforward_switches_and_an_invalid_wind():
    still = one_step(None)
    windy = one_step(air(6.0, 0.0))
    assert windy != pytest.approx(still, abs=1e-3)
    assert one_step(air(math.nan, math.nan, valid=False)) == still
    assert one_step(air(6.0, 0.0), wind_feedforward=False) == still
    pushed = one_step(None, (0.1, 0.0, 0.0))
    assert pushed != pytest.approx(still, abs=1e-3)
    assert one_step(None, (0.1, 0.0, 0.0), disturbance_feedforward=False) == still


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
    """Counts operations rather than seconds, which a busy machine would spoil: 25 thousand take about 30 ms.

    Of a grid of its own, since an equal problem may have been built before, as machine code.
    """
    problem = StationProblem(MODEL, MpcConfig(last_step_s=MpcConfig().last_step_s + 0.001))
    assert isinstance(problem.linearised, ca.Function)
    assert problem.linearised.n_instructions() < 40_000


def test_an_equal_problem_is_not_built_again_and_another_is():
    """A replay, or the next run of a study, has a model of its own with the same figures."""

    def linearised(mass=1.0, **grid):
        vessel = load_config("sitl").vehicle.vessel
        model = SimplifiedDynamics(vessel.model_copy(update={"mass_kg": mass * vessel.mass_kg}))
        return StationProblem(model, MpcConfig(**grid)).linearised

    first = linearised()
    assert linearised() is first
    others = linearised(mass=1.001), linearised(last_step_s=1.1), linearised(stages=12)
    assert not any(other is first for other in others)
    p, inputs = np.ones(first.size1_in(0)), np.ones(first.size1_in(1))
    states = [np.array(function(p, inputs)[0].full()) for function in (first, others[0])]
    assert not np.allclose(*states, rtol=1e-9)


def test_a_slow_output_limits_what_each_stage_can_ask_for():
    """1 command per second, from +0.3 port and -0.5 starboard: free towards neutral, then one stage's time further."""
    problem = StationProblem(TanhModel(), MpcConfig(stages=3, last_step_s=0.8), MotorLimits(rate_per_s=1.0))
    p = problem.pack((0, 0, 0, 0, 0, 0), (0, 0), (0, 0, 0), 0.0, (0.3, -0.5), MpcWeights())
    lower, upper = problem.bounds(p)
    assert problem.times_s[1:] == pytest.approx([0.2, 0.7, 1.5])
    assert lower.tolist() == pytest.approx(np.array([[-0.2, -0.7], [-0.7, -1.0], [-1.0, -1.0]]))
    assert upper.tolist() == pytest.approx(np.array([[0.5, 0.2], [1.0, 0.7], [1.0, 1.0]]))


def test_a_quick_output_limits_nothing_but_the_range():
    problem = StationProblem(MODEL, MpcConfig(stages=3), MotorLimits(rate_per_s=20.0))
    p = problem.pack(np.zeros(8), (0, 0), (0, 0, 0), 0.0, (100.0, -30.0), MpcWeights())
    lower, upper = problem.bounds(p)
    assert (lower == MODEL.input_lower).all() and (upper == MODEL.input_upper).all()


def test_a_cap_and_the_pause_of_a_reversal_are_bounds_of_the_plan():
    """Port goes ahead and starboard is off: within the pause port has to stay at neutral or ahead."""
    limits = MotorLimits(command_max=0.5, reversal_pause_s=0.5)
    problem = StationProblem(TanhModel(), MpcConfig(stages=3, last_step_s=0.8), limits)
    p = problem.pack((0, 0, 0, 0, 0, 0), (0, 0), (0, 0, 0), 0.0, (0.3, 0.0), MpcWeights())
    lower, upper = problem.bounds(p)
    assert lower.tolist() == [[0.0, -0.5], [0.0, -0.5], [-0.5, -0.5]]  # stages begin at 0, 0.2 and 0.7 s
    assert upper.tolist() == [[0.5, 0.5]] * 3
    p = problem.pack((0, 0, 0, 0, 0, 0), (0, 0), (0, 0, 0), 0.0, (0.3, -0.1), MpcWeights())
    assert problem.bounds(p)[1].tolist() == [[0.5, 0.0], [0.5, 0.0], [0.5, 0.5]]


@pytest.mark.parametrize(
    ("controller", "effort", "slew"),
    [
        ("sd-mpc", "precise", 2.0),
        ("sd-mpc", "normal", 3.0),
        ("sd-mpc", "gentle", 112.0),
        ("nnsem-mpc", "normal", 3.0),
        ("nnsem-mpc", "gentle", 20.0),
    ],
)
def test_the_effort_is_the_least_slew_weight_by_the_side_load(controller, effort, slew):
    """At the station with 0.02 m/s^2 of disturbance across its heading: all weight is on the near set.

    The input of SD is thrust, that of NNSEM is the command.
    """
    model = build_model(load_config("sitl", (f"controller.name={controller}",)))
    mpc = StationMpc(model, MpcConfig(effort=effort, near=MpcWeights(slew=2.0)), 0.2)
    packed = []
    pack = mpc._problem.pack
    mpc._problem.pack = lambda *given: packed.append(pack(*given)) or packed[-1]
    mpc.step(estimate((0,) * (6 + model.n_motor), disturbance=(0.0, 0.02, 0.0)), None, ORIGIN)
    assert mpc._problem.unpack_cost(packed[0])[3] == pytest.approx(slew, rel=0.1)  # NNSEM is not quite at rest there


def test_gentle_plans_further_ahead_from_when_it_is_asked_for():
    """While it holds: the plan goes on over the other horizon, and back with the other effort."""
    config = load_config("sitl", ("controller.name=sd-mpc",)).controller
    asking = {
        effort: config.model_copy(update={"mpc": config.mpc.model_copy(update={"effort": effort})})
        for effort in ("normal", "gentle")
    }
    mpc = StationMpc(MODEL, asking["normal"].mpc, 0.2)
    at = estimate((-0.5, 0.4, 0.05, 0.1, 0.0, 0.0, 0.1, 0.1), (0.0, 0.02, 0.0))
    first = mpc.step(at, None, ORIGIN)
    mpc.retune(asking["gentle"])
    gentle = mpc.step(at, None, ORIGIN)
    assert first.plan[-1][0] == pytest.approx(11.0)
    assert gentle.plan[-1][0] == pytest.approx(0.5 * 20 * (0.2 + 1.39))
    assert gentle.ok
    mpc.retune(asking["normal"])
    assert mpc.step(at, None, ORIGIN).plan[-1][0] == pytest.approx(11.0)


def test_a_model_of_the_command_plans_as_far_ahead_with_any_effort():
    for effort in ("precise", "normal", "gentle"):
        mpc = StationMpc(TanhModel(), MpcConfig(effort=effort), 0.2)
        assert mpc.step(estimate((0.5, 0, 0, 0, 0, 0)), None, ORIGIN).plan[-1][0] == pytest.approx(11.0)


@pytest.mark.parametrize("solver", ["sqp", "ipopt", "fatrop", "torch-lqr"])
def test_every_solver_keeps_to_the_slew_limit(solver):
    controller = load_config("sitl", (f"controller.solver={solver}",)).controller
    _, make_solver = choose_solver(controller)
    problem = StationProblem(TanhModel(), MpcConfig(stages=6), MotorLimits(rate_per_s=0.5))
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
