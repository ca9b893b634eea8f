"""Who asks the daemon when: one control at a time, and what stops the motors before all that was asked for earlier."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

Answer = tuple[bool, str]  # whether it was granted, and the daemon's words


class Turns:
    """Controls in the order in which they come, each once the one before is answered."""

    def __init__(self) -> None:
        self._turn = asyncio.Lock()
        self._under_way: dict[asyncio.Task[Answer], str] = {}  # and what has overtaken it, "" for nothing

    async def take(self, ask: Callable[[], Awaitable[Answer]], overtaking: str = "") -> Answer:
        """The answer of `ask`, in its turn. `overtaking`: the name of one that refuses all that came before it.

        What was refused so is not sent again, so that nothing asked for earlier undoes it.
        """
        if overtaking:
            self._refuse_all(overtaking)
        task = asyncio.create_task(self._in_turn(ask))
        self._under_way[task] = ""
        await asyncio.wait((task,))
        overtaken = self._under_way.pop(task)
        return (False, f"overtaken by {overtaken}") if task.cancelled() else task.result()

    def _refuse_all(self, overtaking: str) -> None:
        for task in self._under_way:
            if task.cancel():
                self._under_way[task] = overtaking

    async def _in_turn(self, ask: Callable[[], Awaitable[Answer]]) -> Answer:
        async with self._turn:
            return await ask()
