"""The autopilot's clock beside ours: how old what it dates is, and whether it keeps pace.

A simulation on a busy computer does not keep pace, and a queue delays what it says.

What a slow simulation loses is lost for good: a boat that goes at 2 m/s by its own clock is a metre behind after half a
second that it has not lived through. A filter that believes the velocity would take that for the receiver's slow error.
Sans-IO.
"""

from __future__ import annotations

from collections import deque

BEST_NS = 5_000_000_000  # in which some message comes without delay
LATE_NS = 250_000_000  # radios are late by less
LASTING_NS = 15_000_000_000  # until the filter has believed the position again, or not
FORGET_NS = 30_000_000_000
TOLD_NS = 500_000_000
STEP_NS = 1_000_000_000
OLDEST_NS = 500_000_000  # a fix that seems older is dated by another clock, or waited with all else


class Pace:
    """Takes the time since boot of one kind of message, 5 Hz or more."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """The autopilot has started anew."""
        self._boot_ms = 0
        self._best: deque[tuple[int, int]] = deque()  # (when, its clock less ours), ever less
        self._past: deque[tuple[int, int]] = deque()  # the best of each second, ever less
        self._heard_ns = 0
        self._late_ns: int | None = None  # when a message was late

    def take(self, t_ns: int, boot_ms: int) -> None:
        """A message; what has come before, or by another way, says nothing."""
        if boot_ms <= self._boot_ms:
            return
        self._boot_ms, self._heard_ns = boot_ms, t_ns
        offset_ns = boot_ms * 1_000_000 - t_ns
        _keep(self._best, t_ns, offset_ns, BEST_NS)
        best_ns = self._best[0][1]
        if best_ns - offset_ns > LATE_NS:
            self._late_ns = t_ns
        if not self._past or t_ns - self._past[-1][0] >= STEP_NS:
            _keep(self._past, t_ns, best_ns, FORGET_NS)

    def age_ns(self, t_ns: int, boot_us: int) -> int:
        """How old what the autopilot dates so was at t_ns; 0 where its clock is not known, or the date makes no sense.

        Its clock is told by the message of the last seconds with the least delay: a delay that all have is not counted.
        """
        if not self._best or t_ns - self._heard_ns > BEST_NS:
            return 0
        age_ns = t_ns + self._best[0][1] - boot_us * 1000
        return age_ns if 0 < age_ns <= OLDEST_NS else 0

    def was_late(self, t_ns: int) -> bool:
        """Whether a message of the last 15 s was later than one of the 5 s before it, by more than a radio makes it."""
        return self._late_ns is not None and t_ns - self._late_ns < LASTING_NS

    def lost_s(self, t_ns: int) -> float:
        """How much (s) its clock has fallen behind ours in the last 30 s; 0 where that is nothing to tell."""
        if not self._past or t_ns - self._heard_ns > BEST_NS:
            return 0.0
        behind_ns = self._past[0][1] - self._past[-1][1]
        return behind_ns * 1e-9 if behind_ns > TOLD_NS else 0.0

    def text(self, t_ns: int) -> str:
        """The same for people; empty where there is nothing to tell."""
        if not self.lost_s(t_ns):
            return ""
        return "has fallen behind: a simulation that is slower than real time, or a link with a long queue"


def _keep(greatest: deque[tuple[int, int]], t_ns: int, value: int, for_ns: int) -> None:
    """Add a value to a sliding maximum, which stands first."""
    while greatest and greatest[-1][1] <= value:
        greatest.pop()
    greatest.append((t_ns, value))
    while t_ns - greatest[0][0] > for_ns:
        greatest.popleft()
