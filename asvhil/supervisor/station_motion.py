"""How the station that is held moves: on a course, or after a leader; never faster than the boat can follow."""

from __future__ import annotations

import math
from collections.abc import Callable

from asvhil.config import MovingConfig
from asvhil.config.vehicle import VesselConfig
from asvhil.geo import body_to_ned
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.types import CourseCommand, Note, Station, changed, record

SUBJECT = "moving station"
LONGEST_TICK_S = 1.0  # a longer time between two ticks is a pause, in which the station stays
TOLD_EVERY_NS = 10_000_000_000  # the velocity of a leader, which changes with every message
CATCH_UP_S = 2.0  # time constant with which the station follows where a leader says that it is
COURSE_LEAST_MPS = 0.1  # a leader that is slower has no course of its own
SHARE = 0.5  # of the thrust ahead, which a station's speed may take: the rest is for the weather
BACK = 0.5  # of the distance at which a station waits: from there it goes on
Place = tuple[float, float]


def fastest_mps(vessel: VesselConfig, config: MovingConfig) -> float:
    """How fast a station may be: as the config says, and where SHARE of the thrust balances the drag ahead."""
    return min(config.max_speed_mps, vessel.speed_ahead_mps(SHARE))


@record
class LeaderReport:
    """Where a leader, or a set-point with a velocity, has the station at a time, and its velocity (NED)."""

    t_ns: int
    n_m: float
    e_m: float
    vn_mps: float
    ve_mps: float


