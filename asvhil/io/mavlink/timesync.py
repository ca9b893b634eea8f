"""TIMESYNC: how far another computer's clock is from ours, by the exchange with the shortest round trip. Sans-IO.

We send (tc1 = 0, ts1 = our time); the other end answers (tc1 = its time, ts1 mirrored). Half of the round trip bounds
the error of an exchange, whatever the delays were: so the shortest one of a window is believed, and one that
contradicts it by more than both bounds together is an outlier. https://mavlink.io, time synchronization.
"""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

from asvhil.io.mavlink.frames import dialect
from asvhil.types import TimeOffset

WINDOW = 20  # exchanges, one each second
OUTSTANDING = 8
ANSWERS = 16  # that wait for the next tick; a flood of requests gets no more
LONGEST_NS = 1_000_000_000  # a later answer says nothing
STEP_AFTER = 5  # outliers in a row: the other clock has been set
DRIFT_PPM = 50
SLACK_NS = 100_000  # of stamps that are not taken at the very edge


class _Exchange(NamedTuple):
    t_ns: int
    offset_ns: int
    round_trip_ns: int


class TimeSync:
    """Measures one peer's clock, and answers its questions for ours.

    `offset` is the other clock less ours, None before the first exchange. `rejected` counts answers that were late,
    unasked for, or outliers; `steps` how often the clock was set.
    """

    def __init__(self) -> None:
        self._asked: deque[int] = deque(maxlen=OUTSTANDING)
        self._exchanges: deque[_Exchange] = deque(maxlen=WINDOW)
        self._answers: deque[tuple[int, int]] = deque(maxlen=ANSWERS)
        self._outliers = 0
        self._asks = False
        self.offset: TimeOffset | None = None
        self.accepted = 0
        self.rejected = 0
        self.steps = 0

    def restart(self) -> None:
        """The other end has started anew: nothing of its clock is known."""
        self._asked.clear()
        self._exchanges.clear()
        self._outliers = 0
        self.offset = None

    def ask(self) -> None:
        """Have a request sent with the next data."""
        self._asks = True

    def receive(self, t_ns: int, message: Any) -> None:
        """A TIMESYNC message, received at t_ns: a request, or an answer to ours."""
        if message.tc1 == 0:
            self._answers.append((t_ns, message.ts1))
        else:
            self._answered(t_ns, message.tc1, message.ts1)

    def data_to_send(self, t_ns: int) -> list[Any]:
        """TIMESYNC messages that leave now: the request that was asked for, then an answer for each request received.

        A request has waited for the tick. Our time in the answer is the middle of that wait, so that whoever takes
        half of the round trip away, as all do, is not wrong by half of the wait.
        """
        due: list[Any] = []
        if not (self._asks or self._answers):  # as in nearly every tick
            return due
        if self._asks:
            self._asks = False
            self._asked.append(t_ns)
            due.append(dialect.MAVLink_timesync_message(0, t_ns))
        due += [dialect.MAVLink_timesync_message((received_ns + t_ns) // 2, ts1) for received_ns, ts1 in self._answers]
        self._answers.clear()
        return due

    def _answered(self, t_ns: int, tc1: int, ts1: int) -> None:
        round_trip_ns = t_ns - ts1
        if ts1 not in self._asked or not 0 <= round_trip_ns <= LONGEST_NS:
            self.rejected += 1
            return
        self._asked.remove(ts1)
        exchange = _Exchange(t_ns, tc1 - ts1 - round_trip_ns // 2, round_trip_ns)
        if self._exchanges and not self._agrees(exchange):
            self.rejected += 1
            self._outliers += 1
            if self._outliers < STEP_AFTER:
                return
            self.steps += 1
            self._exchanges.clear()
        self._outliers = 0
        self.accepted += 1
        self._exchanges.append(exchange)
        best = self._best()
        self.offset = TimeOffset(offset_ns=best.offset_ns, round_trip_ns=best.round_trip_ns, exchanges=self.accepted)

    def _best(self) -> _Exchange:
        """The shortest round trip of the window, the latest of equals."""
        return min(reversed(self._exchanges), key=lambda exchange: exchange.round_trip_ns)

    def _agrees(self, exchange: _Exchange) -> bool:
        best = self._best()
        bound_ns = (exchange.round_trip_ns + best.round_trip_ns) // 2
        bound_ns += SLACK_NS + (exchange.t_ns - best.t_ns) * DRIFT_PPM // 1_000_000
        return abs(exchange.offset_ns - best.offset_ns) <= bound_ns
