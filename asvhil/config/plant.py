"""The simulated boat: its autopilot, links and simulator interfaces; the rest is in the modules `plant_*`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from asvhil.config.base import (
    Degrees,
    Latitude,
    LinkSpecText,
    Longitude,
    MavlinkId,
    NonNegative,
    Positive,
    Section,
    ServoUs,
)
from asvhil.config.plant_faults import FaultConfig, GlitchesConfig
from asvhil.config.plant_hull import BlendermannConfig, PlantMotorsConfig, TiltConfig
from asvhil.config.plant_sensors import SensorsConfig
from asvhil.config.plant_weather import WeatherConfig
from asvhil.config.ports import ANEMOMETER, AUTOPILOT, GNSS, INS
from asvhil.config.vehicle import VesselConfig


class FrontseatConfig(Section):
    """The simulated autopilot; the defaults follow a real ArduRover with its dead zones removed.

    `delivered` puts a boat's own parameters in their place. A simulated PX4 takes system_id, boot_s, ready_after_s,
    rc_receiver, current_sensor, loop_hz, parameters, px4_version and px4_outputs from here.
    """

    firmware: Literal["4.6", "4.7"] = Field(
        default="4.6", description="Version of ArduRover, which decides the names of some parameters."
    )
    px4_version: Literal["1.15", "1.16"] = Field(
        default="1.15", description="Version of a PX4, which decides what it says at rest and while disarmed."
    )
    px4_outputs: Literal["board", "sitl"] = Field(
        default="board",
        description=(
            "Outputs of a PX4: a board's, or those of PX4's own simulation, which have no MIN, MAX, DIS and FAIL "
            "parameters and speak only where an output has a motor function."
        ),
    )
    delivered: Literal["blueboat"] | None = Field(
        default=None,
        description=(
            "The boat whose parameters an ArduRover has as delivered, those of the version of `firmware`; null: those "
            "that suit `asvhil sitl`."
        ),
    )
    parameters: dict[str, float] = Field(
        default_factory=dict,
        description="Parameters of the autopilot to set before start, as {NAME: value}; none by default.",
    )
    script: bool = Field(
        default=False,
        description=(
            "Whether the script of docs/autopilot-script.md is on the memory card at power-on; it runs where "
            "parameters have SCR_ENABLE 1."
        ),
    )
    system_id: MavlinkId = Field(default=1, description="MAVLink system id (SYSID_THISMAV, MAV_SYSID, MAV_SYS_ID).")
    mygcs_system_id: MavlinkId = Field(
        default=1, description="System whose overrides it accepts (SYSID_MYGCS, MAV_GCS_SYSID)."
    )
    boot_s: NonNegative = Field(default=1.0, description="Time from power-on until it runs.")
    setup_s: NonNegative = Field(
        default=0.0,
        description=(
            "Time after boot_s for which an ArduRover still sets itself up: it answers, and the default of a dead zone "
            "(RC1_DZ, RC3_DZ of 30) is not in force yet. A real one takes about 1 s."
        ),
    )
    ready_after_s: NonNegative = Field(default=3.0, description="Time from power-on until it has a position.")
    rc_receiver: bool = Field(default=True, description="Whether a transmitter with sticks at rest is on.")
    current_sensor: bool = Field(
        default=False,
        description=(
            "Whether it measures the battery's current: what vehicle.power gives for the motors' signals. false: "
            "SYS_STATUS has -1, as that of an autopilot without a current sensor."
        ),
    )
    override_timeout_s: Positive = Field(
        default=2.9, description="RC_OVERRIDE_TIME: without overrides for this long the sticks are the pilot's again."
    )
    neutral_timeout_s: Positive = Field(
        default=0.5, description="Without stick values for this long (no receiver) the outputs are neutral."
    )
    failsafe_timeout_s: Positive = Field(
        default=1.9, description="Without stick values for this long the radio fail-safe acts (HOLD)."
    )
    loop_hz: Positive = Field(default=50.0, description="Rate of its main loop (SCHED_LOOP_RATE).")
    rc1_dz_us: int = Field(default=0, ge=0, le=200, description="Dead zone of the port motor's stick (RC1_DZ).")
    rc3_dz_us: int = Field(default=0, ge=0, le=200, description="Dead zone of the starboard motor's stick (RC3_DZ).")

    left_out_if_empty = ("current_sensor",)


class ArduPilotJsonConfig(Section):
    """ArduPilot's JSON physics interface (`asvhil plant --ardupilot-json`)."""

    endpoint: LinkSpecText = Field(default="udpin:127.0.0.1:9002", description="Where ArduPilot's frames arrive.")
    windvane: bool = Field(default=True, description="Whether the reply has the apparent wind (WNDVN_TYPE 11).")
    rc_us: tuple[ServoUs, ...] = Field(
        default=(), max_length=12, description="A transmitter's channels, up to 12, for the reply; empty: none."
    )
    battery_v: Positive | None = Field(default=None, description="Battery voltage for the reply; null: none.")


