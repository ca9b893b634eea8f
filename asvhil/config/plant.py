"""The simulated boat: weather, sensors, autopilot."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from asvhil.config.base import Degrees, Latitude, LinkSpecText, Longitude, MavlinkId, NonNegative, Positive, Section
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


class WeatherConfig(Section):
    wind: WindConfig = WindConfig()
    current: CurrentConfig = CurrentConfig()


class GnssSensorConfig(Section):
    rate_hz: Positive = 5.0
    slow_bias_m: NonNegative = 1.0
    slow_bias_time_s: Positive = 90.0
    white_m: NonNegative = 0.07
    velocity_white_mps: NonNegative = 0.05


class HeadingSensorConfig(Section):
    white_deg: NonNegative = 0.25
    bias_deg: float = 0.0


class ImuSensorConfig(Section):
    gyro_white_radps: NonNegative = 0.009
    accel_white_mps2: NonNegative = 0.021
    accel_bias_mps2: NonNegative = 0.05


class AnemometerSensorConfig(Section):
    rate_hz: Positive = 5.0
    speed_white_mps: NonNegative = 0.1
    directions: Annotated[int, Field(ge=4, le=360)] = 16
    misalignment_deg: Degrees = 0.0


class SensorsConfig(Section):
    gnss: GnssSensorConfig = GnssSensorConfig()
    heading: HeadingSensorConfig = HeadingSensorConfig()
    imu: ImuSensorConfig = ImuSensorConfig()
    anemometer: AnemometerSensorConfig = AnemometerSensorConfig()


class FrontseatConfig(Section):
    """The simulated autopilot; defaults follow a real ArduRover with its dead zones taken out."""

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


class PlantLinksConfig(Section):
    autopilot: LinkSpecText = "udpout:127.0.0.1:14560"
    anemometer: LinkSpecText | None = None


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
    weather: WeatherConfig = WeatherConfig()
    sensors: SensorsConfig = SensorsConfig()
    frontseat: FrontseatConfig = FrontseatConfig()
    links: PlantLinksConfig = PlantLinksConfig()
