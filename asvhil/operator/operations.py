"""Operators' frames to requests, and what has become of them to answers and reports."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from asvhil.geo import wrap_rad
from asvhil.io.sensors.sources import Switch
from asvhil.operator.drift import DriftWatch
from asvhil.operator.remarks import Remarks
from asvhil.operator.reports import NOTICE, WARNING, OperatorReport
from asvhil.operator.session import NOTHING, OperatorRequest, OperatorSession
from asvhil.operator.state_arrays import BoatState
from asvhil.operator.station_parameters import (
    MOST_SPEED_PARAMETER,
    PLACE_PARAMETERS,
    request_of_change,
    station_value,
)
from asvhil.operator.tunables import Tunables
from asvhil.supervisor.decision import Decision, Request
from asvhil.supervisor.disarmed import BY_ITSELF
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.supervisor.situation import Situation
from asvhil.types import (
    Control,
    CourseCommand,
    DockingWindow,
    EnergyUse,
    Frame,
    Note,
    ParameterChange,
    Phase,
    ReleaseCommand,
    Wind,
    record,
)


@record
class _Unanswered:
    """A request that waits for its answer: what was decided here, or, with `asked`, what the supervisor will."""

    request: OperatorRequest
    asked: bool
    refusal: Explanation | None = None


@record
class Readings:
    """What is told to displays beside the situation: the wind, both pulses if they are ours, sources by quantity, the
    docking window of a station that is held, and what is taken from the battery.
    """

    wind: Wind | None = None
    pulses_us: tuple[int, int] | None = None
    sources: tuple[tuple[str, str], ...] = ()
    docking: DockingWindow | None = None
    energy: EnergyUse | None = None


NO_READINGS = Readings()


class Operations:
    """What operators ask for and are told. In each tick: `receive`, `take_requests`, `answer`, `data_to_send`."""

    def __init__(self, session: OperatorSession, tunables: Tunables, fastest_mps: float = math.inf) -> None:
        """`fastest_mps`: of a station that the boat can follow."""
        self._session = session
        self._fastest_mps = fastest_mps
        self._tunables = tunables
        self._received: list[OperatorRequest] = []
        self._unanswered: list[_Unanswered] = []
        self._phase = Phase.STANDBY
        self._notes: tuple[Note, ...] = ()
        self._remarks = Remarks()
        self._control: Control | None = None
        self._drift = DriftWatch()
        self._named = False  # the reason of this phase is told of an autopilot that has disarmed by itself

    def receive(self, frame: Frame) -> None:
        """Take in a frame of the operator's port."""
        self._received += self._session.receive(frame)

    def take_requests(self) -> list[Request]:
        """What the supervisor has to decide of what was received, in turn; the controller's parameters are set here."""
        asked: list[Request] = []
        received, self._received = self._received, []
        for request in received:
            wanted = self._meaning(request)
            if isinstance(wanted, ReleaseCommand):
                self._drift.release()
            if wanted is None or isinstance(wanted, Explanation):
                self._unanswered.append(_Unanswered(request=request, asked=False, refusal=wanted))
            else:
                self._unanswered.append(_Unanswered(request=request, asked=True))
                asked.append(wanted)
        return asked

    def answer(self, t_ns: int, decision: Decision) -> None:
        """Answer what was asked for, in turn."""
        answers = iter(decision.answers)
        for waiting in self._unanswered:
            refusal = next(answers) if waiting.asked else waiting.refusal
            self._session.answer(t_ns, waiting.request, refusal)
        self._unanswered.clear()
        if decision.begun:
            self._session.tell_parameters(PLACE_PARAMETERS)

    def data_to_send(
        self,
        situation: Situation,
        decision: Decision,
        control: Control | None,
        switches: Iterable[Switch],
        notes: tuple[Note, ...],
        readings: Readings = NO_READINGS,
    ) -> list[Frame]:
        """The answers of this tick, texts on what has changed, and the reports that are due."""
        t_ns = situation.t_ns
        if decision.station is None:
            self._control = None
        elif control is not None:
            self._control = control
        self._drift.step(situation.status, decision)
        named, self._named = self._named, decision.why.reason in BY_ITSELF
        if decision.phase is not self._phase or (self._named and not named):  # which it may tell after the hold's end
            self._phase = decision.phase
            self._session.tell(t_ns, NOTICE, f"{decision.phase}: {describe(decision.why)}")
        for switch in switches:
            severity = NOTICE if switch.after else WARNING
            self._session.tell(t_ns, severity, f"{switch.quantity} from {switch.after or 'nowhere'}")
        self._notes = notes
        for severity, text in self._remarks.step(t_ns, notes, held=decision.station is not None):
            self._session.tell(t_ns, severity, text)

        def value_of(name: str) -> float:
            if name in self._tunables:
                return self._tunables.value(name)
            if name == MOST_SPEED_PARAMETER:
                return self._fastest_mps
            policy, course = decision.heading_policy, decision.course
            return station_value(name, decision.point, situation.frame, policy, course)

        report = self._report(situation, decision, readings) if self._session.may_report else NOTHING
        return self._session.data_to_send(t_ns, report, value_of)

    @property
    def shell_notes(self) -> tuple[Note, ...]:
        """What is wrong with the program itself."""
        return self._session.shell_notes.notes

    def counters(self) -> tuple[tuple[str, int], ...]:
        """Cumulative counts of what came in and what was dropped."""
        return self._session.counters()

    # --- parts ---------------------------------------------------------------------------------------------

    def _meaning(self, request: OperatorRequest) -> Request | Explanation | None:
        """What the supervisor is to be asked; else a parameter has been set (None), or why not."""
        command = request.command
        if not isinstance(command, ParameterChange):
            return command
        if command.name in self._tunables:
            return self._tunables.set(command.name, command.value)
        wanted = request_of_change(command)
        if isinstance(wanted, CourseCommand) and wanted.leader and wanted.leader in self._session.own_systems:
            allowed = "0, or the system id of another vehicle"
            return explain(Reason.PARAMETER_OUT_OF_RANGE, name=command.name, range=allowed)
        return wanted

    def _report(self, situation: Situation, decision: Decision, readings: Readings) -> OperatorReport:
        station, point, estimate, frame = decision.station, decision.point, situation.estimate, situation.frame
        known: dict[str, Any] = {"phase": decision.phase, "solve_ms": self._session.solve_ms}
        known |= {"why": decision.why, "notes": self._notes, "computer": self._session.computer}
        known |= {"adrift": self._drift.adrift}
        known |= {"docking": readings.docking, "energy": readings.energy}
        if self._control is not None:
            known |= {"iterations": float(self._control.iterations), "control_ok": self._control.ok}
        if station is not None and point is not None and estimate is not None and frame is not None:
            known |= {
                "distance_m": math.hypot(estimate.n_m - station.n_m, estimate.e_m - station.e_m),
                "heading_error_rad": wrap_rad(estimate.psi_rad - station.psi_rad),
                "station": (*frame.to_geodetic(point.n_m, point.e_m), point.psi_rad),
                "station_moves_mps": (station.vn_mps, station.ve_mps) if station.moves else None,
            }
        if self._session.is_asked:  # only displays have a use for it
            known |= {"boat": self._boat(situation, decision, readings)}
        return OperatorReport(**known)

    def _boat(self, situation: Situation, decision: Decision, readings: Readings) -> BoatState:
        status, frame = situation.status, situation.frame
        known: dict[str, Any] = {}
        if status is not None and decision.link_ok:  # the last word of an autopilot that is silent is no state
            known = {"armed": status.armed, "fix": status.fix, "satellites": status.satellites}
            known |= {"battery_v": status.battery_v, "battery_percent": status.battery_percent, "mode": status.mode}
        return BoatState(
            estimate=situation.estimate,
            station=decision.station,
            point=decision.point,
            wind=readings.wind,
            control=self._control,
            pulses_us=readings.pulses_us,
            sources=readings.sources,
            docking=readings.docking,
            energy=readings.energy,
            solve_ms=self._session.solve_ms,
            origin_deg=None if frame is None else (frame.lat_deg, frame.lon_deg),
            **known,
        )
