"""Measurement model: expected readings of a state, innovations, and which readings make one correction."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from asvhil.dynamics.arrays import Array
from asvhil.dynamics.buffers import fastest
from asvhil.estimator.covariance import Correction, compared, wrapped
from asvhil.estimator.states import B_E, B_N, DEVIATION, G_R, PSI, SIZE, E, N, R, U, V
from asvhil.geo import LocalFrame
from asvhil.types import GroundVelocity, Heading, Measurement, Position, SpecificForce, YawRate

Corrected = Position | GroundVelocity | Heading | YawRate
Event = tuple[Corrected | SpecificForce, ...]  # one event of the filter: a pair, or one alone

SENSORS: dict[type, str] = {
    Position: "position",
    GroundVelocity: "velocity",
    Heading: "heading",
    YawRate: "yaw_rate",
}
ROWS: dict[type, int] = {Position: 2, GroundVelocity: 2, Heading: 1, YawRate: 1}
EVENTS = (Position, GroundVelocity, Heading, YawRate, SpecificForce)
PAIRS: tuple[tuple[type, ...], ...] = ((Position, GroundVelocity), (Heading, YawRate))


class Group(NamedTuple):
    """The rows of one sensor, which are accepted or rejected together."""

    sensor: str
    rows: slice
    value: tuple[float, float]
    expected: tuple[float, float]


def corrections(measurements: Sequence[Measurement]) -> list[Event]:
    """The filter's events of the measurements of one frame; other records are left out.

    Position and velocity of one time are one event, and so are heading and yaw rate: both are gated against the same
    prediction, and corrected together.
    """
    events: list[Event] = []
    for m in measurements:
        if not isinstance(m, EVENTS):
            continue
        before = events[-1][0] if events and len(events[-1]) == 1 else None
        if before is not None and (type(before), type(m)) in PAIRS and before.t_ns == m.t_ns:
            events[-1] = (before, m)
        else:
            events.append((m,))
    return events


class Comparison:
    """The readings of one correction, of these kinds, compared with the state in the buffers of its `correction`."""

    def __init__(self, kinds: tuple[type, ...], variances: Sequence[float], x: Array, p: Array, most: Array) -> None:
        count = len(variances)
        self.correction = Correction(count, x, p, most)
        self.correction.noise[:] = variances
        self._readings, self._arms, self._expected = np.zeros(count), np.zeros(count), np.zeros(count)
        self._sensors = [(SENSORS[kind], rows) for kind, rows in zip(kinds, _rows(kinds), strict=True)]
        readings = [x, self._readings, self._arms]
        self._compare = self.correction.compares(_function(kinds), readings, self._expected)

    def compare(self, measurements: Sequence[Corrected], frame: LocalFrame) -> list[Group]:
        """The sensors; all else that `Correction.evaluate` needs is in its buffers then."""
        readings, arms = self._readings, self._arms
        for (_, rows), m in zip(self._sensors, measurements, strict=True):
            match m:
                case Heading():
                    readings[rows] = m.psi_rad
                case YawRate():
                    readings[rows] = m.r_radps
                case Position():
                    readings[rows], arms[rows] = frame.to_ned(m.lat_deg, m.lon_deg), m.arm_m
                case GroundVelocity():
                    readings[rows], arms[rows] = (m.vn_mps, m.ve_mps), m.arm_m
        self._compare()
        values, expected = readings.tolist(), self._expected.tolist()
        return [Group(name, rows, _pair(values, rows), _pair(expected, rows)) for name, rows in self._sensors]


def _pair(numbers: list[float], rows: slice) -> tuple[float, float]:
    """Those of a sensor's rows; a second of zero where it has one."""
    first: int = rows.start
    return numbers[first], numbers[first + 1] if rows.stop - first == 2 else 0.0


def _rows(kinds: tuple[type, ...]) -> list[slice]:
    """The rows of each kind."""
    found, first = [], 0
    for kind in kinds:
        found.append(slice(first, first + ROWS[kind]))
        first += ROWS[kind]
    return found


