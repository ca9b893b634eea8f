"""UDP links: `udpin` binds and learns its peers, `udpout` has one peer. Datagrams stay whole and are never queued."""

from __future__ import annotations

import asyncio
import errno
import socket
from collections.abc import Callable
from typing import Any

from asvhil.config.link_spec import LinkSpec, host_port
from asvhil.errors import LinkError
from asvhil.links.link import Handover, Link, new_socket, resolve, why

MAX_PEERS = 16
PEER_LIFE_NS = 10_000_000_000
NEWCOMER_NS = 1_000_000_000  # until a newcomer is answered
DATAGRAM_BYTES = 65536
# Receive buffer for the time that the process waits for a core; the default holds some 50 ms at 5000 datagrams/s. The
# kernel grants less where net.core.rmem_max is smaller.
RECEIVE_BUFFER_BYTES = 2 * 1024 * 1024
BURST = 64  # datagrams per turn of the loop: a flood must not starve the control tick
# Errors of earlier sends, each reported once: the peer, or the route to it, is not there yet.
_PASSING = {errno.ECONNREFUSED, errno.EHOSTUNREACH, errno.ENETUNREACH, errno.ENETDOWN, errno.EHOSTDOWN, errno.EINTR}


class UdpLink(Link):
    """Base class of both kinds: reading in bursts, and tolerance of transient errors."""

    def __init__(self, spec: LinkSpec, address: str, port: str, now_ns: Callable[[], int], sock: socket.socket) -> None:
        super().__init__(spec.text, address, port, now_ns)
        self._sock = sock
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(sock, self._readable)

    def _readable(self) -> None:
        for _ in range(BURST):
            try:
                data, source = self._sock.recvfrom(DATAGRAM_BYTES)
            except BlockingIOError:
                return
            except OSError as exc:
                if exc.errno not in _PASSING:
                    self._lose(why(exc))
                return
            peer = host_port(source[0], source[1])
            self._heard(peer, source, self._received(data, peer))

    def _heard(self, peer: str, source: Any, t_ns: int) -> None:
        """Note the address of a received datagram."""

    def _release(self) -> None:
        if self._sock.fileno() >= 0:
            self._loop.remove_reader(self._sock)
            self._sock.close()


class UdpIn(UdpLink):
    """Bound. Sends without a peer go to the peers heard in the last 10 s, of at most 16.

    Anybody may send a datagram here. A peer whose frames were accepted loses its place to none whose were not, and once
    there is one nothing is sent to the others. One newcomer is remembered beside all of them, for a second or until the
    next newcomer, so that its first request is answered too.
    """

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._peers: dict[str, tuple[Any, int]] = {}  # text -> (socket address, heard_ns), least recent first
        self._proven: dict[str, None] = {}  # the last proven one at the end

    def note_proven(self, peer: str) -> None:
        if next(reversed(self._proven), None) == peer:
            return
        self._proven.pop(peer, None)
        self._proven[peer] = None
        if len(self._proven) > MAX_PEERS:
            del self._proven[next(iter(self._proven))]

    def _heard(self, peer: str, source: Any, t_ns: int) -> None:
        self._peers.pop(peer, None)
        self._peers[peer] = (source, t_ns)
        if len(self._peers) > MAX_PEERS:
            others = (other for other in self._peers if other not in self._proven and other != peer)
            leaving = next(others, None)
            # Proven ones may talk before a newcomer is answered.
            waits = peer in self._proven and leaving is not None and self._may_wait(leaving, t_ns)
            if leaving is not None and not waits:
                del self._peers[leaving]

    def _may_wait(self, peer: str, t_ns: int) -> bool:
        """Whether a peer in the one place beside the others may still keep it."""
        return len(self._peers) <= MAX_PEERS + 1 and t_ns - self._peers[peer][1] < NEWCOMER_NS

    def _heard_lately(self) -> list[Any]:
        oldest_ns = self._now_ns() - PEER_LIFE_NS
        lately = {peer: source for peer, (source, heard_ns) in self._peers.items() if heard_ns >= oldest_ns}
        proven = [source for peer, source in lately.items() if peer in self._proven]
        return proven or list(lately.values())

    def _handover(self) -> Handover | None:
        peers = tuple(self._heard_lately())
        return Handover(fd=self._sock.fileno(), kind="datagrams", key=self, peers=peers) if peers else None

    def _transmit(self, data: bytes, peer: str) -> None:
        if peer:
            known = self._peers.get(peer)
            targets = [known[0]] if known else []
        else:
            targets = self._heard_lately()
        sent = False
        for target in targets:
            try:
                self._sock.sendto(data, target)
                sent = True
            except OSError:  # no buffer, no route: a datagram may be lost, the link stays
                continue
        if not sent:
            self._count_unsent(1)


class UdpOut(UdpLink):
    """Connected to one peer, which may start later, restart, or be unreachable for a while."""

    def _handover(self) -> Handover | None:
        return Handover(fd=self._sock.fileno(), kind="datagrams", key=self)

    def _transmit(self, data: bytes, peer: str) -> None:
        for _ in range(2):  # an ICMP error of an earlier datagram is reported instead of sending this one
            try:
                self._sock.send(data)
                return
            except ConnectionRefusedError:
                continue
            except OSError:
                break
        self._count_unsent(1)


async def open_udp(spec: LinkSpec, port: str, now_ns: Callable[[], int]) -> UdpLink:
    """Bind (udpin) or connect (udpout) a socket; LinkError when no address of the host will do."""
    reason = ""
    for family, target in await resolve(spec, socket.SOCK_DGRAM):
        sock = new_socket(spec, family, socket.SOCK_DGRAM)
        try:
            sock.setblocking(False)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
            if spec.scheme == "udpin":
                sock.bind(target)
                return UdpIn(spec, host_port(*sock.getsockname()[:2]), port, now_ns, sock)
            sock.connect(target)
            return UdpOut(spec, host_port(*sock.getpeername()[:2]), port, now_ns, sock)
        except OSError as exc:
            sock.close()
            reason = why(exc)
    raise LinkError(f"{spec.text}: {reason}")
