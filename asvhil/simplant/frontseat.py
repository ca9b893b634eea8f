"""A simulated ArduRover 4.6 boat on the link, sans-IO: streams, commands and parameters, as a real one was measured."""

from __future__ import annotations

from collections import deque
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import FrontseatConfig, GnssSensorConfig, PwmConfig
from asvhil.geo import LocalFrame
from asvhil.io.mavlink import Parser, decode, message_id, source
from asvhil.simplant.rc import CHANNELS
from asvhil.simplant.rover import Rover
from asvhil.simplant.schedule import Schedule
from asvhil.simplant.sensors import Navigation
from asvhil.simplant.telemetry import FLIGHT_SW_VERSIONS, Telemetry
from asvhil.simplant.vessel import Vessel
from asvhil.types import Frame

PORT = "autopilot"
COMPONENT_ID = 1
FORCE_ARM = (2989.0, 21196.0)  # ArduPilot's magic number and MAVLink's
TIMESYNC_NS = 10_000_000_000
INBOX_LIMIT = 1000

ACCEPTED = int(dialect.MAV_RESULT_ACCEPTED)
DENIED = int(dialect.MAV_RESULT_DENIED)
FAILED = int(dialect.MAV_RESULT_FAILED)
UNSUPPORTED = int(dialect.MAV_RESULT_UNSUPPORTED)
CUSTOM_MODE = int(dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)

# What each stream of the legacy REQUEST_DATA_STREAM holds; stream 0 is all of them.
DATA_STREAMS = {
    dialect.MAV_DATA_STREAM_RAW_SENSORS: ("RAW_IMU", "SCALED_IMU2"),
    dialect.MAV_DATA_STREAM_EXTENDED_STATUS: ("SYS_STATUS", "GPS_RAW_INT"),
    dialect.MAV_DATA_STREAM_RC_CHANNELS: ("SERVO_OUTPUT_RAW", "RC_CHANNELS"),
    dialect.MAV_DATA_STREAM_POSITION: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
    dialect.MAV_DATA_STREAM_EXTRA1: ("ATTITUDE",),
    dialect.MAV_DATA_STREAM_EXTRA2: ("VFR_HUD",),
    dialect.MAV_DATA_STREAM_EXTRA3: ("SYSTEM_TIME", "EKF_STATUS_REPORT"),
}


