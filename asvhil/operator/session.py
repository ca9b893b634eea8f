"""The daemon as a MAVLink component of its own: commands, set-points and parameters to it, and its answers. Sans-IO."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from asvhil.config import AutopilotLinkConfig, OperatorLinkConfig
from asvhil.io.mavlink import parameter_server
from asvhil.io.mavlink.frames import Parser, decode, dialect, message_id, source, target
from asvhil.io.mavlink.parameter_server import ParameterServer
from asvhil.io.mavlink.timesync import TimeSync
from asvhil.operator.goto import COMMANDS, HERE, SETPOINT, Refusal, is_goto, meaning_of_command, meaning_of_setpoint
from asvhil.operator.reports import OperatorReport, Reports, Texts
from asvhil.types import Frame, HoldCommand, ParameterChange, ReleaseCommand, record

PORT = "operator"
STREAM_NS = 3_000_000_000  # set-points closer than this are one stream, and its first is the command
LISTENING_NS = 15_000_000_000  # reports are for ground stations that are there: these send heartbeats
REPEAT_NS = 5_000_000_000  # the same refusal of a stream is told no more often
SOLVE_TIME = "solve_ms"
UNSUPPORTED = int(dialect.MAV_RESULT_UNSUPPORTED)
ACCEPTED = int(dialect.MAV_RESULT_ACCEPTED)

NOTHING = OperatorReport()


@record
class Request:
    """What is asked, with what is needed to answer it; without a `mav_cmd` there is nothing to acknowledge.

    `answer_as` is the (system, component) that was addressed.
    """

    command: HoldCommand | ReleaseCommand | ParameterChange
    mav_cmd: int | None
    peer: str
    system_id: int
    component_id: int
    answer_as: tuple[int, int]


class OperatorSession:
    """Understands what is addressed to our system and component, and with `claim_goto` the autopilot's gotos too.

    Holds: MAV_CMD_DO_REPOSITION, MAV_CMD_NAV_LOITER_UNLIM, SET_POSITION_TARGET_GLOBAL_INT, MAV_CMD_NAV_GUIDED_ENABLE
    with 1; releases: the last with 0. What is sent to all components of the system is answered only where we do it.
    """

    def __init__(
        self, config: AutopilotLinkConfig, operator: OperatorLinkConfig | None = None, parameters: tuple[str, ...] = ()
    ) -> None:
        operator = operator or OperatorLinkConfig()
        self._us = (config.system_id, config.component_id)
        self._autopilot_system_id = config.autopilot_system_id
        self._claim_goto = operator.claim_goto
        self._parser = Parser()
        self._senders = {self._us: dialect.MAVLink(None, srcSystem=self._us[0], srcComponent=self._us[1])}
        self._parameters = ParameterServer(parameters)
        self._reports = Reports(operator.report_hz)
        self._texts = Texts()
        self._waiting: list[Frame] = []
        self._asked: list[tuple[str, int]] = []
        self._clocks: dict[str, TimeSync] = {}
        self._setpoints_ns: dict[tuple[str, tuple[int, int]], int] = {}
        self._told_ns: dict[str, int] = {}
        self._heard_ns: int | None = None
        self.solve_ms = math.nan

    def decode(self, frame: Frame) -> list[Request]:
        """Requests in one frame; what needs no decision is answered at the next `poll`."""
        found: list[Request] = []
        for data in self._parser.feed(frame.peer, frame.data):
            if not frame.peer and source(data) == self._us:
                self._on_own(data)
                continue
            self._heard_ns = frame.t_ns
            msg_id = message_id(data)
            if msg_id == dialect.MAVLINK_MSG_ID_TIMESYNC:
                self._on_timesync(frame, data)
            elif msg_id == SETPOINT or msg_id in COMMANDS or msg_id in parameter_server.MESSAGES:
                request = self._on_request(frame, data, msg_id)
                if request is not None:
                    found.append(request)
        return found

    def answer(self, t_ns: int, request: Request, refusal: str | None) -> list[Frame]:
        """COMMAND_ACK: accepted, or temporarily rejected with the reason as STATUSTEXT; PARAM_VALUE for a parameter."""
        frames: list[Frame] = []
        command = request.command
        if isinstance(command, ParameterChange):
            self._parameters.tell(command.name)
        elif request.mav_cmd is None and refusal is not None and self._silent(t_ns, refusal):
            return []
        if refusal is not None:
            frames += self._text(t_ns, dialect.MAV_SEVERITY_WARNING, refusal, request.peer)
        if request.mav_cmd is not None:
            result = ACCEPTED if refusal is None else int(dialect.MAV_RESULT_TEMPORARILY_REJECTED)
            frames.append(self._ack(t_ns, request, result))
        return frames

    def tell(self, t_ns: int, severity: int, text: str) -> list[Frame]:
        """STATUSTEXT to every operator heard lately."""
        return self._text(t_ns, severity, text, "")

    def tell_parameters(self, names: tuple[str, ...]) -> None:
        """Have values told to every operator, as after they have changed by another way."""
        if self._heard_ns is not None:
            for name in names:
                self._parameters.tell(name)

    def poll(
        self, t_ns: int, situation: OperatorReport = NOTHING, value_of: Callable[[str], float] = lambda name: math.nan
    ) -> list[Frame]:
        """Answers that are due; a heartbeat once somebody has spoken on this port, reports while somebody does."""
        frames, self._waiting = self._waiting, []
        asked, self._asked = self._asked, []
        for peer, msg_id in asked:
            frames += [self._pack(t_ns, message, peer) for message in self._reports.build(t_ns, msg_id, situation)]
        frames += [self._pack(t_ns, message, peer) for peer, message in self._parameters.poll(value_of)]
        for peer, clock in self._clocks.items():
            frames += [self._pack(t_ns, dialect.MAVLink_timesync_message(*a), peer) for a in clock.answers(t_ns)]
        self._clocks.clear()
        if self._heard_ns is not None:
            quiet = t_ns - self._heard_ns > LISTENING_NS
            frames += [self._pack(t_ns, message, "") for message in self._reports.due(t_ns, situation, quiet=quiet)]
        return frames

    def counters(self) -> tuple[tuple[str, int], ...]:
        return (
            ("operator.frames", self._parser.total("frames")),
            ("operator.bad_crc", self._parser.total("bad_crc")),
            ("operator.garbage_bytes", self._parser.total("garbage_bytes")),
        )

    # --- in ------------------------------------------------------------------------------------------------

    def _on_own(self, data: bytes) -> None:
        """The shell's word on this port, where no clock is: how long solving takes."""
        message = decode(data)
        if message is not None and message.get_type() == "NAMED_VALUE_FLOAT" and message.name == SOLVE_TIME:
            self.solve_ms = message.value

    def _on_timesync(self, frame: Frame, data: bytes) -> None:
        """A ground station asks for our time; its own is of no use to us."""
        message = decode(data)
        if message is not None and message.tc1 == 0 and len(self._clocks) < Parser.MAX_PEERS:
            self._clocks.setdefault(frame.peer, TimeSync()).receive(frame.t_ns, message.tc1, message.ts1)

    def _on_request(self, frame: Frame, data: bytes, msg_id: int) -> Request | None:
        system_id, component_id = target(data)
        claimed = (
            self._claim_goto
            and system_id == self._autopilot_system_id
            and component_id in (dialect.MAV_COMP_ID_AUTOPILOT1, dialect.MAV_COMP_ID_ALL)
            and is_goto(data)
        )
        to_us = (system_id, component_id) == self._us
        to_all = system_id == self._us[0] and component_id == dialect.MAV_COMP_ID_ALL
        message = decode(data) if claimed or to_us or to_all else None
        if message is None:
            return None
        if msg_id in parameter_server.MESSAGES:
            change = self._parameters.receive(frame.t_ns, frame.peer, message)
            return None if change is None else self._request(frame, data, change, None, self._us)
        answer_as = (system_id, dialect.MAV_COMP_ID_AUTOPILOT1) if claimed else self._us
        if msg_id == SETPOINT:
            return self._on_setpoint(frame, data, message, answer_as) if claimed or to_us else None
        return self._on_command(frame, data, message, answer_as, alone=claimed or to_us)

    def _on_setpoint(self, frame: Frame, data: bytes, message: Any, answer_as: tuple[int, int]) -> Request | None:
        key = (frame.peer, source(data))
        last_ns = self._setpoints_ns.pop(key, None)
        if len(self._setpoints_ns) >= Parser.MAX_PEERS:
            self._setpoints_ns.pop(next(iter(self._setpoints_ns)))
        self._setpoints_ns[key] = frame.t_ns
        streaming = last_ns is not None and frame.t_ns - last_ns < STREAM_NS
        meaning = meaning_of_setpoint(frame.t_ns, message, move_only=streaming)
        if isinstance(meaning, Refusal):
            if not self._silent(frame.t_ns, meaning.words):
                self._waiting += self._text(frame.t_ns, dialect.MAV_SEVERITY_WARNING, meaning.words, frame.peer)
            return None
        return self._request(frame, data, meaning, None, answer_as)

    def _on_command(
        self, frame: Frame, data: bytes, message: Any, answer_as: tuple[int, int], *, alone: bool
    ) -> Request | None:
        meaning = meaning_of_command(frame.t_ns, message)
        if isinstance(meaning, ReleaseCommand) or (isinstance(meaning, HoldCommand) and alone):
            return self._request(frame, data, meaning, message.command, answer_as)
        asker = self._request(frame, data, ReleaseCommand(t_ns=frame.t_ns, reason=""), message.command, answer_as)
        asked: int | None = None
        if isinstance(meaning, Refusal):
            result = meaning.result
        elif meaning is not None:
            result = UNSUPPORTED  # a goto to all of the system is the autopilot's
        else:
            result, asked = self._reports.command(message)
        if not alone and result != ACCEPTED:
            return None  # others of the system may do it: no word of ours must stand against theirs
        if isinstance(meaning, Refusal):
            self._waiting += self._text(frame.t_ns, dialect.MAV_SEVERITY_WARNING, meaning.words, frame.peer)
        self._waiting.append(self._ack(frame.t_ns, asker, result))
        if asked is not None:
            self._asked.append((frame.peer, asked))
        return None

    @staticmethod
    def _request(
        frame: Frame,
        data: bytes,
        command: HoldCommand | ReleaseCommand | ParameterChange,
        mav_cmd: int | None,
        answer_as: tuple[int, int],
    ) -> Request:
        system_id, component_id = source(data)
        return Request(
            command=command,
            mav_cmd=mav_cmd,
            peer=frame.peer,
            system_id=system_id,
            component_id=component_id,
            answer_as=answer_as,
        )

    # --- out -----------------------------------------------------------------------------------------------

    def _silent(self, t_ns: int, text: str) -> bool:
        """Whether a text was told a moment ago; if not it is now."""
        self._told_ns = {said: at_ns for said, at_ns in self._told_ns.items() if t_ns - at_ns < REPEAT_NS}
        if text in self._told_ns:
            return True
        self._told_ns[text] = t_ns
        return False

    def _ack(self, t_ns: int, request: Request, result: int) -> Frame:
        message = dialect.MAVLink_command_ack_message(
            request.mav_cmd or 0, result, 0, 0, request.system_id, request.component_id
        )
        return self._pack(t_ns, message, request.peer, request.answer_as)

    def _text(self, t_ns: int, severity: int, text: str, peer: str) -> list[Frame]:
        return [self._pack(t_ns, message, peer) for message in self._texts.messages(severity, text)]

    def _pack(self, t_ns: int, message: Any, peer: str, answer_as: tuple[int, int] | None = None) -> Frame:
        sender = answer_as or self._us
        mav = self._senders.get(sender)
        if mav is None:
            mav = self._senders[sender] = dialect.MAVLink(None, srcSystem=sender[0], srcComponent=sender[1])
        data = bytes(message.pack(mav))
        mav.seq = (mav.seq + 1) % 256
        return Frame(t_ns=t_ns, port=PORT, data=data, peer=peer)


