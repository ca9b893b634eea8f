"""Devices and sockets that take a while to open are opened in a thread, and none is left open by who went away."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Protocol, TypeVar


class Closable(Protocol):
    def close(self) -> Any: ...


Opened = TypeVar("Opened", bound=Closable)


async def open_in_thread(opening: Callable[..., Opened], *arguments: Any) -> Opened:
    """What `opening(*arguments)` returns. Where the caller is cancelled meanwhile, it is closed once it is open."""
    done = asyncio.ensure_future(asyncio.to_thread(opening, *arguments))
    try:
        return await asyncio.shield(done)
    except asyncio.CancelledError:
        done.add_done_callback(_close)
        raise


def _close(done: asyncio.Future[Any]) -> None:
    if not done.cancelled() and done.exception() is None:
        done.result().close()
