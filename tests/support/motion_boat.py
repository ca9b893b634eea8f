"""A simulated hull with noisy sensors under the motion monitor, in virtual time, driven by commands of a test."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from asvhil.config import load_config
from asvhil.controller.pwm import pulse_of_command
from asvhil.motion.monitor import MotionMonitor
from asvhil.simplant.boat.faults import motor_signals_us
from asvhil.simplant.boat.vessel import Vessel
from asvhil.supervisor.reasons import Explanation
from asvhil.types import GroundVelocity, Heading, YawRate

TICK_NS = 50_000_000
Commands = Callable[[float], tuple[float, float]]


def busy(t_s: float) -> tuple[float, float]:
    """Both motors at work, as while a boat is brought to a station: ahead, astern, and turns to both sides."""
    return (
        0.6 * math.sin(1.1 * t_s) + 0.4 * math.sin(0.4 * t_s + 1.0),
        0.6 * math.sin(1.3 * t_s + 0.5) + 0.4 * math.sin(0.5 * t_s),
    )


class MotionBoat:
    """`run` gives the first finding, and `found_s` the time of it; faults as in `plant.faults`."""

    def __init__(
        self,
        base: str = "sitl",
        *,
        faults: tuple[str, ...] = (),
        compass_deg: float = 0.0,
        current: tuple[float, float] = (0.0, 0.0),
        seed: int = 1,
    ) -> None:
        self.config = config = load_config(base)
        self.vessel = Vessel(config.vehicle.vessel, config.vehicle.pwm, 0.01, (0.0, 0.0, 0.5), current)
        self.monitor = MotionMonitor(config.supervisor.motion, config.estimator.ekf, config.vehicle.vessel)
        self.faults, self.compass_rad = frozenset(faults), math.radians(compass_deg)
        self.ailing: frozenset[type] = frozenset()
        self.frozen = False
        self.blind = False  # without a compass
        self.shake_radps = 0.0  # of the yaw rate, to one side and the other from reading to reading
        self.found_s = 0.0
        self._noise = np.random.default_rng(seed)
        self._t_ns = 0
        self._velocity = (0.0, 0.0)

    def run(self, seconds: float, commands: Commands = busy, *, holding: bool = True) -> Explanation | None:
        """Drive for a while, or until something is found."""
        pwm = self.config.vehicle.pwm
        for tick in range(round(seconds * 20)):
            self._t_ns += TICK_NS
            command = commands(self._t_ns * 1e-9)
            port_us, starboard_us = (pulse_of_command(pwm, part) for part in command)
            self.vessel.drive(motor_signals_us((port_us, starboard_us), self.faults, pwm.neutral_us))
            for _ in range(5):
                self.vessel.step(0.0, 0.0)
            self._measure(tick)
            found = self.monitor.step(self._t_ns, command, (0.0, 0.0), self.ailing, holding=holding)
            if found is not None:
                self.found_s = (tick + 1) / 20.0
                return found
        return None

    def _measure(self, tick: int) -> None:
        """Heading and yaw rate in every second tick, velocity in every fourth."""
        ekf, noise = self.config.estimator.ekf, self._noise
        if tick % 4 == 0:
            vn, ve = self.vessel.ground_velocity_ned()
            if not self.frozen:
                self._velocity = (
                    vn + ekf.velocity_std_mps * noise.standard_normal(),
                    ve + ekf.velocity_std_mps * noise.standard_normal(),
                )
            vn, ve = self._velocity
            self.monitor.on_measurement(GroundVelocity(t_ns=self._t_ns, vn_mps=vn, ve_mps=ve))
        if tick % 2 == 0:
            psi = self.vessel.psi_rad + self.compass_rad + math.radians(ekf.heading_std_deg) * noise.standard_normal()
            rate = self.vessel.r_radps + ekf.yaw_rate_std_radps * noise.standard_normal()
            rate += self.shake_radps if tick % 8 < 4 else -self.shake_radps
            if not self.blind:
                self.monitor.on_measurement(Heading(t_ns=self._t_ns, psi_rad=psi))
            self.monitor.on_measurement(YawRate(t_ns=self._t_ns, r_radps=rate))
