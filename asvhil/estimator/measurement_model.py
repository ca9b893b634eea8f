"""Measurement model: expected readings of a state, innovations, and which readings make one correction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from asvhil.dynamics.arrays import Array
from asvhil.estimator.states import B_E, B_N, DEVIATION, G_R, PSI, SIZE, E, N, R, U, V
from asvhil.geo import LocalFrame, body_to_ned, wrap_rad
from asvhil.io.sensors.compass import deviation_row
from asvhil.types import GroundVelocity, Heading, Measurement, Position, SpecificForce, YawRate

Corrected = Position | GroundVelocity | Heading | YawRate
Correction = tuple[Corrected | SpecificForce, ...]  # one event of the filter: a pair, or one alone

ROWS: dict[type, int] = {Position: 2, GroundVelocity: 2, Heading: 1, YawRate: 1}
EVENTS = (Position, GroundVelocity, Heading, YawRate, SpecificForce)
PAIRS: tuple[tuple[type, ...], ...] = ((Position, GroundVelocity), (Heading, YawRate))


class Group(NamedTuple):
    """The rows of one sensor, which are accepted or rejected together."""

    sensor: str
    rows: slice
    value: tuple[float, float]
    expected: tuple[float, float]


class Reading(NamedTuple):
    """The sensors of one correction; innovation (m) and measurement matrix (m, SIZE) of all its rows."""

    groups: list[Group]
    innovation: Array
    h: Array


def corrections(measurements: Sequence[Measurement]) -> list[Correction]:
    """The filter's events of the measurements of one frame; other records are left out.

    Position and velocity of one time are one event, and so are heading and yaw rate: both are gated against the same
    prediction, and corrected together.
    """
    events: list[Correction] = []
    for m in measurements:
        if not isinstance(m, EVENTS):
            continue
        before = events[-1][0] if events and len(events[-1]) == 1 else None
        if before is not None and (type(before), type(m)) in PAIRS and before.t_ns == m.t_ns:
            events[-1] = (before, m)
        else:
            events.append((m,))
    return events


def reading_of(x: Array, measurements: Sequence[Corrected], frame: LocalFrame) -> Reading:
    """The readings of one correction, compared with a state."""
    count = sum(ROWS[type(m)] for m in measurements)
    innovation, h = np.zeros(count), np.zeros((count, SIZE))
    groups = []
    state: list[float] = x.tolist()
    first = 0
    for m in measurements:
        rows = slice(first, first + ROWS[type(m)])
        match m:
            case Position():
                group = _position(state, m, frame, rows, innovation[rows], h[rows])
            case GroundVelocity():
                group = _velocity(state, m, rows, innovation[rows], h[rows])
            case Heading():
                group = _heading(x, m, rows, innovation[rows], h[rows])
            case YawRate():
                group = _yaw_rate(state, m, rows, innovation[rows], h[rows])
        groups.append(group)
        first = rows.stop
    return Reading(groups, innovation, h)


# Each writes its rows of innovation and measurement matrix.


def _position(s: list[float], m: Position, frame: LocalFrame, rows: slice, innovation: Array, h: Array) -> Group:
    """Position of the antenna, with the slow error of the receiver."""
    arm_n, arm_e = body_to_ned(s[PSI], *m.arm_m)
    n, e = s[N] + arm_n + s[B_N], s[E] + arm_e + s[B_E]
    h[0, N] = h[1, E] = h[0, B_N] = h[1, B_E] = 1.0
    h[0, PSI], h[1, PSI] = -arm_e, arm_n
    z_n, z_e = frame.to_ned(m.lat_deg, m.lon_deg)
    innovation[:] = z_n - n, z_e - e
    return Group("position", rows, (z_n, z_e), (n, e))


def _velocity(s: list[float], m: GroundVelocity, rows: slice, innovation: Array, h: Array) -> Group:
    """Velocity over ground of the antenna, whose arm turns with the boat."""
    cos, sin = math.cos(s[PSI]), math.sin(s[PSI])
    arm_x, arm_y = m.arm_m
    arm_n, arm_e = body_to_ned(s[PSI], *m.arm_m)
    u, v = s[U] - s[R] * arm_y, s[V] + s[R] * arm_x
    vn, ve = cos * u - sin * v, sin * u + cos * v
    h[0, PSI], h[0, U], h[0, V], h[0, R] = -ve, cos, -sin, -arm_e
    h[1, PSI], h[1, U], h[1, V], h[1, R] = vn, sin, cos, arm_n
    innovation[:] = m.vn_mps - vn, m.ve_mps - ve
    return Group("velocity", rows, (m.vn_mps, m.ve_mps), (vn, ve))


def _heading(x: Array, m: Heading, rows: slice, innovation: Array, h: Array) -> Group:
    """Heading with the residual deviation of the compass."""
    psi = float(x[PSI])
    _, s1, c1, s2, c2 = row = deviation_row(psi)
    a, b, c, d, e = x[DEVIATION].tolist()
    off = wrap_rad(m.psi_rad - (psi + (a + b * s1 + c * c1 + d * s2 + e * c2)))
    h[0, PSI] = 1.0 + b * c1 - c * s1 + 2.0 * (d * c2 - e * s2)
    h[0, DEVIATION] = row
    innovation[0] = off
    return Group("heading", rows, (m.psi_rad, 0.0), (m.psi_rad - off, 0.0))


def _yaw_rate(s: list[float], m: YawRate, rows: slice, innovation: Array, h: Array) -> Group:
    """Yaw rate with the bias of the gyro."""
    rate = s[R] + s[G_R]
    h[0, R] = h[0, G_R] = 1.0
    innovation[0] = m.r_radps - rate
    return Group("yaw_rate", rows, (m.r_radps, 0.0), (rate, 0.0))
