"""The velocity of a leader by its successive places: where it tells none, or one that they contradict. Pure functions.

A straight line through the places of the last seconds. Another, through what is left of them when the told velocity is
taken out, shows by how much the two differ, however the leader turned meanwhile.
"""

from __future__ import annotations

import math

from asvhil.supervisor.leader_report import LeaderReport, Place
from asvhil.types import changed, record

WINDOW_S = 8.0  # of the line: a receiver that strays by 0.5 m then shows a velocity within 0.07 m/s
KEPT_S = 20.0  # nor are older places of any use, where messages are rare
FEWEST = 4  # places, where messages are rare
APART_S = 0.5  # nearer in time, places only repeat their error
LEAST_S = 3.0  # of a line
STRAY_M, STRAY_WEIGHT = 0.5, 8.0  # what a phone's receiver strays by, before its places show that; as many of them
SURE = 3.0  # times the line's standard deviation
BEGINS_MPS, ENDS_MPS = 0.2, 0.1  # at which a leader is taken to move, and to rest again
WANDERS_M, WANDERS_S = 2.5, 30.0  # nor does it move so near to where it has been of late: receivers wander
LASTING_S = WINDOW_S  # longer than one jump or sharp turn stays in a line
SURE_OF_COURSE_M = 3.0  # from where it was taken to move on, and LASTING_S: what a receiver wanders by is over sooner
LATELY_S = 2.5  # of the places that may show that a leader stops or turns, by the line through those before
BEHIND_M, BEHIND = 0.3, 3.0  # the line by so much at the least, and by so many standard deviations
CONTRADICTS_MPS = 0.25  # at the least, by which velocity and places differ
CONTRADICTS = 0.4  # of the greater of the two: 24 degrees, or the size


@record
class LeaderTrack:
    """What is remembered of a leader's reports. `told_m`: how far the told velocities would have carried it by each."""

    reports: tuple[LeaderReport, ...] = ()
    told_m: tuple[Place, ...] = ()
    tells: bool = False  # a velocity; one of zero is then one of rest
    moves: bool = False  # by its places
    began: LeaderReport | None = None  # to move: its report then
    is_behind: bool = False  # the line through its places: it stops, reverses or turns, which the line has not yet
    rest_m: Place = (0.0, 0.0)  # where it has been of late, or was when it last came to rest
    velocity_mps: Place = (0.0, 0.0)  # by its places, north and east; of zero where these only stray
    contradicts: bool = False  # the told velocity, the places
    turned_ns: int | None = None  # since when it looks otherwise than `contradicts` says

    @property
    def counts(self) -> bool:
        """Whether the velocity by its places is the one to go by."""
        return self.contradicts or not self.tells

    @property
    def has_course(self) -> bool:
        """Whether the velocity to go by may be one of a course: by its places, if it has lasted and carried it on."""
        if not self.counts:
            return True
        if self.began is None or self.is_behind:
            return False
        last, began = self.reports[-1], self.began
        lasting = (last.t_ns - began.t_ns) * 1e-9 >= LASTING_S
        return lasting and math.hypot(last.n_m - began.n_m, last.e_m - began.e_m) >= SURE_OF_COURSE_M


def velocity_of(track: LeaderTrack, report: LeaderReport) -> LeaderReport:
    """A report, the last of a track, with the velocity to go by.

    Of a leader that stops it is zero before the line shows that: a station behind it is better than one beyond it.
    """
    if not track.counts:
        return report
    if track.is_behind:
        return changed(report, vn_mps=0.0, ve_mps=0.0)
    return changed(report, vn_mps=track.velocity_mps[0], ve_mps=track.velocity_mps[1])


def extended(track: LeaderTrack, report: LeaderReport) -> LeaderTrack:
    """The track with another report."""
    tells = track.tells or report.vn_mps != 0.0 or report.ve_mps != 0.0
    reports, told_m = track.reports, track.told_m
    if not reports:
        return LeaderTrack(reports=(report,), told_m=((0.0, 0.0),), tells=tells, rest_m=(report.n_m, report.e_m))
    last = reports[-1]
    elapsed_s = (report.t_ns - last.t_ns) * 1e-9
    if elapsed_s < APART_S:
        return changed(track, tells=tells)
    half_s = 0.5 * elapsed_s
    north_m = told_m[-1][0] + half_s * (last.vn_mps + report.vn_mps)
    east_m = told_m[-1][1] + half_s * (last.ve_mps + report.ve_mps)
    reports, told_m = (*reports, report), (*told_m, (north_m, east_m))
    ages_s = [(report.t_ns - one.t_ns) * 1e-9 for one in reports]
    first = 0
    while ages_s[first] > (WINDOW_S if len(reports) - first > FEWEST else KEPT_S):
        first += 1
    gain = 1.0 if track.moves else elapsed_s / (elapsed_s + WANDERS_S)
    rest_n, rest_e = track.rest_m
    rest_m = rest_n + gain * (report.n_m - rest_n), rest_e + gain * (report.e_m - rest_e)
    track = changed(track, reports=reports[first:], told_m=told_m[first:], tells=tells, rest_m=rest_m)
    return _judged(track, ages_s[first:])


