"""The page's clock: seconds as of the time of day at its start, which no step of the computer's clock moves."""

from __future__ import annotations

import time

_AHEAD_S = time.time() - time.monotonic()


def steady_s() -> float:
    """Now. Ages and time-outs are differences of it."""
    return time.monotonic() + _AHEAD_S


def behind_s() -> float:
    """What it is behind the time of day, which may have been set since the start."""
    return time.time() - steady_s()
