"""Two connected links in one process, without the operating system."""

from __future__ import annotations

from collections.abc import Callable

from asvhil.links.link import Link


class MemoryLink(Link):
    """One end of a pair: the other end has received what it sends when send() returns."""

    def __init__(self, port: str, now_ns: Callable[[], int]) -> None:
        super().__init__("memory", f"memory:{port}", port, now_ns)
        self._other: MemoryLink | None = None

    def _tie(self, other: MemoryLink) -> None:
        self._other = other

    def _transmit(self, data: bytes, peer: str) -> None:
        if self._other is not None:
            self._other._received(data)

    def _release(self) -> None:
        other, self._other = self._other, None
        if other is not None:
            other._lose("the other end closed")


def memory_pair(port_a: str, port_b: str, now_ns: Callable[[], int]) -> tuple[MemoryLink, MemoryLink]:
    """Two ends named `port_a` and `port_b`; sends stay whole, as datagrams do; closing one loses the other."""
    a, b = MemoryLink(port_a, now_ns), MemoryLink(port_b, now_ns)
    a._tie(b)
    b._tie(a)
    return a, b