def _judged(track: LeaderTrack, ages_s: list[float]) -> LeaderTrack:
    """Whether it moves, and whether it is told so."""
    if len(ages_s) < FEWEST or ages_s[0] < LEAST_S:
        return changed(track, moves=False, began=None, is_behind=False, velocity_mps=(0.0, 0.0), turned_ns=None)
    t_s = [-age_s for age_s in ages_s]
    places = [(one.n_m, one.e_m) for one in track.reports]
    vn_mps, ve_mps, std_mps = _line(t_s, places)
    speed_mps = math.hypot(vn_mps, ve_mps)
    gone_m = math.hypot(places[-1][0] - track.rest_m[0], places[-1][1] - track.rest_m[1])
    begins = gone_m > WANDERS_M and speed_mps >= max(BEGINS_MPS, SURE * std_mps)
    moves = speed_mps >= ENDS_MPS if track.moves else begins
    left = [(n_m - told_n, e_m - told_e) for (n_m, e_m), (told_n, told_e) in zip(places, track.told_m, strict=True)]
    left_n, left_e, left_std = _line(t_s, left)
    most_mps = max(speed_mps, math.hypot(vn_mps - left_n, ve_mps - left_e))
    bound_mps = max(CONTRADICTS_MPS, CONTRADICTS * most_mps, SURE * left_std)
    contradicts = track.tells and math.hypot(left_n, left_e) > bound_mps
    turned_ns, now_ns = track.turned_ns, track.reports[-1].t_ns
    if contradicts is track.contradicts:
        turned_ns = None
    elif turned_ns is None:
        turned_ns = now_ns
    lasting = turned_ns is not None and (now_ns - turned_ns) * 1e-9 >= LASTING_S
    return changed(
        track,
        moves=moves,
        began=(track.began or track.reports[-1]) if moves else None,
        is_behind=moves and _is_behind(t_s, places, (vn_mps / speed_mps, ve_mps / speed_mps)),
        velocity_mps=(vn_mps, ve_mps) if moves else (0.0, 0.0),
        contradicts=contradicts if lasting else track.contradicts,
        turned_ns=None if lasting else turned_ns,
    )


def _line(t_s: list[float], places: list[Place]) -> tuple[float, float, float]:
    """Velocity north and east of the straight line through places, and its standard deviation, of each of the two."""
    count = len(t_s)
    mean_t, mean_n, mean_e = _mean(t_s), _mean([n_m for n_m, _ in places]), _mean([e_m for _, e_m in places])
    spread = north = east = 0.0
    for at_s, (n_m, e_m) in zip(t_s, places, strict=True):
        spread += (at_s - mean_t) ** 2
        north += (at_s - mean_t) * (n_m - mean_n)
        east += (at_s - mean_t) * (e_m - mean_e)
    vn_mps, ve_mps = north / spread, east / spread
    square = STRAY_WEIGHT * STRAY_M**2
    for at_s, (n_m, e_m) in zip(t_s, places, strict=True):
        square += (n_m - mean_n - vn_mps * (at_s - mean_t)) ** 2 + (e_m - mean_e - ve_mps * (at_s - mean_t)) ** 2
    return vn_mps, ve_mps, math.sqrt(square / (STRAY_WEIGHT + 2.0 * count - 4.0) / spread)


def _is_behind(t_s: list[float], places: list[Place], ahead: Place) -> bool:
    """Whether the last place, at time 0, is short of the line through those before LATELY_S, along a unit vector."""
    along = [n_m * ahead[0] + e_m * ahead[1] for n_m, e_m in places]
    before = [(at_s, at_m) for at_s, at_m in zip(t_s, along, strict=True) if at_s <= -LATELY_S]
    if len(before) < FEWEST - 1:
        return False
    mean_t, mean_m = _mean([at_s for at_s, _ in before]), _mean([at_m for _, at_m in before])
    spread = product = square = 0.0
    for at_s, at_m in before:
        spread += (at_s - mean_t) ** 2
        product += (at_s - mean_t) * (at_m - mean_m)
    speed_mps = product / spread
    for at_s, at_m in before:
        square += (at_m - mean_m - speed_mps * (at_s - mean_t)) ** 2
    std_m = math.sqrt(square / (len(before) - 2.0) * (1.0 + 1.0 / len(before) + mean_t**2 / spread))
    return mean_m - speed_mps * mean_t - along[-1] > max(BEHIND_M, BEHIND * std_m)


def _mean(values: list[float]) -> float:
    total = 0.0
    for value in values:
        total += value
    return total / len(values)
