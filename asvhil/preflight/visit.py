"""The daemon's own links for a short visit to the vehicle, without routing and ground stations."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable, Iterable
from types import TracebackType

from asvhil.config import Config
from asvhil.config.mavlink import RoutingConfig
from asvhil.config.ports import OPERATOR
from asvhil.io.mavlink.frames import refuse_ignored_crc
from asvhil.links.clock import Clock
from asvhil.links.link import DEVICE_TAKEN, PORT_TAKEN
from asvhil.links.reconnecting import ReconnectingLink
from asvhil.links.router import MavlinkRouter, save_states
from asvhil.types import Frame, Inputs


class Visit:
    """Open while in its `async with`. `ports`: those to be opened alone. Raises LinkError where damage would pass."""

    def __init__(self, config: Config, ports: Iterable[str] | None = None) -> None:
        refuse_ignored_crc()
        self._clock = Clock()
        self._inbox: deque[Frame] = deque()
        links = config.links.model_copy(update={"ground_stations": {}, "routing": RoutingConfig(enabled=False)})
        self._router = MavlinkRouter(links, start_ns=self._clock.now_ns(), unix_ns=time.time_ns)
        specs = {port: spec for port, spec in links.endpoints.items() if port != OPERATOR}
        self._links = {
            port: ReconnectingLink(port, spec, config, self._clock, self._inbox, self._router.receive)
            for port, spec in specs.items()
            if ports is None or port in ports
        }
        self._readers: list[asyncio.Task[None]] = []

    async def __aenter__(self) -> Visit:
        self._readers = [asyncio.create_task(link.run(), name=port) for port, link in self._links.items()]
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for reader in self._readers:
            reader.cancel()
        await asyncio.gather(*self._readers, return_exceptions=True)
        save_states(self._router.states())

    def states(self) -> dict[str, str]:
        """Of the links: up, or why not."""
        return {port: link.state for port, link in self._links.items()}

    def remarks(self, port: str) -> str:
        """What the checks of a link dropped, in words; empty where nothing was."""
        return self._router.remarks(port)

    async def tick(self, step: Callable[[Inputs], Iterable[Frame]], pause_s: float) -> int:
        """Give `step` what has come since, send what it gives, and pause; the time (ns) before the pause."""
        inputs = Inputs(t_ns=self._clock.now_ns(), frames=tuple(self._inbox))
        self._inbox.clear()
        for frame in step(inputs):
            for leaving in self._router.outgoing(frame):
                await self._links[leaving.port].send(leaving)
        await asyncio.sleep(pause_s)
        return inputs.t_ns


def unopened_text(state: str) -> str:
    """What is said of the autopilot's line that does not open; `state`: that of its link, which has the reason."""
    taken = state.endswith((PORT_TAKEN, DEVICE_TAKEN))
    return f"{state}{'; is `asvhil run` using it?' if taken else ''} (links.autopilot.endpoint)"


def in_brackets(remarks: str) -> str:
    """Remarks as they stand behind a question; empty where there are none."""
    return f" ({remarks})" if remarks else ""