class StationMotion:
    """`begin` with each hold; commands and reports as they come; in each tick `step` gives the station.

    A course moves the station until its way is over or another command comes. A leader's report has it go where the
    leader is, at the leader's velocity, for as long as reports come.
    """

    def __init__(self, config: MovingConfig, most_mps: float) -> None:
        self._config, self._most_mps = config, min(config.max_speed_mps, most_mps)
        self.speed_mps = self.course_rad = 0.0
        self.way_m: float | None = None  # what is left of it
        self.leader = 0  # its system id, 0 for none
        self._report: LeaderReport | None = None
        self._course_of_leader_rad = 0.0
        self._t_ns = 0
        self._refused_ns = 0
        self._waits = False
        self._told = ""
        self._told_ns = 0
        self._trouble: str | None = None  # what is wrong with the leader

    def begin(self) -> None:
        """A hold begins, or ends: its station rests."""
        self.speed_mps = 0.0
        self.way_m = None
        self.leader = 0
        self._report = self._trouble = None
        self._waits = False
        self._told = ""

    # --- commands --------------------------------------------------------------------------------------------

    def choose(self, command: CourseCommand) -> Explanation | None:
        """Another speed, course, way or leader; what is None stays. Returns None, or why not."""
        if command.speed_mps is not None:
            if not 0.0 <= command.speed_mps <= self._most_mps:  # a NaN is not
                return explain(Reason.STATION_TOO_FAST, speed=command.speed_mps, most=self._most_mps)
            self.speed_mps = command.speed_mps
            self.leader, self._report, self._trouble = 0, None, None
        if command.course_rad is not None:
            self.course_rad = command.course_rad
        if command.way_m is not None:
            self.way_m = command.way_m if command.way_m > 0.0 else None
        if command.leader is not None:
            self.leader, self._report = command.leader, None
            self._trouble = f"{self._leader_name} is not heard" if command.leader else None
            self.speed_mps = 0.0
        self._told = ""
        return None

    @property
    def course(self) -> CourseCommand:
        """The speed, course, way and leader in force."""
        return CourseCommand(
            t_ns=self._t_ns,
            speed_mps=self.speed_mps,
            course_rad=self.course_rad,
            way_m=self.way_m or 0.0,
            leader=self.leader,
        )

    def refuse(self, t_ns: int, why: Explanation) -> None:
        """A report of the leader cannot be followed."""
        self._refused_ns = t_ns
        self._trouble = f"{self._leader_name} is not followed: {describe(why)}"

    @property
    def _leader_name(self) -> str:
        return f"system {self.leader}" if self.leader else "the leader"

    def rest(self) -> None:
        """The station is put somewhere, at no velocity: what a set-point had it do before is over."""
        if not self.leader:
            self._report = self._trouble = None

    def lead(self, report: LeaderReport) -> Explanation | None:
        """A set-point with a velocity, in the place of a leader that was followed. As `report`."""
        if self.leader:
            self.leader, self._report = 0, None
        return self.report(report)

    def report(self, report: LeaderReport) -> Explanation | None:
        """Where the leader is, or a set-point. Returns None, or why it is not followed."""
        speed_mps = math.hypot(report.vn_mps, report.ve_mps)
        before = self._report
        # A leader that is followed is where it was left; a stream of set-points that comes again is another one.
        if before is not None and (self.leader or self._is_fresh(report.t_ns)):
            there = _carried(before, min(report.t_ns, self._fresh_until_ns(before)))
            jump_m = math.hypot(report.n_m - there[0], report.e_m - there[1])
            if jump_m > self._config.jump_m:
                return explain(Reason.LEADER_JUMPED, metres=jump_m, most=self._config.jump_m)
        self.speed_mps, self.way_m = 0.0, None
        self._report = report
        faster = speed_mps > self._most_mps
        self._trouble = f"{self._leader_name} is faster than {self._most_mps:.1f} m/s" if faster else None
        return None

    def place_of(self, n_m: float, e_m: float, velocity: tuple[float, float]) -> Place:
        """Where the station of a leader is that is there and has that velocity."""
        ahead_m, right_m = self._config.offset_m
        if self._config.offset_frame == "north":
            return n_m + ahead_m, e_m + right_m
        if math.hypot(*velocity) >= COURSE_LEAST_MPS:
            self._course_of_leader_rad = math.atan2(velocity[1], velocity[0])
        north_m, east_m = body_to_ned(self._course_of_leader_rad, ahead_m, right_m)
        return n_m + north_m, e_m + east_m

    # --- each tick -------------------------------------------------------------------------------------------

    def step(
        self, t_ns: int, station: Station, boat_m: Place | None, outside: Callable[[Station], Explanation | None]
    ) -> Station:
        """The station of this tick; `boat_m`: where the boat is, None where that is not known and so waited for.

        `outside` says why a station cannot be where it would go to.
        """
        elapsed_s, self._t_ns = (t_ns - self._t_ns) * 1e-9, t_ns
        report = self._report
        if report is None and self.speed_mps == 0.0:
            self._waits = False
            return changed(station, vn_mps=0.0, ve_mps=0.0) if station.moves else station
        off_m = math.inf if boat_m is None else math.hypot(boat_m[0] - station.n_m, boat_m[1] - station.e_m)
        self._waits = off_m > self._config.wait_beyond_m * (BACK if self._waits else 1.0)
        if self._waits or elapsed_s > LONGEST_TICK_S:
            return changed(station, vn_mps=0.0, ve_mps=0.0)
        if elapsed_s <= 0.0:
            return station
        after = self._on_course(station, elapsed_s) if report is None else self._after(report, station, elapsed_s)
        why = outside(after)
        if why is None:
            return after
        self.speed_mps = 0.0
        self._trouble = f"stays: {describe(why)}"
        return changed(station, vn_mps=0.0, ve_mps=0.0)

    def _on_course(self, station: Station, elapsed_s: float) -> Station:
        vn, ve = body_to_ned(self.course_rad, self.speed_mps, 0.0)
        if self.way_m is not None:
            share = min(self.way_m / (self.speed_mps * elapsed_s), 1.0)
            elapsed_s *= share
            self.way_m -= self.speed_mps * elapsed_s
            if share < 1.0 or self.way_m <= 0.0:
                self.speed_mps, self.way_m = 0.0, None
        return changed(
            station, n_m=station.n_m + vn * elapsed_s, e_m=station.e_m + ve * elapsed_s, vn_mps=vn, ve_mps=ve
        )

    def _after(self, report: LeaderReport, station: Station, elapsed_s: float) -> Station:
        """The station, nearer to where the leader is; its velocity is the leader's, unless it has to catch up."""
        if not self._is_fresh(self._t_ns):
            if (self._t_ns - self._refused_ns) * 1e-9 > self._config.silence_s:
                self._trouble = f"{self._leader_name} is silent: it stays"
            return changed(station, vn_mps=0.0, ve_mps=0.0)
        n_m, e_m = _carried(report, self._t_ns)
        gain = elapsed_s / (elapsed_s + CATCH_UP_S)
        step_n = report.vn_mps * elapsed_s + gain * (n_m - station.n_m - report.vn_mps * elapsed_s)
        step_e = report.ve_mps * elapsed_s + gain * (e_m - station.e_m - report.ve_mps * elapsed_s)
        step_m, most_m = math.hypot(step_n, step_e), self._most_mps * elapsed_s
        vn, ve = report.vn_mps, report.ve_mps
        if step_m > most_m:
            step_n, step_e = step_n * most_m / step_m, step_e * most_m / step_m
            vn, ve = step_n / elapsed_s, step_e / elapsed_s
        speed_mps = math.hypot(vn, ve)
        if speed_mps > self._most_mps:
            vn, ve = vn * self._most_mps / speed_mps, ve * self._most_mps / speed_mps
        return changed(station, n_m=station.n_m + step_n, e_m=station.e_m + step_e, vn_mps=vn, ve_mps=ve)

    def _is_fresh(self, t_ns: int) -> bool:
        return self._report is not None and t_ns <= self._fresh_until_ns(self._report)

    def _fresh_until_ns(self, report: LeaderReport) -> int:
        return report.t_ns + round(self._config.silence_s * 1e9)

    def notes(self, station: Station | None) -> tuple[Note, ...]:
        """What there is to tell of the motion of the station that is held."""
        if station is None:
            return ()
        if self._trouble is not None:
            return (Note(subject=SUBJECT, text=self._trouble, ok=False),)
        if self._waits:
            text = f"waits, the boat is more than {self._config.wait_beyond_m * BACK:g} m off"
            return (Note(subject=SUBJECT, text=text, ok=False),)
        if not station.moves:
            self._told = ""
            return ()
        if not self._told or (self._report is not None and self._t_ns - self._told_ns > TOLD_EVERY_NS):
            speed_mps = math.hypot(station.vn_mps, station.ve_mps)
            course_deg = math.degrees(math.atan2(station.ve_mps, station.vn_mps)) % 360.0
            after = f", after system {self.leader}" if self.leader else ""
            self._told, self._told_ns = f"{speed_mps:.2g} m/s toward {course_deg:.0f}{after}", self._t_ns
        return (Note(subject=SUBJECT, text=self._told, ok=True),)


def _carried(report: LeaderReport, t_ns: int) -> Place:
    """Where a report has the station by then."""
    elapsed_s = (t_ns - report.t_ns) * 1e-9
    return report.n_m + report.vn_mps * elapsed_s, report.e_m + report.ve_mps * elapsed_s
