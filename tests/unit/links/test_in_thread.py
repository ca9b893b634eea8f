"""What is opened in a thread is handed over, or closed where nobody waits for it any more."""

from __future__ import annotations

import asyncio
import threading

import pytest

from asvhil.links.in_thread import open_in_thread


class Device:
    def __init__(self) -> None:
        self.closed = threading.Event()

    def close(self) -> None:
        self.closed.set()


async def test_who_waits_gets_it_open_or_the_error() -> None:
    device = Device()
    assert await open_in_thread(lambda: device) is device and not device.closed.is_set()

    def refused(name: str) -> Device:
        raise OSError(f"{name} is busy")

    with pytest.raises(OSError, match="port is busy"):
        await open_in_thread(refused, "port")


@pytest.mark.parametrize("fails", [False, True])
async def test_who_went_away_leaves_nothing_open(fails: bool) -> None:
    begun, go_on, device = threading.Event(), threading.Event(), Device()

    def opening() -> Device:
        begun.set()
        go_on.wait(10.0)
        if fails:
            raise OSError("busy")
        return device

    waiting = asyncio.create_task(open_in_thread(opening))
    await asyncio.to_thread(begun.wait, 10.0)
    waiting.cancel()
    with pytest.raises(asyncio.CancelledError):
        await waiting
    go_on.set()
    if fails:
        await asyncio.sleep(0.05)
    else:
        assert await asyncio.to_thread(device.closed.wait, 10.0)


def test_who_went_away_with_the_whole_event_loop_leaves_nothing_open() -> None:
    begun, go_on, device = threading.Event(), threading.Event(), Device()

    def opening() -> Device:
        begun.set()
        go_on.wait(10.0)
        return device

    async def go_away() -> None:
        waiting = asyncio.create_task(open_in_thread(opening))
        await asyncio.to_thread(begun.wait, 10.0)
        waiting.cancel()
        asyncio.get_running_loop().call_later(0.1, go_on.set)

    asyncio.run(go_away())
    go_on.set()
    assert device.closed.wait(10.0)
