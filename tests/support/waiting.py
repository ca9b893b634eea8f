"""Waiting for a condition in real time, with an end."""

import asyncio
import inspect
import time
from collections.abc import Awaitable, Callable

PAUSE_S = 0.05


def wait_until(condition: Callable[[], bool], timeout_s: float, state: Callable[[], object] = lambda: "") -> None:
    """Wait until a condition is true. AssertionError, with the state, where it is not within the time-out."""
    end_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end_s, f"not within {timeout_s:g} s: {state()}"
        time.sleep(PAUSE_S)


async def until(
    condition: Callable[[], bool],
    timeout_s: float = 20.0,
    meanwhile: Callable[[], Awaitable[object] | object] = lambda: None,
    pause_s: float = PAUSE_S,
) -> None:
    """As `wait_until` while the event loop runs; `meanwhile` is called, and awaited, before each pause."""
    end_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end_s, f"not within {timeout_s:g} s"
        done = meanwhile()
        if inspect.isawaitable(done):
            await done
        await asyncio.sleep(pause_s)
