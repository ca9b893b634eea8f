"""What the daemon connects to."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator

from asvhil.config.autopilots import OUTPUTS, STREAMS_HZ, WHY_NOT, MotorOutput, Profile
from asvhil.config.base import Degrees, LinkSpecText, MavlinkId, Positive, Section
from asvhil.config.mavlink import GroundStationLinkConfig, LinkName, MavlinkLinkConfig, RoutingConfig

# Sorted, for they are asked for in this order, and a config that is read back from a log comes sorted.
Streams = Annotated[dict[str, Positive], AfterValidator(lambda rates: dict(sorted(rates.items())))]


class AutopilotLinkConfig(MavlinkLinkConfig):
    """The MAVLink link to the frontseat: who we are on it, and what we ask of it."""

    endpoint: LinkSpecText
    profile: Profile = "ardurover"
    output: MotorOutput = "rc_override"  # where absent: the first that the profile has
    port_actuator: Annotated[int, Field(ge=1, le=6)] = 1  # of MAV_CMD_DO_SET_ACTUATOR
    starboard_actuator: Annotated[int, Field(ge=1, le=6)] = 2
    system_id: MavlinkId = 1
    component_id: MavlinkId = 191
    override_system_id: MavlinkId = 1  # ArduPilot obeys overrides only from SYSID_MYGCS
    autopilot_system_id: MavlinkId = 1
    position_source: Literal["GLOBAL_POSITION_INT", "GPS_RAW_INT"] = "GLOBAL_POSITION_INT"
    streams_hz: Streams = Field(default_factory=lambda: dict(sorted(STREAMS_HZ["ardurover"].items())))  # the profile's

    @property
    def overrides_sticks(self) -> bool:
        """Whether motor commands take the place of the pilot's sticks, and show as such in RC_CHANNELS."""
        return self.output in ("rc_override", "manual_control")

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, tree: Any) -> Any:
        """The profile's own output and streams where none are given."""
        profile = tree.get("profile") if isinstance(tree, dict) else None
        if not isinstance(profile, str) or profile not in OUTPUTS:
            return tree
        return {"output": OUTPUTS[profile][0], "streams_hz": dict(STREAMS_HZ[profile]), **tree}

    @model_validator(mode="after")
    def _check_output(self) -> AutopilotLinkConfig:
        able = OUTPUTS[self.profile]
        if self.output not in able:
            why = WHY_NOT[self.profile, self.output]
            raise ValueError(
                f"output {self.output} does not go with profile {self.profile} ({why}): {' or '.join(able)}"
            )
        if self.port_actuator == self.starboard_actuator:
            raise ValueError("port_actuator and starboard_actuator must differ")
        return self


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
    """Where `asvhil hold` and ground stations send their commands, as MAVLink; and what all operators are told.

    `claim_goto`: a ground station's goto that is addressed to the autopilot is taken as ours, and answered in the
    autopilot's name.
    """

    endpoint: LinkSpecText = "udpin:127.0.0.1:14660"
    claim_goto: bool = False
    report_hz: Annotated[float, Field(ge=0.0, le=10.0)] = 2.0  # NAMED_VALUE_FLOAT and the station; 0: none


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
