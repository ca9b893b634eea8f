"""The signals that a running daemon minds."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable
from typing import Any

ENDING = (signal.SIGINT, signal.SIGTERM)
# Of a terminal's job control: while a daemon is suspended, the motors run on as they did.
STOPPING = (signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)


class HandledSignals:
    """Handlers that `restore` takes away."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._handled: list[signal.Signals] = []
        self._before: dict[signal.Signals, Any] = {}
        self._seen: set[signal.Signals] = set()

    def handle(self, number: signal.Signals, call: Callable[[], None]) -> None:
        """Call on a signal."""

        def seen() -> None:
            self._seen.add(number)
            call()

        self._loop.add_signal_handler(number, seen)
        self._handled.append(number)

    def ignore(self, number: signal.Signals) -> None:
        """Have a signal do nothing."""
        self._before[number] = signal.signal(number, signal.SIG_IGN)

    def restore(self) -> None:
        """Have all signals do what they did before; one that has come already is ignored from now on."""
        for number in self._handled:
            self._loop.remove_signal_handler(number)
            if number in self._seen:  # a shell and the kernel both send a hang-up: the log is still to be finished
                signal.signal(number, signal.SIG_IGN)
        for number, before in self._before.items():
            signal.signal(number, before)


def handle_signals(
    loop: asyncio.AbstractEventLoop, *, stop: Callable[[], None], hang_up: Callable[[], None]
) -> HandledSignals:
    """SIGINT and SIGTERM stop; SIGHUP is a hang-up unless it is ignored already, as under nohup; none suspends."""
    handled = HandledSignals(loop)
    for number in ENDING:
        handled.handle(number, stop)
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        handled.handle(signal.SIGHUP, hang_up)
    for number in STOPPING:
        handled.ignore(number)
    return handled
