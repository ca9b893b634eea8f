"""Messages to the autopilot: packed with our ids, numbered as they leave, commands at most once a second. Sans-IO."""

from __future__ import annotations

from typing import Any

from asvhil.config import AutopilotLinkConfig
from asvhil.config.ports import AUTOPILOT
from asvhil.io.mavlink.frames import Numbering, dialect, pack
from asvhil.types import Frame

REQUEST_NS = 1_000_000_000


class AutopilotSender:
    """Makes frames of the autopilot's port. `us` and `it` are (system id, component id) of either side."""

    def __init__(self, config: AutopilotLinkConfig) -> None:
        self.us = config.system_id, config.component_id
        self.it = config.autopilot_system_id, config.autopilot_component_id
        self._own = dialect.MAVLink(None, srcSystem=config.system_id, srcComponent=config.component_id)
        self._numbering = Numbering()
        self._request_ns: dict[int, int] = {}

    def frames(self, t_ns: int, packed: list[bytes]) -> list[Frame]:
        """Numbered as they leave: receivers count what they miss, and routers drop what looks like a copy."""
        return [Frame(t_ns=t_ns, port=AUTOPILOT, data=self._numbering.number(t_ns, data)) for data in packed]

    def frames_ahead(self, t_ns: int, steps: list[list[bytes]]) -> list[list[Frame]]:
        """Frames that may leave later, in steps, with the numbers that come next; these are not taken."""
        found: list[list[Frame]] = []
        by = 0
        for packed in steps:
            numbered = [self._numbering.ahead(data, by + i) for i, data in enumerate(packed)]
            by += len(packed)
            found.append([Frame(t_ns=t_ns, port=AUTOPILOT, data=data) for data in numbered])
        return found

    def frame(self, t_ns: int, message: Any) -> Frame:
        """One message of ours."""
        return Frame(t_ns=t_ns, port=AUTOPILOT, data=self._numbering.number(t_ns, pack(message, self._own)))

    def was_sent(self, t_ns: int, data: bytes) -> bool:
        """Whether a complete frame is one of ours that left a moment ago."""
        return self._numbering.was_sent(t_ns, data)

    def command(self, command: int, *parameters: float) -> Any:
        """COMMAND_LONG, not packed."""
        return dialect.MAVLink_command_long_message(*self.it, command, 0, *parameters, *[0] * (7 - len(parameters)))

    def request(self, t_ns: int, command: int, *parameters: float) -> list[Frame]:
        """A command that is repeated until it has effect, at most once a second."""
        last_ns = self._request_ns.get(command)
        if last_ns is not None and t_ns - last_ns < REQUEST_NS:
            return []
        self._request_ns[command] = t_ns
        return [self.frame(t_ns, self.command(command, *parameters))]


def heartbeat() -> Any:
    """That of a companion computer."""
    return dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_ONBOARD_CONTROLLER, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
    )
