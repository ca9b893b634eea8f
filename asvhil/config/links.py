"""What the daemon connects to."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from asvhil.config.base import Degrees, LinkSpecText, MavlinkId, Positive, Section
from asvhil.config.mavlink import GroundStationLinkConfig, LinkName, MavlinkLinkConfig, RoutingConfig


class AutopilotLinkConfig(MavlinkLinkConfig):
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


class NmeaLinkConfig(Section):
    """NMEA 0183 sentences: wind, GNSS, heading, each from any line.

    `declination_deg` (east positive) turns magnetic directions into true ones; where absent, the variation that RMC
    or HDG on the same line tell is used, and magnetic directions before one was heard are not.
    """

    endpoint: LinkSpecText
    declination_deg: Degrees | None = None


class AnemometerLinkConfig(NmeaLinkConfig):
    """A wind sensor. `firmware` names the firmware that it must run: then its version is asked for and checked."""

    firmware: Literal["arduino_anemometer"] | None = None


class InsLinkConfig(Section):
    """A VectorNav INS (VN-300): binary output messages and ASCII sentences."""

    endpoint: LinkSpecText


class OperatorLinkConfig(MavlinkLinkConfig):
    """Where `asvhil hold` and ground stations send their commands, as MAVLink."""

    endpoint: LinkSpecText = "udpin:127.0.0.1:14660"


class LinksConfig(Section):
    """What the daemon connects to."""

    autopilot: AutopilotLinkConfig
    anemometer: AnemometerLinkConfig | None = None
    ins: InsLinkConfig | None = None
    gnss: NmeaLinkConfig | None = None
    operator: OperatorLinkConfig = OperatorLinkConfig()
    ground_stations: dict[LinkName, GroundStationLinkConfig] = Field(default_factory=dict)
    routing: RoutingConfig = RoutingConfig()
    reconnect_first_s: Positive = 0.2
    reconnect_max_s: Positive = 5.0
