"""Devices and sockets that take a while to open are opened in a thread, and none is left open by who went away."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Any, Protocol, TypeVar


class Closable(Protocol):
    def close(self) -> Any: ...


Opened = TypeVar("Opened", bound=Closable)


async def open_in_thread(opening: Callable[..., Opened], *arguments: Any) -> Opened:
    """What `opening(*arguments)` returns. Where the caller is cancelled meanwhile, it is closed once it is open."""
    # The thread itself closes what nobody takes: by then the caller's event loop may be gone.
    lock, wanted, opened = threading.Lock(), True, None

    def hand_over() -> Opened:
        nonlocal opened
        result = opening(*arguments)
        with lock:
            opened = result
            if not wanted:
                result.close()
        return result

    try:
        return await asyncio.to_thread(hand_over)
    except asyncio.CancelledError:
        with lock:
            wanted = False
            if opened is not None:
                opened.close()
        raise
