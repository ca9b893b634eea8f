"""Common parts of the classical feedback laws: pose error, simplified model, wind feed-forward, steering, allocation.

The laws are written in the station's frame (station at the origin, heading 0), which is the paper's earth-fixed frame
turned so that its axes lie along and across the station's heading: diagonal gains then mean the same for any station.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from asvhil.config import SteeringConfig, VesselConfig
from asvhil.controller.allocation import Allocation, Allocator
from asvhil.dynamics.rigid_body import RigidBody, ThrustCurve
from asvhil.geo import body_to_ned, ned_to_body, wrap_rad
from asvhil.types import Control, Estimate, Station, Wind, record

Vector3 = tuple[float, float, float]  # surge, sway, yaw; or along, across, heading

LONGEST_STEP_S = 1.0  # a longer time between two steps is a pause, in which nothing is integrated
FAILED = Control(command=(0.0, 0.0), ok=False, iterations=0, cost=0.0)
BACK_SHARE = 0.5  # of the steering radius: within it the reference is the station's heading again
TURN_ROUND_RAD = math.radians(120.0)  # bow or stern, once chosen, leads until it is this far off


@record
class TrackingState:
    """The boat against its references, in the station's frame.

    `error` is eta_e (m, m, rad) with the heading wrapped, `rate` its derivative R(psi) nu - eta_s_dot, `nu` the
    velocity (m/s, m/s, rad/s) and `psi_rad` the heading for R(psi), whatever the heading reference is. `moves` is
    eta_s_dot, the velocity of the station.
    """

    t_ns: int
    error: Vector3
    rate: Vector3
    nu: Vector3
    psi_rad: float
    moves: Vector3 = (0.0, 0.0, 0.0)


class SimplifiedModel:
    """M1, C1(nu) and D1 of a vessel, simplified after Sarda et al. (2016).

    M1 = diag(m - X_udot, m - Y_vdot, Iz - N_rdot): the terms off the diagonal, m x_G - Y_rdot and m x_G - N_vdot, are
    neglected. C1 keeps the rigid-body and added-mass terms of M1 alone, so x_G, y_G, Y_rdot and N_vdot are zero in it
    too. D1 = diag(X_u, Y_v, N_r): all quadratic and cross damping is neglected, as the paper does at low speed.
    """

    def __init__(self, vessel: VesselConfig) -> None:
        self.mass: Vector3 = (
            vessel.mass_kg + vessel.added_mass_surge_kg,
            vessel.mass_kg + vessel.added_mass_sway_kg,
            vessel.inertia_yaw_kgm2 + vessel.added_inertia_yaw_kgm2,
        )
        self.damping: Vector3 = (
            vessel.surge_drag_n_per_mps,
            vessel.sway_drag_n_per_mps,
            vessel.yaw_drag_nm_per_radps,
        )

    def load(self, motion: TrackingState, eta_r_dot: Vector3, eta_r_ddot: Vector3) -> Vector3:
        """M1 [R^T eta_r_ddot + Rdot^T eta_r_dot] + C1(nu) R^T eta_r_dot + D1 R^T eta_r_dot (N, N, N m)."""
        u, v, r = motion.nu
        u_r, v_r, r_r = to_body(motion.psi_rad, eta_r_dot)
        du, dv, dr = to_body(motion.psi_rad, eta_r_ddot)
        (m_u, m_v, m_r), (d_u, d_v, d_r) = self.mass, self.damping
        # Rdot^T = r S^T R^T with S^T (a, b, c) = (b, -a, 0).
        return (
            m_u * (du + r * v_r) - m_v * v * r_r + d_u * u_r,
            m_v * (dv - r * u_r) + m_u * u * r_r + d_v * v_r,
            m_r * dr + m_v * v * u_r - m_u * u * v_r + d_r * r_r,
        )


def to_body(psi_rad: float, vector: Vector3) -> Vector3:
    """R(psi)^T of a vector in the station's frame."""
    along, across = ned_to_body(psi_rad, vector[0], vector[1])
    return along, across, vector[2]


