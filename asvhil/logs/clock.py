"""The time of a run by its ticks. A stall is time in which the boat drifted; a jump of the clock is none."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from asvhil.logs.encoding import NOT_VALID
from asvhil.types import record

TICK_HZ = 20.0  # where a log does not tell
STALL_S = 1.0  # a tick that comes later than this after its time
LEAP_S = 86400.0  # no computer stands still for so long and goes on: its clock was set
TOLD_MOST = 5


@record
class TimeJump:
    """A jump of the clock by `by_s` before the tick of this number, counted from 1; `at_s` is the time of the run."""

    tick: int
    at_s: float
    by_s: float

    @property
    def words(self) -> str:
        """One line for people."""
        return f"time jumps by {self.by_s:+.3f} s at tick {self.tick}; no figure counts that as time"


@record
class Stall:
    """`for_s` without a tick before the one of this number, counted from 1, which is at `at_s` of the run."""

    tick: int
    at_s: float
    for_s: float

    @property
    def words(self) -> str:
        """One line for people."""
        return f"no tick for {self.for_s:.1f} s at tick {self.tick}"


def jump_words(jumps: Sequence[TimeJump]) -> list[str]:
    """A line for each of the first jumps, and one for the rest."""
    left = len(jumps) - TOLD_MOST
    return [*(jump.words for jump in jumps[:TOLD_MOST]), *([f"time jumps {left} times more"] if left > 0 else [])]


def stall_words(stalls: Sequence[Stall]) -> list[str]:
    """A line for each of the first stalls, and one for the rest."""
    left = len(stalls) - TOLD_MOST
    rest = [f"no tick for more than {STALL_S:g} s {left} times more"] if left > 0 else []
    return [*(stall.words for stall in stalls[:TOLD_MOST]), *rest]


class TickClock:
    """Seconds since the first tick of the ticks of a log in their order: stalls are counted, jumps left out.

    A daemon's clock is monotonic (`links/clock.py`), so that a gap between ticks is time that has passed.
    """

    def __init__(self, tick_s: float) -> None:
        self._tick_s = tick_s
        self._number = 0
        self._now_ns = self._before_ns = 0
        self._start_ns = self._start_before_ns = 0
        self.jumps: list[TimeJump] = []
        self.stalls: list[Stall] = []

    def tick(self, t_ns: int, number: int | None = None) -> None:
        """The next tick begins; `number` counts from 1 on, and tells which are missing."""
        number = self._number + 1 if number is None else number
        if not self._number:
            self._start_ns = self._now_ns = t_ns
        self._before_ns, self._start_before_ns = self._now_ns, self._start_ns
        if self._number:
            self._judge(t_ns, number)
        self._number, self._now_ns = number, t_ns

    def _judge(self, t_ns: int, number: int) -> None:
        expected_s = max(number - self._number, 1) * self._tick_s
        took_s = (t_ns - self._now_ns) * 1e-9
        if took_s < 0.0 or took_s > expected_s + LEAP_S:
            by_s = took_s - expected_s
            self._start_ns += round(by_s * 1e9)
            self.jumps.append(TimeJump(tick=number, at_s=self._since(t_ns), by_s=by_s))
        elif took_s > expected_s + STALL_S:
            self.stalls.append(Stall(tick=number, at_s=self._since(t_ns), for_s=took_s))

    def t_s(self, t_ns: int) -> float:
        """The time of the run at a time of the present tick, which may be of before a jump."""
        return self.since_ns(t_ns) * 1e-9

    def since_ns(self, t_ns: int) -> int:
        """As `t_s`, in ns; 0 before the first tick."""
        if not self._number:
            return 0
        if self._start_before_ns != self._start_ns and abs(t_ns - self._before_ns) < abs(t_ns - self._now_ns):
            return t_ns - self._start_before_ns
        return t_ns - self._start_ns

    def _since(self, t_ns: int) -> float:
        return (t_ns - self._start_ns) * 1e-9


class _Ticking(msgspec.Struct):
    class Daemon(msgspec.Struct):
        tick_hz: float = TICK_HZ

    daemon: Daemon = msgspec.field(default_factory=Daemon)


def clock_of(metadata: dict[str, dict[str, str]]) -> TickClock:
    """The clock of a log with this metadata; of one that does not tell its tick rate, or a damaged one, of 20 Hz."""
    try:
        tick_hz = msgspec.json.decode(metadata.get("config", {}).get("json", ""), type=_Ticking).daemon.tick_hz
    except NOT_VALID:
        tick_hz = TICK_HZ
    return TickClock(1.0 / (tick_hz if tick_hz > 0.0 else TICK_HZ))
