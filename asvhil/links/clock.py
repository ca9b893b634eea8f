"""The one clock: the host's monotonic clock plus an epoch offset fixed at start, so clock steps never reorder a log."""

from __future__ import annotations

import time


class Clock:
    """Nanoseconds since the Unix epoch, monotonic; the offset is that of the system clock at start."""

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        return time.monotonic_ns() + self._offset_ns
