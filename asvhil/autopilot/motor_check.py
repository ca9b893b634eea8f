"""Whether the motors follow, or would follow, the commands: by the parameters, and by reading the outputs back."""

from __future__ import annotations

from asvhil.autopilot.protocol import Autopilot
from asvhil.autopilot.readback import Fault, Readback
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.types import Cause, FrontseatStatus, Note

UNREAD_NS = 3_000_000_000  # of driving without a report of the outputs
REASONS = {
    Cause.IGNORED: Reason.OVERRIDES_IGNORED,
    Cause.MIXED: Reason.COMMANDS_MIXED,
    Cause.DEAD_ZONE: Reason.OUTPUT_DEAD_ZONE,
    Cause.SLEW: Reason.OUTPUTS_LAG,
    Cause.SWAPPED: Reason.OUTPUTS_SWAPPED,
    Cause.REVERSED: Reason.OUTPUT_REVERSED,
    Cause.SCALED: Reason.OUTPUT_SCALED,
    Cause.STUCK: Reason.OUTPUT_STUCK,
}


class MotorCheck:
    """Faults as one line each. Those whose cause is in `tolerate` are told, and neither end a hold nor refuse one."""

    def __init__(self, link: Autopilot, watch: Readback, tolerate: tuple[Cause, ...]) -> None:
        self._link = link
        self._watch = watch
        self._tolerate = frozenset(tolerate)
        self._driving_ns: int | None = None
        self._unread = False
        self._read_back: Explanation | None = None
        self.fault: Explanation | None = None  # why the motors do not, or would not, follow the commands

    def on_status(self, status: FrontseatStatus) -> None:
        """A report of the autopilot."""
        self._watch.on_status(status)

    def step(self, t_ns: int) -> None:
        """Judge what has been reported, before anything is decided in this tick."""
        seen = self._watch.judge(t_ns)
        self._unread = self._driving_ns is not None and self._watch.unread_ns(t_ns) >= UNREAD_NS
        if seen is not None:
            self._read_back = explain_fault(seen, self._hint(seen))
        elif self._watch.follows:
            self._read_back = None  # until then what was seen last stays in the notes
        ends = seen is not None and seen.cause not in self._tolerate and self._driving_ns is not None
        self.fault = self._wrong_parameter() or (self._read_back if ends else None)

    def note_output(self, t_ns: int, pulses_us: tuple[int, int] | None) -> None:
        """What was sent to the motors in this tick, None where they are not driven."""
        if pulses_us is None:
            self._driving_ns = None
            self._watch.stop()
            return
        self._driving_ns = t_ns if self._driving_ns is None else self._driving_ns
        self._watch.sent(t_ns, pulses_us)

    @property
    def unverified(self) -> Explanation | None:
        """What it means if the motors' sticks do not show our commands; None once they have."""
        ignored = Fault(cause=Cause.IGNORED)
        return None if self._watch.heard else explain_fault(ignored, self._hint(ignored))

    @property
    def notes(self) -> tuple[Note, ...]:
        """What was found, good or bad; nothing before there is something to say."""
        found = []
        wrong = [f for f in self._link.findings if not f.ok and f.value is not None and f.requirement.must]
        if wrong:
            more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
            found.append(Note(subject="parameters", text=f"{wrong[0].text}{more}", ok=False))
        if self._read_back is not None:
            found.append(Note(subject="outputs", text=describe(self._read_back), ok=False))
        elif self._unread:
            found.append(Note(subject="outputs", text="not reported by the autopilot: unverified", ok=False))
        elif self._watch.follows:
            found.append(Note(subject="outputs", text="follow the commands", ok=True))
        return tuple(found)

    def _wrong_parameter(self) -> Explanation | None:
        for finding in self._link.findings:
            cause = finding.requirement.cause
            if not finding.ok and finding.value is not None and cause is not None and cause not in self._tolerate:
                return explain(Reason.AUTOPILOT_PARAMETER, finding=finding.text)
        return None

    def _hint(self, fault: Fault) -> str:
        return self._link.hint(fault.cause, fault.motor, blind=fault.blind)


def explain_fault(fault: Fault, hint: str) -> Explanation:
    """What the readback found, as a reason to let go; `hint` names what to look at."""
    motor = fault.motor or "both"
    reason = REASONS.get(fault.cause, Reason.OUTPUTS_DIFFER)
    match reason:
        case Reason.OUTPUT_STUCK if fault.blind:
            return explain(Reason.OUTPUTS_UNCHANGED, hint=hint)
        case Reason.OUTPUT_REVERSED | Reason.OUTPUT_SCALED | Reason.OUTPUT_STUCK:
            return explain(reason, motor=motor, hint=hint)
        case Reason.OUTPUT_DEAD_ZONE:
            return explain(reason, motor=motor, size_us=fault.size, hint=hint)
        case _:
            return explain(reason, hint=hint)
