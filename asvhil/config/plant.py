"""The simulated boat: weather, sensors, autopilot."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field, model_validator

from asvhil.config.base import (
    Degrees,
    Fraction,
    Latitude,
    LinkSpecText,
    Longitude,
    MavlinkId,
    NonNegative,
    Positive,
    Section,
    ServoUs,
)
from asvhil.config.ports import ANEMOMETER, AUTOPILOT, GNSS, INS
from asvhil.config.vehicle import VesselConfig


class WindConfig(Section):
    """Mean true wind and its gusts: two-component Ornstein-Uhlenbeck, fractions of the mean speed."""

    speed_mps: NonNegative = Field(default=3.0, description="Mean speed of the wind over ground.")
    toward_deg: Degrees = Field(
        default=0.0, description="Direction that the wind blows toward, clockwise from north (not where it comes from)."
    )
    gust_along: NonNegative = Field(
        default=0.15, description="Standard deviation of the gusts along the wind, over the mean speed."
    )
    gust_across: NonNegative = Field(
        default=0.075, description="Standard deviation of the gusts across the wind, over the mean speed."
    )
    gust_time_s: Positive = Field(default=15.0, description="Correlation time of the gusts.")


class CurrentConfig(Section):
    """A current that is the same everywhere and at all times."""

    speed_mps: NonNegative = Field(default=0.0, description="Speed of the water over ground.")
    toward_deg: Degrees = Field(default=0.0, description="Direction that it sets toward, clockwise from north.")


class WavesConfig(Section):
    """First-order motion of the boat in waves; off while both standard deviations are 0.

    0.07 m/s and 0.02 rad/s make a light chop for a boat of 5 m.
    """

    orbital_std_mps: float = Field(
        default=0.0, ge=0.0, le=5.0, description="Standard deviation of the velocity along the waves' direction."
    )
    yaw_std_radps: float = Field(default=0.0, ge=0.0, le=1.0, description="Standard deviation of the yaw rate.")
    peak_hz: float = Field(default=0.3, ge=0.02, le=5.0, description="Peak frequency of the spectrum.")
    damping: float = Field(
        default=0.15, ge=0.01, lt=1.0, description="Damping ratio of each of two shaping filters in series."
    )
    spreading: Fraction = Field(
        default=0.58,
        description=(
            "Velocity across the waves' direction over that along it: 0 for long-crested waves, sqrt(1/3) for "
            "cosine-squared spreading, 1 for a confused sea."
        ),
    )
    toward_deg: Degrees | None = Field(
        default=None, description="Direction that the waves travel toward, clockwise from north; null: with the wind."
    )


class WeatherConfig(Section):
    """Wind, current and waves."""

    wind: WindConfig = Field(default=WindConfig(), description="Wind.")
    current: CurrentConfig = Field(default=CurrentConfig(), description="Current.")
    waves: WavesConfig = Field(default=WavesConfig(), description="Waves.")


class GnssSensorConfig(Section):
    """Errors of a GNSS receiver; the defaults are those of a VN-300."""

    rate_hz: Positive = Field(default=5.0, description="Rate of the fixes.")
    slow_bias_m: NonNegative = Field(
        default=1.0, description="Standard deviation of the position's slow error, each axis (Ornstein-Uhlenbeck)."
    )
    slow_bias_time_s: Positive = Field(default=90.0, description="Correlation time of the slow error.")
    white_m: NonNegative = Field(default=0.07, description="White noise of the position, each axis.")
    velocity_white_mps: NonNegative = Field(default=0.05, description="White noise of the velocity, each axis.")


class FusedVelocityConfig(Section):
    """Error that the autopilot's own filter adds to its velocity (GLOBAL_POSITION_INT, LOCAL_POSITION_NED).

    A first-order Gauss-Markov process on each axis, north and east; the filter's position is off by what comes of it in
    a second. The defaults are those of a real ArduRover 4.6.3 (docs/results/real-ardurover.md).
    """

    slow_bias_mps: NonNegative = Field(default=0.015, description="Standard deviation of the slow error, each axis.")
    slow_bias_time_s: Positive = Field(default=150.0, description="Correlation time of the slow error.")


class HeadingSensorConfig(Section):
    """Errors of the heading: white noise, and a deviation A + B sin psi + C cos psi + D sin 2 psi + E cos 2 psi.

    The deviation is added to the true heading, as a compass adjuster counts it.
    """

    white_deg: NonNegative = Field(default=0.25, description="White noise.")
    bias_deg: float = Field(default=0.0, description="Coefficient A of the deviation, its constant part.")
    deviation_deg: tuple[float, float, float, float] = Field(
        default=(0.0, 0.0, 0.0, 0.0), description="Coefficients B, C, D, E of a compass."
    )


class ImuSensorConfig(Section):
    """Errors of gyro and accelerometer."""

    gyro_white_radps: NonNegative = Field(default=0.009, description="White noise of the yaw rate.")
    accel_white_mps2: NonNegative = Field(default=0.021, description="White noise of the specific force, each axis.")
    accel_bias_mps2: NonNegative = Field(
        default=0.05, description="Standard deviation of the accelerometer's bias, drawn once per run."
    )


class AnemometerSensorConfig(Section):
    """The wind sensor: cups and a vane with a number of positions."""

    rate_hz: Positive = Field(default=5.0, description="Rate of its sentences.")
    speed_white_mps: NonNegative = Field(default=0.1, description="White noise of the speed.")
    directions: int = Field(default=16, ge=4, le=360, description="Positions of the vane.")
    misalignment_deg: Degrees = Field(
        default=0.0, description="How far the vane's zero is turned clockwise from the bow."
    )


class DeviceConfig(Section):
    """A navigation sensor beside the autopilot."""

    gnss: GnssSensorConfig | None = Field(
        default=None, description="Errors of its GNSS receiver; null: as `plant.sensors.gnss`."
    )
    heading: HeadingSensorConfig | None = Field(
        default=None, description="Errors of its heading; null: as `plant.sensors.heading`."
    )
    imu: ImuSensorConfig | None = Field(default=None, description="Errors of its IMU; null: as `plant.sensors.imu`.")


class InsDeviceConfig(DeviceConfig):
    """The simulated VN-300, present where `links.ins` is."""

    rate_hz: float = Field(default=20.0, ge=1.0, le=200.0, description="Rate of its binary output message.")
    align_s: NonNegative = Field(default=2.0, description="Time from power-on until its filter is aligned.")


class NmeaDeviceConfig(DeviceConfig):
    """The simulated GNSS receiver and magnetic compass on one NMEA line, present where `links.gnss` is."""

    compass_hz: float = Field(default=10.0, ge=0.1, le=50.0, description="Rate of the compass (HDG).")
    declination_deg: Degrees = Field(
        default=0.0, description="Magnetic declination, east positive: the variation field of RMC and HDG."
    )


class SensorsConfig(Section):
    """Errors of the simulated sensors: the autopilot's own, the anemometer's, and those of devices beside them."""

    gnss: GnssSensorConfig = Field(default=GnssSensorConfig(), description="The autopilot's receiver.")
    fused_velocity: FusedVelocityConfig = Field(
        default=FusedVelocityConfig(), description="Error of the velocity that the autopilot's own filter tells."
    )
    heading: HeadingSensorConfig = Field(default=HeadingSensorConfig(), description="The autopilot's heading.")
    imu: ImuSensorConfig = Field(default=ImuSensorConfig(), description="The autopilot's IMU.")
    anemometer: AnemometerSensorConfig = Field(default=AnemometerSensorConfig(), description="The wind sensor.")
    ins: InsDeviceConfig = Field(default=InsDeviceConfig(), description="The VN-300.")
    nmea: NmeaDeviceConfig = Field(default=NmeaDeviceConfig(), description="The receiver and compass on an NMEA line.")


class FrontseatConfig(Section):
    """The simulated autopilot; the defaults follow a real ArduRover with its dead zones removed.

    A simulated PX4 takes system_id, boot_s, ready_after_s, rc_receiver, loop_hz, parameters, px4_version and
    px4_outputs from here.
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


