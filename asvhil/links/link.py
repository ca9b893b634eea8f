"""Base class of links: the bounded queue of received frames, the reason of a loss, and closing."""

from __future__ import annotations

import asyncio
import errno
import os
import socket
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from typing import Any

from asvhil.config.link_spec import LinkSpec
from asvhil.errors import LinkError
from asvhil.types import Frame, record

MAX_FRAMES = 4096
MAX_BYTES = 512 * 1024  # 5 s of a full 921600 baud line; a later reader needs the newest frames
OPEN_TIMEOUT_S = 5.0

PORT_TAKEN, DEVICE_TAKEN = "another program has this port", "another program has it open"
_HINTS = {
    errno.EADDRINUSE: PORT_TAKEN,
    errno.EADDRNOTAVAIL: "no interface of this computer has this address; 0.0.0.0 listens on all",
    errno.ECONNREFUSED: "no server listens there",
    errno.ENOENT: "is it plugged in, is the path right?",
    errno.EACCES: "has this user the right (for serial ports: group dialout)?",
    errno.EAGAIN: DEVICE_TAKEN,
    errno.EBUSY: DEVICE_TAKEN,
    errno.ENOTTY: "it is not a serial port",
}


def why(exc: OSError) -> str:
    """An operating system error as a phrase: what it is, and what to check."""
    if isinstance(exc, socket.gaierror):  # its number is none of the system's
        return "the name does not resolve"
    if exc.errno is None:
        return " ".join(str(exc).split()) or type(exc).__name__
    hint = _HINTS.get(exc.errno)
    text = os.strerror(exc.errno).lower()
    return f"{text}: {hint}" if hint else text


async def resolve(spec: LinkSpec, kind: socket.SocketKind) -> list[tuple[socket.AddressFamily, tuple[str, int]]]:
    """The addresses of a spec's host, IPv4 first; LinkError when there are none within 5 s."""
    try:
        try:  # a literal address needs no thread
            found = socket.getaddrinfo(spec.host, spec.ip_port, type=kind, flags=socket.AI_NUMERICHOST)
        except socket.gaierror:
            looked_up = asyncio.get_running_loop().getaddrinfo(spec.host, spec.ip_port, type=kind)
            found = await asyncio.wait_for(looked_up, OPEN_TIMEOUT_S)
    except TimeoutError:
        raise LinkError(f"{spec.text}: host {spec.host!r} not resolved within {OPEN_TIMEOUT_S:.0f} s") from None
    except (socket.gaierror, UnicodeError):
        raise LinkError(f"{spec.text}: host {spec.host!r} does not resolve; an IP address would do") from None
    # A dual-stacked name is bound and called on IPv4: that is where autopilots and ground stations look.
    found.sort(key=lambda info: info[0] != socket.AF_INET)
    return [(info[0], info[4]) for info in found]  # type: ignore[misc]


def new_socket(spec: LinkSpec, family: socket.AddressFamily, kind: socket.SocketKind) -> socket.socket:
    """A socket; LinkError where there is none to be had, as without file descriptors."""
    try:
        return socket.socket(family, kind)
    except OSError as exc:
        raise LinkError(f"{spec.text}: {why(exc)}") from None


@record
class Handover:
    """What another process needs to send on an open link: a descriptor to duplicate, and where datagrams go.

    `kind` is `datagrams`, `stream` or `serial`; `peers` are socket addresses, none where the socket is connected. `key`
    is the same as long as the descriptor stands for the same connection.
    """

    fd: int
    kind: str
    key: object
    peers: tuple[Any, ...] = ()


class Link(ABC):
    """Base of every endpoint: subclasses call `_received` and `_lose`, and give `_transmit` and `_release`."""

    def __init__(self, spec: str, address: str, port: str, now_ns: Callable[[], int]) -> None:
        self.spec = spec
        self.address = address
        self._port = port
        self._now_ns = now_ns
        self._frames: deque[Frame] = deque()
        self._bytes = 0
        self._arrived = asyncio.Event()
        self._gone = ""
        self._closed = False
        self._dropped = 0
        self._unsent = 0

    @property
    def dropped(self) -> int:
        """Received frames that were dropped, oldest first, because nobody read them."""
        return self._dropped

    @property
    def unsent(self) -> int:
        """Sends that did not go out: no peer yet, or a reader too slow."""
        return self._unsent

    @property
    def congested(self) -> bool:
        """Whether queued bytes keep the line busy: then only urgent data should be sent."""
        return False  # datagrams are sent at once or dropped

    async def recv(self) -> Frame:
        """The next frame. After the link is lost: what had arrived, then LinkError. After close(): LinkError."""
        while not self._frames:
            self._check()
            self._arrived.clear()
            await self._arrived.wait()
        frame = self._frames.popleft()
        self._bytes -= len(frame.data)
        return frame

    async def send(self, data: bytes, peer: str = "") -> None:
        """Send without waiting; what cannot be sent is dropped and counted. LinkError when the link is gone."""
        self._check()
        if data:
            self._transmit(bytes(data), peer)

    async def close(self) -> None:
        """Free the link; idempotent. A pending recv() raises LinkError, and unread frames are discarded."""
        if self._closed:
            return
        self._closed = True
        self._gone = self._gone or "closed"
        self._frames.clear()
        self._bytes = 0
        self._arrived.set()
        try:
            await self._linger()
        finally:
            self._release()

    def note_proven(self, peer: str) -> None:  # noqa: B027  (most links have one peer, whoever it is)
        """A frame of a peer was accepted: it is one that this link is for."""

    def handover(self) -> Handover | None:
        """What another process needs to send on this link now; None where it cannot, or there is nobody."""
        return None if self._gone else self._handover()

    def _handover(self) -> Handover | None:
        return None

    def _check(self) -> None:
        if self._gone:
            raise LinkError(f"{self.spec}: {self._gone}")

    def _received(self, data: bytes, peer: str = "") -> int:
        """Stamp and queue received bytes: the stamp (ns). The only place where a received frame gets its time."""
        t_ns = self._now_ns()
        if self._gone or not data:
            return t_ns
        self._frames.append(Frame(t_ns=t_ns, port=self._port, data=data, peer=peer))
        self._bytes += len(data)
        while len(self._frames) > MAX_FRAMES or self._bytes > MAX_BYTES:
            self._bytes -= len(self._frames.popleft().data)
            self._dropped += 1
        self._arrived.set()
        return t_ns

    def _lose(self, reason: str) -> None:
        """The link is lost: free it at once, so that the device can be opened again before close()."""
        if not self._gone:
            self._gone = reason
            self._arrived.set()
            self._release()

    def _count_unsent(self, sends: int) -> None:
        self._unsent += sends

    @abstractmethod
    def _transmit(self, data: bytes, peer: str) -> None:
        """Send or drop and count, without waiting."""

    async def _linger(self) -> None:
        """Wait, for a bounded time, until the last bytes are sent."""
        return  # nothing is queued

    @abstractmethod
    def _release(self) -> None:
        """Free descriptors and callbacks; called once by `_lose`, and by close()."""
