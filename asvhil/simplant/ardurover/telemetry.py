"""The messages that a simulated ArduRover sends, built from its sensors and its state."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import GnssSensorConfig
from asvhil.geo import LocalFrame
from asvhil.simplant.ardurover.rover import MODE_HOLD, MODE_INITIALISING, Rover
from asvhil.simplant.boat.sensors import Navigation
from asvhil.simplant.boat.vessel import Vessel
from asvhil.simplant.vehicle.telemetry import VehicleTelemetry

EKF_UNINITIALISED = 1024  # as recorded in the first seconds of a real vehicle
EKF_ALIGNED_NO_POSITION = 167  # as recorded from then until the position is used
EKF_READY = 831  # as recorded afterwards: horizontal position absolute, constant position mode left
EKF_FORGETS_NS = 10_000_000_000  # without a fix, after which EKF3 goes back to it
EKF_ALIGNED_AFTER = 0.15  # share of the time to readiness after which the recorded filter was aligned
FLIGHT_SW_VERSIONS = {"4.6": 0x040603FF, "4.7": 0x040700FF}  # 4.6.3 and 4.7.0, official releases
PILOT_MODES = frozenset({0, 1, 3, 7, MODE_INITIALISING})  # sticks have a say: manual, acro, steering, simple
CAPABILITIES = (
    dialect.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | dialect.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | dialect.MAV_PROTOCOL_CAPABILITY_FTP
    | dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)


class RoverTelemetry(VehicleTelemetry):
    """What an ArduRover sends: one builder per message id; one gives None where there is nothing to say (yet)."""

    def __init__(
        self,
        rover: Rover,
        nav: Navigation,
        truth: Vessel,
        origin: LocalFrame,
        gnss: GnssSensorConfig,
        flight_sw_version: int,
    ) -> None:
        super().__init__(rover, nav, truth, origin, gnss)
        self._rover = rover
        self._flight_sw_version = flight_sw_version
        d = dialect
        self.streamed = {
            d.MAVLINK_MSG_ID_HEARTBEAT: self.heartbeat,
            d.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
            d.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position,
            d.MAVLINK_MSG_ID_VFR_HUD: self._vfr_hud,
            d.MAVLINK_MSG_ID_SYS_STATUS: self._sys_status,
            d.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: self._servo_output,
            d.MAVLINK_MSG_ID_RC_CHANNELS: self._rc_channels,
            d.MAVLINK_MSG_ID_RAW_IMU: self._raw_imu,
            d.MAVLINK_MSG_ID_SCALED_IMU2: self._scaled_imu2,
            d.MAVLINK_MSG_ID_GPS_RAW_INT: self._gps_raw,
            d.MAVLINK_MSG_ID_SYSTEM_TIME: self._system_time,
            d.MAVLINK_MSG_ID_BATTERY_STATUS: self._battery_status,
            d.MAVLINK_MSG_ID_EKF_STATUS_REPORT: self._ekf_status,
            d.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._local_position,
        }
        self.on_request = {
            d.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: self._attitude_quaternion,
            d.MAVLINK_MSG_ID_SCALED_IMU: self._scaled_imu,
            d.MAVLINK_MSG_ID_HIGHRES_IMU: self._highres_imu,
            d.MAVLINK_MSG_ID_SIM_STATE: self._sim_state,
            d.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self._autopilot_version,
            d.MAVLINK_MSG_ID_HOME_POSITION: self._home_position,
            d.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: self._global_origin,
            # Accepted by the real one too, and then not sent: it has no second receiver and no wind vane configured.
            d.MAVLINK_MSG_ID_WIND: self._nothing,
            d.MAVLINK_MSG_ID_GPS2_RAW: self._nothing,
        }

    def heartbeat(self, t_ns: int) -> Any:
        rover = self._rover
        base_mode = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        if rover.mode in PILOT_MODES:
            base_mode |= dialect.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
        if rover.armed:
            base_mode |= dialect.MAV_MODE_FLAG_SAFETY_ARMED
        if rover.radio_failsafe:
            status = dialect.MAV_STATE_CRITICAL
        elif rover.mode == MODE_INITIALISING:
            status = dialect.MAV_STATE_CALIBRATING
        else:
            status = dialect.MAV_STATE_STANDBY if rover.mode == MODE_HOLD else dialect.MAV_STATE_ACTIVE
        return dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_SURFACE_BOAT, dialect.MAV_AUTOPILOT_ARDUPILOTMEGA, base_mode, rover.mode, status, 3
        )

    def named_float(self, name: str, value: float) -> Any:
        """NAMED_VALUE_FLOAT of a script."""
        milliseconds = (self._rover.t_ns - self._rover.power_on_ns) // 1_000_000
        return dialect.MAVLink_named_value_float_message(milliseconds, name.encode("ascii", "replace"), value)

    def _ekf_status(self, t_ns: int) -> Any:
        rover = self._rover
        if rover.ready(t_ns) and t_ns - self._nav.fix_ns > EKF_FORGETS_NS:
            flags = EKF_ALIGNED_NO_POSITION
        elif rover.ready(t_ns):
            flags = EKF_READY
        else:
            span_ns = rover.ready_ns - rover.power_on_ns
            aligned = t_ns - rover.power_on_ns >= EKF_ALIGNED_AFTER * span_ns
            flags = EKF_ALIGNED_NO_POSITION if aligned else EKF_UNINITIALISED
        return dialect.MAVLink_ekf_status_report_message(flags, 0.003, 0.001, 0.03, 0.008, 0.0, 0.0)

    def _sys_status(self, t_ns: int) -> Any:
        d, rover = dialect, self._rover
        sensors = d.MAV_SYS_STATUS_SENSOR_3D_GYRO | d.MAV_SYS_STATUS_SENSOR_3D_ACCEL | d.MAV_SYS_STATUS_SENSOR_GPS
        healthy = sensors if rover.ready(t_ns) else sensors & ~d.MAV_SYS_STATUS_SENSOR_GPS
        enabled = sensors if rover.safety_on else sensors | d.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
        present = sensors | d.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS | d.MAV_SYS_STATUS_PREARM_CHECK
        if not rover.checks_skipped:
            enabled |= d.MAV_SYS_STATUS_PREARM_CHECK
            healthy |= d.MAV_SYS_STATUS_PREARM_CHECK if rover.armed or rover.checks_pass else 0
        if rover.rc.seen:  # overrides count
            present |= d.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
            enabled |= d.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
            healthy |= 0 if rover.radio_silent else d.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
        mv, centiamperes = self._battery()
        return d.MAVLink_sys_status_message(present, enabled, healthy, 0, mv, centiamperes, -1, 0, 0, 0, 0, 0, 0)

    def _autopilot_version(self, t_ns: int) -> Any:
        none = [0] * 8
        return dialect.MAVLink_autopilot_version_message(
            CAPABILITIES, self._flight_sw_version, 0, 0, 0, none, none, none, 0, 0, 0
        )
