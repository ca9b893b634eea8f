"""The model with factors: none changes nothing, each changes what it is named for, by whichever way a model has it."""

import casadi as ca
import numpy as np
import pytest

from asvhil.config import find_shipped, load_config
from asvhil.dynamics.corrected import COUNT, CorrectedModel, has_lag
from asvhil.dynamics.protocol import Dynamics
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.dynamics.weights import load_model

VESSEL = load_config("sitl").vehicle.vessel
KINDS = ("physics", "lagnet", "nnsem", "sd", "knode")
NU, A, WIND = [0.4, -0.2, 0.1], np.array([0.6, -0.3]), np.array([3.0, -4.0])


def model_of(kind: str) -> Dynamics:
    if kind == "physics":
        return SimplifiedDynamics(VESSEL)
    return load_model(find_shipped(f"wamv16-{kind}", "models", ".npz", "model"))


def rate(model: Dynamics, x: list[float]) -> list[float]:
    values = [part.tolist() for part in (model.derivative(np.array(x), A, WIND),)]
    symbols = model.derivative(ca.DM(x), ca.DM(A), ca.DM(WIND))
    assert np.allclose(values[0], np.array(symbols).ravel(), rtol=1e-12, atol=1e-14)
    return values[0]


def states(model: Dynamics) -> list[float]:
    return NU + [0.5, -0.2][: model.n_motor]


@pytest.mark.parametrize("kind", KINDS)
def test_without_factors_it_is_the_model(kind: str) -> None:
    model = model_of(kind)
    corrected = CorrectedModel(model)
    found = rate(corrected, states(model) + [0.0] * COUNT)
    assert found == [*rate(model, states(model)), *[0.0] * COUNT]
    assert corrected.n_motor == model.n_motor + COUNT
    assert corrected.command_of_input((0.3, -0.4)) == model.command_of_input((0.3, -0.4))
    assert has_lag(corrected) == has_lag(model) == (model.n_motor > 0)


def test_a_weak_motor_of_the_physics_is_exactly_one_with_less_of_the_curve() -> None:
    weak = SimplifiedDynamics(VESSEL, shares=(0.7, 0.9))
    corrected = CorrectedModel(SimplifiedDynamics(VESSEL))
    assert np.allclose(rate(corrected, [*NU, 0.5, -0.2, -0.3, -0.1, 0.0, 0.0, 0.0])[:5], rate(weak, [*NU, 0.5, -0.2]))


@pytest.mark.parametrize("kind", ["nnsem", "sd", "knode"])
def test_a_motor_without_a_state_loses_that_part_of_its_effect(kind: str) -> None:
    model = model_of(kind)
    whole, off = rate(model, NU), model.derivative(np.array(NU), np.array([0.0, A[1]]), WIND).tolist()
    weak = rate(CorrectedModel(model), [*NU, -0.3, 0.0, 0.0, 0.0, 0.0])[:3]
    assert np.allclose(weak, [w - 0.3 * (w - o) for w, o in zip(whole, off, strict=True)])


@pytest.mark.parametrize("kind", KINDS)
def test_each_axis_answers_by_their_factor(kind: str) -> None:
    model = model_of(kind)
    u_dot, v_dot, r_dot = rate(model, states(model))[:3]
    answered = rate(CorrectedModel(model), [*states(model), 0.0, 0.0, -0.1, 0.2, -0.4])[:3]
    assert np.allclose(answered, [0.9 * u_dot, 1.2 * v_dot, 0.6 * r_dot])
