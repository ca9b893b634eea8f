"""How often the daemon cuts a tick because something has arrived."""

from __future__ import annotations


class Allowance:
    """A rate that holds on average: single events pass at once, a flood is spread out."""

    def __init__(self, rate_hz: float, burst: int) -> None:
        self._rate_hz = rate_hz
        self._burst = float(burst)
        self._left = self._burst
        self._at_s: float | None = None

    def take_s(self, now_s: float) -> float:
        """Take one event. Returns the seconds that it has to wait for its turn."""
        elapsed_s = 0.0 if self._at_s is None else now_s - self._at_s
        self._at_s = now_s
        self._left = min(self._burst, self._left + elapsed_s * self._rate_hz) - 1.0
        return max(0.0, -self._left / self._rate_hz)
