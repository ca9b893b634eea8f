"""The ArduRover profile: what the backseat says to, and understands of, an ArduPilot boat over MAVLink. Sans-IO."""

from __future__ import annotations

from typing import Any

from asvhil.config import AutopilotLinkConfig, PwmConfig
from asvhil.io.mavlink import Parser, decode, dialect, message_id, source
from asvhil.io.mavlink_sensors import MavlinkSensors, raw_fix, scaled_imu
from asvhil.io.streams import StreamKeeper
from asvhil.io.timesync import TimeSync
from asvhil.types import Attitude, Frame, FrontseatStatus, GnssFix, Measurement, TimeOffset

PORT = "autopilot"
RELEASE_CHANNEL = 0
IGNORE_CHANNEL = 65535
HEARTBEAT_NS = 1_000_000_000
REQUEST_NS = 1_000_000_000
EKF_HORIZONTAL_POSITION = dialect.EKF_POS_HORIZ_ABS
EKF_CONSTANT_POSITION = dialect.EKF_CONST_POS_MODE

MODES = {
    "MANUAL": 0,
    "ACRO": 1,
    "STEERING": 3,
    "HOLD": 4,
    "LOITER": 5,
    "FOLLOW": 6,
    "SIMPLE": 7,
    "DOCK": 8,
    "CIRCLE": 9,
    "AUTO": 10,
    "RTL": 11,
    "SMART_RTL": 12,
    "GUIDED": 15,
    "INITIALISING": 16,
}
_MODE_NAMES = {number: name for name, number in MODES.items()}


