"""Integral line of sight path following: cross-track error to a heading, and heading and speed to the two motors.

Guidance after Borhaug, Pavlov and Pettersen (2008) and Caharija et al. (2016), with y the cross-track error, positive
to starboard of the path, gamma the path's heading, D the look-ahead and s the integral gain:

    psi_d  = gamma - atan((y + s z) / D) - beta
    z_dot  = D y / ((y + s z)^2 + D^2)

so that z (s; the gain in m/s) hardly grows while the boat is far off. beta is the estimated drift angle; z corrects
its error.
"""

from __future__ import annotations

import math

from asvhil.config import ProcedureConfig, VesselConfig
from asvhil.controller.allocation import Allocator
from asvhil.controller.dubins import Dubins
from asvhil.dynamics.rigid_body import RigidBody, ThrustCurve
from asvhil.geo import ned_to_body, wrap_rad
from asvhil.types import Estimate, Wind, record

SEARCH_BACK_M, SEARCH_AHEAD_M = 3.0, 8.0  # range of the search for the nearest point
CURVATURE_LEAD_S = 0.6  # the yaw rate is commanded this much ahead, for motor lag and inertia
LEAST_SPEED_MPS = 0.5  # below it the drift angle is ill-defined, and is faded out
DRIFT_MAX_RAD = 0.6
ON_COURSE_RAD = 0.5  # beyond this heading error the integral is held: the error is that of the turn, not of drift


@record
class Guidance:
    """References: heading (rad), yaw rate of the path (rad/s), nearest point (m) and cross-track error (m)."""

    psi_rad: float
    r_radps: float
    along_m: float
    cross_m: float


class Ilos:
    """Guidance along one path; its state is the nearest point and the integral of the cross-track error."""

    def __init__(self, config: ProcedureConfig) -> None:
        self._config = config
        self.begin()

    def retune(self, config: ProcedureConfig) -> None:
        """Other settings, such as the look-ahead, from the next step on."""
        self._config = config

    def begin(self) -> None:
        """Start on a new path, from its beginning. The integral is reset, since the wind acts from another side."""
        self._along_m = 0.0
        self.integral_s = 0.0

    def step(self, path: Dubins, estimate: Estimate, elapsed_s: float) -> Guidance:
        """Guidance for an estimate `elapsed_s` after the last one."""
        low_m, high_m = self._along_m - SEARCH_BACK_M, self._along_m + SEARCH_AHEAD_M
        self._along_m = along_m = path.project(estimate.n_m, estimate.e_m, low_m, high_m)
        n_m, e_m, gamma_rad = path.pose(along_m)
        _, cross_m = ned_to_body(gamma_rad, estimate.n_m - n_m, estimate.e_m - e_m)
        ahead_m, gain = self._config.lookahead_m, self._config.integral_gain
        speed_mps = max(estimate.u_mps, LEAST_SPEED_MPS)
        beta_rad = min(max(math.atan2(estimate.v_mps, speed_mps), -DRIFT_MAX_RAD), DRIFT_MAX_RAD)
        course_rad = gamma_rad - math.atan2(cross_m + gain * self.integral_s, ahead_m)
        psi_rad = wrap_rad(course_rad - beta_rad)
        if abs(wrap_rad(psi_rad - estimate.psi_rad)) < ON_COURSE_RAD:
            self._integrate(cross_m, elapsed_s)
        moving_mps = max(estimate.u_mps, 0.0)
        curvature = path.curvature(along_m + CURVATURE_LEAD_S * moving_mps)
        # On the inside of a turn the nearest point moves faster than the boat; half a radius is the limit.
        foot_mps = moving_mps / max(1.0 - curvature * cross_m, 0.5)
        return Guidance(psi_rad=psi_rad, r_radps=curvature * foot_mps, along_m=along_m, cross_m=cross_m)

    def _integrate(self, cross_m: float, elapsed_s: float) -> None:
        ahead_m, gain = self._config.lookahead_m, self._config.integral_gain
        rate = ahead_m * cross_m / ((cross_m + gain * self.integral_s) ** 2 + ahead_m**2)
        bound = self._config.integral_max_m / gain if gain > 0.0 else 0.0
        self.integral_s = min(max(self.integral_s + rate * elapsed_s, -bound), bound)


def approach_speed(config: ProcedureConfig, distance_m: float, heading_error_rad: float) -> float:
    """Surge speed (m/s) at a distance to the station: reduced to the hand-over speed at r_s, to zero at the station.

    With a heading error it is reduced by the cosine, to zero at a right angle.
    """
    beyond_m = distance_m - config.r_s_m
    if beyond_m > 0.0:
        allowed_mps = math.sqrt(config.handover_speed_mps**2 + 2.0 * config.slow_down_mps2 * beyond_m)
    else:
        allowed_mps = config.handover_speed_mps * distance_m / config.r_s_m
    return min(config.speed_mps, allowed_mps) * max(math.cos(heading_error_rad), 0.0)


class Helm:
    """Heading and speed to motor commands by inverting the rigid body's surge and yaw equations (Fossen 2011, 6.109).

    The known wind load and the estimated disturbance are fed forward.
    """

    def __init__(self, config: ProcedureConfig, vessel: VesselConfig) -> None:
        self._config = config
        self._body = RigidBody(vessel)
        self._allocator = Allocator(ThrustCurve(vessel.thrust_curve), vessel.motor_arm_m)
        self._m_u_kg = vessel.mass_kg + vessel.added_mass_surge_kg
        self._m_r_kgm2 = vessel.inertia_yaw_kgm2 + vessel.added_inertia_yaw_kgm2

    def command(self, estimate: Estimate, wind: Wind | None, guidance: Guidance, u_mps: float) -> tuple[float, float]:
        """(port, starboard) in [-1, 1] toward the guidance's heading and a surge speed; None as wind is still air."""
        config = self._config
        u, v, r = estimate.u_mps, estimate.v_mps, estimate.r_radps
        air = ned_to_body(estimate.psi_rad, wind.vn_mps, wind.ve_mps) if wind is not None else (0.0, 0.0)
        load = self._body.wind_forces(air[0] - u, air[1] - v)
        u_dot, _, r_dot = self._body.acceleration(u, v, r, *load)
        push_u, _ = ned_to_body(estimate.psi_rad, estimate.disturbance[0], estimate.disturbance[1])
        turn = guidance.r_radps + wrap_rad(guidance.psi_rad - estimate.psi_rad) / config.heading_time_s
        r_wanted = min(max(turn, -config.yaw_rate_max_radps), config.yaw_rate_max_radps)
        x_n = self._m_u_kg * ((u_mps - u) / config.surge_time_s - u_dot - push_u)
        n_nm = self._m_r_kgm2 * ((r_wanted - r) / config.yaw_rate_time_s - r_dot - estimate.disturbance[2])
        return self._allocator.allocate(x_n, n_nm).command
