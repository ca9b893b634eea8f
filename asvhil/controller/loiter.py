"""The autopilot's own LOITER mode, which a boat without a backseat would use, for comparison.

Written from the mode's documented and measured behaviour (ArduRover 4.6, boat): within the radius it drifts; outside
it turns bow or stern to the station, whichever is nearer, and drives at a speed in proportion to the distance from the
circle. It sits on the circle with any heading. Like the autopilot it knows neither model nor wind.
"""

from __future__ import annotations

import math

from asvhil.config import Config, ControllerConfig, LoiterConfig
from asvhil.controller.classical import FAILED, LONGEST_STEP_S
from asvhil.dynamics.protocol import Dynamics
from asvhil.geo import wrap_rad
from asvhil.types import Control, Estimate, Station, Wind


class Loiter:
    """The autopilot's speed and heading loops with its LOITER rule. The skid-steering mixer gives steering priority."""

    def __init__(self, config: LoiterConfig) -> None:
        self._config = config
        self.reset()

    def retune(self, config: ControllerConfig) -> None:
        """Another radius or speed from the next step on."""
        self._config = config.loiter

    def reset(self) -> None:
        """Empty the speed integral, as after a time without control."""
        self._integral = 0.0
        self._t_ns: int | None = None

    def new_station(self) -> None:
        """Nothing to do: the speed integral does not depend on the station."""

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control:
        """One control tick; the wind and the station's heading are not used. Not ok where an input is not finite."""
        north_m, east_m = station.n_m - estimate.n_m, station.e_m - estimate.e_m
        seen = (north_m, east_m, estimate.psi_rad, estimate.u_mps, estimate.r_radps)
        if not all(map(math.isfinite, seen)):
            return FAILED
        elapsed_s = 0.0 if self._t_ns is None else (estimate.t_ns - self._t_ns) * 1e-9
        self._t_ns = estimate.t_ns
        outside_m = math.hypot(north_m, east_m) - self._config.radius_m
        if outside_m <= 0.0:
            self._integral = 0.0
            return Control(command=(0.0, 0.0), ok=True, iterations=0, cost=0.0)

        off_rad = wrap_rad(math.atan2(east_m, north_m) - estimate.psi_rad)
        speed_mps = min(self._config.speed_gain_per_s * outside_m, self._config.speed_max_mps)
        if abs(off_rad) > 0.5 * math.pi:
            off_rad, speed_mps = wrap_rad(off_rad + math.pi), -speed_mps
        speed_mps *= 1.0 - abs(off_rad) / math.pi  # half the speed at right angles
        throttle = self._throttle(speed_mps, estimate.u_mps, elapsed_s)
        return Control(command=self._mix(throttle, self._steer(off_rad, estimate)), ok=True, iterations=0, cost=0.0)

    def _throttle(self, speed_mps: float, u_mps: float, elapsed_s: float) -> float:
        """Feed-forward, P and I on the speed; the integral waits while the throttle is at its bound."""
        config = self._config
        error_mps = speed_mps - u_mps
        throttle = config.throttle_ff_per_mps * speed_mps + config.throttle_p_per_mps * error_mps + self._integral
        if 0.0 < elapsed_s <= LONGEST_STEP_S and (abs(throttle) < 1.0 or throttle * error_mps < 0.0):
            integral = self._integral + config.throttle_i_per_m * error_mps * elapsed_s
            self._integral = min(max(integral, -1.0), 1.0)
        return min(max(throttle, -1.0), 1.0)

    def _steer(self, off_rad: float, estimate: Estimate) -> float:
        """P on the heading to a bounded turn rate; feed-forward and P on that."""
        config = self._config
        limit_radps = math.radians(config.rate_max_degps)
        rate_radps = min(max(config.angle_p_per_s * off_rad, -limit_radps), limit_radps)
        steering = config.rate_ff_s * rate_radps + config.rate_p_s * (rate_radps - estimate.r_radps)
        return min(max(steering, -1.0), 1.0)

    def _mix(self, throttle: float, steering: float) -> tuple[float, float]:
        """(port, starboard): throttle gives way to steering, then each motor skips its dead band."""
        room = 1.0 - abs(steering)
        throttle = min(max(throttle, -room), room)
        return self._start(throttle + steering), self._start(throttle - steering)

    def _start(self, level: float) -> float:
        """A motor's command: any level but zero starts at `throttle_min`."""
        least = self._config.throttle_min
        return 0.0 if level == 0.0 else math.copysign(least + (1.0 - least) * abs(level), level)


def build(settings: LoiterConfig, config: Config, model: Dynamics) -> Loiter:
    """The controller of a config; it uses no model."""
    return Loiter(settings)
