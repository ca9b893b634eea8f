"""The links of the daemon and the plant: UDP, TCP, serial, pseudo terminal, memory, behind one protocol.

Links are one-shot: a broken one is never repaired, its owner opens a new one. Nothing here waits for a slow peer: what
is not read or cannot be sent in time is dropped, oldest first, and counted.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from asvhil.config.link_spec import LinkSpec, parse_spec
from asvhil.config.registry import LINKS
from asvhil.links.memory import memory_pair
from asvhil.types import Frame

__all__ = ["INBOX_FRAMES", "Endpoint", "LinkSpec", "memory_pair", "open_endpoint", "parse_spec"]

INBOX_FRAMES = 20_000  # queued before the oldest are dropped: 4 s of a flooded link


class Endpoint(Protocol):
    """One open link. `spec` is as configured; `address` is the actual one (bound port, slave of the pty)."""

    spec: str
    address: str

    async def recv(self) -> Frame:
        """The next datagram, or up to 4096 bytes of a stream, stamped on arrival; LinkError when the link is gone."""
        ...

    async def send(self, data: bytes, peer: str = "") -> None:
        """Send to `peer`, or to all peers of the last 10 s. Never waits: drops and counts. LinkError when gone."""
        ...

    async def close(self) -> None:
        """Free the link; idempotent; a pending recv() raises LinkError."""
        ...

    @property
    def dropped(self) -> int:
        """Received frames that were dropped, oldest first, because nobody read them."""
        ...

    @property
    def unsent(self) -> int:
        """Sends that did not go out: no peer yet, or a reader too slow."""
        ...

    @property
    def congested(self) -> bool:
        """Whether sends are queued: then only urgent data should be sent."""
        ...


async def open_endpoint(spec: str, port: str, now_ns: Callable[[], int]) -> Endpoint:
    """Open a link named `port`; ConfigError on a bad spec, LinkError (one line with the spec) when it cannot open."""
    parsed = parse_spec(spec)
    endpoint: Endpoint = await LINKS.find(parsed.scheme).make(parsed, port, now_ns)
    return endpoint
