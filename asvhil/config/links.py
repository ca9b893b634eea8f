"""What the daemon connects to."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from asvhil.config.base import LinkSpecText, MavlinkId, Positive, Section


class AutopilotLinkConfig(Section):
    """The MAVLink link to the frontseat: who we are on it, and what we ask of it."""

    endpoint: LinkSpecText
    profile: Literal["ardurover"] = "ardurover"
    system_id: MavlinkId = 1
    component_id: MavlinkId = 191
    override_system_id: MavlinkId = 1  # ArduPilot obeys overrides only from SYSID_MYGCS
    autopilot_system_id: MavlinkId = 1
    position_source: Literal["GLOBAL_POSITION_INT", "GPS_RAW_INT"] = "GLOBAL_POSITION_INT"
    streams_hz: dict[str, Positive] = Field(
        default_factory=lambda: {
            "HEARTBEAT": 5.0,
            "ATTITUDE": 20.0,
            "GLOBAL_POSITION_INT": 10.0,
            "SERVO_OUTPUT_RAW": 10.0,
            "RC_CHANNELS": 10.0,
            "EKF_STATUS_REPORT": 2.0,
            "GPS_RAW_INT": 1.0,
            "SYSTEM_TIME": 1.0,
        }
    )


class AnemometerLinkConfig(Section):
    """NMEA 0183 wind sentences."""

    endpoint: LinkSpecText


class OperatorLinkConfig(Section):
    """Where `asvhil hold` and ground stations send their commands, as MAVLink."""

    endpoint: LinkSpecText = "udpin:127.0.0.1:14660"


class LinksConfig(Section):
    """What the daemon connects to."""

    autopilot: AutopilotLinkConfig
    anemometer: AnemometerLinkConfig | None = None
    operator: OperatorLinkConfig = OperatorLinkConfig()
    reconnect_first_s: Positive = 0.2
    reconnect_max_s: Positive = 5.0
