"""Whether the motors do, and would do, as told: by the parameters, and by reading the outputs back. In words."""

from __future__ import annotations

from asvhil.autopilot.protocol import Autopilot
from asvhil.autopilot.readback import Fault, Readback, words
from asvhil.types import Cause, FrontseatStatus, Note

UNREAD_NS = 3_000_000_000  # of driving without a report of the outputs


class MotorCheck:
    """Faults as one line each. Those whose cause is in `tolerate` are told, and neither end a hold nor refuse one."""

    def __init__(self, link: Autopilot, watch: Readback, tolerate: tuple[Cause, ...]) -> None:
        self._link = link
        self._watch = watch
        self._tolerate = frozenset(tolerate)
        self._driving_ns: int | None = None
        self._unread = False
        self._read_back = ""
        self.fault: str | None = None

    def on_status(self, status: FrontseatStatus) -> None:
        """A report of the autopilot."""
        self._watch.on_status(status)

    def step(self, t_ns: int) -> str | None:
        """Why the motors do not, or would not, do as told, before anything is decided in this tick."""
        seen = self._watch.judge(t_ns)
        self._unread = self._driving_ns is not None and self._watch.unread_ns(t_ns) >= UNREAD_NS
        if seen is not None:
            self._read_back = self._words(seen)
        elif self._watch.follows:
            self._read_back = ""  # until then what was seen last stays in the notes
        ends = seen is not None and seen.cause not in self._tolerate and self._driving_ns is not None
        self.fault = self._wrong_parameter() or (self._read_back if ends else None)
        return self.fault

    def drove(self, t_ns: int, pulses_us: tuple[int, int] | None) -> None:
        """What was sent to the motors in this tick, None where they are not driven."""
        if pulses_us is None:
            self._driving_ns = None
            self._watch.stop()
            return
        self._driving_ns = t_ns if self._driving_ns is None else self._driving_ns
        self._watch.sent(t_ns, pulses_us)

    @property
    def unheard(self) -> str | None:
        """What it means if the motors' sticks do not show our commands; None once they have."""
        return None if self._watch.heard else self._words(Fault(cause=Cause.IGNORED))

    @property
    def notes(self) -> tuple[Note, ...]:
        """What was found, good or bad; nothing before there is something to say."""
        found = []
        wrong = [f for f in self._link.findings if not f.ok and f.value is not None and f.requirement.must]
        if wrong:
            more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
            found.append(Note(subject="parameters", text=f"{wrong[0].text}{more}", ok=False))
        if self._read_back:
            found.append(Note(subject="outputs", text=self._read_back, ok=False))
        elif self._unread:
            found.append(Note(subject="outputs", text="never reported: nobody sees what the motors do", ok=False))
        elif self._watch.follows:
            found.append(Note(subject="outputs", text="follow the commands", ok=True))
        return tuple(found)

    def _wrong_parameter(self) -> str | None:
        for finding in self._link.findings:
            cause = finding.requirement.cause
            if not finding.ok and finding.value is not None and cause is not None and cause not in self._tolerate:
                return finding.text
        return None

    def _words(self, fault: Fault) -> str:
        return words(fault, self._link.hint(fault.cause, fault.motor, blind=fault.blind))