Device = Literal["autopilot", "ins", "nmea"]
DEFAULT_SIZE = {"gnss-jump": 20.0, "heading-jump": 60.0}
OF_ONE_DEVICE = frozenset({"gnss-jump", "gnss-frozen", "gnss-silent", "heading-jump", "heading-silent", "imu-silent"})
FaultKind = Literal[
    "port-motor",
    "starboard-motor",
    "gnss",
    "gnss-jump",
    "gnss-frozen",
    "gnss-silent",
    "heading-jump",
    "heading-silent",
    "imu-silent",
    "anemometer",
    "anemometer-stuck",
    "vane",
    "cups",
    "ins",
    "ins-gnss",
    "nmea",
    "transmitter",
]


class FaultConfig(Section):
    """A fault of the simulated boat during a span of time.

    docs/sensors.md says what each kind does to each device. A sensor's fault shows on every device that has the sensor,
    or on `device` alone.
    """

    kind: FaultKind = Field(description="What fails.")
    from_s: NonNegative = Field(default=0.0, description="Begin, after power-on.")
    until_s: Positive | None = Field(default=None, description="End, after power-on; null: it lasts.")
    size: float | None = Field(
        default=None, description="Size of a jump: gnss-jump in m (null: 20), heading-jump in degrees (null: 60)."
    )
    toward_deg: Degrees = Field(default=45.0, description="Direction of a gnss-jump, clockwise from north.")
    device: Device | None = Field(
        default=None, description="The one device that has a gnss-, heading- or imu- fault; null: all."
    )

    @property
    def to_s(self) -> float:
        """The end of the span (s); infinity where it has none."""
        return math.inf if self.until_s is None else self.until_s

    @property
    def magnitude(self) -> float:
        """The size of a jump: the config's, or the kind's default."""
        return DEFAULT_SIZE.get(self.kind, 0.0) if self.size is None else self.size

    @model_validator(mode="after")
    def _check(self) -> FaultConfig:
        if self.to_s <= self.from_s:
            raise ValueError("from_s < until_s must hold")
        if self.size is not None and self.kind not in DEFAULT_SIZE:
            raise ValueError(f"only {' and '.join(DEFAULT_SIZE)} have a size, {self.kind} has none")
        if self.device is not None and self.kind not in OF_ONE_DEVICE:
            raise ValueError(f"a device can be named for {', '.join(sorted(OF_ONE_DEVICE))}, not for {self.kind}")
        return self