class SimulatedArduRover:
    """The autopilot: bytes in by `receive`, one main loop by `loop`, bytes out; `outputs_us` drives the motors.

    It acts only at its loops, so a command waits for the next one, as on the real vehicle. Answers go to the peer
    that asked, streams and texts to all (an empty peer).
    """

    def __init__(
        self,
        config: FrontseatConfig,
        pwm: PwmConfig,
        gnss: GnssSensorConfig,
        origin: LocalFrame,
        nav: Navigation,
        truth: Vessel,
        t_ns: int,
    ) -> None:
        self._system_id = config.system_id
        self._loop_hz = config.loop_hz
        self._mav = dialect.MAVLink(None, srcSystem=config.system_id, srcComponent=COMPONENT_ID)
        self.rover = Rover(config, pwm, t_ns)
        self._telemetry = Telemetry(self.rover, nav, truth, origin, gnss, FLIGHT_SW_VERSIONS[config.firmware])
        self._inbox: deque[Frame] = deque()
        self._outbox: list[tuple[str, Any]] = []
        self.impossible = 0  # frames with a good checksum and content that cannot be
        self.dropped = 0  # chunks beyond the inbox
        self._handlers = {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: self._on_heartbeat,
            dialect.MAVLINK_MSG_ID_RC_CHANNELS_OVERRIDE: self._on_override,
            dialect.MAVLINK_MSG_ID_MANUAL_CONTROL: self._on_manual_control,
            dialect.MAVLINK_MSG_ID_COMMAND_LONG: self._on_command,
            dialect.MAVLINK_MSG_ID_COMMAND_INT: self._on_command,
            dialect.MAVLINK_MSG_ID_SET_MODE: self._on_set_mode,
            dialect.MAVLINK_MSG_ID_REQUEST_DATA_STREAM: self._on_data_stream,
            dialect.MAVLINK_MSG_ID_TIMESYNC: self._on_timesync,
            dialect.MAVLINK_MSG_ID_PARAM_REQUEST_READ: self._on_param_read,
            dialect.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: self._on_param_list,
            dialect.MAVLINK_MSG_ID_PARAM_SET: self._on_param_set,
        }
        self._commands = {
            dialect.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_message_interval,
            dialect.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_message_interval,
            dialect.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._request_capabilities,
            dialect.MAV_CMD_DO_SET_MODE: self._do_set_mode,
            dialect.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            dialect.MAV_CMD_DO_SET_SERVO: self._do_set_servo,
            dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: self._reboot_vehicle,
        }
        self.reboot(t_ns)

    def reboot(self, t_ns: int) -> None:
        """Power on: parameters and the pilot's sticks stay, stream rates, mode and arming are forgotten."""
        self.rover.restart(t_ns)
        boot_ns = self.rover.boot_ns
        self._schedule = Schedule(self._telemetry.streamed, self._telemetry.on_request, self._loop_hz, boot_ns)
        self._parser = Parser()
        self._outbox.clear()
        self._rebooting = False
        self._timesync_ns = boot_ns + TIMESYNC_NS

    # --- the pilot, who stands beside the link ---------------------------------------------------------------

    def set_sticks(self, pulses_us: dict[int, int]) -> None:
        """The pilot's transmitter: channel (from 1) to pulse width (us)."""
        for channel, pulse_us in pulses_us.items():
            self.rover.rc.set_stick(channel, pulse_us)

    def set_receiver(self, present: bool) -> None:
        """The pilot's transmitter comes into, or goes out of, range."""
        self.rover.rc.set_receiver(self.rover.t_ns, present)

    def set_mode(self, number: int) -> bool:
        """The pilot's mode switch; False where the vehicle refuses."""
        return self.rover.enter_mode(number)

    def arm(self, on: bool) -> bool:
        """The pilot's arming switch; False where the vehicle refuses."""
        return self.rover.arm() if on else self.rover.disarm()

    @property
    def outputs_us(self) -> tuple[int, int]:
        """Pulse widths at the port and the starboard motor; 0 before the vehicle has booted."""
        return self.rover.outputs_us

    # --- in and out ------------------------------------------------------------------------------------------

    def receive(self, frame: Frame) -> None:
        """Bytes from a peer, acted upon at the first loop that is not before their time."""
        if len(self._inbox) < INBOX_LIMIT:
            self._inbox.append(frame)
        else:
            self.dropped += 1

    def loop(self, t_ns: int) -> list[Frame]:
        """One main loop, after the sensors have been sampled; what is sent now, in order."""
        if t_ns < self.rover.boot_ns:
            self._take_inbox(t_ns)  # nobody listens yet
            return []
        rover = self.rover
        rover.begin(t_ns)
        for frame in self._take_inbox(t_ns):
            for data in self._parser.feed(frame.peer, frame.data):
                self._dispatch(frame.peer, data)
        rover.end()
        due = self._schedule.due(t_ns)
        for msg_id in due:
            self._send_message("", msg_id)
        if rover.changed and dialect.MAVLINK_MSG_ID_HEARTBEAT not in due:
            self._outbox.append(("", self._telemetry.heartbeat(t_ns)))
        rover.changed = False
        for severity, text in rover.texts:
            self._outbox.append(("", dialect.MAVLink_statustext_message(severity, text.encode()[:50])))
        rover.texts.clear()
        if t_ns >= self._timesync_ns:
            self._timesync_ns += TIMESYNC_NS
            self._outbox.append(("", dialect.MAVLink_timesync_message(0, t_ns - rover.power_on_ns)))
        frames = self._flush(t_ns)
        if self._rebooting:
            self.reboot(t_ns)
        return frames

    def _take_inbox(self, t_ns: int) -> list[Frame]:
        frames = []
        while self._inbox and self._inbox[0].t_ns <= t_ns:
            frames.append(self._inbox.popleft())
        return frames

    def _flush(self, t_ns: int) -> list[Frame]:
        frames = []
        mav = self._mav
        for peer, message in self._outbox:
            frames.append(Frame(t_ns=t_ns, port=PORT, data=message.pack(mav), peer=peer))
            mav.seq = (mav.seq + 1) % 256
        self._outbox.clear()
        return frames

    def _send_message(self, peer: str, msg_id: int) -> None:
        message = self._telemetry.build(msg_id, self.rover.t_ns)
        if message is not None:
            self._outbox.append((peer, message))

    def _dispatch(self, peer: str, data: bytes) -> None:
        handler = self._handlers.get(message_id(data))
        sender = source(data)
        if handler is None or sender == (self._system_id, COMPONENT_ID):
            return
        message = decode(data)
        if message is None:
            self.impossible += 1
            return
        to_system = getattr(message, "target_system", getattr(message, "target", 0))
        to_component = getattr(message, "target_component", 0)
        if to_system in (0, self._system_id) and to_component in (0, COMPONENT_ID):
            handler(peer, sender, message)

    # --- commands --------------------------------------------------------------------------------------------

    def _acknowledge(self, peer: str, sender: tuple[int, int], command: int, result: int) -> None:
        self._outbox.append((peer, dialect.MAVLink_command_ack_message(command, result, 0, 0, *sender)))

    def _on_command(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        handler = self._commands.get(m.command)
        before = len(self._outbox)
        result = UNSUPPORTED if handler is None else handler(peer, m)
        answers = self._outbox[before:]
        del self._outbox[before:]
        self._acknowledge(peer, sender, m.command, result)
        self._outbox += answers  # the acknowledgement comes before what was asked for

    def _set_message_interval(self, peer: str, m: Any) -> int:
        msg_id = _whole(m.param1)
        return DENIED if msg_id is None else self._schedule.set_interval(self.rover.t_ns, msg_id, m.param2)

    def _get_message_interval(self, peer: str, m: Any) -> int:
        msg_id = _whole(m.param1)
        interval_us = None if msg_id is None else self._schedule.interval_us(msg_id)
        if interval_us is None:
            return FAILED
        self._outbox.append((peer, dialect.MAVLink_message_interval_message(msg_id, min(interval_us, 2**31 - 1))))
        return ACCEPTED

    def _request_message(self, peer: str, m: Any) -> int:
        msg_id = _whole(m.param1)
        if msg_id is None or msg_id not in self._telemetry:
            return FAILED
        self._send_message(peer, msg_id)
        return ACCEPTED

    def _request_capabilities(self, peer: str, m: Any) -> int:
        self._send_message(peer, dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        return ACCEPTED

    def _do_set_mode(self, peer: str, m: Any) -> int:
        base_mode, number = _whole(m.param1), _whole(m.param2)
        if base_mode is None or number is None or not base_mode & CUSTOM_MODE:
            return DENIED
        return ACCEPTED if self.rover.enter_mode(number) else FAILED

    def _arm_disarm(self, peer: str, m: Any) -> int:
        if m.param1 == 1.0:
            return ACCEPTED if self.rover.arm(force=m.param2 in FORCE_ARM) else FAILED
        if m.param1 == 0.0:
            return ACCEPTED if self.rover.disarm() else FAILED
        return UNSUPPORTED

    def _do_set_servo(self, peer: str, m: Any) -> int:
        channel, pulse_us = _whole(m.param1), _whole(m.param2)
        if channel is None or pulse_us is None:
            return FAILED
        return ACCEPTED if self.rover.set_servo(channel, pulse_us) else FAILED

    def _reboot_vehicle(self, peer: str, m: Any) -> int:
        if m.param1 != 1.0 or self.rover.armed:
            return FAILED
        self._rebooting = True
        return ACCEPTED

    # --- other messages --------------------------------------------------------------------------------------

    def _on_heartbeat(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        self.rover.heartbeat(sender[0])

    def _on_override(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        self.rover.override(sender[0], [getattr(m, f"chan{i}_raw") for i in range(1, CHANNELS + 1)])

    def _on_manual_control(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        self.rover.manual_control(sender[0], m.y, m.z)

    def _on_set_mode(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        result = DENIED
        if m.base_mode & CUSTOM_MODE:
            result = ACCEPTED if self.rover.enter_mode(m.custom_mode) else FAILED
        # ArduPilot acknowledges this message as if it were a command with the message's number.
        self._acknowledge(peer, sender, dialect.MAVLINK_MSG_ID_SET_MODE, result)

    def _on_data_stream(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        rate_hz = float(m.req_message_rate) if m.start_stop else 0.0
        for stream, names in DATA_STREAMS.items():
            if m.req_stream_id in (dialect.MAV_DATA_STREAM_ALL, stream):
                for name in names:
                    self._schedule.set_rate(self.rover.t_ns, getattr(dialect, f"MAVLINK_MSG_ID_{name}"), rate_hz)

    def _on_timesync(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        if m.tc1 == 0:
            since_power_on_ns = self.rover.t_ns - self.rover.power_on_ns
            self._outbox.append((peer, dialect.MAVLink_timesync_message(since_power_on_ns, m.ts1)))

    def _on_param_read(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        name = self.rover.parameters.find(m.param_id, m.param_index)
        if name is not None:
            self._outbox.append((peer, self.rover.parameters.message(name)))

    def _on_param_list(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        for name in self.rover.parameters.names:
            self._outbox.append((peer, self.rover.parameters.message(name)))

    def _on_param_set(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        if self.rover.parameters.set(m.param_id, m.param_value):
            self._outbox.append(("", self.rover.parameters.message(m.param_id, changed=True)))


def _whole(value: float) -> int | None:
    """A float parameter as an integer; None where it is not a number (which compares false) or too large."""
    return int(value) if abs(value) < 2.0**31 else None
