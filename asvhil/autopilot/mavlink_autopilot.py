"""The MAVLink session with an autopilot: what all vehicle profiles share. Sans-IO."""

from __future__ import annotations

from typing import Any

from asvhil.autopilot.listener import AutopilotListener
from asvhil.autopilot.parameter_watch import ParameterRules
from asvhil.autopilot.sender import heartbeat
from asvhil.autopilot.wiring import Pulses
from asvhil.config import AutopilotLinkConfig, PwmConfig
from asvhil.config.registry import AUTOPILOTS
from asvhil.io.mavlink.frames import dialect
from asvhil.types import Frame

HEARTBEAT_NS = 1_000_000_000
FIRST_TIME_NS = 300_000_000  # between requests for the autopilot's clock until one was answered
ASK_MODE_AFTER_NS = 1_100_000_000  # since the last heartbeat, while other messages come: mode and arming are asked for
ASK_MODE_NS = 400_000_000


class MavlinkAutopilot(AutopilotListener):
    """One autopilot: status and measurements in; heartbeat, streams, time, parameters, mode, arming and motors out."""

    def __init__(self, config: AutopilotLinkConfig, pwm: PwmConfig, rules: ParameterRules | None = None) -> None:
        super().__init__(config, pwm, rules)
        self._modes = AUTOPILOTS.find(config.profile).modes
        self._driven_sticks_us: Pulses | None = None
        self._heartbeat_ns: int | None = None
        self._time_asked_ns = -HEARTBEAT_NS
        self._mode_asked_ns = 0

    @property
    def driven_sticks_us(self) -> Pulses | None:
        """Where the last command of the motors has put their sticks (RC values); None where it overrides none."""
        return self._driven_sticks_us

    def data_to_send(self, t_ns: int) -> list[Frame]:
        """What is due: a heartbeat and TIMESYNC each second, and requests once the autopilot has been heard."""
        self._t_ns = t_ns
        connected = self.autopilot_heartbeat_ns is not None
        due: list[Any] = []
        if self._heartbeat_ns is None or t_ns - self._heartbeat_ns >= HEARTBEAT_NS:
            self._heartbeat_ns = t_ns
            due.append(heartbeat())
        if connected and t_ns - self._time_asked_ns >= (FIRST_TIME_NS if self.clock is None else HEARTBEAT_NS):
            self._time_asked_ns = t_ns
            self._timesync.ask()
        due += self._timesync.data_to_send(t_ns)
        if connected:
            booting = self._vehicle.booting
            due += self._streams.data_to_send(t_ns)
            if not booting:
                due += self.parameters.data_to_send(t_ns)
            if not (self._vehicle.armed or booting) and self.arming_checks.is_due(t_ns):
                due.append(self._sender.command(dialect.MAV_CMD_RUN_PREARM_CHECKS))
            due += self._questions(t_ns)
        sender = self._sender
        frames = [sender.frame(t_ns, message) for message in due] if due else []
        held = self._output.data_to_send(t_ns)
        return frames + sender.frames(t_ns, held) if held else frames

    def _questions(self, t_ns: int) -> list[Any]:
        """Its mode, where its heartbeats get lost; its hardware's number, where it is heard by several ways."""
        asked = []
        if self._mode_age_ns() > ASK_MODE_AFTER_NS and t_ns - self._mode_asked_ns >= ASK_MODE_NS:
            self._mode_asked_ns = t_ns
            asked.append(dialect.MAVLINK_MSG_ID_HEARTBEAT)
        if self._one.wants_uid(t_ns):
            asked.append(dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        request = dialect.MAV_CMD_REQUEST_MESSAGE
        return [self._sender.command(request, float(msg_id)) for msg_id in asked] if asked else []

    def drive(self, t_ns: int, port_us: int, starboard_us: int) -> list[Frame]:
        """Both motors, as pulse widths (us)."""
        wiring = self._known.begin_driving()
        if self._overrides_sticks:
            self.transmitter.note_override(t_ns)
            self._driven_sticks_us = wiring.to_sticks((port_us, starboard_us))
        return self._sender.frames(t_ns, self._output.drive(port_us, starboard_us))

    def release(self, t_ns: int) -> list[Frame]:
        """Give the motors back."""
        released = self._output.release(t_ns)
        self._known.end_driving()
        return self._sender.frames(t_ns, released)

    def last_words(self, t_ns: int, *, neutral: bool) -> list[list[Frame]]:
        """What another process sends, step by step, if this one dies before the next tick. Changes nothing here."""
        return self._sender.frames_ahead(t_ns, self._output.last_words(neutral=neutral))

    def request_mode(self, t_ns: int, mode: str) -> list[Frame]:
        """DO_SET_MODE, at most once a second; nothing for a mode that the autopilot does not have."""
        number = self._modes.get(mode)
        if number is None:
            return []
        return self._sender.request(t_ns, dialect.MAV_CMD_DO_SET_MODE, 1.0, *self._mode_parameters(number))

    def request_arming(self, t_ns: int) -> list[Frame]:
        """COMPONENT_ARM_DISARM with all checks, at most once a second."""
        return self._sender.request(t_ns, dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)

    def _mode_parameters(self, number: int) -> tuple[float, ...]:
        """param2 and on of DO_SET_MODE."""
        return (float(number),)
