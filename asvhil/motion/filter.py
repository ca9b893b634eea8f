"""The Kalman filter of one hypothesis, as CasADi functions: its prediction, and its correction by readings."""

from __future__ import annotations

import functools

import casadi as ca

from asvhil.config import VesselConfig
from asvhil.dynamics.ordered import symmetric
from asvhil.dynamics.rigid_body import RigidBody
from asvhil.types import record

VN, VE, R, DN, DE, DR, G, CN, CE = range(9)
SIZE = 9
CONDITIONS = 6  # of a prediction: time step (s), heading (rad), whether the wind is known, wind (m/s), thrust (N)
READINGS = 6  # whether there is a velocity, it (m/s), whether there is a yaw rate, it (rad/s), thrust in transit (N)
# So that no hypothesis becomes another one: at a gain of -1 a sound boat would be a reversed one. Half of the thrust is
# left where the sticks of a ground station take turns with our commands.
GAINS = (0.45, 3.0)


@record
class BankNoise:
    """How far the bank's physics may be wrong. Walks are per sqrt(s).

    A part of the walks grows with the thrust: lag, curve and hull are never quite known. The disturbance and the gain
    forget: they are drawn to 0 and 1. `timing_s`: how early or late a thrust may come, or its effect be seen.
    """

    velocity_std_mps: float
    yaw_rate_std_radps: float
    velocity_walk_mps: float = 0.05
    yaw_walk_radps: float = 0.03
    of_thrust: float = 0.10
    heading_std_rad: float = 0.10
    disturbance_mps2: float = 0.04
    disturbance_yaw_radps2: float = 0.02
    disturbance_time_s: float = 20.0
    gain_std: float = 0.20
    gain_time_s: float = 40.0
    current_mps: float = 0.15
    timing_s: float = 0.15


@functools.lru_cache(maxsize=4)
def prediction(vessel: VesselConfig, noise: BankNoise) -> ca.Function:
    """(x (9), P (9, 9), thrusts (2) in N, compass error (rad), load, conditions (6)) -> (x, P) one step later.

    `load`: mass and inertia aboard beside the vessel's, as a share of these.
    """
    body = RigidBody(vessel)
    m_u = vessel.mass_kg + vessel.added_mass_surge_kg
    m_v = vessel.mass_kg + vessel.added_mass_sway_kg
    m_r = vessel.inertia_yaw_kgm2 + vessel.added_inertia_yaw_kgm2
    x, p = ca.SX.sym("x", SIZE), ca.SX.sym("p", SIZE, SIZE)
    thrust_n, off_rad, load = ca.SX.sym("thrust", 2), ca.SX.sym("off"), ca.SX.sym("load")
    conditions = ca.SX.sym("conditions", CONDITIONS)
    dt_s, heading_rad, windy, wn, we, commanded_n = ca.vertsplit(conditions)

    c, s = ca.cos(heading_rad - off_rad), ca.sin(heading_rad - off_rad)
    r, vn_water, ve_water = x[R], x[VN] - x[CN], x[VE] - x[CE]
    u, v = c * vn_water + s * ve_water, c * ve_water - s * vn_water
    force_n, moment_nm = body.motor_forces(thrust_n[0], thrust_n[1])
    air_n, air_e = wn - x[VN], we - x[VE]
    x_w, y_w, n_w = (windy * part for part in body.wind_forces(c * air_n + s * air_e, c * air_e - s * air_n))
    u_dot, v_dot, r_dot = body.acceleration(u, v, r, x[G] * force_n + x_w, y_w, x[G] * moment_nm + n_w)
    # Of a loaded boat; what of the forces goes with the mass is small at the speeds of a station.
    slow_u, slow_v = m_u / (m_u + load * vessel.mass_kg), m_v / (m_v + load * vessel.mass_kg)
    slow_r = m_r / (m_r + load * vessel.inertia_yaw_kgm2)
    u_dot, v_dot, r_dot = slow_u * u_dot, slow_v * v_dot, slow_r * r_dot
    a_x, a_y = u_dot - r * v, v_dot + r * u
    forget_d, forget_g = ca.exp(-dt_s / noise.disturbance_time_s), ca.exp(-dt_s / noise.gain_time_s)

    drag_u = -slow_u * (vessel.surge_drag_n_per_mps + 2.0 * vessel.surge_drag_n_per_mps2 * ca.fabs(u)) / m_u
    drag_v = -slow_v * (vessel.sway_drag_n_per_mps + 2.0 * vessel.sway_drag_n_per_mps2 * ca.fabs(v)) / m_v
    drag_r = -slow_r * (vessel.yaw_drag_nm_per_radps + 2.0 * vessel.yaw_drag_nm_per_radps2 * ca.fabs(r)) / m_r
    f = ca.SX(SIZE, SIZE)  # sparse: zeros cost nothing
    f[VN, VN] = 1.0 + dt_s * ca.fmax(c * c * drag_u + s * s * drag_v, -1.0 / dt_s)
    f[VE, VE] = 1.0 + dt_s * ca.fmax(s * s * drag_u + c * c * drag_v, -1.0 / dt_s)
    f[VN, VE] = f[VE, VN] = dt_s * c * s * (drag_u - drag_v)
    f[R, R] = ca.fmax(1.0 + dt_s * drag_r, 0.0)
    f[VN, DN] = f[VE, DE] = f[R, DR] = dt_s
    f[VN, G], f[VE, G] = dt_s * slow_u * c * force_n / m_u, dt_s * slow_u * s * force_n / m_u
    f[R, G] = dt_s * slow_r * moment_nm / m_r
    f[DN, DN] = f[DE, DE] = f[DR, DR] = forget_d
    f[G, G] = forget_g
    f[CN, CN] = f[CE, CE] = 1.0
    f[VN, CN], f[VE, CE] = 1.0 - f[VN, VN], 1.0 - f[VE, VE]
    f[VN, CE] = f[VE, CN] = -f[VN, VE]

    after = ca.vertcat(
        x[VN] + dt_s * (c * a_x - s * a_y + x[DN]),
        x[VE] + dt_s * (s * a_x + c * a_y + x[DE]),
        # The drag in yaw may be faster than the step: it is taken at the step's end.
        r + dt_s * (r_dot + x[DR]) / ca.fmax(1.0 - dt_s * drag_r, 1.0),
        forget_d * x[DN : DR + 1],
        1.0 + forget_g * (x[G] - 1.0),
        x[CN : CE + 1],
    )

    # What is not known of the thrust: along it by its size, across it by the heading's error. By the size of what is
    # commanded, for all alike: else a hypothesis without thrust would be sure of more, and win where all are right.
    thrust_a = commanded_n / m_u
    thrust_r = commanded_n * vessel.motor_arm_m / m_r
    along = (noise.of_thrust * thrust_a) ** 2 + noise.velocity_walk_mps**2
    across = (noise.heading_std_rad * thrust_a) ** 2 + noise.velocity_walk_mps**2
    q = ca.SX(SIZE, SIZE)
    q[VN, VN] = dt_s * (c * c * along + s * s * across)
    q[VE, VE] = dt_s * (s * s * along + c * c * across)
    q[VN, VE] = q[VE, VN] = dt_s * c * s * (along - across)
    q[R, R] = dt_s * ((noise.of_thrust * thrust_r) ** 2 + noise.yaw_walk_radps**2)
    q[DN, DN] = q[DE, DE] = noise.disturbance_mps2**2 * (1.0 - forget_d**2)
    q[DR, DR] = noise.disturbance_yaw_radps2**2 * (1.0 - forget_d**2)
    q[G, G] = noise.gain_std**2 * (1.0 - forget_g**2)
    covariance = symmetric(f @ symmetric(p) @ f.T + q)
    return ca.Function("predict", [x, p, thrust_n, off_rad, load, conditions], [after, covariance], {"cse": True})


