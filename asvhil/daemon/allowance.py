"""Rate limit of the ticks that the daemon cuts on arrival."""

from __future__ import annotations


class Allowance:
    """A token bucket: single events pass at once, many at a time are spread out to the average rate."""

    def __init__(self, rate_hz: float, burst: int) -> None:
        self._rate_hz = rate_hz
        self._burst = float(burst)
        self._left = self._burst
        self._at_s: float | None = None

    def take_s(self, now_s: float) -> float:
        """Take one event at a time (s): the seconds to wait before it."""
        elapsed_s = 0.0 if self._at_s is None else now_s - self._at_s
        self._at_s = now_s
        self._left = min(self._burst, self._left + elapsed_s * self._rate_hz) - 1.0
        return max(0.0, -self._left / self._rate_hz)
