"""The simulated boat's sensors and their errors."""

from __future__ import annotations

from pydantic import Field

from asvhil.config.base import Degrees, NonNegative, Positive, Section


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

    The deviation is added to the true heading, as a compass adjuster counts it, and so is the pull of the motors.
    """

    white_deg: NonNegative = Field(default=0.25, description="White noise.")
    bias_deg: float = Field(default=0.0, description="Coefficient A of the deviation, its constant part.")
    deviation_deg: tuple[float, float, float, float] = Field(
        default=(0.0, 0.0, 0.0, 0.0), description="Coefficients B, C, D, E of a compass."
    )
    motor_deg: tuple[Degrees, Degrees] = Field(
        default=(0.0, 0.0),
        description=(
            "How far the current of the port and of the starboard motor pulls a compass at full command; less in "
            "proportion to the command, and to the same side ahead and astern."
        ),
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