@functools.lru_cache(maxsize=4)
def correction(vessel: VesselConfig, noise: BankNoise) -> ca.Function:
    """(x (9), P (9, 9), readings (6)) -> (x, P, log likelihood, squared innovations over their variances).

    The readings are taken one after the other, so that nothing is inverted. Their noise grows with the thrust that is
    in transit, whose time is not known to a tenth of a second.
    """
    m_u = vessel.mass_kg + vessel.added_mass_surge_kg
    m_r = vessel.inertia_yaw_kgm2 + vessel.added_inertia_yaw_kgm2
    x, p = ca.SX.sym("x", SIZE), ca.SX.sym("p", SIZE, SIZE)
    readings = ca.SX.sym("readings", READINGS)
    moved, vn, ve, turned, yaw_rate, transit_n = ca.vertsplit(readings)
    velocity_variance = noise.velocity_std_mps**2 + (noise.timing_s * transit_n / m_u) ** 2
    yaw_variance = noise.yaw_rate_std_radps**2 + (noise.timing_s * transit_n * vessel.motor_arm_m / m_r) ** 2
    after, covariance = x, symmetric(p)
    log = nis = ca.SX(0.0)
    for row, reading, there, variance in (
        (VN, vn, moved, velocity_variance),
        (VE, ve, moved, velocity_variance),
        (R, yaw_rate, turned, yaw_variance),
    ):
        off = reading - after[row]
        s = covariance[row, row] + variance
        square = there * off * off / s
        log -= 0.5 * (square + there * ca.log(s))
        nis += square
        gain = there * covariance[:, row] / s
        after = after + gain * off
        covariance = symmetric(covariance - gain @ covariance[row, :])
    after[G] = ca.fmin(ca.fmax(after[G], GAINS[0]), GAINS[1])
    return ca.Function("correct", [x, p, readings], [after, covariance, log, nis], {"cse": True})
