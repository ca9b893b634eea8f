"""TCP links: `tcp` connects to a server, `tcpin` is a server for one client at a time."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable

from asvhil.config.link_spec import LinkSpec, host_port
from asvhil.errors import LinkError
from asvhil.links.link import OPEN_TIMEOUT_S, Handover, Link, new_socket, resolve, why
from asvhil.links.stream import ByteStream

DEAD_PEER_S = 10
CONGESTED_BYTES = 16 * 1024  # not accepted by the kernel yet: the peer is too slow


def _tune(sock: socket.socket) -> None:
    """Set no-delay, and keep-alive so that a peer that vanishes is noticed within some 10 s."""
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 4)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 2)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, DEAD_PEER_S * 1000)


class TcpClient(Link):
    """One connection; when the server closes it, the link is lost."""

    def __init__(self, spec: LinkSpec, port: str, now_ns: Callable[[], int], sock: socket.socket) -> None:
        super().__init__(spec.text, host_port(*sock.getpeername()[:2]), port, now_ns)
        self._sock = sock
        self._stream = ByteStream(sock.fileno(), self._received, self._lose, self._count_unsent)

    def _handover(self) -> Handover | None:
        return Handover(fd=self._sock.fileno(), kind="stream", key=self)

    def _transmit(self, data: bytes, peer: str) -> None:
        self._stream.send(data)

    @property
    def congested(self) -> bool:
        """Whether sends are queued since the peer reads too slowly."""
        return self._stream.pending_bytes > CONGESTED_BYTES

    def _release(self) -> None:
        self._stream.stop()
        self._sock.close()


class TcpServer(Link):
    """Listens; a new client replaces the last one, so that a dead connection never blocks a client that reconnects."""

    def __init__(self, spec: LinkSpec, port: str, now_ns: Callable[[], int], sock: socket.socket) -> None:
        super().__init__(spec.text, host_port(*sock.getsockname()[:2]), port, now_ns)
        self._listener = sock
        self._client: socket.socket | None = None
        self._sessions = 0
        self._stream: ByteStream | None = None
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(sock, self._acceptable)

    @property
    def session(self) -> int:
        """The number of the client that is connected, counted from 1; 0 while there is none."""
        return self._sessions if self._client is not None else 0

    def _acceptable(self) -> None:
        try:
            client, _ = self._listener.accept()
        except (BlockingIOError, InterruptedError, ConnectionError):
            return  # the client closed before it was accepted
        except OSError as exc:  # out of file descriptors: the listener would stay readable and keep the loop busy
            self._lose(f"cannot take a client: {why(exc)}")
            return
        self._drop_client()
        try:
            _tune(client)
        except OSError:
            client.close()
            return
        self._client = client
        self._sessions += 1
        self._stream = ByteStream(client.fileno(), self._received, self._client_left, self._count_unsent)

    def _handover(self) -> Handover | None:
        if self._client is None:
            return None
        return Handover(fd=self._client.fileno(), kind="stream", key=(self, self._sessions))

    def _client_left(self, _reason: str) -> None:
        self._drop_client()

    def _drop_client(self) -> None:
        if self._stream is not None:
            self._stream.stop()
            self._stream = None
        if self._client is not None:
            self._client.close()
            self._client = None

    def _transmit(self, data: bytes, peer: str) -> None:
        if self._stream is None:
            self._count_unsent(1)
        else:
            self._stream.send(data)

    @property
    def congested(self) -> bool:
        """Whether sends are queued since the client reads too slowly."""
        return self._stream is not None and self._stream.pending_bytes > CONGESTED_BYTES

    def _release(self) -> None:
        self._drop_client()
        if self._listener.fileno() >= 0:
            self._loop.remove_reader(self._listener)
            self._listener.close()


async def open_tcp(spec: LinkSpec, port: str, now_ns: Callable[[], int]) -> TcpClient:
    """Connect to the first address of the host that answers within 5 s; LinkError when none does."""
    reason = ""
    for family, target in await resolve(spec, socket.SOCK_STREAM):
        sock = new_socket(spec, family, socket.SOCK_STREAM)
        try:
            sock.setblocking(False)
            await asyncio.wait_for(asyncio.get_running_loop().sock_connect(sock, target), OPEN_TIMEOUT_S)
            # Repeated attempts at a free port of this computer can end in a connection of the socket to itself.
            if sock.getsockname() == sock.getpeername():
                raise ConnectionRefusedError("no server listens there")
            _tune(sock)
            return TcpClient(spec, port, now_ns, sock)
        except TimeoutError:
            sock.close()
            reason = f"no answer within {OPEN_TIMEOUT_S:.0f} s"
        except OSError as exc:
            sock.close()
            reason = why(exc)
        except BaseException:  # cancelled
            sock.close()
            raise
    raise LinkError(f"{spec.text}: {reason}")


async def open_tcpin(spec: LinkSpec, port: str, now_ns: Callable[[], int]) -> TcpServer:
    """Listen on the first address of the host that can be bound; LinkError when none can."""
    reason = ""
    for family, target in await resolve(spec, socket.SOCK_STREAM):
        sock = new_socket(spec, family, socket.SOCK_STREAM)
        try:
            sock.setblocking(False)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # or a restart waits for TIME_WAIT
            sock.bind(target)
            sock.listen(4)
            return TcpServer(spec, port, now_ns, sock)
        except OSError as exc:
            sock.close()
            reason = why(exc)
    raise LinkError(f"{spec.text}: {reason}")
