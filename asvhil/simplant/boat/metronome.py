"""Due times on the grid of a rate."""

from __future__ import annotations


class Metronome:
    """Beats at a rate, counted from power-on so that they never drift."""

    def __init__(self, t_ns: int, rate_hz: float) -> None:
        self._start_ns = t_ns
        self.set_rate(t_ns, rate_hz)

    def set_rate(self, t_ns: int, rate_hz: float) -> None:
        """Beats at another rate from now on, on the grid of that rate since power-on."""
        self._rate_hz = rate_hz
        self._count = int((t_ns - self._start_ns) * 1e-9 * rate_hz)
        self._advance(t_ns)

    def take_due(self, t_ns: int) -> bool:
        """Whether a beat has come since the last one that was taken; those that were missed count as one."""
        if t_ns < self._due_ns:
            return False
        self._advance(t_ns)
        return True

    def _advance(self, t_ns: int) -> None:
        """To the next beat after now."""
        self._due_ns = t_ns
        while self._due_ns <= t_ns:
            self._count += 1
            self._due_ns = self._start_ns + round(self._count * 1e9 / self._rate_hz)
