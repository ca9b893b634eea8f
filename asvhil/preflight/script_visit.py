"""A look at the script on the autopilot: its file, its alive sign, and what else decides whether it runs. Sans-IO."""

from __future__ import annotations

from typing import Any

from asvhil.autopilot.script_protocol import AliveSign
from asvhil.config import Config
from asvhil.config.ports import AUTOPILOT
from asvhil.io.mavlink.file_client import FileClient
from asvhil.io.mavlink.frames import Parser, decode, dialect, message_id, source, target
from asvhil.io.mavlink.parameter_client import ParameterClient
from asvhil.io.mavlink.texts import TextReader
from asvhil.types import Frame, Inputs

ENABLE = "SCR_ENABLE"
CHECKS, SKIPPED = "ARMING_CHECK", "ARMING_SKIPCHK"  # its name since 4.7, with the sense turned round
HEARTBEAT_NS = 1_000_000_000
RESTART = 3.0  # MAV_CMD_SCRIPTING: stop, and begin again
STOPPED_NS = 300_000_000  # after the answer to that no script of before speaks any more
AGAIN_NS = 700_000_000  # between two times that a command is sent
COMMAND_ATTEMPTS = 6


class ScriptVisit:
    """Stepped like a backseat. It moves no motor: it asks, carries files, and has scripting restarted."""

    def __init__(self, config: Config) -> None:
        own = config.links.autopilot
        self._autopilot = own.autopilot_system_id, own.autopilot_component_id
        self._own = own.system_id, own.component_id
        self._mav = dialect.MAVLink(None, srcSystem=own.system_id, srcComponent=own.component_id)
        self._parser = Parser()
        self._texts = TextReader()
        self._beat_ns = 0
        self.files = FileClient(*self._autopilot)
        self.parameters = ParameterClient([(ENABLE,), (CHECKS, SKIPPED)], *self._autopilot)
        self.alive = AliveSign()
        self.armed: bool | None = None  # None: not heard of yet
        self.heard = 0  # bytes
        self.problem = ""  # what scripting has said last of a script that fails
        self.restart_result: int | None = None
        self._restarts = 0
        self._restart_ns = 0
        self._restarted_ns = 0
        self._forget_ns: int | None = None
        self.quiet_ns = 0  # for how long no alive sign has come, or since scripting was restarted

    def step(self, inputs: Inputs) -> list[Frame]:
        """One tick: what came in, and what goes out."""
        t_ns = inputs.t_ns
        for frame in inputs.frames:
            if frame.port == AUTOPILOT:
                self.heard += len(frame.data)
                for data in self._parser.receive(frame.peer, frame.data):
                    if source(data) == self._autopilot and target(data) in ((0, 0), (self._own[0], 0), self._own):
                        self._take(t_ns, data)
        if self._forget_ns is not None and t_ns >= self._forget_ns:
            self._forget_ns = None
            self.alive.forget()
        since_ns = self._restarted_ns if self.alive.heard_ns is None else self.alive.heard_ns
        self.quiet_ns = t_ns - since_ns
        messages = self._heartbeat(t_ns)
        if self.armed is not None:
            messages += self.files.data_to_send(t_ns) or self.parameters.data_to_send(t_ns) or self._command(t_ns)
        return [Frame(t_ns=t_ns, port=AUTOPILOT, data=bytes(message.pack(self._mav))) for message in messages]

    def restart_scripting(self) -> None:
        """Have all scripts stopped and loaded again; `restart_result` is None until that is answered."""
        self.restart_result, self._restarts, self._restart_ns = None, COMMAND_ATTEMPTS, 0
        self.problem = ""
        self.alive.forget()

    @property
    def restarting(self) -> bool:
        """Whether an answer to the command may still come."""
        return self.restart_result is None and self._restarts > 0

    def _take(self, t_ns: int, data: bytes) -> None:
        if message_id(data) not in _TAKEN:
            return
        message = decode(data)
        if message is None:
            return
        match message_id(data):
            case dialect.MAVLINK_MSG_ID_HEARTBEAT:
                self.armed = bool(message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
            case dialect.MAVLINK_MSG_ID_PARAM_VALUE:
                self.parameters.receive(t_ns, message)
            case dialect.MAVLINK_MSG_ID_PARAM_ERROR:
                self.parameters.on_error(message)
            case dialect.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL:
                self.files.receive(message)
            case dialect.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT:
                self.alive.receive(t_ns, message)
            case dialect.MAVLINK_MSG_ID_STATUSTEXT:
                text = self._texts.receive(message) or ""
                if text.startswith("Lua: "):
                    self.problem = text.removeprefix("Lua: ")
                elif text == "Scripting: restarted":
                    self.alive.forget()  # what came until then was of before
            case dialect.MAVLINK_MSG_ID_COMMAND_ACK:
                if message.command == dialect.MAV_CMD_SCRIPTING:
                    self.restart_result, self._restarts = message.result, 0
                    self._restarted_ns, self._forget_ns = t_ns, t_ns + STOPPED_NS

    def _heartbeat(self, t_ns: int) -> list[Any]:
        if t_ns < self._beat_ns:
            return []
        self._beat_ns = t_ns + HEARTBEAT_NS
        kind, none = dialect.MAV_TYPE_ONBOARD_CONTROLLER, dialect.MAV_AUTOPILOT_INVALID
        return [dialect.MAVLink_heartbeat_message(kind, none, 0, 0, dialect.MAV_STATE_ACTIVE, 3)]

    def _command(self, t_ns: int) -> list[Any]:
        if not self._restarts or t_ns < self._restart_ns:
            return []
        self._restarts -= 1
        self._restart_ns = t_ns + AGAIN_NS
        command = dialect.MAV_CMD_SCRIPTING
        return [dialect.MAVLink_command_int_message(*self._autopilot, 0, command, 0, 0, RESTART, 0, 0, 0, 0, 0, 0)]


_TAKEN = frozenset(
    {
        dialect.MAVLINK_MSG_ID_HEARTBEAT,
        dialect.MAVLINK_MSG_ID_PARAM_VALUE,
        dialect.MAVLINK_MSG_ID_PARAM_ERROR,
        dialect.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL,
        dialect.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT,
        dialect.MAVLINK_MSG_ID_STATUSTEXT,
        dialect.MAVLINK_MSG_ID_COMMAND_ACK,
    }
)
