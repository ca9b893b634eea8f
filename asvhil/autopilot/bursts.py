"""Reports of one kind that a link delivers in bursts: several at once, after a silence. Pure."""

from __future__ import annotations

SILENCE_NS = 150_000_000  # before a burst: longer than the interval of a stream of 10 Hz
TOGETHER_NS = 20_000_000  # after the first of them, what else has come in the same delivery
OF_ONE_TIME_NS = 1_000  # room for the reports of one delivery, a nanosecond each


class Bursts:
    """`take` the time of each report; ask `silence_ns` for how long those that came together may have waited."""

    def __init__(self) -> None:
        self._last_ns: int | None = None
        self._first_ns, self._before_ns = (
            0,
            0,
        )  # the first report of those that came together, and the silence before it
        self.silence_ns = 0  # before the burst that the last report is one of; 0: it came alone

    def take(self, t_ns: int) -> None:
        """A report, later than the last."""
        gap_ns = None if self._last_ns is None else t_ns - self._last_ns
        self._last_ns = t_ns
        if gap_ns is not None and gap_ns < SILENCE_NS and t_ns - self._first_ns <= TOGETHER_NS:
            self.silence_ns = self._before_ns
        else:
            late = gap_ns is not None and gap_ns >= SILENCE_NS
            self._first_ns, self._before_ns = (t_ns, gap_ns or 0) if late else (-TOGETHER_NS - 1, 0)
            self.silence_ns = 0


def time_of_its_own(t_ns: int, last_ns: int) -> int:
    """The time of a report, by nanoseconds later than the last one where both came in one delivery."""
    return last_ns + 1 if 0 <= last_ns - t_ns < OF_ONE_TIME_NS else t_ns
