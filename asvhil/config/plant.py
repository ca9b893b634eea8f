"""The simulated boat: weather, sensors, autopilot."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from asvhil.config.autopilots import Profile
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
from asvhil.config.vehicle import VesselConfig


class WindConfig(Section):
    """Mean true wind and its gusts: two-component Ornstein-Uhlenbeck, fractions of the mean speed."""

    speed_mps: NonNegative = 3.0
    toward_deg: Degrees = 0.0
    gust_along: NonNegative = 0.15
    gust_across: NonNegative = 0.075
    gust_time_s: Positive = 15.0


class CurrentConfig(Section):
    speed_mps: NonNegative = 0.0
    toward_deg: Degrees = 0.0


class WavesConfig(Section):
    """First-order motion of the boat in the waves; off where both standard deviations are 0.

    `orbital_std_mps` is that of the velocity along the waves' way, `spreading` times as much across it (the square root
    of 1/3 for a cosine-squared spreading, 0 for long-crested waves, 1 for a confused sea). 0.07 and 0.02 make a light
    chop for a boat of 5 m. `damping` is that of each of two filters in series.
    """

    orbital_std_mps: Annotated[float, Field(ge=0.0, le=5.0)] = 0.0
    yaw_std_radps: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    peak_hz: Annotated[float, Field(ge=0.02, le=5.0)] = 0.3
    damping: Annotated[float, Field(ge=0.01, lt=1.0)] = 0.15
    spreading: Fraction = 0.58
    toward_deg: Degrees | None = None  # with the wind where absent


class WeatherConfig(Section):
    wind: WindConfig = WindConfig()
    current: CurrentConfig = CurrentConfig()
    waves: WavesConfig = WavesConfig()


class GnssSensorConfig(Section):
    rate_hz: Positive = 5.0
    slow_bias_m: NonNegative = 1.0
    slow_bias_time_s: Positive = 90.0
    white_m: NonNegative = 0.07
    velocity_white_mps: NonNegative = 0.05


class HeadingSensorConfig(Section):
    """Errors of the heading: white, constant, and for a compass the deviation that depends on the heading itself.

    Deviation is `bias_deg` (A) + B sin psi + C cos psi + D sin 2 psi + E cos 2 psi, as a compass adjuster has it; the
    sensor reads that much too much.
    """

    white_deg: NonNegative = 0.25
    bias_deg: float = 0.0
    deviation_deg: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)  # B, C, D, E


class ImuSensorConfig(Section):
    gyro_white_radps: NonNegative = 0.009
    accel_white_mps2: NonNegative = 0.021
    accel_bias_mps2: NonNegative = 0.05


class AnemometerSensorConfig(Section):
    rate_hz: Positive = 5.0
    speed_white_mps: NonNegative = 0.1
    directions: Annotated[int, Field(ge=4, le=360)] = 16
    misalignment_deg: Degrees = 0.0


class DeviceConfig(Section):
    """A navigation sensor beside the autopilot; a section of errors that is absent is that of the autopilot's own."""

    gnss: GnssSensorConfig | None = None
    heading: HeadingSensorConfig | None = None
    imu: ImuSensorConfig | None = None


class InsDeviceConfig(DeviceConfig):
    """The simulated VN-300: the rate of its binary output message, and how long it takes to align."""

    rate_hz: Annotated[float, Field(ge=1.0, le=200.0)] = 20.0
    align_s: NonNegative = 2.0


class NmeaDeviceConfig(DeviceConfig):
    """The simulated NMEA receiver, which sends at the rate of its fixes, and the magnetic compass on the same line."""

    compass_hz: Annotated[float, Field(ge=0.1, le=50.0)] = 10.0
    declination_deg: Degrees = 0.0  # of the earth's field, east positive: the variation field of RMC and HDG


class SensorsConfig(Section):
    gnss: GnssSensorConfig = GnssSensorConfig()
    heading: HeadingSensorConfig = HeadingSensorConfig()
    imu: ImuSensorConfig = ImuSensorConfig()
    anemometer: AnemometerSensorConfig = AnemometerSensorConfig()
    ins: InsDeviceConfig = InsDeviceConfig()
    nmea: NmeaDeviceConfig = NmeaDeviceConfig()


class FrontseatConfig(Section):
    """The simulated autopilot; defaults follow a real ArduRover with its dead zones taken out.

    `firmware` decides over the names of ArduRover's parameters. `parameters` sets any of the autopilot's by its name. A
    PX4 takes from here its system id, times to boot and to readiness, `rc_receiver` and `loop_hz`.
    """

    firmware: Literal["4.6", "4.7"] = "4.6"
    parameters: dict[str, float] = Field(default_factory=dict)
    system_id: MavlinkId = 1
    mygcs_system_id: MavlinkId = 1
    boot_s: NonNegative = 1.0
    ready_after_s: NonNegative = 3.0
    rc_receiver: bool = True
    override_timeout_s: Positive = 2.9
    neutral_timeout_s: Positive = 0.5
    failsafe_timeout_s: Positive = 1.9
    loop_hz: Positive = 50.0
    rc1_dz_us: Annotated[int, Field(ge=0, le=200)] = 0
    rc3_dz_us: Annotated[int, Field(ge=0, le=200)] = 0


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
]


