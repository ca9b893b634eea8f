"""The links of the daemon: autopilot, sensors, operator, ground stations."""

from __future__ import annotations

from itertools import combinations
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, model_validator

from asvhil.config.autopilots import outputs_of
from asvhil.config.base import LinkSpecText, MavlinkId, NonNegative, Positive, Section, is_stored, known_only
from asvhil.config.chosen import NamedIn
from asvhil.config.link_spec import shared_place
from asvhil.config.mavlink import GroundStationLinkConfig, LinkName, MavlinkLinkConfig, RoutingConfig
from asvhil.config.ports import AUTOPILOT, OPERATOR
from asvhil.config.registry import AUTOPILOTS, OUTPUTS
from asvhil.config.sensors import (
    OWN_LINKS,
    AnemometerLinkConfig,
    AnySensorLink,
    InsLinkConfig,
    NmeaLinkConfig,
    SensorLinkConfig,
    SensorName,
)


def _without_none(rates: Any) -> Any:
    """Without the messages that are not to be asked for: a rate of 0 or null."""
    return {name: rate for name, rate in rates.items() if rate not in (0, None)} if isinstance(rates, dict) else rates


# Sorted, for they are asked for in this order, and a config that is read back from a log comes sorted.
Streams = Annotated[
    dict[str, Positive], BeforeValidator(_without_none), AfterValidator(lambda rates: dict(sorted(rates.items())))
]


def _streams_hz(profile: str) -> dict[str, float]:
    """The messages that a profile asks for, and how often."""
    return dict(sorted(AUTOPILOTS.find(profile).streams_hz.items()))


class AutopilotLinkConfig(MavlinkLinkConfig):
    """The MAVLink link to the autopilot: the daemon's own ids, the way to the motors, and the messages to request."""

    endpoint: LinkSpecText = Field(description="Link spec, such as serial:/dev/ttyAMA0:921600 or udpin:HOST:PORT.")
    profile: Annotated[str, NamedIn(AUTOPILOTS)] = Field(default="ardurover", description="The autopilot's firmware.")
    output: Annotated[str, NamedIn(OUTPUTS)] = Field(
        default="rc_override",
        description=(
            "Way to the motors, see docs/autopilots.md: rc_override, manual_control, script or set_servo with "
            "ardurover, set_actuator with px4. Default: the first that the profile has."
        ),
    )
    port_actuator: int = Field(
        default=1, ge=1, le=6, description="Actuator of the port motor in MAV_CMD_DO_SET_ACTUATOR (set_actuator)."
    )
    starboard_actuator: int = Field(default=2, ge=1, le=6, description="Actuator of the starboard motor.")
    system_id: MavlinkId = Field(default=1, description="MAVLink system id of the daemon: that of the vehicle.")
    component_id: MavlinkId = Field(default=191, description="Its component id (191: onboard computer).")
    override_system_id: MavlinkId = Field(
        default=1,
        description="System id that overrides are sent with; an ArduRover accepts only SYSID_MYGCS (MAV_GCS_SYSID).",
    )
    autopilot_system_id: MavlinkId = Field(default=1, description="System id of the autopilot.")
    autopilot_component_id: MavlinkId = Field(
        default=1,
        description=(
            "Its component id; 1 by the protocol. Cameras, gimbals and other components of the vehicle are not "
            "listened to."
        ),
    )
    position_source: Literal["GLOBAL_POSITION_INT", "GPS_RAW_INT"] | None = Field(
        default=None,
        description=(
            "Message for position and velocity where `sources` names none: the autopilot's estimate or its receiver's "
            "fix; the other one stands by. null: GPS_RAW_INT, if it is asked for at 2 Hz or more."
        ),
    )
    streams_hz: Streams = Field(
        default_factory=lambda: _streams_hz("ardurover"),
        description=(
            "Rate to request for each message, as {MESSAGE: Hz}; merged over those that the profile needs "
            "(asvhil/config/autopilots.py). 0 or null: not asked for. What `sources` lists is asked for in any case."
        ),
    )

    battery_hz: NonNegative = Field(
        default=1.0,
        description=(
            "Rate to request for BATTERY_STATUS, which tells of each battery by itself (an ArduPilot of one in turn), "
            "unless streams_hz has it. 0: not asked for."
        ),
    )
    left_out_if_empty = ("battery_hz",)
    before_it_came = (("battery_hz", 0.0),)

    @property
    def requested_hz(self) -> dict[str, float]:
        """The rates of all messages to request; that of the batteries, which nothing waits for, comes last."""
        batteries = {"BATTERY_STATUS": self.battery_hz} if self.battery_hz else {}
        return self.streams_hz | {name: hz for name, hz in batteries.items() if name not in self.streams_hz}

    @property
    def overrides_sticks(self) -> bool:
        """Whether motor commands replace the pilot's sticks, and RC_CHANNELS shows them instead."""
        kind = OUTPUTS.get(self.output)
        return kind is not None and kind.overrides_sticks

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, tree: Any, info: ValidationInfo) -> Any:
        """The profile's own output where none is given, and its streams under those that are."""
        if not isinstance(tree, dict):
            return tree
        profile = tree.get("profile", "ardurover")
        kind = AUTOPILOTS.get(profile) if isinstance(profile, str) else None
        if kind is None:
            return tree
        given = tree.get("streams_hz", {})
        streams = {**kind.streams_hz, **given} if isinstance(given, dict) and not is_stored(info) else given
        return {"output": kind.outputs[0], **tree, "streams_hz": streams}

    @model_validator(mode="after")
    def _check_output(self) -> AutopilotLinkConfig:
        kind = AUTOPILOTS.get(self.profile)
        able = outputs_of(kind) if kind is not None else (self.output,)
        if kind is not None and self.output not in able:
            why = kind.unsuited.get(self.output, "it does not have it")
            raise ValueError(
                f"output {self.output} does not go with profile {self.profile} ({why}): {' or '.join(able)}"
            )
        if self.port_actuator == self.starboard_actuator:
            raise ValueError("port_actuator and starboard_actuator must differ")
        return self