class GlitchConfig(Section):
    """One kind of fault that comes at random, for a time that is uniform between two bounds."""

    kind: FaultKind = Field(description="What fails.")
    least_s: Positive = Field(default=0.2, description="Shortest duration.")
    most_s: Positive = Field(default=3.0, description="Longest duration.")
    size: float | None = Field(default=None, description="Size of a jump, as in `plant.faults`.")
    device: Device | None = Field(default=None, description="As in `plant.faults`; null: that of `plant.glitches`.")

    @model_validator(mode="after")
    def _check(self) -> GlitchConfig:
        if self.most_s < self.least_s:
            raise ValueError("least_s <= most_s must hold")
        FaultConfig(kind=self.kind, size=self.size, device=self.device)
        return self


_GLITCHES = (
    GlitchConfig(kind="gnss-jump", least_s=0.2, most_s=5.0),
    GlitchConfig(kind="gnss-frozen", least_s=2.0, most_s=10.0),
    GlitchConfig(kind="gnss-silent", least_s=2.0, most_s=30.0),
    GlitchConfig(kind="heading-jump", least_s=0.2, most_s=5.0),
    GlitchConfig(kind="heading-silent", least_s=2.0, most_s=30.0),
    GlitchConfig(kind="imu-silent", least_s=2.0, most_s=30.0),
    GlitchConfig(kind="anemometer-stuck", least_s=5.0, most_s=30.0),
    GlitchConfig(kind="anemometer", least_s=5.0, most_s=30.0),
)


class GlitchesConfig(Section):
    """Sensor faults at random times, one after the other, drawn from `plant.seed`.

    Every round has all kinds in random order. Jumps of the position go in a random direction, those of the heading to a
    random side.
    """

    kinds: tuple[GlitchConfig, ...] = Field(
        default=_GLITCHES, min_length=1, description="Kinds of fault; by default eight kinds of sensor fault."
    )
    from_s: NonNegative = Field(default=30.0, description="Begin, after power-on.")
    until_s: Positive = Field(default=3600.0, description="End, after power-on.")
    rest_s: NonNegative = Field(default=5.0, description="Least time between two faults.")
    gap_s: Positive = Field(default=10.0, description="Mean of the exponential time that is added to rest_s.")
    device: Device | None = Field(
        default=None, description="Device that fails, for kinds that name none; null: all that have the sensor."
    )


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
