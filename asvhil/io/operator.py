"""The operator's port: MAVLink commands addressed to the daemon, and its answers. Sans-IO."""

from __future__ import annotations

import math
from typing import Any

from asvhil.config import AutopilotLinkConfig
from asvhil.io.mavlink import Parser, decode, dialect, message_id, source
from asvhil.io.timesync import TimeSync
from asvhil.types import Frame, HoldCommand, ReleaseCommand, record

PORT = "operator"
HERE = 2**31 - 1  # INT32_MAX: "no value" of a COMMAND_INT coordinate
HEARTBEAT_NS = 1_000_000_000


@record
class Request:
    """A command with what is needed to answer it."""

    command: HoldCommand | ReleaseCommand
    mav_cmd: int
    peer: str
    system_id: int
    component_id: int


class OperatorLink:
    """Understands COMMAND_INT and COMMAND_LONG to our system and component; answers with COMMAND_ACK and STATUSTEXT.

    MAV_CMD_DO_REPOSITION holds a station (coordinates INT32_MAX: here; yaw NaN: as it is now);
    MAV_CMD_NAV_GUIDED_ENABLE with 0 releases.
    """

    def __init__(self, config: AutopilotLinkConfig) -> None:
        self._config = config
        self._parser = Parser()
        self._own = dialect.MAVLink(None, srcSystem=config.system_id, srcComponent=config.component_id)
        self._heartbeat_ns: int | None = None
        self._refused: list[tuple[Any, str]] = []
        self._clocks: dict[str, TimeSync] = {}
        self._heard = False

    def decode(self, frame: Frame) -> list[Request]:
        """Requests in one frame; commands that are not understood are answered at the next `poll`."""
        found: list[Request] = []
        for data in self._parser.feed(frame.peer, frame.data):
            self._heard = True
            if message_id(data) == dialect.MAVLINK_MSG_ID_TIMESYNC:
                self._on_timesync(frame, data)
            if message_id(data) not in (dialect.MAVLINK_MSG_ID_COMMAND_INT, dialect.MAVLINK_MSG_ID_COMMAND_LONG):
                continue
            message = decode(data)
            if message is None or not self._addressed(message):
                continue
            system_id, component_id = source(data)
            command, result = self._command(frame.t_ns, message)
            request = Request(
                command=command or ReleaseCommand(t_ns=frame.t_ns, reason=""),
                mav_cmd=message.command,
                peer=frame.peer,
                system_id=system_id,
                component_id=component_id,
            )
            if command is None:
                self._refused.append((self._ack(request, result), frame.peer))
            else:
                found.append(request)
        return found

    def answer(self, t_ns: int, request: Request, refusal: str | None) -> list[Frame]:
        """COMMAND_ACK for a request: accepted, or temporarily rejected with the reason as STATUSTEXT."""
        result = dialect.MAV_RESULT_ACCEPTED if refusal is None else dialect.MAV_RESULT_TEMPORARILY_REJECTED
        messages = [self._ack(request, result)]
        if refusal is not None:
            messages.insert(0, self._text(dialect.MAV_SEVERITY_WARNING, refusal))
        return [self._pack(t_ns, message, request.peer) for message in messages]

    def tell(self, t_ns: int, severity: int, text: str) -> Frame:
        """STATUSTEXT to every operator heard lately."""
        return self._pack(t_ns, self._text(severity, text), "")

    def poll(self, t_ns: int) -> list[Frame]:
        """Refusals that are due, and a heartbeat each second once somebody has spoken on this port."""
        frames = [self._pack(t_ns, message, peer) for message, peer in self._refused]
        self._refused = []
        for peer, clock in self._clocks.items():
            frames += [self._pack(t_ns, dialect.MAVLink_timesync_message(*a), peer) for a in clock.answers(t_ns)]
        self._clocks.clear()
        if self._heard and (self._heartbeat_ns is None or t_ns - self._heartbeat_ns >= HEARTBEAT_NS):
            self._heartbeat_ns = t_ns
            heartbeat = dialect.MAVLink_heartbeat_message(
                dialect.MAV_TYPE_ONBOARD_CONTROLLER, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
            )
            frames.append(self._pack(t_ns, heartbeat, ""))
        return frames

    def counters(self) -> tuple[tuple[str, int], ...]:
        return (
            ("operator.frames", self._parser.total("frames")),
            ("operator.bad_crc", self._parser.total("bad_crc")),
            ("operator.garbage_bytes", self._parser.total("garbage_bytes")),
        )

    def _on_timesync(self, frame: Frame, data: bytes) -> None:
        """A ground station asks for our time; its own is of no use to us."""
        message = decode(data)
        if message is not None and message.tc1 == 0 and len(self._clocks) < Parser.MAX_PEERS:
            self._clocks.setdefault(frame.peer, TimeSync()).receive(frame.t_ns, message.tc1, message.ts1)

    def _addressed(self, message: Any) -> bool:
        return message.target_system == self._config.system_id and message.target_component in (
            self._config.component_id,
            dialect.MAV_COMP_ID_ALL,
        )

    @staticmethod
    def _command(t_ns: int, message: Any) -> tuple[HoldCommand | ReleaseCommand | None, int]:
        """The command a message means, or None and the MAV_RESULT that refuses it."""
        if message.command == dialect.MAV_CMD_NAV_GUIDED_ENABLE:
            if message.param1 == 0.0:
                return ReleaseCommand(t_ns=t_ns, reason="released by the operator"), 0
            return None, int(dialect.MAV_RESULT_DENIED)
        if message.command != dialect.MAV_CMD_DO_REPOSITION:
            return None, int(dialect.MAV_RESULT_UNSUPPORTED)
        if message.get_type() != "COMMAND_INT":
            return None, int(dialect.MAV_RESULT_COMMAND_INT_ONLY)
        here = message.x == HERE and message.y == HERE
        lat_deg, lon_deg = message.x * 1e-7, message.y * 1e-7
        if not here and (abs(lat_deg) > 90.0 or abs(lon_deg) > 180.0 or (message.x == 0 and message.y == 0)):
            return None, int(dialect.MAV_RESULT_DENIED)
        return HoldCommand(
            t_ns=t_ns,
            lat_deg=None if here else lat_deg,
            lon_deg=None if here else lon_deg,
            psi_rad=message.param4 if math.isfinite(message.param4) else None,
        ), 0

    @staticmethod
    def _ack(request: Request, result: int) -> Any:
        return dialect.MAVLink_command_ack_message(
            request.mav_cmd, result, 0, 0, request.system_id, request.component_id
        )

    @staticmethod
    def _text(severity: int, text: str) -> Any:
        return dialect.MAVLink_statustext_message(severity, text.encode("ascii", "replace")[:50])

    def _pack(self, t_ns: int, message: Any, peer: str) -> Frame:
        return Frame(t_ns=t_ns, port=PORT, data=bytes(message.pack(self._own)), peer=peer)


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


def _pack_as_ground_station(message: Any) -> bytes:
    ground_station = dialect.MAVLink(None, srcSystem=255, srcComponent=dialect.MAV_COMP_ID_MISSIONPLANNER)
    return bytes(message.pack(ground_station))
