"""Whether the autopilot has disarmed by itself: by what it says of it, and by its clock. Sans-IO.

A heartbeat tells that a vehicle is disarmed, and not who did it. PX4 says so in a text ("Disarmed by failsafe",
"Disarmed by external command"). An ArduRover says "Throttle disarmed" whoever does it. Just before, it names the
fail-safe that acts ("Radio Failsafe"), the battery, or what else acts. That fail-safe need not be the radio's: the text
has the name of whichever check has looked last (Rover/failsafe.cpp). Of a fence it says nothing, but its next check
before arming, up to a second later, does.

A fail-safe that begins later has disarmed nothing: whoever disarms a boat may switch the transmitter off then. Nor has
one that began long before, which may have told of a low battery alone. Where nothing is said it is taken for a person's
doing.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from asvhil.io.mavlink.texts import TextReader
from asvhil.supervisor.disarmed import REBOOT

DISARMED_BY = re.compile(r"Disarmed by (.+)")  # PX4, of whatever disarms it
# Of those, what no person does.
ITS_OWN = frozenset({"failsafe", "landing", "auto preflight disarming", "failure detector", "lockdown"})
# ArduRover: what it says of that which acts, and what is told of it. "... Failsafe Cleared" does not match, and a
# termination that a ground station has asked for is a person's.
CAUSES = (
    (re.compile(r"(\w+) Failsafe"), "a fail-safe (it says {})"),
    (re.compile(r"Battery (\d+ is (?:low|critical)) .*"), "battery {}"),
    (re.compile(r"Crash: (Going to HOLD|Disarming)"), "its crash check"),
    (re.compile(r"Terminating due to (?!GCS)(.+)"), "terminated for {}"),
)
FENCE = re.compile(r"PreArm: Vehicle breaching (.+)")
DISARMED = "Throttle disarmed"
BEAT_NS = 1_500_000_000  # a text comes at once, the heartbeat that goes with it up to a second later
BATCH_NS = 500_000_000  # from what acts to the text that it is disarmed: they leave at once, one after the other
FENCE_NS = 1_500_000_000  # from being disarmed to the next check before arming, which is made each second


class Disarming:
    """`itself`: why the autopilot has disarmed by itself; empty while it is armed, and where people did.

    `fence_disarms`: whether a breach of its fence would, as far as is known. Where it would not, a person may disarm a
    boat that is outside.
    """

    def __init__(self, fence_disarms: Callable[[], bool] = lambda: True) -> None:
        self.itself = ""
        self._fence_disarms = fence_disarms
        self._texts = TextReader()
        self._armed = self._armed_at_clock = False  # as last told; at the last word of its clock
        self._disarmed_ns = 0  # by a heartbeat
        self._said_ns: int | None = None  # when it said that it is, if it did
        self._cause: tuple[int, str] | None = None  # when it said what acts, and what that is

    def on_text(self, t_ns: int, message: Any) -> bool:
        """STATUSTEXT. Whether it says that the vehicle is disarmed now, before a heartbeat does."""
        text = self._texts.receive(message) or ""
        by = DISARMED_BY.fullmatch(text)
        if by is not None:
            self.itself = by[1] if by[1] in ITS_OWN else ""
            self._cause = None
            self._note(t_ns, armed=False)
            return True
        if text == DISARMED:
            self._said_ns = t_ns
        for pattern, words in CAUSES:
            cause = pattern.fullmatch(text)
            if cause is not None:
                self._cause = t_ns, words.format(cause[1])
        fence = FENCE.fullmatch(text)
        if fence is not None and self._fence_disarms():
            self._on_breach(t_ns, fence[1])
        return False

    def on_heartbeat(self, t_ns: int, *, armed: bool) -> None:
        """Whether it is armed, by a heartbeat."""
        self._note(t_ns, armed=armed)

    def note_clock(self) -> None:
        """The clock of its boot has gone on."""
        self._armed_at_clock = self._armed

    def restart(self, booted_ns: int) -> None:
        """It has booted anew, at that time by its clock: one that was armed until then has lost that by the boot.

        The first heartbeat after the boot may come before its clock does; one before the boot tells of a person.
        """
        if self._armed_at_clock and (self._armed or self._disarmed_ns >= booted_ns):
            self.itself = REBOOT
        self._armed = self._armed_at_clock = False
        self._cause = self._said_ns = None

    def _note(self, t_ns: int, *, armed: bool) -> None:
        if armed:
            self.itself = ""
            if not self._armed:
                self._said_ns = None
        elif self._armed:
            self._disarmed_ns = t_ns
            self._name(t_ns)
        self._armed = armed

    def _name(self, t_ns: int) -> None:
        """What acted just before the vehicle was disarmed has done it, as nothing else is said."""
        if self._cause is None or self.itself:
            return
        cause_ns, words = self._cause
        since_ns = self._disarmed_since_ns
        if cause_ns >= (t_ns - BEAT_NS if since_ns == t_ns else since_ns - BATCH_NS):
            self.itself = words

    def _on_breach(self, t_ns: int, fences: str) -> None:
        """A check before arming, which is made of a disarmed vehicle alone, finds it outside its fence.

        A heartbeat may have told that it is disarmed before, or tells it later.
        """
        words = f"it is outside its fence ({fences.removesuffix(' fence')})"
        if self._armed:
            self._cause = t_ns, words
        elif self._disarmed_ns and not self.itself and t_ns - self._disarmed_since_ns <= FENCE_NS:
            self.itself = words

    @property
    def _disarmed_since_ns(self) -> int:
        """By its own word where that came just before the heartbeat."""
        said_ns = self._said_ns
        return self._disarmed_ns if said_ns is None or said_ns < self._disarmed_ns - BEAT_NS else said_ns
