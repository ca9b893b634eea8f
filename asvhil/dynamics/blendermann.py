"""Blendermann's wind loads, for a simulated boat whose wind is by another law than that of the models."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca

from asvhil.config import BlendermannConfig

STILL = 1e-12  # (m/s)^2 under the root: without it still air would divide by zero


class Blendermann:
    """Blendermann's loads (1994; Fossen 2011, section 8.1) of a hull with areas A_F and A_L, for floats and CasADi.

    With g the angle of the wind from the bow and q = 0.5 rho V^2: X = -q A_F C_l cos(g) / D, Y = q A_L C_t sin(g) / D
    and N = (s_L + 0.18 L (pi/2 - |g|)) Y, where D = 1 - (d/2) (1 - C_l A_F / (C_t A_L)) sin^2(2g). C_l goes from its
    value at the bow to that at the stern with cos(g), where Blendermann has a step at the beam.
    """

    def __init__(self, config: BlendermannConfig) -> None:
        half_density = 0.5 * config.air_density_kgpm3
        self._front, self._side = half_density * config.frontal_area_m2, half_density * config.lateral_area_m2
        self._c_mean = 0.5 * (config.drag_bow + config.drag_stern)
        self._c_swing = 0.5 * (config.drag_bow - config.drag_stern)
        self._c_side, self._cross = config.drag_side, config.cross_force
        self._ahead_m, self._length_m = config.centroid_ahead_m, config.length_m

    def forces(self, u_air: Any, v_air: Any) -> tuple[Any, Any, Any]:
        speed2 = u_air * u_air + v_air * v_air + STILL
        speed = _sqrt(speed2)
        c_long = self._c_mean - self._c_swing * u_air / speed  # cos(g) = -u_air / V
        sin2 = 2.0 * u_air * v_air / speed2
        ratio = c_long * self._front / (self._c_side * self._side)
        cross = 1.0 - 0.5 * self._cross * (1.0 - ratio) * sin2 * sin2
        x_n = self._front * c_long * speed * u_air / cross
        y_n = self._side * self._c_side * speed * v_air / cross
        before_beam = _arctan2(-u_air, abs(v_air) + STILL)  # pi/2 - |g|
        return x_n, y_n, (self._ahead_m + 0.18 * self._length_m * before_beam) * y_n


def _sqrt(x: Any) -> Any:
    return math.sqrt(x) if isinstance(x, float) else ca.sqrt(x)


def _arctan2(y: Any, x: Any) -> Any:
    return math.atan2(y, x) if isinstance(x, float) else ca.atan2(y, x)
