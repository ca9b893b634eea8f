"""The station, when motors are taken and given back, rates, and where logs go."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from asvhil.config.base import Degrees, Latitude, Longitude, Positive, Section
from asvhil.types import Cause


class StationConfig(Section):
    lat_deg: Latitude
    lon_deg: Longitude
    heading_deg: Degrees


class ReadbackConfig(Section):
    """How outputs are held against commands: a report may answer what was sent up to `lag_s` before it came.

    `tolerate` names causes that are told and do not end a hold, nor refuse one.
    """

    tolerance_us: Annotated[float, Field(ge=2.0, le=50.0)] = 8.0
    lag_s: Annotated[float, Field(ge=0.1, le=2.0)] = 0.5
    tolerate: tuple[Cause, ...] = ()


class SupervisorConfig(Section):
    """When the motors are taken and when they are given back.

    `take_mode`: a hold command while another mode stands asks the autopilot for `control_mode`; else it is refused.
    """

    engage: Literal["command", "auto"] = "command"
    take_mode: bool = False
    take_mode_timeout_s: Positive = 3.0
    station: StationConfig | None = None
    control_mode: str = "MANUAL"
    stick_channels: tuple[Annotated[int, Field(ge=1, le=18)], ...] = (2, 4)
    stick_threshold_us: Annotated[int, Field(ge=10, le=500)] = 60
    heartbeat_timeout_s: Positive = 2.5
    override_echo_s: Positive = 1.0
    failsafe_neutral_s: Positive = 2.0
    readback: ReadbackConfig = ReadbackConfig()


class DaemonConfig(Section):
    """`control_hz` solves; `tick_hz` cuts inputs, resends the override and sees the pilot.

    `cut_on: arrival` cuts besides when the autopilot or a sensor is heard, at most at `arrival_hz_max`, and solves in
    the first such tick that is due: a controller that needs no time of its own then answers at once.
    """

    control_hz: Annotated[float, Field(ge=1.0, le=100.0)] = 5.0
    tick_hz: Annotated[float, Field(ge=10.0, le=100.0)] = 20.0
    cut_on: Literal["timer", "arrival"] = "timer"
    arrival_hz_max: Annotated[float, Field(ge=10.0, le=1000.0)] = 200.0

    @model_validator(mode="after")
    def _check_rates(self) -> DaemonConfig:
        ratio = self.tick_hz / self.control_hz
        if abs(ratio - round(ratio)) > 1e-9:
            raise ValueError("tick_hz must be a whole multiple of control_hz")
        return self

    @property
    def ticks_per_control(self) -> int:
        return round(self.tick_hz / self.control_hz)


class RecorderConfig(Section):
    directory: str = "runs"
    chunk_kib: Annotated[int, Field(ge=16, le=4096)] = 128
    sync_period_s: Positive = 0.5
