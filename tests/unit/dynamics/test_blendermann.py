"""Blendermann's wind loads against his formula as it is printed, in the angle of the wind."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest

from asvhil.config import BlendermannConfig, load_config
from asvhil.dynamics.blendermann import Blendermann
from asvhil.dynamics.wind_load import QuadraticWind

HULL = BlendermannConfig(
    frontal_area_m2=1.5, lateral_area_m2=1.9, length_m=4.9, centroid_ahead_m=0.1, drag_bow=0.55, drag_stern=0.55
)


def printed(angle_rad: float, speed_mps: float) -> tuple[float, float, float]:
    """X, Y (N) and N (N m) of a wind `angle_rad` from the bow, positive on the port side (it pushes to starboard)."""
    front, side, length = HULL.frontal_area_m2, HULL.lateral_area_m2, HULL.length_m
    q = 0.5 * HULL.air_density_kgpm3 * speed_mps**2
    c_long, c_side = HULL.drag_bow * front / side, HULL.drag_side
    under = 1.0 - 0.5 * HULL.cross_force * (1.0 - c_long / c_side) * math.sin(2.0 * angle_rad) ** 2
    c_x = -c_long * side / front * math.cos(angle_rad) / under
    c_y = c_side * math.sin(angle_rad) / under
    c_n = (HULL.centroid_ahead_m / length - 0.18 * (abs(angle_rad) - 0.5 * math.pi)) * c_y
    return q * c_x * front, q * c_y * side, q * c_n * side * length


@pytest.mark.parametrize("degrees", range(-180, 181, 15))
def test_the_loads_are_those_of_the_printed_formula(degrees: int) -> None:
    angle_rad = math.radians(degrees)
    air = -6.0 * math.cos(angle_rad), 6.0 * math.sin(angle_rad)
    assert Blendermann(HULL).forces(*air) == pytest.approx(printed(angle_rad, 6.0), abs=1e-6)


def test_bow_and_stern_have_coefficients_of_their_own() -> None:
    loads = Blendermann(HULL.model_copy(update={"drag_stern": 0.8}))
    q_front = 0.5 * HULL.air_density_kgpm3 * HULL.frontal_area_m2 * 25.0
    assert loads.forces(-5.0, 0.0)[0] == pytest.approx(-0.55 * q_front)
    assert loads.forces(5.0, 0.0)[0] == pytest.approx(0.8 * q_front)


def test_still_air_and_its_slope_are_zero() -> None:
    loads = Blendermann(HULL)
    assert loads.forces(0.0, 0.0) == (0.0, 0.0, 0.0)
    u, v = ca.SX.sym("u"), ca.SX.sym("v")
    forces = ca.vertcat(*loads.forces(u, v))
    slope = ca.Function("slope", [u, v], [ca.jacobian(forces, ca.vertcat(u, v))])
    assert np.abs(np.array(slope(0.0, 0.0))).max() < 1e-3
    whole = ca.Function("forces", [u, v], [forces])
    for air in ((3.0, -2.0), (-4.0, 0.5), (0.0, 5.0)):
        assert np.array(whole(*air)).ravel() == pytest.approx(loads.forces(*air))


def test_the_second_boats_loads_are_near_those_of_the_first() -> None:
    second = load_config("sitl-second").plant.wind_load
    assert second is not None
    first, other = QuadraticWind(load_config("sitl").vehicle.vessel), Blendermann(second)
    for air, part in (((-6.0, 0.0), 0), ((6.0, 0.0), 0), ((0.0, 6.0), 1)):
        assert other.forces(*air)[part] == pytest.approx(first.forces(*air)[part], rel=0.2)
    assert other.forces(-4.0, 4.0)[2] * first.forces(-4.0, 4.0)[2] > 0.0, "both turn the boat across the wind"
