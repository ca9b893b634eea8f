"""Ctrl-C, or SIGTERM, is for the command, which tells of it; the processes that it starts may hear it too."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker

ENDING = {signal.SIGINT, signal.SIGTERM}


@contextmanager
def interrupts_held_back() -> Iterator[None]:
    """Processes that this thread starts within are not interrupted, not even before their first line runs.

    An interrupt of this process comes after it. Each of those processes lets SIGTERM through again (`let_through`),
    by which what started it may end it.
    """
    resource_tracker.ensure_running()  # which lets interrupts through when it is started
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def let_through(*numbers: signal.Signals) -> None:
    """In a process that was started within `interrupts_held_back`: what was held back at its start is so no longer."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, numbers)
