"""The ArduRover profile: what is its own in the conversation with an ArduPilot boat. Sans-IO."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from asvhil.autopilot.ardurover_parameters import names_for, requirements
from asvhil.autopilot.mavlink_autopilot import MavlinkAutopilot
from asvhil.autopilot.requirements import Requirement
from asvhil.config import AutopilotLinkConfig, Config, PwmConfig
from asvhil.io.mavlink.frames import dialect
from asvhil.types import Cause, Measurement

EKF_HORIZONTAL_POSITION = dialect.EKF_POS_HORIZ_ABS
EKF_CONSTANT_POSITION = dialect.EKF_CONST_POS_MODE


class ArduRoverAutopilot(MavlinkAutopilot):
    """Ready once its EKF uses a position; mode numbers stand in custom_mode as they are."""

    legacy_streams = True

    def __init__(self, config: AutopilotLinkConfig, pwm: PwmConfig) -> None:
        super().__init__(config, pwm)
        self._handlers[dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT] = self._on_ekf_status

    def _requirements(self) -> tuple[Requirement, ...]:
        return requirements(self._config, self._pwm)

    def hint(self, cause: Cause, motor: str, *, blind: bool) -> str:
        """The parameters to look at for a cause seen on the outputs."""
        channels = {"port": (self._pwm.port_channel,), "starboard": (self._pwm.starboard_channel,)}
        both = (self._pwm.port_channel, self._pwm.starboard_channel)
        return names_for(cause, channels.get(motor, both), blind=blind)

    def _on_ekf_status(self, t_ns: int, m: Any) -> Sequence[Measurement]:
        self._ready = bool(m.flags & EKF_HORIZONTAL_POSITION) and not m.flags & EKF_CONSTANT_POSITION
        return self._status(t_ns)


def build(config: Config) -> ArduRoverAutopilot:
    """The conversation of a config."""
    return ArduRoverAutopilot(config.links.autopilot, config.vehicle.pwm)