@functools.lru_cache(maxsize=8)
def _function(kinds: tuple[type, ...]) -> ca.Function:
    """(state, readings, arms, P, variances) -> `covariance.compared` of them."""
    rows = _rows(kinds)
    count = rows[-1].stop
    s, y, arms = ca.SX.sym("x", SIZE), ca.SX.sym("y", count), ca.SX.sym("l", count)
    p, variances = ca.SX.sym("p", SIZE, SIZE), ca.SX.sym("r", count)
    parts = [EXPECTATIONS[kind](s, y[part], arms[part]) for kind, part in zip(kinds, rows, strict=True)]
    innovation, expected, h = (ca.vertcat(*part) for part in zip(*parts, strict=True))
    name = "ekf_" + "_".join(SENSORS[kind] for kind in kinds)
    results = compared(innovation, expected, h, p, variances)
    return fastest(ca.Function(name, [s, y, arms, p, variances], results, {"cse": True}))


# Each gives innovation, expected readings, and its rows of the measurement matrix.


def _position(s: Any, y: Any, arm: Any) -> tuple[Any, Any, Any]:
    """Position of the antenna, with the slow error of the receiver."""
    cos, sin = ca.cos(s[PSI]), ca.sin(s[PSI])
    arm_n, arm_e = cos * arm[0] - sin * arm[1], sin * arm[0] + cos * arm[1]
    expected = ca.vertcat(s[N] + arm_n + s[B_N], s[E] + arm_e + s[B_E])
    h = ca.SX(2, SIZE)
    h[0, N] = h[1, E] = h[0, B_N] = h[1, B_E] = 1.0
    h[0, PSI], h[1, PSI] = -arm_e, arm_n
    return y - expected, expected, h


def _velocity(s: Any, y: Any, arm: Any) -> tuple[Any, Any, Any]:
    """Velocity over ground of the antenna, whose arm turns with the boat."""
    cos, sin = ca.cos(s[PSI]), ca.sin(s[PSI])
    arm_n, arm_e = cos * arm[0] - sin * arm[1], sin * arm[0] + cos * arm[1]
    u, v = s[U] - s[R] * arm[1], s[V] + s[R] * arm[0]
    vn, ve = cos * u - sin * v, sin * u + cos * v
    h = ca.SX(2, SIZE)
    h[0, PSI], h[0, U], h[0, V], h[0, R] = -ve, cos, -sin, -arm_e
    h[1, PSI], h[1, U], h[1, V], h[1, R] = vn, sin, cos, arm_n
    expected = ca.vertcat(vn, ve)
    return y - expected, expected, h


def _heading(s: Any, y: Any, _: Any) -> tuple[Any, Any, Any]:
    """Heading with the residual deviation of the compass (`compass.deviation_row`)."""
    psi = s[PSI]
    c1, s1 = ca.cos(psi), ca.sin(psi)
    s2, c2 = 2.0 * s1 * c1, c1 * c1 - s1 * s1
    a, b, c, d, e = ca.vertsplit(s[DEVIATION])
    off = wrapped(y - (psi + (a + b * s1 + c * c1 + d * s2 + e * c2)))
    h = ca.SX(1, SIZE)
    h[0, PSI] = 1.0 + b * c1 - c * s1 + 2.0 * (d * c2 - e * s2)
    h[0, DEVIATION] = ca.horzcat(1.0, s1, c1, s2, c2)
    return off, y - off, h


def _yaw_rate(s: Any, y: Any, _: Any) -> tuple[Any, Any, Any]:
    """Yaw rate with the bias of the gyro."""
    expected = s[R] + s[G_R]
    h = ca.SX(1, SIZE)
    h[0, R] = h[0, G_R] = 1.0
    return y - expected, expected, h


EXPECTATIONS = {Position: _position, GroundVelocity: _velocity, Heading: _heading, YawRate: _yaw_rate}
