"""Base class of simulated autopilots on the link, sans-IO: peers, streams, commands, time and parameters."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config.ports import AUTOPILOT
from asvhil.io.mavlink.frames import Parser, decode, message_id, pack, source
from asvhil.io.mavlink.texts import Texts
from asvhil.simplant.vehicle.parameter_table import ParameterTable
from asvhil.simplant.vehicle.rc import RcInputs
from asvhil.simplant.vehicle.schedule import Schedule
from asvhil.types import Frame

COMPONENT_ID = 1
FORCE_ARM = (2989.0, 21196.0)  # ArduPilot's magic number and MAVLink's
INBOX_LIMIT = 1000

ACCEPTED = int(dialect.MAV_RESULT_ACCEPTED)
DENIED = int(dialect.MAV_RESULT_DENIED)
FAILED = int(dialect.MAV_RESULT_FAILED)
UNSUPPORTED = int(dialect.MAV_RESULT_UNSUPPORTED)
CUSTOM_MODE = int(dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)


class Vehicle(Protocol):
    """State and rules of a vehicle, without bytes. `texts` and `changed` collect what is to be sent to the stations."""

    t_ns: int
    power_on_ns: int
    boot_ns: int
    armed: bool
    changed: bool
    texts: list[tuple[int, str]]
    servo_us: list[int]
    battery_v: float
    battery_a: float | None
    used_ah: float
    used_wh: float

    @property
    def rc(self) -> RcInputs: ...

    @property
    def outputs_us(self) -> tuple[int, int]: ...

    def ready(self, t_ns: int) -> bool: ...

    def has_fix(self, t_ns: int) -> bool: ...

    def restart(self, t_ns: int) -> None: ...

    def begin(self, t_ns: int) -> None: ...

    def end(self) -> None: ...

    def enter_mode(self, number: int) -> bool: ...

    def arm(self, *, force: bool = False) -> bool: ...

    def disarm(self) -> bool: ...


class Messages(Protocol):
    """Builders of messages by id; None of one that has no data (yet)."""

    def build(self, msg_id: int, t_ns: int) -> Any | None: ...

    def heartbeat(self, t_ns: int) -> Any: ...

    def __contains__(self, msg_id: int) -> bool: ...


class SimulatedAutopilot(ABC):
    """The autopilot: bytes in by `receive`, one main loop by `loop`, bytes out; `outputs_us` drives the motors.

    It acts only in its loops, so a command waits for the next one, as on the real vehicle. Answers go to the peer
    that asked, streams and texts to all (an empty peer).
    """

    timesync_every_ns = 10_000_000_000

    def __init__(
        self, vehicle: Vehicle, parameters: ParameterTable, telemetry: Messages, system_id: int, t_ns: int
    ) -> None:
        self._vehicle, self._parameters, self._telemetry = vehicle, parameters, telemetry
        self._system_id = system_id
        self._mav = dialect.MAVLink(None, srcSystem=system_id, srcComponent=COMPONENT_ID)
        self._inbox: deque[Frame] = deque()
        self._texts = Texts()
        self._outbox: list[tuple[str, Any]] = []
        self.impossible = 0  # frames with a good checksum and impossible content
        self.dropped = 0  # chunks beyond the inbox
        self._handlers: dict[int, Callable[[str, tuple[int, int], Any], None]] = {
            dialect.MAVLINK_MSG_ID_COMMAND_LONG: self._on_command,
            dialect.MAVLINK_MSG_ID_COMMAND_INT: self._on_command,
            dialect.MAVLINK_MSG_ID_TIMESYNC: self._on_timesync,
            dialect.MAVLINK_MSG_ID_PARAM_REQUEST_READ: self._on_param_read,
            dialect.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: self._on_param_list,
            dialect.MAVLINK_MSG_ID_PARAM_SET: self._on_param_set,
        }
        self._commands: dict[int, Callable[[str, Any], int]] = {
            dialect.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_message_interval,
            dialect.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_message_interval,
            dialect.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._request_capabilities,
            dialect.MAV_CMD_DO_SET_MODE: self._do_set_mode,
            dialect.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: self._reboot_vehicle,
        }
        self.reboot(t_ns)

    @abstractmethod
    def _new_schedule(self, boot_ns: int) -> Schedule:
        """The streams as they are after boot."""

    @abstractmethod
    def _do_set_mode(self, peer: str, m: Any) -> int:
        """MAV_RESULT of MAV_CMD_DO_SET_MODE."""

    @abstractmethod
    def _tell_of_change(self, t_ns: int) -> None:
        """A change of mode or arming, in a loop without a heartbeat."""

    def reboot(self, t_ns: int) -> None:
        """Reboot: parameters and the pilot's sticks are kept, stream rates, mode and arming are reset."""
        vehicle = self._vehicle
        vehicle.restart(t_ns)
        self._schedule = self._new_schedule(vehicle.boot_ns)
        self._parser = Parser()
        self._outbox.clear()
        self._rebooting = False
        self._timesync_ns = vehicle.boot_ns + self.timesync_every_ns

    # --- the pilot ---------------------------------------------------------------

    def set_sticks(self, pulses_us: dict[int, int]) -> None:
        """The pilot's transmitter: channel (from 1) to pulse width (us)."""
        for channel, pulse_us in pulses_us.items():
            self._vehicle.rc.set_stick(channel, pulse_us)

    def set_receiver(self, present: bool) -> None:
        """The pilot's transmitter comes into, or goes out of, range."""
        self._vehicle.rc.set_receiver(self._vehicle.t_ns, present)

    def set_battery(self, volts: float, watts: float | None, elapsed_s: float) -> None:
        """The voltage of the battery, what is drawn from it (None: there is no current sensor), and for how long."""
        vehicle, hours = self._vehicle, elapsed_s / 3600.0
        vehicle.battery_v = volts
        vehicle.battery_a = None if watts is None else watts / volts
        vehicle.used_ah += (vehicle.battery_a or 0.0) * hours
        vehicle.used_wh += (watts or 0.0) * hours

    def set_mode(self, number: int) -> bool:
        """The pilot's mode switch; False where the vehicle refuses."""
        return self._vehicle.enter_mode(number)

    def arm(self, on: bool) -> bool:
        """The pilot's arming switch; False where the vehicle refuses."""
        return self._vehicle.arm() if on else self._vehicle.disarm()

    @property
    def outputs_us(self) -> tuple[int, int]:
        """Pulse widths at the port and the starboard motor; 0 before the vehicle has booted."""
        return self._vehicle.outputs_us

    # --- in and out ------------------------------------------------------------------------------------------

    def receive(self, frame: Frame) -> None:
        """Bytes from a peer, acted upon at the first loop that is not before their time."""
        if len(self._inbox) < INBOX_LIMIT:
            self._inbox.append(frame)
        else:
            self.dropped += 1

    def loop(self, t_ns: int) -> list[Frame]:
        """One main loop, after the sensors have been sampled; what is sent now, in order."""
        vehicle = self._vehicle
        if t_ns < vehicle.boot_ns:
            self._take_inbox(t_ns)  # discarded before boot
            return []
        vehicle.begin(t_ns)
        frames = self._take_inbox(t_ns)
        for frame in frames:
            for data in self._parser.receive(frame.peer, frame.data):
                self._dispatch(frame.peer, data)
        self._before_outputs(frames)
        vehicle.end()
        due = self._schedule.take_due(t_ns)
        for msg_id in due:
            self._send_message("", msg_id)
        if vehicle.changed and dialect.MAVLINK_MSG_ID_HEARTBEAT not in due:
            self._tell_of_change(t_ns)
        vehicle.changed = False
        if vehicle.texts:
            for severity, text in vehicle.texts:
                self._outbox += [("", message) for message in self._texts.messages(severity, text)]
            vehicle.texts.clear()
        if t_ns >= self._timesync_ns:
            self._timesync_ns += self.timesync_every_ns
            self._outbox.append(("", dialect.MAVLink_timesync_message(0, t_ns - vehicle.power_on_ns)))
        sent = self._flush(t_ns)
        if self._rebooting:
            self.reboot(t_ns)
        return sent

    def _before_outputs(self, frames: list[Frame]) -> None:  # noqa: B027 - most have nothing
        """Hook before the outputs are set; `frames` are those received, whole or in parts."""

    def _take_inbox(self, t_ns: int) -> list[Frame]:
        frames = []
        while self._inbox and self._inbox[0].t_ns <= t_ns:
            frames.append(self._inbox.popleft())
        return frames

    def _flush(self, t_ns: int) -> list[Frame]:
        frames: list[Frame] = []
        if not self._outbox:
            return frames
        mav = self._mav
        for peer, message in self._outbox:
            frames.append(Frame(t_ns=t_ns, port=AUTOPILOT, data=pack(message, mav), peer=peer))
            mav.seq = (mav.seq + 1) % 256
        self._outbox.clear()
        return frames

    def _send_message(self, peer: str, msg_id: int) -> None:
        message = self._telemetry.build(msg_id, self._vehicle.t_ns)
        if message is not None:
            self._outbox.append((peer, message))

    def _dispatch(self, peer: str, data: bytes) -> None:
        handler = self._handlers.get(message_id(data))
        if handler is None:
            return
        sender = source(data)
        if sender == (self._system_id, COMPONENT_ID):
            return
        message = decode(data)
        if message is None:
            self.impossible += 1
            return
        to_system = getattr(message, "target_system", None)
        if to_system is None:
            to_system = getattr(message, "target", 0)
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
        msg_id = whole(m.param1)
        return DENIED if msg_id is None else self._schedule.set_interval(self._vehicle.t_ns, msg_id, m.param2)

    def _get_message_interval(self, peer: str, m: Any) -> int:
        msg_id = whole(m.param1)
        interval_us = None if msg_id is None else self._schedule.interval_us(msg_id)
        if interval_us is None:
            return FAILED
        self._outbox.append((peer, dialect.MAVLink_message_interval_message(msg_id, min(interval_us, 2**31 - 1))))
        return ACCEPTED

    def _request_message(self, peer: str, m: Any) -> int:
        msg_id = whole(m.param1)
        if msg_id is None or msg_id not in self._telemetry:
            return FAILED
        self._send_message(peer, msg_id)
        return ACCEPTED

    def _request_capabilities(self, peer: str, m: Any) -> int:
        self._send_message(peer, dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        return ACCEPTED

    def _arm_disarm(self, peer: str, m: Any) -> int:
        if m.param1 == 1.0:
            return ACCEPTED if self._vehicle.arm(force=m.param2 in FORCE_ARM) else self.arming_refused
        if m.param1 == 0.0:
            return ACCEPTED if self._vehicle.disarm() else FAILED
        return UNSUPPORTED

    arming_refused = FAILED

    def _reboot_vehicle(self, peer: str, m: Any) -> int:
        if m.param1 != 1.0 or self._vehicle.armed:
            return FAILED
        self._rebooting = True
        return ACCEPTED

    # --- other messages --------------------------------------------------------------------------------------

    def _on_timesync(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        if m.tc1 == 0:
            since_power_on_ns = self._vehicle.t_ns - self._vehicle.power_on_ns
            self._outbox.append((peer, dialect.MAVLink_timesync_message(since_power_on_ns, m.ts1)))

    def _on_param_read(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        name = self._parameters.find(m.param_id, m.param_index)
        if name is not None:
            self._outbox.append((peer, self._parameters.message(name)))

    def _on_param_list(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        for name in self._parameters.names:
            self._outbox.append((peer, self._parameters.message(name)))

    def _on_param_set(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        if self._parameters.set(m.param_id, m.param_value):
            self._outbox.append(("", self._parameters.message(m.param_id, changed=True)))


def whole(value: float) -> int | None:
    """A float parameter as an integer; None where it is not a number (which compares false) or too large."""
    return int(value) if abs(value) < 2.0**31 else None