class OperatorLinkConfig(MavlinkLinkConfig):
    """The MAVLink link of `asvhil hold` and `asvhil release`, and what operators on all links get."""

    endpoint: LinkSpecText = Field(default="udpin:127.0.0.1:14660", description="Link spec.")
    claim_goto: bool = Field(
        default=False,
        description=(
            "Whether a ground station's goto to the autopilot is taken as one to the daemon, and answered in the "
            "autopilot's name."
        ),
    )
    report_hz: float = Field(
        default=2.0,
        ge=0.0,
        le=10.0,
        description="Rate of NAMED_VALUE_FLOAT and POSITION_TARGET_GLOBAL_INT to ground stations; 0: none.",
    )


class LinksConfig(Section):
    """The links of the daemon. A link is a spec of text: udpin:, udpout:, tcp:, tcpin:HOST:PORT, serial:PATH:BAUD.

    A link that is lost is opened again with pauses that double from reconnect_first_s to reconnect_max_s.
    """

    autopilot: AutopilotLinkConfig = Field(description="The autopilot.")
    anemometer: AnemometerLinkConfig | None = Field(default=None, description="The wind sensor's NMEA line.")
    ins: InsLinkConfig | None = Field(default=None, description="A VectorNav INS.")
    gnss: NmeaLinkConfig | None = Field(default=None, description="An NMEA line with GNSS, compass or wind.")
    sensors: dict[SensorName, AnySensorLink] = Field(
        default_factory=dict,
        description=(
            "Further sensors by name (lower case letters, digits, _ and -); `sources` refer to them as NAME.MESSAGE."
        ),
    )
    operator: OperatorLinkConfig = Field(default=OperatorLinkConfig(), description="The operator's commands.")
    ground_stations: dict[LinkName, GroundStationLinkConfig] = Field(
        default_factory=dict,
        description="Ground stations by name (lower case letters, digits, _ and -); none by default.",
    )
    routing: RoutingConfig = Field(default=RoutingConfig(), description="Routing between MAVLink links.")
    reconnect_first_s: Positive = Field(default=0.2, description="First pause before a lost link is opened again.")
    reconnect_max_s: Positive = Field(default=5.0, description="Longest pause.")

    left_out_if_empty = ("sensors",)

    @model_validator(mode="after")
    def _one_link_each(self, info: ValidationInfo) -> LinksConfig:
        """Of two links on one device or port the second could never be opened, and would be tried for ever."""
        if known_only(info) or is_stored(info):
            return self
        stations = {f"ground_stations.{name}": station.endpoint for name, station in self.ground_stations.items()}
        for (port, spec), (other, its) in combinations({**self.endpoints, **stations}.items(), 2):
            place = shared_place(spec, its)
            if place:
                raise ValueError(
                    f"{port} and {other} are both on {place}, which one link alone can open: "
                    "each needs a device or port of its own"
                )
        return self

    def sensor_links(self) -> dict[str, AnemometerLinkConfig | NmeaLinkConfig | InsLinkConfig | SensorLinkConfig]:
        """The sections of all sensor links by port, those with keys of their own first."""
        own = {port: getattr(self, port) for port in OWN_LINKS}
        return {**{port: link for port, link in own.items() if link is not None}, **self.sensors}

    def key_of(self, port: str) -> str:
        """The key of the config that a link of the autopilot or of a sensor has, or would have."""
        return f"links.{port}" if port == AUTOPILOT or port in OWN_LINKS else f"links.sensors.{port}"

    def kind_of(self, port: str) -> str:
        """The kind of sensor at a port that is among `sensor_links`."""
        return OWN_LINKS.get(port) or self.sensors[port].kind

    @property
    def endpoints(self) -> dict[str, str]:
        """Link specs by port: of the autopilot, of all sensors, of the operator."""
        sensors = {port: link.endpoint for port, link in self.sensor_links().items()}
        return {AUTOPILOT: self.autopilot.endpoint, **sensors, OPERATOR: self.operator.endpoint}