class Steering:
    """The heading reference of a boat without sway force, since its motors are fixed: the usual solution in practice.

    Beyond `radius_m` the bow or the stern, whichever is nearer, points at the station, until within half of the
    radius. Near, once the boat is abeam by `lean_from_m` and fully at twice that, the heading leans off the station's
    by up to `lean_max_deg`, so that surge force carries part of the wanted side force: the angle of the wanted force
    to the station's axis, faded out where the surge force is weak.
    """

    def __init__(self, config: SteeringConfig) -> None:
        self._config = config
        self.reset()

    def reset(self) -> None:
        self.away = False
        self._astern = False

    def reference_rad(self, x_m: float, y_m: float, psi_rad: float) -> float:
        """Heading reference in the station's frame, from the position and heading in it; without the lean."""
        distance_m = math.hypot(x_m, y_m)
        was_away = self.away
        radius_m = self._config.radius_m
        self.away = distance_m > (BACK_SHARE * radius_m if was_away else radius_m)
        if not self.away:
            return 0.0
        bearing_rad = math.atan2(-y_m, -x_m)
        off_rad = abs(wrap_rad(psi_rad - bearing_rad))
        if not was_away:
            self._astern = off_rad > 0.5 * math.pi
        elif (math.pi - off_rad if self._astern else off_rad) > TURN_ROUND_RAD:
            self._astern = not self._astern
        return bearing_rad + math.pi if self._astern else bearing_rad

    def lean_rad(self, y_m: float, psi_rad: float, surge_n: float, sway_n: float) -> float:
        """The lean (rad) at an offset abeam (m) for a wanted force (N) in body axes; 0 while the boat is far off."""
        share = min(max(abs(y_m) / self._config.lean_from_m - 1.0, 0.0), 1.0)
        limit_rad = share * math.radians(self._config.lean_max_deg)
        if self.away or limit_rad == 0.0:
            return 0.0
        along_n, across_n = body_to_ned(psi_rad, surge_n, sway_n)
        # tan of the force's angle, for surge ahead and astern alike; `lean_fade_n` keeps it finite without any.
        lean_rad = math.atan(along_n * across_n / (along_n**2 + self._config.lean_fade_n**2))
        return min(max(lean_rad, -limit_rad), limit_rad)


class FeedbackLoop:
    """From estimates to motor commands around a law tau = f(motion), which has no knowledge of wind and motors.

    The law's sway force Y cannot be produced; it only decides the lean. `law` is called twice in a step, so it must
    not change anything; what it integrates is advanced afterwards, from what `step` returns. The position error that
    the law sees is shortened to `error_max_m`: the laws are proportional, so that at a large distance the
    reference velocity, and with it C1 R^T eta_r_dot, would exceed what the motors can do.
    """

    def __init__(self, vessel: VesselConfig, steering: SteeringConfig, wind_feedforward: bool) -> None:
        self._body = RigidBody(vessel)
        self._allocator = Allocator(ThrustCurve(vessel.thrust_curve), vessel.motor_arm_m)
        self._wind_feedforward = wind_feedforward
        self._error_max_m = steering.error_max_m
        self.steering = Steering(steering)

    def step(
        self, estimate: Estimate, wind: Wind | None, station: Station, law: Callable[[TrackingState], Vector3]
    ) -> tuple[TrackingState, Allocation] | None:
        """The motion under the final heading reference and the allocation; None if an input is not finite."""
        nu = (estimate.u_mps, estimate.v_mps, estimate.r_radps)
        x_m, y_m = ned_to_body(station.psi_rad, estimate.n_m - station.n_m, estimate.e_m - station.e_m)
        psi_rad = estimate.psi_rad - station.psi_rad
        if not all(map(math.isfinite, (x_m, y_m, psi_rad, *nu))):
            return None
        psi_rad = wrap_rad(psi_rad)
        reference_rad = self.steering.reference_rad(x_m, y_m, psi_rad)
        x_dot, y_dot = body_to_ned(psi_rad, nu[0], nu[1])
        x_moves, y_moves = ned_to_body(station.psi_rad, station.vn_mps, station.ve_mps)
        short = min(1.0, self._error_max_m / max(math.hypot(x_m, y_m), 1e-9))

        def motion(psi_r_rad: float) -> TrackingState:
            error = (short * x_m, short * y_m, wrap_rad(psi_rad - psi_r_rad))
            return TrackingState(
                t_ns=estimate.t_ns,
                error=error,
                rate=(x_dot - x_moves, y_dot - y_moves, nu[2]),
                nu=nu,
                psi_rad=psi_rad,
                moves=(x_moves, y_moves, 0.0),
            )

        load = self._wind_load(estimate, wind)
        seen = motion(reference_rad)
        surge_n, sway_n, yaw_nm = law(seen)
        # The wind's surge load is met by thrust: what is left over, and carries sideways, is the law's own surge force.
        lean_rad = self.steering.lean_rad(y_m, psi_rad, surge_n, sway_n - load[1])
        if lean_rad != 0.0:
            seen = motion(reference_rad + lean_rad)
            surge_n, sway_n, yaw_nm = law(seen)
        wanted = (surge_n - load[0], yaw_nm - load[2])
        if not all(map(math.isfinite, wanted)):
            return None
        return seen, self._allocator.allocate(*wanted)

    def _wind_load(self, estimate: Estimate, wind: Wind | None) -> Vector3:
        """tau_w at the present relative wind; zero without one, or where it is switched off."""
        if wind is None or not self._wind_feedforward:
            return 0.0, 0.0, 0.0
        u_air, v_air = ned_to_body(estimate.psi_rad, wind.vn_mps, wind.ve_mps)
        surge_n, sway_n, yaw_nm = self._body.wind_forces(u_air - estimate.u_mps, v_air - estimate.v_mps)
        return surge_n, sway_n, yaw_nm
