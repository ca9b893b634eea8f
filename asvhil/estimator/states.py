"""The state vector of the filter, its process noise and its priors.

Position n, e (m), heading psi (rad), velocity over ground u, v (m/s, body axes), yaw rate r (rad/s); the disturbance,
the acceleration that the model does not explain, d_n, d_e (m/s^2, NED) and d_r (rad/s^2); biases of accelerometer
(m/s^2, body axes), gyro (rad/s) and GNSS position (m, NED); and the residual compass deviation after calibration,
coefficients A to E (rad).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from asvhil.config import EkfConfig
from asvhil.dynamics.arrays import Array
from asvhil.estimator.accelerometer_doubt import Doubt
from asvhil.estimator.agreement import Agreement
from asvhil.estimator.sensor_health import NEVER, Track

N, E, PSI, U, V, R, D_N, D_E, D_R, A_X, A_Y, G_R, B_N, B_E = range(14)
DEVIATION = slice(14, 19)  # of the compass: constant, sin, cos, sin 2, cos 2
SIZE = 19
MOVING = D_N  # states before it have a motion of their own


def noise_rate(config: EkfConfig) -> Array:
    """Variance per second of each state's random walk; the velocity's is the model's error."""
    compass_walk_rad = math.radians(config.compass.walk_deg)
    bias_walk_m = config.position_bias_std_m * math.sqrt(2.0 / config.position_bias_time_s)
    walks = (
        [config.position_walk_m] * 2
        + [config.heading_walk_rad]
        + [config.velocity_walk_mps] * 2
        + [config.yaw_rate_walk_radps]
        + [config.disturbance_walk_mps2] * 2
        + [config.disturbance_yaw_walk_radps2]
        + [config.accel_bias_walk_mps2 if config.accel_bias_std_mps2 else 0.0] * 2
        + [config.gyro_bias_walk_radps if config.gyro_bias_std_radps else 0.0]
        + [bias_walk_m] * 2
        + [compass_walk_rad if config.compass.std_deg else 0.0] * 5
    )
    return np.array(walks) ** 2


def prior(config: EkfConfig) -> Array:
    """Variances at the start, for a first fix of unknown quality.

    The slow error of the GNSS position is relative to that at the start, so it is zero then: its constant part is not
    observable, and with a prior for it the estimate would follow half of the receiver's wander.
    """
    compass_variance = math.radians(config.compass.std_deg) ** 2
    pose_and_velocity = [1.0] * 2 + [0.05] + [0.25] * 2 + [0.01]
    disturbance = [1e-3, 1e-3, 1e-4]
    inertial = [config.accel_bias_std_mps2**2] * 2 + [config.gyro_bias_std_radps**2]
    return np.array(pose_and_velocity + disturbance + inertial + [0.0] * 2 + [compass_variance] * 5)


class Forcing(NamedTuple):
    """What drives the prediction: the model's input (2), and the true wind (m/s, NED), None if not known."""

    model_input: tuple[float, float]
    wind_ned: tuple[float, float] | None


class Factors(NamedTuple):
    """What corrects the model from now on: its last motor states (`dynamics.corrected`)."""

    values: tuple[float, ...]


class FilterState:
    """The complete state of the filter at a time. Its arrays and tracks are replaced, never changed in place."""

    __slots__ = (
        "agreement",
        "carries_wind",
        "cleared_ns",
        "displacement",
        "displacement_ns",
        "doubt",
        "follows_bias",
        "forcing",
        "inertial_ns",
        "interval_s",
        "invalid_since_ns",
        "model_off",
        "motor",
        "p",
        "resets",
        "residual",
        "started_ns",
        "t_ns",
        "tracks",
        "turn_agreement",
        "turn_cleared_ns",
        "turned_ns",
        "turned_rad",
        "x",
    )

    def __init__(self, t_ns: int, x: Array, p: Array, motor: Array) -> None:
        self.t_ns, self.x, self.p, self.motor = t_ns, x, p, motor
        self.forcing = Forcing((0.0, 0.0), None)
        self.residual: Array = np.zeros(2)
        self.inertial_ns = NEVER
        self.interval_s = 0.0
        self.tracks: dict[str, Track] = {}
        self.displacement = (0.0, 0.0)  # integral of the receiver's velocity (m, NED)
        self.displacement_ns = NEVER
        self.agreement = Agreement()  # of the receiver's position and velocity
        self.turned_rad = 0.0  # integral of the gyro's yaw rate
        self.turned_ns = NEVER
        self.turn_agreement = Agreement()  # of compass and gyro
        # When position and velocity, or compass and gyro, were believed last since they agree, against the filter.
        self.cleared_ns = self.turn_cleared_ns = NEVER
        self.model_off = (0.0, 0.0)  # mean of the velocity's innovation (m/s, NED), which a right model leaves at zero
        self.doubt = Doubt()  # of the accelerometer
        self.invalid_since_ns = NEVER
        self.resets = 0
        self.started_ns = t_ns
        self.follows_bias = True  # the velocity is independent of the position, so the position's slow error shows
        self.carries_wind = False  # the disturbance includes the load of a wind that is not known

    def copy(self) -> FilterState:
        """A shallow copy."""
        other = FilterState.__new__(FilterState)  # line by line: it is made for every event
        other.t_ns, other.x, other.p, other.motor = self.t_ns, self.x, self.p, self.motor
        other.forcing, other.residual = self.forcing, self.residual
        other.inertial_ns, other.interval_s = self.inertial_ns, self.interval_s
        other.tracks = self.tracks.copy()
        other.displacement, other.displacement_ns = self.displacement, self.displacement_ns
        other.model_off, other.doubt = self.model_off, self.doubt
        other.agreement, other.turn_agreement = self.agreement, self.turn_agreement
        other.turned_rad, other.turned_ns = self.turned_rad, self.turned_ns
        other.cleared_ns, other.turn_cleared_ns = self.cleared_ns, self.turn_cleared_ns
        other.invalid_since_ns, other.resets = self.invalid_since_ns, self.resets
        other.started_ns, other.carries_wind = self.started_ns, self.carries_wind
        other.follows_bias = self.follows_bias
        return other
