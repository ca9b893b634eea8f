"""What shows things to people on a thread of its own, so that a slow or broken terminal never holds up a boat."""

from __future__ import annotations

import sys
import threading
import time
from collections import deque
from collections.abc import Callable

from asvhil.commands.output import StandardStream

STUCK_S = 2.0
CLOSE_S = 1.0


class Display:
    """Calls `put` hands over, done one after the other on a thread. Neither `put` nor `close` raises or waits long.

    Of what waits only the newest `keep` are kept. The first call that raises is the last one.
    """

    def __init__(self, keep: int) -> None:
        self._waiting: deque[Callable[[], None]] = deque(maxlen=keep)
        self._come = threading.Event()
        self._closing = False
        self._since_s: float | None = None  # when the call that is being done began
        self._failure = ""
        self._thread = threading.Thread(target=self._work, name="display", daemon=True)
        self._thread.start()

    @property
    def trouble(self) -> str:
        """Why nothing, or nothing new, is shown; empty while all is."""
        if self._failure:
            return self._failure
        since_s = self._since_s
        stuck = since_s is not None and time.monotonic() - since_s > STUCK_S
        return f"takes nothing for more than {STUCK_S:g} s" if stuck else ""

    def put(self, show: Callable[[], None]) -> None:
        """Have something shown when its turn comes."""
        if not self._failure:
            self._waiting.append(show)
            self._come.set()

    def close(self) -> None:
        """Show what waits, for a second at most."""
        self._closing = True
        self._come.set()
        self._thread.join(CLOSE_S)

    def _work(self) -> None:
        while not self._failure:
            self._come.wait()
            self._come.clear()
            while self._waiting and not self._failure:
                self._do(self._waiting.popleft())
            if self._closing and not self._waiting:
                return

    def _do(self, show: Callable[[], None]) -> None:
        self._since_s = time.monotonic()
        try:
            show()
            output = sys.stdout
            self._failure = output.failure if isinstance(output, StandardStream) else ""
        except BaseException as error:  # rich ends the program where a pipe is closed
            self._failure = (error.strerror if isinstance(error, OSError) else None) or type(error).__name__
        self._since_s = None
