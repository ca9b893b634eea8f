"""What EKF2 makes of a boat: a receiver dropped at rest, and the accelerometer's bias found under way.

"At rest" is the landed vehicle whose gyros and accelerometers do not vibrate: a boat adrift with its motors off is.
If the receiver moves then (EKF2_GPS_CHECK, EKF2_REQ_HDRIFT), it is no longer used. Armed, this is not checked. By the
sources of 1.15 (gps_checks, gps_control), and as measured: docs/simulated-autopilots.md.
"""

from __future__ import annotations

import math

from asvhil.simplant.boat.sensors import Navigation
from asvhil.simplant.px4.parameters import Px4Parameters

FILTER_S = 10.0
DROPPED_NS = 5_000_000_000  # of failed checks in a row
TAKEN_NS = 5_000_000_000  # of passed ones
BIAS_S = 8.0  # measured: gone between 4 and 25 s after the boat moves
LIMIT = 10.0  # times EKF2_REQ_HDRIFT: a faster receiver counts as this fast
HORIZONTAL_DRIFT, HORIZONTAL_SPEED = 32, 128  # bits of EKF2_GPS_CHECK


class RestingEstimator:
    """Whether GNSS is in use; one `step` at each loop of the vehicle."""

    def __init__(self, parameters: Px4Parameters, t_ns: int) -> None:
        self._parameters = parameters
        self.restart(t_ns)

    def restart(self, t_ns: int) -> None:
        """Power on: in use from the start, since the vehicle itself waits for its first fix."""
        self.in_use = True
        self.drifts = False
        self._fix_ns = self._passed_ns = t_ns
        self._failed_ns = t_ns - TAKEN_NS
        self._vn_mps = self._ve_mps = 0.0

    def step(self, navigation: Navigation, *, armed: bool) -> None:
        """Evaluate the last fix, if it is new."""
        t_ns = navigation.fix_ns
        if t_ns <= self._fix_ns:
            return
        share = min(1.0, 1e-9 * (t_ns - self._fix_ns) / FILTER_S)
        self._fix_ns = t_ns
        limit_mps = self._parameters["EKF2_REQ_HDRIFT"]
        if armed:
            self._vn_mps = self._ve_mps = 0.0
        else:
            self._vn_mps += share * (_clipped(navigation.fix_vn_mps, LIMIT * limit_mps) - self._vn_mps)
            self._ve_mps += share * (_clipped(navigation.fix_ve_mps, LIMIT * limit_mps) - self._ve_mps)
        checked = int(self._parameters["EKF2_GPS_CHECK"]) & (HORIZONTAL_DRIFT | HORIZONTAL_SPEED)
        self.drifts = bool(checked) and math.hypot(self._vn_mps, self._ve_mps) > limit_mps
        if self.drifts:
            self._failed_ns = t_ns
        else:
            self._passed_ns = t_ns
        if t_ns - self._passed_ns > DROPPED_NS:
            self.in_use = False
        elif t_ns - self._failed_ns > TAKEN_NS:
            self.in_use = True


class AccelerometerBias:
    """The share of the accelerometer's bias that EKF2 has found and takes out of HIGHRES_IMU, from the first arming on.

    At rest it cannot tell a bias from a tilt. Measured: docs/results/real-px4.md.
    """

    def __init__(self) -> None:
        self._since_ns: int | None = None

    def found(self, t_ns: int, *, armed: bool) -> float:
        """The share, in [0, 1): it approaches 1 by a first-order lag."""
        if self._since_ns is None and armed:
            self._since_ns = t_ns
        return 0.0 if self._since_ns is None else -math.expm1(-1e-9 * (t_ns - self._since_ns) / BIAS_S)


def _clipped(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
