"""Whether the motors follow, or would follow, the commands: by the parameters, and by reading the outputs back."""

from __future__ import annotations

from asvhil.autopilot.fault_reasons import explain_fault
from asvhil.autopilot.protocol import Autopilot
from asvhil.autopilot.readback import Fault, Readback
from asvhil.autopilot.requirements import Finding
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.supervisor.situation import StationSticks
from asvhil.types import Cause, FrontseatStatus, Note

UNREAD_NS = 3_000_000_000  # of driving without a report of the outputs
BENDS = frozenset({Cause.DEAD_ZONE, Cause.SCALED, Cause.SLEW})  # the readback does not tell these apart


class MotorCheck:
    """Collects faults of the motors. One whose cause is in `tolerate` only leaves a note: it ends and refuses no hold.

    A tolerated dead zone, scale or slew limit whose parameter is wrong or could not be read also makes a note of
    outputs that do not follow for no other known reason.
    """

    def __init__(self, autopilot: Autopilot, readback: Readback, tolerate: tuple[Cause, ...]) -> None:
        self._autopilot = autopilot
        self._readback = readback
        self._tolerate = frozenset(tolerate)
        self._driving_ns: int | None = None
        self._unread = False
        self._armed = True  # as last told
        self._found: Explanation | None = None  # by the readback, last
        # What follows from which findings: a fault, and what to tell. Each parameter that is read makes a new list.
        self._judged: tuple[list[Finding], Explanation | None, str] = ([], None, "")
        self.fault: Explanation | None = None  # why the motors do not, or would not, follow the commands

    def on_status(self, status: FrontseatStatus) -> None:
        """A report of the autopilot."""
        self._armed = status.armed
        self._readback.on_status(status)

    def on_station_sticks(self, sticks: StationSticks) -> None:
        """Sticks of a ground station, which drive the motors in turn with us."""
        if sticks.motors_us is not None:
            self._readback.note_station(sticks.t_ns, sticks.motors_us)

    def step(self, t_ns: int) -> None:
        """Judge what has been reported, before anything is decided in this tick."""
        fault = self._readback.judge(t_ns)
        self._unread = self._driving_ns is not None and self._readback.unread_ns(t_ns) >= UNREAD_NS
        tolerated = False
        if fault is not None:
            bend = self._tolerated_bend() if fault.cause is Cause.UNEXPLAINED else None
            tolerated = bend is not None or fault.cause in self._tolerate
            if not self._may_be_disarmed(fault):  # of which nobody is told as of a fault
                self._found = self._explain(fault) if bend is None else _explain_bend(bend)
        elif self._readback.follows:
            self._found = None  # until then what was found last stays in the notes
        ends = fault is not None and not tolerated and self._driving_ns is not None and not self._may_be_disarmed(fault)
        found = self._found if ends else None
        shut = self._unread_wiring() or self._autopilot.way_fault
        self.fault = self._unbounded() or self._wrong_parameter() or shut or found

    def note_output(self, t_ns: int, pulses_us: tuple[int, int] | None) -> None:
        """What was sent to the motors in this tick, None where they are not driven."""
        if pulses_us is None:
            self._driving_ns = None
            self._readback.stop()
            return
        self._driving_ns = t_ns if self._driving_ns is None else self._driving_ns
        self._readback.note_sent(t_ns, pulses_us)

    @property
    def unverified(self) -> Explanation | None:
        """What it means if the motors' sticks do not show our commands; None once they have."""
        return None if self._readback.override_seen else self._explain(Fault(cause=Cause.IGNORED))

    @property
    def notes(self) -> tuple[Note, ...]:
        """What was found, good or bad; nothing before there is something to say."""
        found = []
        why = self._autopilot.unbounded
        if why:
            taken = "; tolerated" if Cause.UNBOUNDED in self._tolerate else ""
            found.append(Note(subject="motors after a crash", text=f"nothing stops them ({why}){taken}", ok=False))
        wrong = self._judge_parameters()[2]
        if wrong:
            found.append(Note(subject="parameters", text=wrong, ok=False))
        if self._found is not None:
            found.append(Note(subject="outputs", text=describe(self._found), ok=False))
        elif self._unread:
            found.append(Note(subject="outputs", text="not reported by the autopilot: unverified", ok=False))
        elif self._readback.follows:
            found.append(Note(subject="outputs", text="follow the commands", ok=True))
        return tuple(found)

    def _may_be_disarmed(self, fault: Fault) -> bool:
        """Disarmed; or outputs that stand still, and no heartbeat since that would say so, as on a lossy link."""
        if not self._armed:
            return True
        beat_ns = self._autopilot.autopilot_heartbeat_ns
        return fault.cause is Cause.STUCK and beat_ns is not None and beat_ns < self._readback.differing_ns

    def _unbounded(self) -> Explanation | None:
        why = self._autopilot.unbounded
        return explain(Reason.UNBOUNDED, why=why) if why and Cause.UNBOUNDED not in self._tolerate else None

    def _unread_wiring(self) -> Explanation | None:
        """Only before the motors are taken: what a boat's wiring is taken for stands until they are given back."""
        name = self._autopilot.unread_wiring if self._driving_ns is None else ""
        return explain(Reason.WIRING_UNREAD, name=name) if name else None

    def _wrong_parameter(self) -> Explanation | None:
        return self._judge_parameters()[1]

    def _judge_parameters(self) -> tuple[list[Finding], Explanation | None, str]:
        findings = self._autopilot.findings
        if findings is not self._judged[0]:
            wrong = [f for f in findings if f.wrong]
            causes = (None, *self._tolerate)
            faults = (f for f in wrong if f.requirement.cause not in causes)
            fault = next((explain(Reason.AUTOPILOT_PARAMETER, finding=f.text) for f in faults), None)
            must = [f for f in wrong if f.requirement.must]
            more = f" (and {len(must) - 1} more)" if len(must) > 1 else ""
            self._judged = findings, fault, f"{must[0].text}{more}" if must else ""
        return self._judged

    def _tolerated_bend(self) -> Finding | None:
        """A parameter that is wrong, or could not be read, and whose effect is tolerated."""
        causes = BENDS & self._tolerate
        return next((f for f in self._autopilot.findings if not f.ok and f.requirement.cause in causes), None)

    def _explain(self, fault: Fault) -> Explanation:
        return explain_fault(fault, self._autopilot.findings)


def _explain_bend(finding: Finding) -> Explanation:
    return explain(Reason.AUTOPILOT_PARAMETER, finding=finding.requirement.fault, hint=finding.name)