class ArduRoverLink:
    """One MAVLink conversation with the autopilot: heartbeat, streams, overrides out; measurements in."""

    def __init__(self, config: AutopilotLinkConfig, pwm: PwmConfig) -> None:
        self._config = config
        self._pwm = pwm
        self._parser = Parser()
        self._own = dialect.MAVLink(None, srcSystem=config.system_id, srcComponent=config.component_id)
        self._overrider = dialect.MAVLink(None, srcSystem=config.override_system_id, srcComponent=config.component_id)
        self._streams = StreamKeeper(config.streams_hz)
        self._heartbeat_ns: int | None = None
        self._timesync = TimeSync()
        self._autopilot_component_id: int | None = None
        self._request_ns: dict[str, int] = {}
        self._boot_ms = -1
        self._gnss_time_us = -1
        self._h_acc_m = 0.0
        self._armed = False
        self._mode = ""
        self._ready = False
        self._rc_us: tuple[int, ...] = ()
        self._outputs_us: tuple[int, ...] = ()
        self.autopilot_heartbeat_ns: int | None = None
        self.impossible = 0
        self.reboots = 0
        self._handlers = {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: self._on_heartbeat,
            dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT: self._on_ekf_status,
            dialect.MAVLINK_MSG_ID_RC_CHANNELS: self._on_rc_channels,
            dialect.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: self._on_servo_output,
            dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._on_global_position,
            dialect.MAVLINK_MSG_ID_GPS_RAW_INT: self._on_gps_raw,
            dialect.MAVLINK_MSG_ID_ATTITUDE: self._on_attitude,
            dialect.MAVLINK_MSG_ID_RAW_IMU: scaled_imu,
            dialect.MAVLINK_MSG_ID_SYSTEM_TIME: self._on_system_time,
            dialect.MAVLINK_MSG_ID_COMMAND_ACK: self._on_command_ack,
            dialect.MAVLINK_MSG_ID_TIMESYNC: self._on_timesync,
            **MavlinkSensors(lambda: self._ready).handlers,
        }
        other = {"GLOBAL_POSITION_INT", "GPS_RAW_INT"} - {config.position_source}
        self._not_the_position = other.pop()

    # --- in ------------------------------------------------------------------------------------------------

    def decode(self, frame: Frame) -> list[Measurement]:
        """As `read`, with positions of the configured source alone, and without names."""
        return [measurement for name, measurement in self.read(frame) if name != self._not_the_position]

    def read(self, frame: Frame) -> list[tuple[str, Measurement]]:
        """(message name, measurement) of all in one frame of the autopilot's port; others and bad bytes give none."""
        found: list[tuple[str, Measurement]] = []
        for data in self._parser.feed(frame.peer, frame.data):
            system_id, component_id = source(data)
            if system_id != self._config.autopilot_system_id or component_id == self._config.component_id:
                continue
            msg_id = message_id(data)
            self._streams.seen(msg_id)
            handler = self._handlers.get(msg_id)
            if handler is None:
                continue
            message = decode(data)
            if message is None:
                self.impossible += 1
                continue
            measurement = handler(frame.t_ns, message)
            if measurement is not None:
                found.append((message.msgname, measurement))
        return found

    @property
    def clock(self) -> TimeOffset | None:
        """How far the autopilot's clock is from ours."""
        return self._timesync.offset

    def counters(self) -> tuple[tuple[str, int], ...]:
        """Cumulative counts of what came in and what was dropped."""
        return (
            ("autopilot.frames", self._parser.total("frames")),
            ("autopilot.bad_crc", self._parser.total("bad_crc")),
            ("autopilot.garbage_bytes", self._parser.total("garbage_bytes")),
            ("autopilot.unknown", self._parser.total("unknown")),
            ("autopilot.impossible", self.impossible),
            ("autopilot.reboots", self.reboots),
            ("autopilot.timesync_rejected", self._timesync.rejected),
            ("autopilot.timesync_steps", self._timesync.steps),
            ("autopilot.stream_requests", self._streams.requests),
            ("autopilot.streams_denied", len(self._streams.denied)),
        )

    def _status(self, t_ns: int) -> FrontseatStatus:
        return FrontseatStatus(
            t_ns=t_ns,
            armed=self._armed,
            mode=self._mode,
            ready=self._ready,
            rc_us=self._rc_us,
            outputs_us=self._outputs_us,
        )

    def _on_heartbeat(self, t_ns: int, m: Any) -> Measurement | None:
        if m.autopilot == dialect.MAV_AUTOPILOT_INVALID:
            return None  # another component of the vehicle, not its autopilot
        self.autopilot_heartbeat_ns = t_ns
        self._autopilot_component_id = m.get_srcComponent()
        self._armed = bool(m.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
        self._mode = _MODE_NAMES.get(m.custom_mode, f"MODE_{m.custom_mode}")
        return self._status(t_ns)

    def _on_ekf_status(self, t_ns: int, m: Any) -> Measurement:
        self._ready = bool(m.flags & EKF_HORIZONTAL_POSITION) and not m.flags & EKF_CONSTANT_POSITION
        return self._status(t_ns)

    def _on_rc_channels(self, t_ns: int, m: Any) -> Measurement:
        values = (getattr(m, f"chan{i}_raw") for i in range(1, 19))
        self._rc_us = tuple(0 if value == IGNORE_CHANNEL else value for value in values)
        return self._status(t_ns)

    def _on_servo_output(self, t_ns: int, m: Any) -> Measurement | None:
        if m.port != 0:
            return None
        self._outputs_us = tuple(getattr(m, f"servo{i}_raw") for i in range(1, 17))
        return self._status(t_ns)

    def _on_global_position(self, t_ns: int, m: Any) -> Measurement | None:
        if not self._ready:
            return None
        return GnssFix(
            t_ns=t_ns,
            lat_deg=m.lat * 1e-7,
            lon_deg=m.lon * 1e-7,
            vn_mps=m.vx * 0.01,
            ve_mps=m.vy * 0.01,
            h_acc_m=self._h_acc_m,
        )

    def _on_gps_raw(self, t_ns: int, m: Any) -> Measurement | None:
        self._h_acc_m = m.h_acc * 1e-3
        if m.fix_type < dialect.GPS_FIX_TYPE_3D_FIX:
            return None
        if m.time_usec == self._gnss_time_us:
            return None  # the same fix, streamed again
        self._gnss_time_us = m.time_usec
        return raw_fix(t_ns, m)

    def _on_attitude(self, t_ns: int, m: Any) -> Measurement | None:
        self._note_boot_time(m.time_boot_ms)
        if not self._ready:
            return None
        return Attitude(t_ns=t_ns, psi_rad=m.yaw, r_radps=m.yawspeed)

    def _on_system_time(self, t_ns: int, m: Any) -> None:
        self._note_boot_time(m.time_boot_ms)

    def _on_command_ack(self, t_ns: int, m: Any) -> None:
        if m.command == dialect.MAV_CMD_SET_MESSAGE_INTERVAL:
            self._streams.acknowledged(m.result)

    def _on_timesync(self, t_ns: int, m: Any) -> None:
        # Other components answer our broadcast as well, by clocks of their own.
        if m.tc1 == 0 or m.get_srcComponent() == self._autopilot_component_id:
            self._timesync.receive(t_ns, m.tc1, m.ts1)

    def _note_boot_time(self, boot_ms: int) -> None:
        """A boot clock that runs back by a second or more is a reboot: rates and readiness are gone."""
        if boot_ms + 1000 < self._boot_ms:
            self.reboots += 1
            self._ready = False
            self._streams.restart()
            self._timesync.restart()
        self._boot_ms = boot_ms

    # --- out -----------------------------------------------------------------------------------------------

    def poll(self, t_ns: int) -> list[Frame]:
        """What is due: heartbeat and time sync each second, stream requests once the autopilot is heard."""
        due: list[Any] = []
        if self._heartbeat_ns is None or t_ns - self._heartbeat_ns >= HEARTBEAT_NS:
            self._heartbeat_ns = t_ns
            due.append(
                dialect.MAVLink_heartbeat_message(
                    dialect.MAV_TYPE_ONBOARD_CONTROLLER,
                    dialect.MAV_AUTOPILOT_INVALID,
                    0,
                    0,
                    dialect.MAV_STATE_ACTIVE,
                    3,
                )
            )
            if self.autopilot_heartbeat_ns is not None:
                due.append(dialect.MAVLink_timesync_message(*self._timesync.request(t_ns)))
        due += [dialect.MAVLink_timesync_message(*answer) for answer in self._timesync.answers(t_ns)]
        if self.autopilot_heartbeat_ns is not None:
            request = self._streams.next_request(t_ns)
            if request is not None:
                msg_id, interval_us = request
                due.append(self._command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, msg_id, interval_us))
        return [self._pack(t_ns, message) for message in due]

    def override(self, t_ns: int, port_us: int, starboard_us: int) -> Frame:
        """RC_CHANNELS_OVERRIDE with the two motor pulses; every other channel is left to the pilot."""
        channels = [IGNORE_CHANNEL] * 8
        channels[self._pwm.port_channel - 1] = port_us
        channels[self._pwm.starboard_channel - 1] = starboard_us
        message = dialect.MAVLink_rc_channels_override_message(self._config.autopilot_system_id, 1, *channels)
        return Frame(t_ns=t_ns, port=PORT, data=bytes(message.pack(self._overrider)))

    def release(self, t_ns: int) -> Frame:
        """RC_CHANNELS_OVERRIDE that gives both motor channels back to the pilot."""
        return self.override(t_ns, RELEASE_CHANNEL, RELEASE_CHANNEL)

    def request_mode(self, t_ns: int, mode: str) -> list[Frame]:
        """DO_SET_MODE, at most once a second."""
        return self._request(t_ns, dialect.MAV_CMD_DO_SET_MODE, 1.0, float(MODES[mode]))

    def request_arming(self, t_ns: int) -> list[Frame]:
        """COMPONENT_ARM_DISARM with all checks, at most once a second."""
        return self._request(t_ns, dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, 0.0)

    def _request(self, t_ns: int, command: int, param1: float, param2: float) -> list[Frame]:
        last_ns = self._request_ns.get(str(command))
        if last_ns is not None and t_ns - last_ns < REQUEST_NS:
            return []
        self._request_ns[str(command)] = t_ns
        return [self._pack(t_ns, self._command(command, param1, param2))]

    def _command(self, command: int, param1: float, param2: float) -> Any:
        return dialect.MAVLink_command_long_message(
            self._config.autopilot_system_id, 1, command, 0, param1, param2, 0, 0, 0, 0, 0
        )

    def _pack(self, t_ns: int, message: Any) -> Frame:
        return Frame(t_ns=t_ns, port=PORT, data=bytes(message.pack(self._own)))
