"""How the station that is held moves: on a course, or after a leader; never faster than the boat can follow."""

from __future__ import annotations

import math
from collections.abc import Callable

from asvhil.config import MovingConfig
from asvhil.config.single import clipped, told, within
from asvhil.config.vehicle import VesselConfig
from asvhil.geo import body_to_ned
from asvhil.supervisor.leader_report import LeaderReport, Place, carried, mean_velocity, slower
from asvhil.supervisor.leader_velocity import LeaderTrack, extended, velocity_of
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.types import CourseCommand, Note, Station, changed

SUBJECT = "moving station"
VELOCITY_SUBJECT = "leader's velocity"
LONGEST_TICK_S = 1.0  # a longer time between two ticks is a pause, in which the station stays
TOLD_EVERY_NS = 10_000_000_000  # the velocity of a leader, which changes with every message
CATCH_UP_S = 2.0  # time constant with which the station follows where a leader says that it is
COURSE_LEAST_MPS = 0.1  # a leader that is slower has no course of its own
SHARE = 0.5  # of the thrust ahead, which a station's speed may take: the rest is for the weather
Going = tuple[float, float, int]
AT_REST: Going = (0.0, 0.0, 0)
BACK = 0.5  # of the distance at which a station waits: from there it goes on


def fastest_mps(vessel: VesselConfig, config: MovingConfig) -> float:
    """How fast a station may be: as the config says, and where SHARE of the thrust balances the drag ahead."""
    return min(config.max_speed_mps, vessel.speed_ahead_mps(SHARE))


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
        self._offset: Place = (0.0, 0.0)  # NED, of the station from where the report is
        self._mean: LeaderReport | None = None  # of the leader's velocity, for its course
        self._track = LeaderTrack()
        self._contradiction: str | None = None  # of its velocity and its positions, in words
        self._course_of_leader_rad = 0.0
        self._t_ns = 0
        self._refused: tuple[int, Reason] | None = None  # the last message that was not followed
        self._refusal, self._refusal_told_ns = "", 0  # of it, in words
        self._waits = False
        self._steered = True
        self._told = ""
        self._told_ns = 0
        self._trouble: str | None = None  # what is wrong with the leader

    def begin(self) -> None:
        """A hold begins, or ends: its station rests."""
        self.speed_mps = 0.0
        self.way_m = None
        self._forget_leader(0)
        self._trouble = None
        self._waits = False
        self._told = ""

    def _forget_leader(self, leader: int) -> None:
        """Another one from now on, 0 for none: nothing is known of it."""
        self.leader = leader
        self._report = self._mean = self._refused = self._contradiction = None
        self._track = LeaderTrack()
        self._offset, self._course_of_leader_rad = (0.0, 0.0), 0.0

    # --- commands --------------------------------------------------------------------------------------------

    def choose(self, command: CourseCommand) -> Explanation | None:
        """Another speed, course, way or leader; what is None stays. Returns None, or why not."""
        if command.speed_mps is not None:
            if not within(command.speed_mps, 0.0, self._most_mps):
                return explain(Reason.STATION_TOO_FAST, speed=command.speed_mps, most=told(self._most_mps))
            self.speed_mps = clipped(command.speed_mps, 0.0, self._most_mps)
            self._forget_leader(0)
            self._trouble = None
        if command.course_rad is not None:
            self.course_rad = command.course_rad
        if command.way_m is not None:
            self.way_m = command.way_m if command.way_m > 0.0 else None
        if command.leader or (command.leader == 0 and self.leader):  # no leader after no leader changes nothing
            self._forget_leader(command.leader)
            self._trouble = f"{self._name} not heard" if command.leader else None
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

    @property
    def going(self) -> Going:
        """What the station goes after, while it waits as well: a course, or a leader, -1 for set-points.

        Velocity north and east of the course (m/s), and the leader, 0 for none; 0 all of them: it rests.
        """
        if self.speed_mps > 0.0:
            return *body_to_ned(self.course_rad, self.speed_mps, 0.0), 0
        return AT_REST if self._report is None else (0.0, 0.0, self.leader or -1)

    def refuse_course(self, why: Explanation) -> None:
        """The course of the config cannot be followed."""
        self._trouble = f"stays: {describe(why)}"

    def refuse(self, t_ns: int, why: Explanation) -> None:
        """A report of the leader cannot be followed.

        The metres in the words change with every message; the words do so seldom, since operators are told of each, and
        of a leader that is lost for good not at all.
        """
        is_same = self._refused is not None and self._refused[1] is why.reason
        is_lost = why.reason is Reason.LEADER_JUMPED
        if not is_same or (t_ns - self._refusal_told_ns > TOLD_EVERY_NS and not is_lost):
            self._refusal_told_ns = t_ns
            again = "; set ST_FOLLOW anew to follow it from there" if is_lost else ""
            self._refusal = f"{self._name} not followed: {describe(why)}{again}"
        self._refused = t_ns, why.reason
        self._trouble = self._refusal

    @property
    def _name(self) -> str:
        return f"system {self.leader} is" if self.leader else "the set-points are"

    def rest(self) -> None:
        """The station is put somewhere, at no velocity: what a set-point had it do before is over."""
        if not self.leader:
            self._report = self._trouble = self._contradiction = None

    def lead(self, report: LeaderReport) -> Explanation | None:
        """A set-point with a velocity, in the place of a leader that was followed. As `report`."""
        if self.leader:
            self._forget_leader(0)
        return self.report(report)

    def report(
        self, report: LeaderReport, why_not: Callable[[Place], Explanation | None] = lambda place: None
    ) -> Explanation | None:
        """Where the leader is, or a set-point; `why_not` a station cannot be at a place.

        Returns None, or why it is not followed, which leaves all as it was.
        """
        jump_m = self._jump_m(report)
        if jump_m > self._config.jump_m:
            return explain(Reason.LEADER_JUMPED, metres=jump_m, most=self._config.jump_m)
        again = self.leader or self._is_fresh(report.t_ns)
        track = extended(self._track if again else LeaderTrack(), report)
        told, report = report, velocity_of(track, report)
        mean, course_rad = self._mean, self._course_of_leader_rad
        if track.has_course:  # a receiver that wanders turns nothing
            mean = mean_velocity(mean, slower(report, self._most_mps))  # one wrong velocity turns it for seconds
        if mean is not None and math.hypot(mean.vn_mps, mean.ve_mps) >= COURSE_LEAST_MPS:
            course_rad = math.atan2(mean.ve_mps, mean.vn_mps)
        offset = self._offset_at(course_rad) if self.leader else (0.0, 0.0)
        refusal = why_not((report.n_m + offset[0], report.e_m + offset[1]))
        if refusal is not None:
            return refusal
        self.speed_mps, self.way_m = 0.0, None
        self._report, self._mean, self._course_of_leader_rad, self._offset = report, mean, course_rad, offset
        self._refused, self._track = None, track
        self._tell_contradiction(told)
        faster = not within(math.hypot(report.vn_mps, report.ve_mps), 0.0, self._most_mps)
        self._trouble = f"{self._name} faster than {self._most_mps:.1f} m/s" if faster else None
        return None

    def _tell_contradiction(self, told: LeaderReport) -> None:
        """In words that stay the same for as long as it lasts."""
        if not self._track.contradicts:
            self._contradiction = None
        elif self._contradiction is None:
            who = f"system {self.leader} tells" if self.leader else "the set-points tell"
            self._contradiction = (
                f"{who} {_in_words(told.vn_mps, told.ve_mps)}, the positions go "
                f"{_in_words(*self._track.velocity_mps)}, which counts; MAVLink's velocity is north, east in m/s"
            )
            self._told_ns = self._t_ns - TOLD_EVERY_NS  # the velocity is told anew in the next tick, which has it

    def _jump_m(self, report: LeaderReport) -> float:
        """How far a report is from the last one, which is taken to have gone on at its velocity, or not at all."""
        before = self._report
        # A leader that is followed is where it was left; a stream of set-points that comes again is another one.
        if before is None or not (self.leader or self._is_fresh(report.t_ns)):
            return 0.0
        there = carried(before, min(report.t_ns, self._fresh_until_ns(before)))
        places = there, (before.n_m, before.e_m)  # one wrong velocity does not lose it
        return min(math.hypot(report.n_m - n_m, report.e_m - e_m) for n_m, e_m in places)

    def _offset_at(self, course_rad: float) -> Place:
        """Of the station from its leader, NED."""
        if self._config.offset_frame == "north":
            return self._config.offset_m
        return body_to_ned(course_rad, *self._config.offset_m)

    # --- each tick -------------------------------------------------------------------------------------------

    def step(
        self, t_ns: int, station: Station, boat_m: Place | None, outside: Callable[[Station], Explanation | None]
    ) -> Station:
        """The station of this tick; `boat_m`: where the boat is, None where that is not known, or the boat not steered,
        and so waited for.

        `outside` says why a station cannot be where it would go to.
        """
        elapsed_s, self._t_ns = (t_ns - self._t_ns) * 1e-9, t_ns
        report = self._report
        if report is None and self.speed_mps == 0.0:
            self._tell_silence()
            self._waits = False
            return changed(station, vn_mps=0.0, ve_mps=0.0) if station.moves else station
        self._steered = boat_m is not None
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
        self._trouble = f"stays, until it is given a speed again: {describe(why)}"
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
            self._tell_silence()
            return changed(station, vn_mps=0.0, ve_mps=0.0)
        report = slower(report, self._most_mps)
        n_m, e_m = carried(report, self._t_ns)
        n_m, e_m = n_m + self._offset[0], e_m + self._offset[1]
        gain = elapsed_s / (elapsed_s + CATCH_UP_S)
        step_n = report.vn_mps * elapsed_s + gain * (n_m - station.n_m - report.vn_mps * elapsed_s)
        step_e = report.ve_mps * elapsed_s + gain * (e_m - station.e_m - report.ve_mps * elapsed_s)
        step_m, most_m = math.hypot(step_n, step_e), self._most_mps * elapsed_s
        vn, ve = report.vn_mps, report.ve_mps
        if step_m > most_m:
            step_n, step_e = step_n * most_m / step_m, step_e * most_m / step_m
            vn, ve = step_n / elapsed_s, step_e / elapsed_s
        return changed(station, n_m=station.n_m + step_n, e_m=station.e_m + step_e, vn_mps=vn, ve_mps=ve)

    def _tell_silence(self) -> None:
        """That what was followed, or would have been, says nothing any more."""
        heard = [one for one in (self._report and self._report.t_ns, self._refused and self._refused[0]) if one]
        if heard and (self._t_ns - max(heard)) * 1e-9 > self._config.silence_s:
            self._trouble = f"{self._name} silent: it stays"

    def _is_fresh(self, t_ns: int) -> bool:
        return self._report is not None and t_ns <= self._fresh_until_ns(self._report)

    def _fresh_until_ns(self, report: LeaderReport) -> int:
        return report.t_ns + round(self._config.silence_s * 1e9)

    def notes(self, station: Station | None) -> tuple[Note, ...]:
        """What there is to tell of the motion of the station that is held."""
        if station is None:
            return ()
        of_motion = self._notes_of_motion(station)
        if self._contradiction is None or not self._is_fresh(self._t_ns):  # of a silent one no velocity counts
            return of_motion
        return (*of_motion, Note(subject=VELOCITY_SUBJECT, text=self._contradiction, ok=False))

    def _notes_of_motion(self, station: Station) -> tuple[Note, ...]:
        if self._trouble is not None:
            return (Note(subject=SUBJECT, text=self._trouble, ok=False),)
        if self._waits:
            beyond = f"waits, the boat is more than {self._config.wait_beyond_m * BACK:g} m off"
            text = beyond if self._steered else "waits until the boat is steered again"
            return (Note(subject=SUBJECT, text=text, ok=False),)
        if not station.moves:
            self._told = ""
            return ()
        if not self._told or (self._report is not None and self._t_ns - self._told_ns > TOLD_EVERY_NS):
            after = f", after system {self.leader}" if self.leader else ""
            vn, ve = station.vn_mps, station.ve_mps
            if self._report is not None and self._track.moves and self._track.counts:
                vn, ve = self._track.velocity_mps  # not how fast it catches up with a receiver that strays
            self._told, self._told_ns = f"{_in_words(vn, ve)}{after}", self._t_ns
        return (Note(subject=SUBJECT, text=self._told, ok=True),)


def _in_words(vn_mps: float, ve_mps: float) -> str:
    speed_mps, course_deg = math.hypot(vn_mps, ve_mps), math.degrees(math.atan2(ve_mps, vn_mps)) % 360.0
    return f"{speed_mps:.2g} m/s toward {course_deg:.0f}" if speed_mps > 0.0 else "0 m/s"
