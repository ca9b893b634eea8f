"""The holds of a log: when the controller had the motors, and what ended it."""

from __future__ import annotations

from typing import Any

from asvhil.types import Phase


class Holds:
    """Spans in which the controller had the motors, with the reason that ended each."""

    def __init__(self) -> None:
        self.spans: list[dict[str, Any]] = []
        self._open: dict[str, Any] | None = None

    def add(self, t_s: float, phase: str, reason: str) -> None:
        """The phase of a tick, with its reason."""
        if phase == Phase.HOLD:
            if self._open is None:
                self._open = {"from_s": t_s, "ended": None}
                self.spans.append(self._open)
            self._open["to_s"] = t_s
        elif self._open is not None:
            self._open["ended"] = f"{phase}: {reason}"
            self._open = None
