"""Due times on the grid of a rate."""

from __future__ import annotations


class Metronome:
    """A periodic timer, counted from power-on so that it does not drift; `due_ns` is when it is due next."""

    def __init__(self, t_ns: int, rate_hz: float) -> None:
        self._start_ns = t_ns
        self.set_rate(t_ns, rate_hz)

    def set_rate(self, t_ns: int, rate_hz: float) -> None:
        """Another rate from now on, on the grid of that rate since power-on."""
        self._rate_hz = rate_hz
        self._count = int((t_ns - self._start_ns) * 1e-9 * rate_hz)
        self._advance(t_ns)

    def take_due(self, t_ns: int) -> bool:
        """Whether a due time has passed since the last call; several count as one."""
        if t_ns < self.due_ns:
            return False
        self._advance(t_ns)
        return True

    def _advance(self, t_ns: int) -> None:
        """Move to the next due time after a time."""
        self.due_ns = t_ns
        while self.due_ns <= t_ns:
            self._count += 1
            self.due_ns = self._start_ns + round(self._count * 1e9 / self._rate_hz)
