"""The phases of a log: when the controller had the motors, when a fail-safe stood, and what ended each."""

from __future__ import annotations

from typing import Any

from asvhil.types import Phase, record


@record
class PhaseSpan:
    """Consecutive ticks of one phase: times (s) of the first and the last, and the reason given on entering it.

    `ended` is the phase that came next, with its reason; None where the log ends.
    """

    phase: Phase
    from_s: float
    to_s: float
    reason: str
    code: str
    ended: str | None


class PhaseSpans:
    """Collects spans from the ticks of a log in their order."""

    def __init__(self) -> None:
        self._closed: list[PhaseSpan] = []
        self._open: tuple[Phase, float, str, str] | None = None
        self._last_s = 0.0
        self.hold = 0  # the number of the present hold, from 1 on; 0: the controller has not the motors
        self._holds = 0

    def add(self, t_s: float, phase: Phase, reason: str, code: str = "") -> None:
        """The phase of a tick, with its reason in words and by name."""
        if self._open is None or phase is not self._open[0]:
            if self._open is not None:
                self._closed.append(self._span(f"{phase}: {reason}"))
            self._open = phase, t_s, reason, code
            self._holds += phase is Phase.HOLD
            self.hold = self._holds if phase is Phase.HOLD else 0
        self._last_s = t_s

    @property
    def all(self) -> tuple[PhaseSpan, ...]:
        """The spans so far, the present one included."""
        return tuple(self._closed) if self._open is None else (*self._closed, self._span(None))

    @property
    def holds(self) -> list[dict[str, Any]]:
        """Of the holds alone: `from_s`, `to_s`, `ended`, as JSON has them."""
        return [
            {"from_s": span.from_s, "ended": span.ended, "to_s": span.to_s}
            for span in self.all
            if span.phase is Phase.HOLD
        ]

    def _span(self, ended: str | None) -> PhaseSpan:
        assert self._open is not None
        phase, from_s, reason, code = self._open
        return PhaseSpan(phase=phase, from_s=from_s, to_s=self._last_s, reason=reason, code=code, ended=ended)
