"""A configured link that is reopened, with bounded back-off, whenever it is lost."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import Awaitable, Callable

from asvhil.config import Config
from asvhil.errors import LinkError
from asvhil.links.clock import Clock
from asvhil.links.endpoint import INBOX_FRAMES, Endpoint, open_endpoint
from asvhil.links.link import Handover, Link
from asvhil.types import Frame


class ReconnectingLink:
    """One configured port: opens its endpoint, reads it, and reopens it with bounded back-off after a loss."""

    def __init__(
        self,
        port: str,
        spec: str,
        config: Config,
        clock: Clock,
        inbox: deque[Frame],
        take: Callable[[Frame], Awaitable[list[Frame]]] | None = None,
    ) -> None:
        self.port = port
        self._spec = spec
        self._first_s = config.links.reconnect_first_s
        self._max_s = config.links.reconnect_max_s
        self._clock = clock
        self._inbox = inbox
        self._take = take
        self._endpoint: Endpoint | None = None
        self.state = "connecting"
        self.opened_ns = 0
        self.openings = 0
        self.received_bytes = 0  # since it was last opened
        self.unsent = 0
        self.overflowed = 0

    @property
    def is_serial(self) -> bool:
        """Whether it has a baud rate, which may be the wrong one."""
        return self._spec.startswith("serial:")

    async def run(self) -> None:
        """Read frames into the inbox until cancelled."""
        wait_s = self._first_s
        try:
            while True:
                try:
                    self._endpoint = await open_endpoint(self._spec, self.port, self._clock.now_ns)
                    self.state = "up"
                    self.opened_ns = self._clock.now_ns()
                    self.openings += 1
                    self.received_bytes = 0
                    while True:
                        frame = await self._endpoint.recv()
                        self.received_bytes += len(frame.data)
                        wait_s = self._first_s
                        for taken in (frame,) if self._take is None else await self._take(frame):
                            if len(self._inbox) >= INBOX_FRAMES:
                                self._inbox.popleft()
                                self.overflowed += 1
                            self._inbox.append(taken)
                except LinkError as error:
                    self.state = str(error)
                except Exception as error:  # a link that nobody opens again would be the end of all control
                    self.state = f"{self._spec}: {' '.join(str(error).split()) or type(error).__name__}"
                await self._close()
                await asyncio.sleep(wait_s)
                wait_s = min(2.0 * wait_s, self._max_s)
        finally:
            await self._close()

    async def send(self, frame: Frame) -> None:
        """Send at once, or drop: a motor command must not arrive late."""
        endpoint = self._endpoint
        if endpoint is None:
            self.unsent += 1
            return
        try:
            await endpoint.send(frame.data, frame.peer)
        except LinkError as error:
            self.unsent += 1
            self.state = str(error)

    async def forward(self, data: bytes) -> bool:
        """Forward a frame of others if the link is not congested, so that the daemon's own frames never wait for it."""
        endpoint = self._endpoint
        if endpoint is None or endpoint.congested:
            return False
        unsent = endpoint.unsent
        with contextlib.suppress(LinkError):
            await endpoint.send(data)
            return endpoint.unsent == unsent
        return False

    def note_proven(self, peer: str) -> None:
        """A frame of a peer was accepted."""
        if isinstance(self._endpoint, Link):
            self._endpoint.note_proven(peer)

    @property
    def handover(self) -> Handover | None:
        """What another process needs to send on the link as it is now; None where it could not."""
        return self._endpoint.handover() if isinstance(self._endpoint, Link) else None

    @property
    def losses(self) -> str:
        """How much was not sent or not read, as text; empty if nothing."""
        return f"{self.unsent} sends and {self.overflowed} frames dropped" if self.unsent or self.overflowed else ""

    async def _close(self) -> None:
        endpoint, self._endpoint = self._endpoint, None
        if endpoint is not None:
            self.unsent += endpoint.unsent
            self.overflowed += endpoint.dropped
            with contextlib.suppress(LinkError):
                await endpoint.close()
