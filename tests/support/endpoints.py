"""Two ends of each kind of link, for the tests of endpoints."""

from __future__ import annotations

import asyncio
import gc
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from asvhil.links.endpoint import Endpoint, memory_pair, open_endpoint

KINDS = ["udp", "udp6", "tcp", "tcp6", "serial", "memory"]
DATAGRAMS = {"udp", "udp6", "memory"}


class Clock:
    """A clock that a test sets; it notes each time it was read."""

    def __init__(self, t_ns: int = 1_000) -> None:
        self.t_ns = t_ns
        self.reads = 0

    def __call__(self) -> int:
        self.reads += 1
        return self.t_ns


def run(body: Callable[[], Awaitable[None]]) -> None:
    """Run a test's coroutine; whatever asyncio complains about, also while objects are collected, fails the test."""
    noise: list[str] = []

    async def guarded() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: noise.append(str(context)))
        await asyncio.wait_for(body(), 10.0)
        assert asyncio.all_tasks() == {asyncio.current_task()}

    asyncio.run(guarded())
    gc.collect(1)  # what a test leaves is young
    assert not noise


async def recv_soon(link: Endpoint, timeout_s: float = 2.0) -> bytes:
    return (await asyncio.wait_for(link.recv(), timeout_s)).data


async def recv_exactly(link: Endpoint, n: int) -> bytes:
    data = b""
    while len(data) < n:
        data += await recv_soon(link)
    return data


async def pair(kind: str, folder: Path, clock: Callable[[], int] = Clock()) -> tuple[Endpoint, Endpoint]:  # noqa: B008
    """Two ends of a link that have met: the first is named "near" and waits or serves, the second "far" calls."""
    if kind == "memory":
        return memory_pair("near", "far", clock)
    host = "[::1]" if kind.endswith("6") else "127.0.0.1"
    if kind == "serial":
        near = await open_endpoint(f"pty:{folder}/port", "near", clock)
        far_spec = f"serial:{folder}/port:115200"
    else:
        call, serve = ("udpout", "udpin") if kind.startswith("udp") else ("tcp", "tcpin")
        near = await open_endpoint(f"{serve}:{host}:0", "near", clock)
        far_spec = f"{call}:{near.address}"
    far = await open_endpoint(far_spec, "far", clock)
    await far.send(b"hello")
    assert await recv_exactly(near, 5) == b"hello"
    return near, far


def ends(near: Endpoint, far: Endpoint, direction: str) -> tuple[Endpoint, Endpoint]:
    return (near, far) if direction == "outward" else (far, near)


def every_kind(test: Callable[..., None]) -> Callable[..., None]:
    return pytest.mark.parametrize("kind", KINDS)(test)


def both_ways(test: Callable[..., None]) -> Callable[..., None]:
    return pytest.mark.parametrize("direction", ["outward", "inward"])(every_kind(test))
