"""One boat: its hull, motors and motor outputs."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

from pydantic import Field, model_validator

from asvhil.config.base import NonNegative, Positive, Section, ServoUs


class VesselConfig(Section):
    """A 3-DOF vessel with two fixed motors: Fossen (2011) parameters, each positive as a magnitude."""

    mass_kg: Positive
    added_mass_surge_kg: NonNegative
    added_mass_sway_kg: NonNegative
    inertia_yaw_kgm2: Positive
    added_inertia_yaw_kgm2: NonNegative
    surge_drag_n_per_mps: NonNegative
    surge_drag_n_per_mps2: NonNegative
    sway_drag_n_per_mps: NonNegative
    sway_drag_n_per_mps2: NonNegative
    yaw_drag_nm_per_radps: NonNegative
    yaw_drag_nm_per_radps2: NonNegative
    motor_arm_m: Positive
    motor_lag_s: Positive
    thrust_curve: tuple[tuple[float, float], ...]  # rows of (command in [-1, 1], thrust in N of one motor)
    wind_surge_n_per_mps2: NonNegative
    wind_sway_n_per_mps2: NonNegative
    wind_yaw_nm_per_mps2: NonNegative

    @model_validator(mode="after")
    def _check_curve(self) -> VesselConfig:
        commands = [row[0] for row in self.thrust_curve]
        thrusts = [row[1] for row in self.thrust_curve]
        if len(commands) < 2 or any(b <= a for a, b in pairwise(commands)):
            raise ValueError("thrust_curve needs at least 2 rows with rising commands")
        if any(b < a for a, b in pairwise(thrusts)):
            raise ValueError("thrust_curve: thrust must not fall while the command rises")
        if commands[0] < -1.0 or commands[-1] > 1.0 or thrusts[0] >= 0.0 or thrusts[-1] <= 0.0:
            raise ValueError("thrust_curve must lie in commands -1..1 and reach both astern and ahead thrust")
        return self


class PwmConfig(Section):
    """How a motor command becomes a pulse width, and the limits enforced last before the wire."""

    port_channel: Annotated[int, Field(ge=1, le=8)] = 1
    starboard_channel: Annotated[int, Field(ge=1, le=8)] = 3
    astern_us: ServoUs = 1100
    neutral_us: ServoUs = 1500
    ahead_us: ServoUs = 1900
    slew_us_per_s: Positive = 8000.0

    @model_validator(mode="after")
    def _check_order(self) -> PwmConfig:
        if not self.astern_us < self.neutral_us < self.ahead_us:
            raise ValueError("astern_us < neutral_us < ahead_us must hold")
        if self.port_channel == self.starboard_channel:
            raise ValueError("port_channel and starboard_channel must differ")
        return self


class VehicleConfig(Section):
    """One boat: its name, its hull and motors, and its motor outputs."""

    name: str
    vessel: VesselConfig
    pwm: PwmConfig = PwmConfig()