def encode_hold(
    config: AutopilotLinkConfig, lat_deg: float | None, lon_deg: float | None, psi_rad: float | None
) -> bytes:
    """The frame that asks the daemon to hold a station; None means as the boat is now."""
    message = dialect.MAVLink_command_int_message(
        config.system_id,
        config.component_id,
        dialect.MAV_FRAME_GLOBAL,
        dialect.MAV_CMD_DO_REPOSITION,
        0,
        0,
        -1.0,
        0.0,
        0.0,
        math.nan if psi_rad is None else psi_rad,
        HERE if lat_deg is None else round(lat_deg * 1e7),
        HERE if lon_deg is None else round(lon_deg * 1e7),
        0.0,
    )
    return _pack_as_ground_station(message)


def encode_release(config: AutopilotLinkConfig) -> bytes:
    """The frame that asks the daemon to let go of the motors."""
    message = dialect.MAVLink_command_long_message(
        config.system_id, config.component_id, dialect.MAV_CMD_NAV_GUIDED_ENABLE, 0, 0, 0, 0, 0, 0, 0, 0
    )
    return _pack_as_ground_station(message)


def encode_solve_time(config: AutopilotLinkConfig, solve_ms: float) -> bytes:
    """The frame by which the shell tells how long solving takes."""
    message = dialect.MAVLink_named_value_float_message(0, SOLVE_TIME.encode(), solve_ms)
    return bytes(message.pack(dialect.MAVLink(None, srcSystem=config.system_id, srcComponent=config.component_id)))


def _pack_as_ground_station(message: Any) -> bytes:
    ground_station = dialect.MAVLink(None, srcSystem=255, srcComponent=dialect.MAV_COMP_ID_MISSIONPLANNER)
    return bytes(message.pack(ground_station))
