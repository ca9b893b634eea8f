"""Out-of-sequence measurements: a history of events and states, to process a late reading at its own time."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from typing import Any, Generic, NamedTuple, TypeVar

State = TypeVar("State")


class _Entry(NamedTuple):
    t_ns: int
    event: Any
    state: Any  # after the event


class History(Generic[State]):
    """Events in order of time, each with the state after it, over a bounded span.

    `step(state, t_ns, event)` gives the state after an event and does not change the one before. The newest state does
    not depend on the order in which events of different times were added, as long as none was too late.
    """

    def __init__(self, step: Callable[[State, int, Any], State], span_ns: int, t_ns: int, state: State) -> None:
        self._step = step
        self._span_ns = span_ns
        self._entries = [_Entry(t_ns, None, state)]
        self.too_late = 0

    @property
    def t_ns(self) -> int:
        """The time of the newest event."""
        return self._entries[-1].t_ns

    @property
    def event(self) -> Any:
        """The newest event."""
        return self._entries[-1].event

    @property
    def state(self) -> State:
        """The state after the newest event."""
        newest: State = self._entries[-1].state
        return newest

    def add(self, t_ns: int, event: Any) -> None:
        """Add an event, and redo all later ones; one from before the span is dropped and counted."""
        entries = self._entries
        newest = entries[-1]
        if t_ns >= newest.t_ns:
            entries.append(_Entry(t_ns, event, self._step(newest.state, t_ns, event)))
            if t_ns - entries[1].t_ns > self._span_ns:
                self._forget(t_ns - self._span_ns)
            return
        place = bisect_right(entries, t_ns, key=lambda entry: entry.t_ns)
        if place == 0 or newest.t_ns - t_ns > self._span_ns:
            self.too_late += 1
            return
        again = entries[place:]
        del entries[place:]
        for at_ns, what in ((t_ns, event), *((entry.t_ns, entry.event) for entry in again)):
            entries.append(_Entry(at_ns, what, self._step(entries[-1].state, at_ns, what)))

    def _forget(self, before_ns: int) -> None:
        """Drop entries from before a time, but the last of them: its state is where the span begins."""
        entries, keep = self._entries, 0
        while keep + 1 < len(entries) and entries[keep + 1].t_ns <= before_ns:  # a few at a time
            keep += 1
        del entries[:keep]
