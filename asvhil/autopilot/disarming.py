"""Whether the autopilot has disarmed by itself: by what it says of it, and by its clock. Sans-IO.

A heartbeat tells that a vehicle is disarmed, and not who did it. PX4 says so in a text ("Disarmed by failsafe",
"Disarmed by external command"), an ArduRover names the fail-safe that acts ("GCS Failsafe") before it disarms. A
fail-safe that begins later has disarmed nothing: whoever disarms a boat may switch the transmitter off then. Where
nothing is said it is taken for a person's doing.
"""

from __future__ import annotations

import re
from typing import Any

from asvhil.io.mavlink.texts import TextReader
from asvhil.supervisor.disarmed import REBOOT

DISARMED_BY = re.compile(r"Disarmed by (.+)")  # PX4, of whatever disarms it
# Of those, what no person does.
ITS_OWN = frozenset({"failsafe", "landing", "auto preflight disarming", "failure detector", "lockdown"})
FAIL_SAFE = re.compile(r"(\w+) Failsafe")  # ArduRover, of one that begins; "... Failsafe Cleared" does not match
BEAT_NS = 1_500_000_000  # a text comes at once, the heartbeat that goes with it up to a second later


class Disarming:
    """`itself`: why the autopilot has disarmed by itself; empty while it is armed, and where people did."""

    def __init__(self) -> None:
        self.itself = ""
        self._texts = TextReader()
        self._armed = self._armed_at_clock = False  # as last told; at the last word of its clock
        self._disarmed_ns = 0
        self._fail_safe: tuple[int, str] | None = None

    def on_text(self, t_ns: int, message: Any) -> bool:
        """STATUSTEXT. Whether it says that the vehicle is disarmed now, before a heartbeat does."""
        text = self._texts.receive(message) or ""
        by = DISARMED_BY.fullmatch(text)
        if by is not None:
            self.itself = by[1] if by[1] in ITS_OWN else ""
            self._fail_safe = None
            self._note(t_ns, armed=False)
            return True
        fail_safe = FAIL_SAFE.fullmatch(text)
        if fail_safe is not None:
            self._fail_safe = t_ns, f"{fail_safe[1]} fail-safe"
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
        self._fail_safe = None

    def _note(self, t_ns: int, *, armed: bool) -> None:
        if armed:
            self.itself = ""
        elif self._armed:
            self._disarmed_ns = t_ns
            self._name(t_ns)
        self._armed = armed

    def _name(self, t_ns: int) -> None:
        """A fail-safe that began just before the vehicle was disarmed has done it, as nothing else is said."""
        if self._fail_safe is not None and not self.itself and t_ns - self._fail_safe[0] <= BEAT_NS:
            self.itself = self._fail_safe[1]
