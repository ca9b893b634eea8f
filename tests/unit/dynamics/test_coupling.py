"""The paper's full equations against its matrices, written out here once more."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from pydantic import ValidationError

from asvhil.config import CouplingConfig, VesselConfig, load_config
from asvhil.dynamics.rigid_body import RigidBody, SimplifiedDynamics

WAMV = load_config("sitl").vehicle.vessel
SECOND = load_config("sitl-second").vehicle.vessel


def drawn(rng: np.random.Generator, **fixed: float) -> VesselConfig:
    """A WAM-V with couplings of a size that its masses and drags bear."""
    sizes = {"x_g_m": 0.3, "y_g_m": 0.2, "y_rdot_kgm": 60.0, "n_vdot_kgm": 60.0}
    sizes |= {name: 60.0 for name in CouplingConfig.model_fields if name not in sizes}
    terms = {name: float(rng.uniform(-size, size)) for name, size in sizes.items()} | fixed
    return WAMV.model_copy(update={"coupling": CouplingConfig(**terms)})


def by_the_matrices(vessel: VesselConfig, nu: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """nu_dot of the paper's M, C_RB, C_A, D_L and D_NL; -m y_G is added in M, where it belongs with C_RB."""
    part = vessel.coupling
    assert part is not None
    u, v, r = nu
    m, x_g, y_g = vessel.mass_kg, part.x_g_m, part.y_g_m
    x_udot, y_vdot, n_rdot = -vessel.added_mass_surge_kg, -vessel.added_mass_sway_kg, -vessel.added_inertia_yaw_kgm2
    y_rdot, n_vdot = -part.y_rdot_kgm, -part.n_vdot_kgm
    mass = np.array(
        [
            [m - x_udot, 0.0, -m * y_g],
            [0.0, m - y_vdot, m * x_g - y_rdot],
            [-m * y_g, m * x_g - n_vdot, vessel.inertia_yaw_kgm2 - n_rdot],
        ]
    )
    rigid = np.array(
        [[0, 0, -m * (x_g * r + v)], [0, 0, -m * (y_g * r - u)], [m * (x_g * r + v), m * (y_g * r - u), 0]]
    )
    half = 0.5 * (y_rdot + n_vdot)
    added = np.array([[0, 0, y_vdot * v + half * r], [0, 0, -x_udot * u], [-y_vdot * v - half * r, x_udot * u, 0]])
    linear = np.diag([vessel.surge_drag_n_per_mps, vessel.sway_drag_n_per_mps, vessel.yaw_drag_nm_per_radps])
    v_v, r_r = vessel.sway_drag_n_per_mps2 * abs(v), vessel.yaw_drag_nm_per_radps2 * abs(r)
    square = np.array(
        [
            [vessel.surge_drag_n_per_mps2 * abs(u), 0, 0],
            [0, v_v + part.y_v_absr * abs(r), part.y_r_absv * abs(v) + part.y_r_absr * abs(r)],
            [0, part.n_v_absv * abs(v) + part.n_v_absr * abs(r), r_r + part.n_r_absv * abs(v)],
        ]
    )
    return np.linalg.solve(mass, tau - (rigid + added + linear + square) @ nu)


def test_the_acceleration_is_that_of_the_papers_matrices() -> None:
    rng = np.random.default_rng(1)
    for _ in range(300):
        vessel = drawn(rng)
        nu, tau = rng.normal(size=3) * (1.0, 0.5, 0.5), rng.normal(size=3) * 200.0
        assert RigidBody(vessel).acceleration(*nu, *tau) == pytest.approx(by_the_matrices(vessel, nu, tau), abs=1e-12)


def test_without_drag_and_forces_the_kinetic_energy_stays() -> None:
    rng = np.random.default_rng(2)
    free = dict.fromkeys((name for name in VesselConfig.model_fields if "_drag_" in name), 0.0)
    still = {name: 0.0 for name in CouplingConfig.model_fields if "abs" in name}
    for _ in range(50):
        vessel = drawn(rng, **still, y_rdot_kgm=20.0, n_vdot_kgm=20.0).model_copy(update=free)
        nu = rng.normal(size=3)
        body = RigidBody(vessel)
        # Columns of the inverse of M: the accelerations at rest under unit forces.
        inverse = np.array([body.acceleration(0.0, 0.0, 0.0, *unit) for unit in np.eye(3)]).T
        power = nu @ np.linalg.solve(inverse, body.acceleration(*nu, 0.0, 0.0, 0.0))
        assert abs(power) < 1e-9


def test_terms_of_zero_are_the_simplified_dynamics() -> None:
    zero = WAMV.model_copy(update={"coupling": CouplingConfig()})
    rng = np.random.default_rng(3)
    for _ in range(50):
        state, forces = rng.normal(size=3), rng.normal(size=3) * 100.0
        simple = RigidBody(WAMV).acceleration(*state, *forces)
        assert RigidBody(zero).acceleration(*state, *forces) == pytest.approx(simple, abs=1e-13)


def test_the_physics_model_predicts_with_them() -> None:
    x, a, wind = np.array([0.3, -0.2, 0.1, 0.4, -0.2]), np.array([0.5, 0.1]), np.array([-3.0, 2.0])
    whole, simple = SimplifiedDynamics(SECOND), SimplifiedDynamics(SECOND.model_copy(update={"coupling": None}))
    assert np.abs(whole.derivative(x, a, wind) - simple.derivative(x, a, wind))[:3].min() > 1e-4
    symbols = ca.SX.sym("x", 5), ca.SX.sym("a", 2), ca.SX.sym("w", 2)
    compiled = ca.Function("f", list(symbols), [whole.derivative(*symbols)])
    assert np.array(compiled(x, a, wind)).ravel() == pytest.approx(whole.derivative(x, a, wind), abs=1e-13)


@pytest.mark.parametrize(
    ("terms", "says"),
    [
        ({"x_g_m": 3.0}, "mass matrix is not positive definite"),
        ({"y_g_m": 3.0}, "mass matrix is not positive definite"),
        ({"n_vdot_kgm": 1600.0}, "mass matrix is not positive definite"),
        ({"n_v_absv": -2000.0}, "pushes the boat where r = "),
        ({"y_r_absr": 3000.0, "n_v_absr": 3000.0}, "pushes the boat where r = -"),
    ],
)
def test_terms_that_no_hull_can_have_are_refused(terms: dict[str, float], says: str) -> None:
    with pytest.raises(ValidationError, match=f"coupling: .*{says}"):
        VesselConfig(**{**WAMV.model_dump(), "coupling": terms})
