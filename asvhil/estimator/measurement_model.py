"""What a compass with a gyro, and a receiver, should say in a state, and how far off it a reading of them is."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from asvhil.estimator.states import B_E, B_N, DEVIATION, G_R, PSI, SIZE, Array, E, N, R, U, V, deviation_row
from asvhil.geo import LocalFrame, wrap_rad
from asvhil.types import Attitude, GnssFix


class Group(NamedTuple):
    """The rows that are one sensor's: they are believed or refused together."""

    sensor: str
    rows: slice
    value: tuple[float, float]
    expected: tuple[float, float]


class Reading(NamedTuple):
    """The sensors that are in a reading; innovation (m) and measurement matrix (m, SIZE) of all its rows."""

    groups: list[Group]
    innovation: Array
    h: Array


def of_attitude(x: Array, m: Attitude) -> Reading:
    """Heading and yaw rate, or the one of them that the source has."""
    has_heading, has_rate = math.isfinite(m.psi_rad), math.isfinite(m.r_radps)
    s = x.tolist()
    _, s1, c1, s2, c2 = row = deviation_row(s[PSI])
    _, b, c, d, e = s[DEVIATION]
    heading = s[PSI] + float(x[DEVIATION] @ row)
    off = wrap_rad(m.psi_rad - heading) if has_heading else 0.0
    rate = s[R] + s[G_R]
    h = np.zeros((2, SIZE))
    h[0, PSI] = 1.0 + b * c1 - c * s1 + 2.0 * (d * c2 - e * s2)
    h[0, DEVIATION] = row
    h[1, R] = h[1, G_R] = 1.0
    groups = []
    if has_heading:
        groups.append(Group("heading", slice(0, 1), (m.psi_rad, 0.0), (m.psi_rad - off, 0.0)))
    if has_rate:
        groups.append(Group("yaw_rate", slice(1, 2), (m.r_radps, 0.0), (rate, 0.0)))
    return Reading(groups, np.array([off, m.r_radps - rate]), h)


def of_gnss(x: Array, m: GnssFix, frame: LocalFrame) -> Reading:
    """Position and velocity of the antenna, or the one of them that the fix has."""
    has_position = math.isfinite(m.lat_deg) and math.isfinite(m.lon_deg)
    has_velocity = math.isfinite(m.vn_mps) and math.isfinite(m.ve_mps)
    state = x.tolist()
    c, s = math.cos(state[PSI]), math.sin(state[PSI])
    arm_x, arm_y = m.arm_m
    arm_n, arm_e = c * arm_x - s * arm_y, s * arm_x + c * arm_y
    u, v = state[U] - state[R] * arm_y, state[V] + state[R] * arm_x
    vn, ve = c * u - s * v, s * u + c * v
    n, e = state[N] + arm_n + state[B_N], state[E] + arm_e + state[B_E]
    h = np.zeros((4, SIZE))
    h[0, N] = h[1, E] = h[0, B_N] = h[1, B_E] = 1.0
    h[0, PSI], h[1, PSI] = -arm_e, arm_n
    h[2, PSI], h[2, U], h[2, V], h[2, R] = -ve, c, -s, -arm_e
    h[3, PSI], h[3, U], h[3, V], h[3, R] = vn, s, c, arm_n
    groups = []
    innovation = np.zeros(4)
    if has_position:
        z_n, z_e = frame.to_ned(m.lat_deg, m.lon_deg)
        innovation[:2] = z_n - n, z_e - e
        groups.append(Group("position", slice(0, 2), (z_n, z_e), (n, e)))
    if has_velocity:
        innovation[2:] = m.vn_mps - vn, m.ve_mps - ve
        groups.append(Group("velocity", slice(2, 4), (m.vn_mps, m.ve_mps), (vn, ve)))
    return Reading(groups, innovation, h)
