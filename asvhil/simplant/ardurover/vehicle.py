"""A simulated ArduRover 4.6 boat on the link, sans-IO: streams, commands and parameters, as a real one was measured."""

from __future__ import annotations

from operator import attrgetter
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import FrontseatConfig, GnssSensorConfig, PwmConfig
from asvhil.config.shipped_script import CARD_FOLDER, NAME, shipped_script
from asvhil.geo import LocalFrame
from asvhil.io.mavlink.file_transfer import decode_packet
from asvhil.io.mavlink.frames import MAGIC_V2
from asvhil.simplant.ardurover.file_server import FileServer
from asvhil.simplant.ardurover.rover import Rover
from asvhil.simplant.ardurover.scripting import Scripting, whole_but_damaged
from asvhil.simplant.ardurover.telemetry import FLIGHT_SW_VERSIONS, RoverTelemetry
from asvhil.simplant.boat.sensors import Navigation
from asvhil.simplant.boat.vessel import Vessel
from asvhil.simplant.vehicle.autopilot import (
    ACCEPTED,
    CUSTOM_MODE,
    DENIED,
    FAILED,
    UNSUPPORTED,
    SimulatedAutopilot,
    whole,
)
from asvhil.simplant.vehicle.schedule import Schedule
from asvhil.types import Frame

OVERRIDES_OF = attrgetter(*(f"chan{i}_raw" for i in range(1, 17)))  # the channels that are looked at
MOTOR_EMERGENCY_STOP = 31  # RCn_OPTION
LOW, MIDDLE, HIGH = 0.0, 1.0, 2.0  # positions of a switch
TEMPORARILY_REJECTED = int(dialect.MAV_RESULT_TEMPORARILY_REJECTED)
# What each stream of the legacy REQUEST_DATA_STREAM holds; stream 0 is all of them.
DATA_STREAMS = {
    dialect.MAV_DATA_STREAM_RAW_SENSORS: ("RAW_IMU", "SCALED_IMU2"),
    dialect.MAV_DATA_STREAM_EXTENDED_STATUS: ("SYS_STATUS", "GPS_RAW_INT"),
    dialect.MAV_DATA_STREAM_RC_CHANNELS: ("SERVO_OUTPUT_RAW", "RC_CHANNELS"),
    dialect.MAV_DATA_STREAM_POSITION: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
    dialect.MAV_DATA_STREAM_EXTRA1: ("ATTITUDE",),
    dialect.MAV_DATA_STREAM_EXTRA2: ("VFR_HUD",),
    dialect.MAV_DATA_STREAM_EXTRA3: ("SYSTEM_TIME", "EKF_STATUS_REPORT", "BATTERY_STATUS"),
}


class SimulatedArduRover(SimulatedAutopilot):
    """An autopilot with overrides, servo commands and legacy streams as ArduRover has them."""

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
        self._loop_hz = config.loop_hz
        self.files: dict[str, bytes] = {}  # of the memory card: path to content
        if config.script:
            self.files[f"{CARD_FOLDER}/{NAME}"] = shipped_script().encode("ascii")
        self.file_server = FileServer(self.files, (CARD_FOLDER,))
        self.rover = Rover(config, pwm, t_ns, lambda: truth.ground_velocity_body()[0])
        self._messages = RoverTelemetry(self.rover, nav, truth, origin, gnss, FLIGHT_SW_VERSIONS[config.firmware])
        super().__init__(self.rover, self.rover.parameters, self._messages, config.system_id, t_ns)
        self._handlers |= {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: self._on_heartbeat,
            dialect.MAVLINK_MSG_ID_RC_CHANNELS_OVERRIDE: self._on_override,
            dialect.MAVLINK_MSG_ID_MANUAL_CONTROL: self._on_manual_control,
            dialect.MAVLINK_MSG_ID_SET_MODE: self._on_set_mode,
            dialect.MAVLINK_MSG_ID_REQUEST_DATA_STREAM: self._on_data_stream,
            dialect.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL: self._on_files,
        }
        self._commands[dialect.MAV_CMD_DO_SET_SERVO] = self._do_set_servo
        self._commands[dialect.MAV_CMD_RUN_PREARM_CHECKS] = self._run_checks
        self._commands[dialect.MAV_CMD_DO_AUX_FUNCTION] = self._do_aux_function
        self._commands[dialect.MAV_CMD_SCRIPTING] = self._do_scripting

    def reboot(self, t_ns: int) -> None:
        super().reboot(t_ns)
        self.scripting = Scripting(self.rover, self.files)

    def _before_outputs(self, frames: list[Frame]) -> None:
        """Scripts run beside the main loop; here, after its messages: they get those of others and damaged ones too."""
        self.rover.rc.read()
        for frame in frames if self.scripting.listening else ():
            damaged = whole_but_damaged(frame.data)
            if damaged is not None:
                self.scripting.message(damaged)
        self.scripting.run()
        if self.rover.named_floats:
            self._outbox += [("", self._messages.named_float(name, value)) for name, value in self.rover.named_floats]
            self.rover.named_floats.clear()

    def _dispatch(self, peer: str, data: bytes) -> None:
        if data[0] == MAGIC_V2:
            self.scripting.message(data)
        super()._dispatch(peer, data)

    def _new_schedule(self, boot_ns: int) -> Schedule:
        return Schedule(self._messages.streamed, self._messages.on_request, self._loop_hz, boot_ns)

    def _tell_of_change(self, t_ns: int) -> None:
        self._outbox.append(("", self._messages.heartbeat(t_ns)))

    def _do_set_mode(self, peer: str, m: Any) -> int:
        base_mode, number = whole(m.param1), whole(m.param2)
        if base_mode is None or number is None or not base_mode & CUSTOM_MODE:
            return DENIED
        return ACCEPTED if self.rover.enter_mode(number) else FAILED

    def _do_set_servo(self, peer: str, m: Any) -> int:
        channel, pulse_us = whole(m.param1), whole(m.param2)
        if channel is None or pulse_us is None:
            return FAILED
        return ACCEPTED if self.rover.outputs.set_servo(channel, pulse_us) else FAILED

    def _run_checks(self, peer: str, m: Any) -> int:
        return ACCEPTED if self.rover.tell_checks() else TEMPORARILY_REJECTED

    def _do_aux_function(self, peer: str, m: Any) -> int:
        """Of an auxiliary switch: the emergency stop of the motors alone."""
        if m.param1 != MOTOR_EMERGENCY_STOP or m.param2 not in (LOW, MIDDLE, HIGH):
            return FAILED
        if m.param2 != MIDDLE:
            self.rover.emergency_stop = m.param2 == HIGH
        return ACCEPTED

    def _do_scripting(self, peer: str, m: Any) -> int:
        return ACCEPTED if self.scripting.command(m.param1) else UNSUPPORTED

    def _on_files(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        request = decode_packet(bytes(m.payload))
        if request is None:
            return
        for answer in self.file_server.receive(self.rover.t_ns, sender, request):
            message = dialect.MAVLink_file_transfer_protocol_message(0, *sender, answer.encode())
            self._outbox.append((peer, message))

    def _on_heartbeat(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        self.rover.heartbeat(sender[0])

    def _on_override(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        self.rover.override(sender[0], OVERRIDES_OF(m))

    def _on_manual_control(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        self.rover.manual_control(sender[0], m.target, m.y, m.z)

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
