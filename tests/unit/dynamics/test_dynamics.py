"""The physics model by hand-worked cases, alike in NumPy, CasADi and torch; the thrust curve and its inverse."""

import casadi as ca
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from asvhil.config import load_config
from asvhil.dynamics.arrays import namespace_of
from asvhil.dynamics.rigid_body import RigidBody, SimplifiedDynamics, ThrustCurve

VESSEL = load_config("sitl").vehicle.vessel
BODY = RigidBody(VESSEL)
MODEL = SimplifiedDynamics(VESSEL)


def test_accelerations_by_hand() -> None:
    # 279.95 N on 254.5 + 25.45 kg at rest: 1 m/s^2; 892 N m on 446 + 446 kg m^2: 1 rad/s^2.
    assert BODY.acceleration(0.0, 0.0, 0.0, 279.95, 0.0, 892.0) == pytest.approx((1.0, 0.0, 1.0))
    # Drag at 1 m/s ahead: 51.3 + 72.4 N.
    assert BODY.acceleration(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)[0] == pytest.approx(-123.7 / 279.95)
    # Drag opposes motion astern as well.
    assert BODY.acceleration(-1.0, 0.0, 0.0, 0.0, 0.0, 0.0)[0] == pytest.approx(123.7 / 279.95)
    # Coriolis: moving ahead and turning to starboard pushes the hull to port, -m_u u r.
    _, v_dot, _ = BODY.acceleration(1.0, 0.0, 0.5, 0.0, 0.0, 0.0)
    assert v_dot == pytest.approx(-279.95 * 0.5 / 636.25)
    # Munk moment: (m_u - m_v) u v, destabilising for the larger sway mass.
    _, _, r_dot = BODY.acceleration(1.0, 0.1, 0.0, 0.0, 0.0, 0.0)
    assert r_dot == pytest.approx((279.95 - 636.25) * 0.1 / 892.0)


def test_motor_and_wind_signs() -> None:
    assert BODY.motor_forces(100.0, 0.0) == pytest.approx((100.0, 102.7))  # the port motor turns the bow to starboard
    assert BODY.motor_forces(-50.0, 50.0) == pytest.approx((0.0, -102.7))
    assert BODY.wind_forces(-4.0, 0.0) == pytest.approx((-8.0, 0.0, 0.0))  # headwind of 4 m/s
    assert BODY.wind_forces(0.0, 3.0) == pytest.approx((0.0, 9.0, 0.0))  # from port, pushes to starboard
    assert BODY.wind_forces(2.0, 3.0)[2] == pytest.approx(-2.0 * 0.33 * 6.0)


@given(st.floats(-1.0, 1.0))
def test_the_thrust_curve_is_inverted_outside_its_dead_band(command: float) -> None:
    curve = ThrustCurve(VESSEL.thrust_curve)
    thrust_n = curve.thrust_n(command)
    if thrust_n == 0.0:
        assert curve.command(thrust_n) == 0.0
    else:
        assert curve.thrust_n(curve.command(thrust_n)) == pytest.approx(thrust_n, abs=1e-9)
        assert curve.command(thrust_n) == pytest.approx(max(command, -0.95), abs=1e-9)


def test_a_curve_without_a_dead_band_is_inverted_too() -> None:
    curve = ThrustCurve(((-1.0, -10.0), (-0.5, -2.0), (0.5, 4.0), (1.0, 12.0)))
    for command in (-1.0, -0.7, -0.5, 0.5, 0.9, 1.0):
        assert curve.thrust_n(curve.command(curve.thrust_n(command))) == pytest.approx(curve.thrust_n(command))
    for thrust_n in (-1.0, 1.0, 3.0):
        assert curve.thrust_n(curve.command(thrust_n)) == pytest.approx(thrust_n)


@given(st.lists(st.floats(-2.0, 2.0), min_size=9, max_size=9))
def test_numpy_casadi_and_torch_agree(numbers: list[float]) -> None:
    x, a, w = np.array(numbers[:5]), np.array(numbers[5:7]), 3.0 * np.array(numbers[7:])
    expected = MODEL.derivative(x, a, w)
    exact = MODEL.derivative(ca.DM(x), ca.DM(a), ca.DM(w))
    np.testing.assert_allclose(np.array(exact).ravel(), expected, rtol=0, atol=1e-12)
    tensors = [torch.tensor(part, dtype=torch.float64) for part in (x, a, w)]
    np.testing.assert_allclose(MODEL.derivative(*tensors).numpy(), expected, rtol=0, atol=1e-12)


def test_jacobians_of_casadi_and_torch_agree() -> None:
    rng = np.random.default_rng(1)
    x, a, w = ca.SX.sym("x", 5), ca.SX.sym("a", 2), ca.SX.sym("w", 2)
    jacobian = ca.Function("j", [x, a, w], [ca.jacobian(MODEL.derivative(x, a, w), ca.vertcat(x, a, w))])
    for _ in range(20):
        values = [rng.normal(size=5), rng.normal(size=2), rng.normal(size=2) * 4.0]
        tensors = tuple(torch.tensor(part, dtype=torch.float64) for part in values)
        theirs = torch.autograd.functional.jacobian(MODEL.derivative, tensors)
        np.testing.assert_allclose(np.hstack([part.numpy() for part in theirs]), np.array(jacobian(*values)), atol=1e-9)


def test_batches_go_through_as_they_are() -> None:
    rng = np.random.default_rng(2)
    x, a, w = rng.normal(size=(7, 3, 5)), rng.normal(size=(7, 3, 2)), rng.normal(size=(7, 3, 2))
    batch = MODEL.derivative(x, a, w)
    assert batch.shape == (7, 3, 5)
    np.testing.assert_array_equal(batch[4, 2], MODEL.derivative(x[4, 2], a[4, 2], w[4, 2]))


def test_other_kinds_of_arrays_are_refused() -> None:
    with pytest.raises(TypeError, match="a NumPy, CasADi or torch array is needed, not list"):
        namespace_of([1.0])


def test_commands_and_inputs_are_inverse() -> None:
    assert MODEL.command_of_input((1.0, MODEL.input_lower)) == pytest.approx((1.0, -0.95))
    assert MODEL.input_of_command((1.0, 0.0)) == pytest.approx((1.0, 0.0))