class Px4HilConfig(Section):
    """PX4's simulator interface (`asvhil plant --px4-hil`)."""

    endpoint: LinkSpecText = Field(default="tcpin:127.0.0.1:4560", description="Where PX4 connects.")
    port_control: int = Field(
        default=1, ge=1, le=16, description="Control of HIL_ACTUATOR_CONTROLS, in [-1, 1], that drives the port motor."
    )
    starboard_control: int = Field(default=2, ge=1, le=16, description="Control that drives the starboard motor.")
    sensor_hz: float = Field(default=250.0, ge=50.0, le=1000.0, description="Rate of HIL_SENSOR.")
    slow_sensor_hz: float = Field(
        default=50.0, ge=1.0, le=100.0, description="Rate of compass and barometer in HIL_SENSOR."
    )
    speed: NonNegative = Field(default=1.0, description="Pace over real time; 0: as fast as PX4 answers.")
    answer_timeout_s: Positive = Field(
        default=0.01, description="In lockstep: how long an answer is awaited before the next sample is sent."
    )
    altitude_m: float = Field(default=0.0, description="Altitude of the water, for barometer and GNSS.")
    mag_white_gauss: NonNegative = Field(default=0.001, description="White noise of the compass, each axis.")
    baro_white_pa: NonNegative = Field(default=1.0, description="White noise of the barometer.")

    @model_validator(mode="after")
    def _check_controls(self) -> Px4HilConfig:
        if self.port_control == self.starboard_control:
            raise ValueError("port_control and starboard_control must differ")
        return self


class HilConfig(Section):
    """The simulated boat as the physics of a real autopilot (docs/autopilots.md).

    An autopilot may drive its outputs anywhere while it boots, so the boat is moored until both have been near neutral
    for a while.
    """

    neutral_first_s: NonNegative = Field(
        default=5.0, description="Time without a break for which the outputs must be near neutral; 0: never moored."
    )
    neutral_band_us: int = Field(default=20, ge=0, le=200, description="How near to neutral they must be.")
    ardupilot: ArduPilotJsonConfig = Field(default=ArduPilotJsonConfig(), description="ArduPilot.")
    px4: Px4HilConfig = Field(default=Px4HilConfig(), description="PX4.")


class PlantLinksConfig(Section):
    """The simulated boat's ends of the links; `asvhil sitl` connects them to those of the daemon."""

    autopilot: LinkSpecText = Field(default="udpout:127.0.0.1:14560", description="The simulated autopilot's MAVLink.")
    anemometer: LinkSpecText | None = Field(default=None, description="The wind sensor's NMEA line; null: none.")
    ins: LinkSpecText | None = Field(default=None, description="The VN-300's line; null: none.")
    gnss: LinkSpecText | None = Field(default=None, description="The NMEA line of receiver and compass; null: none.")
    sensors: dict[str, LinkSpecText] = Field(
        default_factory=dict, description="Lines of the sensors of links.sensors by name."
    )

    left_out_if_empty = ("sensors",)

    @property
    def endpoints(self) -> dict[str, str]:
        """Link specs by port: of the autopilot, and of every sensor that has a line."""
        lines = {ANEMOMETER: self.anemometer, INS: self.ins, GNSS: self.gnss}
        return {
            AUTOPILOT: self.autopilot,
            **{port: spec for port, spec in lines.items() if spec is not None},
            **self.sensors,
        }


class PlantConfig(Section):
    """The simulated boat with its weather, sensors and autopilot. A real boat ignores this section."""

    seed: int = Field(default=1, ge=0, description="Seed of weather, sensor noise and glitches.")
    origin_lat_deg: Latitude = Field(default=40.4237, description="Latitude of the local frame's origin.")
    origin_lon_deg: Longitude = Field(default=-86.9212, description="Longitude of the local frame's origin.")
    start_n_m: float = Field(default=-14.0, description="Start, north of the origin.")
    start_e_m: float = Field(default=-3.0, description="Start, east of the origin.")
    start_heading_deg: Degrees = Field(default=0.0, description="Heading at the start, clockwise from north.")
    step_s: float = Field(default=0.01, gt=0.0, le=0.05, description="Step of the integration.")
    vessel: VesselConfig | None = Field(
        default=None, description="The true boat, where it differs from vehicle.vessel."
    )
    wind_load: BlendermannConfig | None = Field(
        default=None, description="Another law of the wind load on the true boat; null: that of the vessel."
    )
    motors: PlantMotorsConfig | None = Field(
        default=None, description="How the motors fall short of the thrust curve; null: not at all."
    )
    tilt: TiltConfig | None = Field(
        default=None, description="Roll and pitch of the true boat; null: those of its waves alone."
    )
    autopilot: Literal["ardurover", "px4"] = Field(
        default="ardurover", description="The simulated autopilot; links.autopilot.profile must be one for it."
    )
    weather: WeatherConfig = Field(default=WeatherConfig(), description="Weather.")
    sensors: SensorsConfig = Field(default=SensorsConfig(), description="Sensor errors.")
    frontseat: FrontseatConfig = Field(default=FrontseatConfig(), description="The simulated autopilot.")
    links: PlantLinksConfig = Field(default=PlantLinksConfig(), description="The simulated boat's links.")
    faults: tuple[FaultConfig, ...] = Field(default=(), description="Faults at given times.")
    glitches: GlitchesConfig | None = Field(default=None, description="Faults at random times; null: none.")
    hil: HilConfig = Field(default=HilConfig(), description="A real autopilot in the loop.")

    left_out_if_empty = ("wind_load", "motors", "tilt")
