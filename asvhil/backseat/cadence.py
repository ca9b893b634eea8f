"""When a control is due, at ticks that come on a timer's grid or as they will. A pure function of the ticks' times."""

from __future__ import annotations

from typing import Protocol


class Cadence(Protocol):
    """Advanced once in each tick in which the controller may run."""

    def advance(self, t_ns: int, fresh: bool = True) -> bool:
        """Go on by a tick. Whether it solves; `fresh`: it has brought something from the autopilot or a sensor."""
        ...

    def restart(self) -> None:
        """The next tick is due."""
        ...


class EveryTicks:
    """Every n-th tick."""

    def __init__(self, ticks: int) -> None:
        self._ticks = ticks
        self._left = 0

    def advance(self, t_ns: int, fresh: bool = True) -> bool:
        """Go on by a tick. Whether it solves."""
        if self._left > 0:
            self._left -= 1
            return False
        self._left = self._ticks - 1
        return True

    def restart(self) -> None:
        """The next tick is due."""
        self._left = 0


class EveryPeriod:
    """The tick nearest to each point of a grid of time: ticks that come irregularly keep the rate on average.

    A tick that has brought nothing leaves the solution to the datagram that may be about to come, for a period or so;
    once nothing comes, such ticks keep the rate.
    """

    def __init__(self, period_ns: int, slack_ns: int) -> None:
        self._period_ns = period_ns
        self._slack_ns = slack_ns
        self._due_ns: int | None = None
        self._patience_most_ns = period_ns + 2 * slack_ns
        self._patience_ns = self._patience_most_ns

    def advance(self, t_ns: int, fresh: bool = True) -> bool:
        """Go on by a tick. Whether it solves: it is due, or nearly so."""
        due_ns = t_ns if self._due_ns is None else self._due_ns
        if t_ns < due_ns - self._slack_ns + (0 if fresh else self._patience_ns):
            return False
        self._patience_ns = self._patience_most_ns if fresh else 0
        late = t_ns - due_ns >= self._period_ns
        self._due_ns = (t_ns if late else due_ns) + self._period_ns  # a grid that was left behind starts anew
        return True

    def restart(self) -> None:
        """The next tick is due."""
        self._due_ns = None
