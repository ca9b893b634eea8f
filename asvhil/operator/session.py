"""The daemon as a MAVLink component of its own: commands, set-points and parameters to it, and its answers. Sans-IO."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

from asvhil.config import AutopilotLinkConfig, OperatorLinkConfig
from asvhil.io.mavlink import parameter_server
from asvhil.io.mavlink.frames import Parser, decode, dialect, message_id, source, target
from asvhil.io.mavlink.parameter_server import ParameterServer
from asvhil.io.mavlink.timesync import TimeSync
from asvhil.operator.encoding import SOLVE_TIME
from asvhil.operator.goto import (
    COMMANDS,
    FOLLOW_TARGET,
    LOCAL_SETPOINT,
    SETPOINT,
    Refusal,
    is_goto,
    meaning_of_command,
    meaning_of_leader,
    meaning_of_local_setpoint,
    meaning_of_setpoint,
)
from asvhil.operator.leader_streams import LeaderStreams
from asvhil.operator.repeats import Heard, RepeatedSettings, Repeats
from asvhil.operator.replies import Replies
from asvhil.operator.reports import ACCEPTED, TEXT_ID, OperatorReport, Reports
from asvhil.operator.setpoint_streams import SetpointStreams
from asvhil.operator.shell_notes import NoteReader
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.types import (
    EVERYONE,
    Address,
    Frame,
    HoldCommand,
    LeaderMessage,
    MoveCommand,
    NeutralCommand,
    ParameterChange,
    ReleaseCommand,
    record,
)

Command = HoldCommand | MoveCommand | LeaderMessage | NeutralCommand | ReleaseCommand | ParameterChange

LISTENING_NS = 15_000_000_000  # reports are for ground stations that are there: these send heartbeats
UNSUPPORTED = int(dialect.MAV_RESULT_UNSUPPORTED)
REJECTED = int(dialect.MAV_RESULT_TEMPORARILY_REJECTED)
NOTHING = OperatorReport()


@record
class OperatorRequest:
    """What is asked, with what is needed to answer it; without a `mav_cmd` there is nothing to acknowledge.

    `address`, `system_id` and `component_id` are the asker's; `answer_as` is the (system, component) that was asked.
    `heard` keeps the answer for a repetition of the command or setting.
    """

    command: Command
    mav_cmd: int | None
    address: Address
    system_id: int
    component_id: int
    answer_as: tuple[int, int]
    heard: Heard | None = None


class OperatorSession:
    """Understands what is addressed to our system and component, and with `claim_goto` the autopilot's gotos too.

    Holds: MAV_CMD_DO_REPOSITION, MAV_CMD_NAV_LOITER_UNLIM, SET_POSITION_TARGET_GLOBAL_INT, MAV_CMD_NAV_GUIDED_ENABLE
    with 1; releases: the last with 0. Moves: SET_POSITION_TARGET_LOCAL_NED; neutral: MAV_CMD_COMPONENT_ARM_DISARM with
    0, where it is sent to us alone. A FOLLOW_TARGET is taken in whoever sends it. What is sent to all components of the
    system is answered only where we do it.
    A request that comes again is answered as before, and not done again.
    """

    def __init__(
        self, config: AutopilotLinkConfig, operator: OperatorLinkConfig | None = None, parameters: tuple[str, ...] = ()
    ) -> None:
        operator = operator or OperatorLinkConfig()
        self._us = (config.system_id, config.component_id)
        self._autopilot = (config.autopilot_system_id, config.autopilot_component_id)
        self.own_systems = frozenset({config.system_id, config.autopilot_system_id})  # no station follows these
        self._claim_goto = operator.claim_goto
        self._parser = Parser()
        self._replies = Replies(self._us)
        self._parameters = ParameterServer(parameters)
        self._reports = Reports(operator.report_hz)
        self._asked: list[tuple[Address, int]] = []  # for messages, by id
        self._clocks: dict[Address, TimeSync] = {}
        self._repeats = Repeats()
        self._repeated_settings = RepeatedSettings()
        self._setpoint_streams = SetpointStreams()
        self._leader_streams = LeaderStreams()
        self._heard_ns: int | None = None
        self.solve_ms = math.nan
        self.shell_notes = NoteReader()
        self.computer: Any = None  # the latest ONBOARD_COMPUTER_STATUS of the shell

    def receive(self, frame: Frame) -> list[OperatorRequest]:
        """Requests in one frame; what needs no decision is answered by the next `data_to_send`."""
        found: list[OperatorRequest] = []
        for data in self._parser.receive(frame.peer, frame.data, frame.via):
            if frame.address == EVERYONE and source(data) == self._us:
                self._on_own(data)
                continue
            self._heard_ns = frame.t_ns
            msg_id = message_id(data)
            if msg_id == dialect.MAVLINK_MSG_ID_TIMESYNC:
                self._on_timesync(frame, data)
            elif msg_id == FOLLOW_TARGET:
                found += self._on_leader(frame, data)
            elif msg_id in (SETPOINT, LOCAL_SETPOINT) or msg_id in COMMANDS or msg_id in parameter_server.MESSAGES:
                request = self._on_request(frame, data, msg_id)
                if request is not None:
                    found.append(request)
        return found

    def answer(self, t_ns: int, request: OperatorRequest, refusal: Explanation | None) -> None:
        """COMMAND_ACK: accepted, or temporarily rejected with the reason as STATUSTEXT; PARAM_VALUE for a parameter."""
        command = request.command
        if isinstance(command, ParameterChange):
            self._parameters.tell(command.name)
        if refusal is not None:
            is_setpoint = request.mav_cmd is None and not isinstance(command, ParameterChange)
            self._replies.send_refusal(t_ns, refusal, request.address, seldom=is_setpoint)
        result = ACCEPTED if refusal is None else REJECTED
        if request.heard is not None:
            request.heard.result, request.heard.refusal = result, refusal
        if request.mav_cmd is not None:
            self._send_ack(t_ns, request, result)

    def tell(self, t_ns: int, severity: int, text: str) -> None:
        """STATUSTEXT to every operator heard lately."""
        self._replies.send_text(t_ns, severity, text, EVERYONE)

    def tell_parameters(self, names: tuple[str, ...]) -> None:
        """Send values to every operator, as after they have changed by another way."""
        if self._heard_ns is not None:
            for name in names:
                self._parameters.tell(name)

    def data_to_send(
        self, t_ns: int, report: OperatorReport = NOTHING, value_of: Callable[[str], float] = lambda name: math.nan
    ) -> list[Frame]:
        """Answers and texts, and what is due: a heartbeat once an operator was heard, reports while one is."""
        asked, self._asked = self._asked, []
        for address, msg_id in asked:
            for severity, text in report.texts() if msg_id == TEXT_ID else ():
                self._replies.send_text(t_ns, severity, text, address)
            for message in self._reports.build(t_ns, msg_id, report):
                self._replies.send(t_ns, message, address)
        for address, message in self._parameters.data_to_send(value_of):
            self._replies.send(t_ns, message, address)
        for address, clock in self._clocks.items():
            for message in clock.data_to_send(t_ns):
                self._replies.send(t_ns, message, address)
        self._clocks.clear()
        if self._heard_ns is not None:
            quiet = t_ns - self._heard_ns > LISTENING_NS
            for message in self._reports.take_due(t_ns, report, quiet=quiet):
                self._replies.send(t_ns, message, EVERYONE)
        return self._replies.take()

    @property
    def may_report(self) -> bool:
        """Whether `data_to_send` may have a use for a report: not before an operator was heard."""
        return self._heard_ns is not None

    @property
    def is_asked(self) -> bool:
        """Whether anybody has asked for a message since the last `data_to_send`."""
        return bool(self._asked)

    def counters(self) -> tuple[tuple[str, int], ...]:
        """Cumulative counts of what came in and what was dropped."""
        frames, bad_crc, _, garbage_bytes = self._parser.totals()
        late = self._leader_streams.late
        return (
            ("operator.frames", frames),
            ("operator.bad_crc", bad_crc),
            ("operator.garbage_bytes", garbage_bytes),
            *((("operator.late_leaders", late),) if late else ()),
        )

    # --- in ------------------------------------------------------------------------------------------------

    def _on_own(self, data: bytes) -> None:
        """The shell's own messages on this port: how long solving takes, what is wrong with it, its computer."""
        message = decode(data)
        if message is None:
            return
        if message.get_type() == "NAMED_VALUE_FLOAT" and message.name == SOLVE_TIME:
            self.solve_ms = message.value
        elif message.get_type() == "STATUSTEXT":
            self.shell_notes.receive(message)
        elif message.get_type() == "ONBOARD_COMPUTER_STATUS":
            self.computer = message

    def _on_timesync(self, frame: Frame, data: bytes) -> None:
        """A ground station asks for our time; its own clock is not used."""
        message = decode(data)
        if message is not None and message.tc1 == 0 and len(self._clocks) < Parser.MAX_PEERS:
            self._clocks.setdefault(frame.address, TimeSync()).receive(frame.t_ns, message)

    def _on_leader(self, frame: Frame, data: bytes) -> list[OperatorRequest]:
        """A vehicle that tells where it is, to everybody; the supervisor knows which is followed."""
        message = decode(data)
        meaning = None if message is None else meaning_of_leader(frame.t_ns, source(data)[0], message)
        if message is None or meaning is None:
            return []
        place = message.lat, message.lon
        if self._leader_streams.is_late(frame, source(data), message.timestamp, place):
            return []
        return [self._request(frame, data, meaning, None, self._us)]

    def _on_request(self, frame: Frame, data: bytes, msg_id: int) -> OperatorRequest | None:
        system_id, component_id = target(data)
        claimed = (
            self._claim_goto
            and system_id == self._autopilot[0]
            and component_id in (self._autopilot[1], dialect.MAV_COMP_ID_ALL)
            and is_goto(data)
        )
        to_us = (system_id, component_id) == self._us
        to_all = system_id == self._us[0] and component_id == dialect.MAV_COMP_ID_ALL
        message = decode(data) if claimed or to_us or to_all else None
        if message is None:
            return None
        if msg_id in parameter_server.MESSAGES:
            change = self._parameters.receive(frame.t_ns, frame.address, message)
            return None if change is None else self._on_setting(frame, data, change)
        answer_as = self._autopilot if claimed else self._us
        if msg_id in (SETPOINT, LOCAL_SETPOINT):
            return self._on_setpoint(frame, data, message, answer_as) if claimed or to_us else None
        return self._on_command(frame, data, message, answer_as, alone=claimed or to_us)

    def _on_setting(self, frame: Frame, data: bytes, change: ParameterChange) -> OperatorRequest | None:
        """A new setting. One that comes again gets its answer again: somebody may have set another value since."""
        heard, again = self._repeated_settings.take(frame, data, change.name)
        if not again:
            return dataclasses.replace(self._request(frame, data, change, None, self._us), heard=heard)
        if heard.refusal is not None:
            self._replies.send_refusal(frame.t_ns, heard.refusal, frame.address)
        self._parameters.tell(change.name)
        return None

    def _on_setpoint(
        self, frame: Frame, data: bytes, message: Any, answer_as: tuple[int, int]
    ) -> OperatorRequest | None:
        streaming, overtaken = self._setpoint_streams.take(frame, data)
        if overtaken:
            return None
        if message_id(data) == LOCAL_SETPOINT:
            meaning: HoldCommand | MoveCommand | Refusal = meaning_of_local_setpoint(frame.t_ns, message)
        else:
            meaning = meaning_of_setpoint(frame.t_ns, message, streaming=streaming)
        if isinstance(meaning, Refusal):
            self._replies.send_refusal(frame.t_ns, meaning.why, frame.address, seldom=True)
            return None
        return self._request(frame, data, meaning, None, answer_as)

    def _on_command(
        self, frame: Frame, data: bytes, message: Any, answer_as: tuple[int, int], *, alone: bool
    ) -> OperatorRequest | None:
        meaning = meaning_of_command(frame.t_ns, message)
        if isinstance(meaning, ReleaseCommand) or (isinstance(meaning, HoldCommand | NeutralCommand) and alone):
            return self._on_repeatable(frame, data, meaning, message.command, answer_as)
        asker = self._request(frame, data, ReleaseCommand(t_ns=frame.t_ns), message.command, answer_as)
        asked: int | None = None
        if isinstance(meaning, Refusal):
            result = meaning.result
        elif meaning is not None:
            result = UNSUPPORTED  # a goto to all of the system, or its disarming, is the autopilot's
        else:
            result, asked = self._reports.command(message)
        if not alone and result != ACCEPTED:
            return None  # others of the system may do it: no answer of ours must stand against theirs
        if isinstance(meaning, Refusal):
            self._replies.send_refusal(frame.t_ns, meaning.why, frame.address)
        self._send_ack(frame.t_ns, asker, result)
        if asked is not None:
            self._asked.append((frame.address, asked))
        return None

    def _on_repeatable(
        self,
        frame: Frame,
        data: bytes,
        meaning: HoldCommand | NeutralCommand | ReleaseCommand,
        mav_cmd: int,
        answer_as: tuple[int, int],
    ) -> OperatorRequest | None:
        """A request of a new command. One that comes again gets its answer again, a hold that comes too late none."""
        request = self._request(frame, data, meaning, mav_cmd, answer_as)
        before = self._repeats.find(frame, data)
        if before is not None:
            if before.result is not None:
                if before.refusal is not None:
                    self._replies.send_refusal(frame.t_ns, before.refusal, frame.address)
                self._send_ack(frame.t_ns, request, before.result)
            return None
        if isinstance(meaning, HoldCommand) and self._repeats.is_late(frame, data):
            self._replies.send_refusal(frame.t_ns, explain(Reason.REQUEST_LATE), frame.address)
            self._send_ack(frame.t_ns, request, REJECTED)
            return None
        return dataclasses.replace(request, heard=self._repeats.take(frame, data))

    @staticmethod
    def _request(
        frame: Frame,
        data: bytes,
        command: Command,
        mav_cmd: int | None,
        answer_as: tuple[int, int],
    ) -> OperatorRequest:
        system_id, component_id = source(data)
        return OperatorRequest(
            command=command,
            mav_cmd=mav_cmd,
            address=frame.address,
            system_id=system_id,
            component_id=component_id,
            answer_as=answer_as,
        )

    def _send_ack(self, t_ns: int, request: OperatorRequest, result: int) -> None:
        message = dialect.MAVLink_command_ack_message(
            request.mav_cmd or 0, result, 0, 0, request.system_id, request.component_id
        )
        self._replies.send(t_ns, message, request.address, request.answer_as)