class FaultConfig(Section):
    """Something that breaks, from a time after power-on until another, or for good.

    `port-motor`, `starboard-motor`: no thrust. `anemometer`: silent. `vane`, `cups`: direction or speed stuck where it
    is, `anemometer-stuck`: both. `ins`, `nmea`: the VN-300, or the receiver and compass on the NMEA line, silent.

    In every way that the boat has the sensor, or in `device` alone: `gnss-jump`: positions off by `size` metres
    (20) toward `toward_deg`. `gnss-frozen`: position and velocity repeated as if they were new. `gnss-silent`: no
    satellites, and the receiver says so. `heading-jump`: off by `size` degrees (60). `heading-silent`, `imu-silent`:
    none. `gnss` and `ins-gnss` are `gnss-silent` of the autopilot and of the VN-300.
    """

    kind: FaultKind
    from_s: NonNegative = 0.0
    until_s: Positive | None = None
    size: float | None = None
    toward_deg: Degrees = 45.0
    device: Device | None = None

    @property
    def to_s(self) -> float:
        """The end of the span; infinity where it has none."""
        return math.inf if self.until_s is None else self.until_s

    @property
    def magnitude(self) -> float:
        """The size of a jump, the kind's own where the config gives none."""
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
    """One kind of fault that comes at random: how long it lasts, uniform between two times, and how large it is."""

    kind: FaultKind
    least_s: Positive = 0.2
    most_s: Positive = 3.0
    size: float | None = None
    device: Device | None = None

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
    """Faults at random times, one after the other, drawn from `plant.seed`: a jump goes to a random side.

    Between two of them are `rest_s` and an exponential time of mean `gap_s`. `device` is that of all kinds that can be
    in one alone and name none: of a boat that has each sensor twice, one set fails.
    """

    kinds: Annotated[tuple[GlitchConfig, ...], Field(min_length=1)] = _GLITCHES
    from_s: NonNegative = 30.0
    until_s: Positive = 3600.0
    rest_s: NonNegative = 5.0
    gap_s: Positive = 10.0
    device: Device | None = None


class ArduPilotJsonConfig(Section):
    """ArduPilot's JSON physics interface: where it listens, and the parts of the reply that are optional there."""

    endpoint: LinkSpecText = "udpin:127.0.0.1:9002"
    windvane: bool = True
    rc_us: Annotated[tuple[ServoUs, ...], Field(max_length=12)] = ()  # a transmitter's sticks; none where empty
    battery_v: Positive | None = None


class Px4HilConfig(Section):
    """PX4's simulator interface. A control in [-1, 1] (from 1, of HIL_ACTUATOR_CONTROLS) drives each motor."""

    endpoint: LinkSpecText = "tcpin:127.0.0.1:4560"
    port_control: Annotated[int, Field(ge=1, le=16)] = 1
    starboard_control: Annotated[int, Field(ge=1, le=16)] = 2
    sensor_hz: Annotated[float, Field(ge=50.0, le=1000.0)] = 250.0
    slow_sensor_hz: Annotated[float, Field(ge=1.0, le=100.0)] = 50.0  # compass and barometer
    speed: NonNegative = 1.0  # times real time; 0: as fast as PX4 answers
    answer_timeout_s: Positive = 0.01  # in lockstep, then the next sample goes out all the same
    altitude_m: float = 0.0
    mag_white_gauss: NonNegative = 0.001
    baro_white_pa: NonNegative = 1.0

    @model_validator(mode="after")
    def _check_controls(self) -> Px4HilConfig:
        if self.port_control == self.starboard_control:
            raise ValueError("port_control and starboard_control must differ")
        return self


class HilConfig(Section):
    """The plant as the physics of an autopilot in the loop.

    An autopilot may drive its outputs anywhere while it boots, so the boat is moored until both have been within
    `neutral_band_us` of neutral for `neutral_first_s` of its time on end; 0: never moored.
    """

    neutral_first_s: NonNegative = 5.0
    neutral_band_us: Annotated[int, Field(ge=0, le=200)] = 20
    ardupilot: ArduPilotJsonConfig = ArduPilotJsonConfig()
    px4: Px4HilConfig = Px4HilConfig()


class PlantLinksConfig(Section):
    autopilot: LinkSpecText = "udpout:127.0.0.1:14560"
    anemometer: LinkSpecText | None = None
    ins: LinkSpecText | None = None
    gnss: LinkSpecText | None = None


class PlantConfig(Section):
    """The boat, weather and sensors that stand in for the real ones."""

    seed: Annotated[int, Field(ge=0)] = 1
    origin_lat_deg: Latitude = 40.4237
    origin_lon_deg: Longitude = -86.9212
    start_n_m: float = -14.0
    start_e_m: float = -3.0
    start_heading_deg: Degrees = 0.0
    step_s: Annotated[float, Field(gt=0.0, le=0.05)] = 0.01
    vessel: VesselConfig | None = None  # vehicle.vessel where absent
    autopilot: Profile = "ardurover"  # what the simulated vehicle has; links.autopilot.profile must be the same
    weather: WeatherConfig = WeatherConfig()
    sensors: SensorsConfig = SensorsConfig()
    frontseat: FrontseatConfig = FrontseatConfig()
    links: PlantLinksConfig = PlantLinksConfig()
    faults: tuple[FaultConfig, ...] = ()
    glitches: GlitchesConfig | None = None
    hil: HilConfig = HilConfig()
