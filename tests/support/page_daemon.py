"""A daemon's operator port for tests of the page's client: hears frames, and says what a test has it say."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from typing import Any

from asvhil.io.mavlink.frames import decode, dialect
from asvhil.io.mavlink.texts import Texts

WARNING = int(dialect.MAV_SEVERITY_WARNING)
NEUTRAL = dialect.MAV_CMD_COMPONENT_ARM_DISARM


class PageDaemon(asyncio.DatagramProtocol):
    """`heard`: what was asked but for questions, as kinds or as names and values of parameters.

    `parameters`: those that it tells. `answers`: what it says to a request, before the value of a parameter.
    """

    def __init__(self) -> None:
        self.heard: list[Any] = []
        self.parameters: dict[str, float] = {}
        self.answers: Callable[[Any], list[Any]] = lambda message: []
        self._mav = dialect.MAVLink(None, srcSystem=1, srcComponent=191)
        self._texts = Texts()
        self._transport: asyncio.DatagramTransport | None = None

    def connection_made(self, transport: asyncio.DatagramTransport) -> None:
        self._transport = transport

    def datagram_received(self, data: bytes, addr: Any) -> None:
        message = decode(data)
        assert message is not None and self._transport is not None
        for answer in self._answers(message):
            self._transport.sendto(bytes(answer.pack(self._mav)), addr)

    def _answers(self, message: Any) -> list[Any]:
        match message.get_type():
            case "COMMAND_LONG" if message.command == dialect.MAV_CMD_REQUEST_MESSAGE:
                return []
            case "PARAM_REQUEST_READ":
                return self.value(message.param_id)
            case "PARAM_SET":
                self.heard.append((message.param_id, round(message.param_value, 3)))
                said = self.answers(message)
                if not said:
                    self.parameters[message.param_id] = message.param_value
                return said + self.value(message.param_id)
            case "COMMAND_LONG" | "COMMAND_INT":
                self.heard.append(message.command)
            case kind:
                self.heard.append(kind)
        return self.answers(message)

    def value(self, name: str) -> list[Any]:
        """PARAM_VALUE, of a parameter that it has."""
        if name not in self.parameters:
            return []
        return [dialect.MAVLink_param_value_message(name.encode(), self.parameters[name], 9, 40, 3)]

    def warning(self, text: str) -> list[Any]:
        """A refusal in words."""
        return self._texts.messages(WARNING, text)

    @staticmethod
    def ack(mav_cmd: int, result: int) -> Any:
        """How a command has ended."""
        return dialect.MAVLink_command_ack_message(mav_cmd, result)


@contextlib.asynccontextmanager
async def page_daemon(port: int) -> AsyncIterator[PageDaemon]:
    """One that listens on a UDP port of this computer."""
    loop = asyncio.get_running_loop()
    transport, daemon = await loop.create_datagram_endpoint(PageDaemon, local_addr=("127.0.0.1", port))
    try:
        yield daemon
    finally:
        transport.close()
