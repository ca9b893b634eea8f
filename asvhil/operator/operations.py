"""What operators ask for, and what they are told: the operator's link, the supervisor and the parameters together."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable

from asvhil.geo import LocalFrame, wrap_rad
from asvhil.io.mavlink.frames import dialect
from asvhil.io.sensors.sources import Switch
from asvhil.operator.reports import OperatorReport
from asvhil.operator.session import OperatorSession, Request
from asvhil.operator.tunables import Tunables
from asvhil.supervisor.situation import Situation
from asvhil.supervisor.supervisor import Decision, Supervisor
from asvhil.types import (
    Control,
    Estimate,
    Frame,
    HoldCommand,
    Note,
    ParameterChange,
    Phase,
    ReleaseCommand,
    Station,
)

NOTICE, WARNING = dialect.MAV_SEVERITY_NOTICE, dialect.MAV_SEVERITY_WARNING
# The station that is held, NaN while none is: degrees on the ellipsoid, and metres from the first position heard,
# which a 32-bit float tells to a tenth of a millimetre while it tells degrees to half a metre.
STATION_PARAMETERS = ("ST_LAT", "ST_LON", "ST_HDG", "ST_NORTH", "ST_EAST")


class Operations:
    """Takes requests in, has them decided, answers them, and reports."""

    def __init__(self, link: OperatorSession, supervisor: Supervisor, tunables: Tunables) -> None:
        self._link = link
        self._supervisor = supervisor
        self._tunables = tunables
        self._requests: list[Request] = []
        self._phase = Phase.STANDBY
        self._notes: tuple[Note, ...] = ()
        self._control: Control | None = None
        self._station: Station | None = None
        self._frame: LocalFrame | None = None

    def take(self, frame: Frame) -> None:
        """Take in a frame of the operator's port."""
        self._requests += self._link.decode(frame)

    def answer(self, known: Situation) -> tuple[list[Frame], bool]:
        """Decide what was asked for, in order: the answers, and whether a hold has begun."""
        self._frame = known.frame
        answers: list[Frame] = []
        begun = False
        requests, self._requests = self._requests, []
        for request in requests:
            command = request.command
            refusal: str | None = None
            match command:
                case HoldCommand():
                    refusal = self._supervisor.on_hold(command, known)
                    begun = begun or (refusal is None and not command.move_only)
                case ReleaseCommand():
                    self._supervisor.on_release(command)
                case ParameterChange():
                    refusal = self._change(command, known)
            answers += self._link.answer(known.t_ns, request, refusal)
        if begun:
            self._link.tell_parameters(STATION_PARAMETERS)
        return answers, begun

    def report(
        self,
        t_ns: int,
        decision: Decision,
        estimate: Estimate | None,
        control: Control | None,
        switches: Iterable[Switch],
        notes: tuple[Note, ...],
    ) -> list[Frame]:
        """What this tick has to tell: texts on changes, and what is due."""
        self._station = decision.station
        if decision.station is None:
            self._control = None
        elif control is not None:
            self._control = control
        frames: list[Frame] = []
        if decision.phase is not self._phase:
            self._phase = decision.phase
            frames += self._link.tell(t_ns, NOTICE, f"{decision.phase}: {decision.reason}")
        for switch in switches:
            severity = NOTICE if switch.after else WARNING
            frames += self._link.tell(t_ns, severity, f"{switch.quantity} from {switch.after or 'nowhere'}")
        for severity, text in self._remarks(notes):
            frames += self._link.tell(t_ns, severity, text)
        return [*frames, *self._link.poll(t_ns, self._situation(estimate), self._value)]

    def counters(self) -> tuple[tuple[str, int], ...]:
        return self._link.counters()

    # --- parts ---------------------------------------------------------------------------------------------

    def _situation(self, estimate: Estimate | None) -> OperatorReport:
        station, control, frame = self._station, self._control, self._frame
        situation = OperatorReport(phase=self._phase, solve_ms=self._link.solve_ms)
        if control is not None:
            iterations = float(control.iterations)
            situation = dataclasses.replace(situation, iterations=iterations, control_ok=control.ok)
        if station is None or estimate is None or frame is None:
            return situation
        return dataclasses.replace(
            situation,
            distance_m=math.hypot(estimate.n_m - station.n_m, estimate.e_m - station.e_m),
            heading_error_rad=wrap_rad(estimate.psi_rad - station.psi_rad),
            station=(*frame.to_geodetic(station.n_m, station.e_m), station.psi_rad),
        )

    def _remarks(self, notes: tuple[Note, ...]) -> list[tuple[int, str]]:
        """What has become wrong, and what has come right again, since the last tick: (severity, text)."""
        before, self._notes = self._notes, notes
        if notes == before:
            return []
        told = [(WARNING, f"{note.subject}: {note.text}") for note in notes if not note.ok and note not in before]
        wrong = {note.subject for note in notes if not note.ok}
        right = [note.subject for note in before if not note.ok and note.subject not in wrong]
        return [*told, *((NOTICE, f"{subject}: well again") for subject in right)]

    def _value(self, name: str) -> float:
        if name in self._tunables:
            return self._tunables.value(name)
        station, frame = self._station, self._frame
        if station is None or frame is None:
            return math.nan
        lat_deg, lon_deg = frame.to_geodetic(station.n_m, station.e_m)
        values = (lat_deg, lon_deg, math.degrees(station.psi_rad) % 360.0, station.n_m, station.e_m)
        return values[STATION_PARAMETERS.index(name)]

    def _change(self, change: ParameterChange, known: Situation) -> str | None:
        """Set a parameter. Returns None, or the reason why not."""
        name, value = change.name, change.value
        if name in self._tunables:
            return self._tunables.set(name, value)
        station, frame = self._supervisor.station, known.frame
        if station is None or frame is None:
            return f"{name}: no station is held"
        lat_deg, lon_deg = frame.to_geodetic(station.n_m, station.e_m)
        psi_rad: float | None = None
        match name:
            case "ST_LAT" if abs(value) <= 90.0:
                lat_deg = value
            case "ST_LON" if abs(value) <= 180.0:
                lon_deg = value
            case "ST_HDG" if abs(value) <= 360.0:
                psi_rad = wrap_rad(math.radians(value))
            case "ST_NORTH" if math.isfinite(value):
                lat_deg, lon_deg = frame.to_geodetic(value, station.e_m)
            case "ST_EAST" if math.isfinite(value):
                lat_deg, lon_deg = frame.to_geodetic(station.n_m, value)
            case _:
                return f"{name}: {value:g} is out of range"
        moved = HoldCommand(t_ns=change.t_ns, lat_deg=lat_deg, lon_deg=lon_deg, psi_rad=psi_rad, move_only=True)
        return self._supervisor.on_hold(moved, known)
