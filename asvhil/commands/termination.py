"""Ctrl-C, and SIGTERM as Ctrl-C: what ends a command from outside, and is not lost on its way through a library.

A signal becomes a KeyboardInterrupt wherever Python happens to be. Where that is within a call from C, as CasADi's for
the shape of a matrix while a graph is built, the library may drop it, and the command would run on to its end.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
import time
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import typer

from asvhil.errors import is_interrupt
from asvhil.files import is_there

AGAIN_S = 0.02  # after a loss: by then whatever dropped the interrupt has gone on
# What each signal does in a process that nobody has told otherwise.
UNTOUCHED: dict[signal.Signals, Any] = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}


class WatchedInterrupt(KeyboardInterrupt):
    """A KeyboardInterrupt that takes weak references, by which its loss is noticed."""


@contextmanager
def interrupted_by(*numbers: signal.Signals) -> Iterator[None]:
    """Within it these of SIGINT and SIGTERM raise KeyboardInterrupt, and do so again where that was dropped.

    One that is ignored, or that another handler takes, stays as it is; off the main thread, all do. A KeyboardInterrupt
    that is caught on purpose within it counts as dropped, and comes again: code in there lets it pass.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    interrupts = _Interrupts()
    taken = [number for number in numbers if signal.getsignal(number) == UNTOUCHED[number]]
    try:
        try:
            for number in taken:
                signal.signal(number, interrupts.take)
            yield
        finally:
            interrupts.end()
    finally:
        interrupts.end()  # again, since a signal may have come before the first had any effect
        for number in taken:
            if signal.getsignal(number) == interrupts.take:
                signal.signal(number, UNTOUCHED[number])
        if interrupts.late:
            raise KeyboardInterrupt


_told: list[str] = []  # what has been said of the interrupt that ends the command


def tell_interrupted(words: str) -> None:
    """Say on standard error what an interrupt leaves, and how to go on; the command line then adds nothing."""
    _told.append(words)
    typer.echo(f"asvhil: {words}", err=True)


def left_to_tell() -> str:
    """What the command line is to say of an interrupt: nothing where the command has said it. The next one is new."""
    told = bool(_told)
    _told.clear()
    return "" if told else "interrupted"


@contextmanager
def logs_told(logs: Sequence[Path], go_on: str = "") -> Iterator[None]:
    """What is recorded within it is kept where it is interrupted; a line then tells where. The list may grow.

    `go_on`: how to go on, for the end of that line.
    """
    try:
        yield
    except BaseException as error:
        there = [str(log) for log in logs if is_there(log)]
        if there and is_interrupt(error):
            tell_interrupted(f"interrupted; log {', '.join(there)} (read it with `asvhil report`){go_on}")
        raise


class _Interrupts:
    """The handler, and the interrupt that is on its way."""

    def __init__(self) -> None:
        self.late = False  # a signal came when it was over, and nothing has been raised yet
        self._over = False
        self._sending = threading.Lock()
        self._number = int(signal.SIGINT)
        self._watch: weakref.ref[WatchedInterrupt] | None = None
        self._repeated = False

    def end(self) -> None:
        """From here on nothing is sent again: the signals may soon do what they do without a handler.

        Nor does the handler raise, which would leave it in place: `late` says whether it would have.
        """
        self._over = True  # without the lock, whose taking may be interrupted
        with self._sending:
            pass  # a thread that has found it not over has sent by now

    def take(self, number: int, frame: FrameType | None) -> None:
        repeated, self._repeated = self._repeated, False
        if repeated and is_interrupt(sys.exc_info()[1]):  # dropped, but a library has made an error of its own of it
            return
        if self._over:
            self.late = True
            return
        self._number = number
        raise self._watched()

    def _watched(self) -> WatchedInterrupt:
        """In a frame of its own: that of the handler is in the traceback, and would keep the interrupt alive."""
        interrupt = WatchedInterrupt()
        self._watch = weakref.ref(interrupt, self._gone)
        return interrupt

    def _gone(self, watch: weakref.ref[WatchedInterrupt]) -> None:
        """Nobody has it any more. What is raised here would be lost too, so a thread sends the signal again."""
        if not self._over:
            _thread.start_new_thread(self._send_again, ())

    def _send_again(self) -> None:
        time.sleep(AGAIN_S)
        with self._sending:
            if not self._over:
                self._repeated = True
                signal.pthread_kill(threading.main_thread().ident or 0, self._number)
