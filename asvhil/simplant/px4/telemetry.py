"""The messages that a simulated PX4 sends, built from its sensors and its state."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import GnssSensorConfig
from asvhil.geo import LocalFrame
from asvhil.simplant.boat.sensors import Navigation
from asvhil.simplant.boat.vessel import Vessel
from asvhil.simplant.px4.commander import OFFBOARD, STICK_MODES, Px4Vehicle
from asvhil.simplant.vehicle.telemetry import VehicleTelemetry

FLIGHT_SW_VERSIONS = {"1.15": 0x010F04FF, "1.16": 0x011000FF}  # 1.15.4, 1.16.0
CAPABILITIES = (
    dialect.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | dialect.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    | dialect.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    | dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)

# ESTIMATOR_STATUS.flags as recorded, armed. Disarmed, 1.15 has a height above ground too (the ground is taken to be
# here); 1.16, where the vehicle is at rest, has constant position mode instead.
READY = 831  # attitude, velocities, positions and predictions
DROPPED = 165  # attitude, vertical velocity and position, constant position mode
ON_GROUND, AT_REST = dialect.ESTIMATOR_POS_VERT_AGL, dialect.ESTIMATOR_CONST_POS_MODE
BOARD_OUTPUTS, SITL_OUTPUTS = 8, 16  # of the module that drives PWM MAIN
NO_CHANNEL = 65535

# Of MAVLink in "normal" mode; the rest of what is streamed comes at 1 Hz.
RATES_HZ = {
    dialect.MAVLINK_MSG_ID_ATTITUDE: 15.0,
    dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 5.0,
    dialect.MAVLINK_MSG_ID_RC_CHANNELS: 5.0,
    dialect.MAVLINK_MSG_ID_VFR_HUD: 4.0,
    dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 0.5,
    dialect.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
}


class Px4Telemetry(VehicleTelemetry):
    """One builder per message id; a builder gives None without data (yet)."""

    def __init__(
        self,
        vehicle: Px4Vehicle,
        nav: Navigation,
        truth: Vessel,
        origin: LocalFrame,
        gnss: GnssSensorConfig,
        version: str,
    ) -> None:
        super().__init__(vehicle, nav, truth, origin, gnss)
        self._px4 = vehicle
        self._version = FLIGHT_SW_VERSIONS[version]
        d = dialect
        self.streamed = {
            d.MAVLINK_MSG_ID_HEARTBEAT: self.heartbeat,
            d.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
            d.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position_once_valid,
            d.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._local_position,
            d.MAVLINK_MSG_ID_VFR_HUD: self._vfr_hud,
            d.MAVLINK_MSG_ID_SYS_STATUS: self._sys_status,
            d.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._extended_sys_state,
            d.MAVLINK_MSG_ID_ESTIMATOR_STATUS: self._estimator_status,
            d.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: self._servo_output_where_told,
            d.MAVLINK_MSG_ID_RC_CHANNELS: self._rc_channels_where_heard,
            d.MAVLINK_MSG_ID_GPS_RAW_INT: self._gps_raw,
            d.MAVLINK_MSG_ID_SYSTEM_TIME: self._system_time,
            d.MAVLINK_MSG_ID_BATTERY_STATUS: self._battery_status,
        }
        self.on_request = {
            d.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS: self._actuator_output_status,
            d.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: self._attitude_quaternion,
            d.MAVLINK_MSG_ID_HIGHRES_IMU: self._highres_imu,
            d.MAVLINK_MSG_ID_SCALED_IMU: self._scaled_imu,
            d.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self._autopilot_version,
            d.MAVLINK_MSG_ID_HOME_POSITION: self._home_position,
            d.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: self._global_origin,
            d.MAVLINK_MSG_ID_SIM_STATE: self._sim_state,  # the truth, for the summary: no real PX4 sends it
        }

    def heartbeat(self, t_ns: int) -> Any:
        vehicle = self._px4
        d = dialect
        base_mode = d.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        if vehicle.mode in STICK_MODES:
            base_mode |= d.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
        elif vehicle.mode != OFFBOARD:
            base_mode |= (
                d.MAV_MODE_FLAG_AUTO_ENABLED | d.MAV_MODE_FLAG_GUIDED_ENABLED | d.MAV_MODE_FLAG_STABILIZE_ENABLED
            )
        if vehicle.armed:
            base_mode |= d.MAV_MODE_FLAG_SAFETY_ARMED
        if vehicle.terminated:
            state = d.MAV_STATE_FLIGHT_TERMINATION
        elif vehicle.failsafe:
            state = d.MAV_STATE_CRITICAL
        elif vehicle.armed:
            state = d.MAV_STATE_ACTIVE
        else:
            state = d.MAV_STATE_STANDBY if vehicle.checks_pass() else d.MAV_STATE_UNINIT
        return dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_SURFACE_BOAT, dialect.MAV_AUTOPILOT_PX4, base_mode, vehicle.mode, state, 3
        )

    def _specific_force(self, t_ns: int) -> tuple[float, float]:
        """Without what EKF2 has found of the bias."""
        nav = self._nav
        found = self._px4.accelerometer_bias.found(t_ns, armed=self._px4.armed)
        return nav.ax_mps2 - found * nav.accel_bias_mps2[0], nav.ay_mps2 - found * nav.accel_bias_mps2[1]

    def _global_position_once_valid(self, t_ns: int) -> Any:
        return self._global_position(t_ns) if self._px4.ready(t_ns) else None

    def _sys_status(self, t_ns: int) -> Any:
        """The pre-arm checks are reported by their health bit alone; the receiver is present while it is heard."""
        d, vehicle = dialect, self._px4
        sensors = d.MAV_SYS_STATUS_SENSOR_3D_GYRO | d.MAV_SYS_STATUS_SENSOR_3D_ACCEL | d.MAV_SYS_STATUS_SENSOR_GPS
        radio = d.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
        present = sensors | (radio if vehicle.rc.receiver else 0)
        healthy = present | (d.MAV_SYS_STATUS_PREARM_CHECK if vehicle.checks_pass() else 0)
        if not vehicle.has_fix(t_ns):
            healthy &= ~d.MAV_SYS_STATUS_SENSOR_GPS
        mv, centiamperes = self._battery()
        return d.MAVLink_sys_status_message(
            present, sensors | radio, healthy, 0, mv, centiamperes, -1, 0, 0, 0, 0, 0, 0
        )

    def _battery_status(self, t_ns: int) -> Any:
        """As recorded: without a current sensor -1 A, and no charge used; the energy is never told."""
        d, vehicle = dialect, self._px4
        mv, centiamperes = self._battery()
        if vehicle.battery_a is None:
            centiamperes = -100
        used_mah = round(1000.0 * vehicle.used_ah)
        function, kind = d.MAV_BATTERY_FUNCTION_ALL, d.MAV_BATTERY_TYPE_LIPO
        return self._battery_message(function, kind, mv, centiamperes, used_mah, -1)

    def _extended_sys_state(self, t_ns: int) -> Any:
        """A rover is on the ground while it is disarmed."""
        landed = dialect.MAV_LANDED_STATE_IN_AIR if self._px4.armed else dialect.MAV_LANDED_STATE_ON_GROUND
        return dialect.MAVLink_extended_sys_state_message(dialect.MAV_VTOL_STATE_UNDEFINED, landed)

    def _estimator_status(self, t_ns: int) -> Any:
        vehicle = self._px4
        flags = READY if vehicle.ready(t_ns) else DROPPED
        if not vehicle.armed:
            flags |= AT_REST if vehicle.says_rest else ON_GROUND
        return dialect.MAVLink_estimator_status_message(
            self._us(t_ns), flags, 0.05, 0.05, 0.05, 0.1, 0.0, 0.0, self._h_acc_mm * 1e-3, 1.0
        )

    def _servo_output_where_told(self, t_ns: int) -> Any:
        return self._servo_output(t_ns) if self._px4.tells_outputs else None

    def _rc_channels_where_heard(self, t_ns: int) -> Any:
        """None without a transmitter; channels beyond those of the receiver have no value."""
        rc, present = self._px4.rc, 8
        if not rc.receiver:
            return None
        values = [*rc.radio_us[:present], *[NO_CHANNEL] * (len(rc.radio_us) - present)]
        return dialect.MAVLink_rc_channels_message(self._ms(t_ns), present, *values, rc.rssi)

    def _actuator_output_status(self, t_ns: int) -> Any:
        """Pulse widths in microseconds; PX4 fills `active` with the number of outputs."""
        vehicle = self._px4
        if not vehicle.tells_outputs:
            return None
        active = BOARD_OUTPUTS if vehicle.on_board else SITL_OUTPUTS
        values = [float(pulse_us) for pulse_us in vehicle.servo_us[:active]]
        return dialect.MAVLink_actuator_output_status_message(self._us(t_ns), active, [*values, *[0.0] * (32 - active)])

    def _autopilot_version(self, t_ns: int) -> Any:
        none = [0] * 8
        return dialect.MAVLink_autopilot_version_message(
            CAPABILITIES, self._version, 0, 0, 0, none, none, none, 0, 0, 0
        )
