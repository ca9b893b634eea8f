"""What a leader, or a set-point with a velocity, tells of where the station is to go. Pure functions."""

from __future__ import annotations

import math

from asvhil.types import changed, record

COURSE_TIME_S = 5.0  # time constant of the mean velocity that a leader's course is of
Place = tuple[float, float]


@record
class LeaderReport:
    """Where a leader is, or a set-point with a velocity has the station, at a time, and its velocity (NED)."""

    t_ns: int
    n_m: float
    e_m: float
    vn_mps: float
    ve_mps: float


def slower(report: LeaderReport, most_mps: float) -> LeaderReport:
    """The same, at no more than a speed."""
    speed_mps = math.hypot(report.vn_mps, report.ve_mps)
    if speed_mps <= most_mps:
        return report
    share = most_mps / speed_mps
    return changed(report, vn_mps=report.vn_mps * share, ve_mps=report.ve_mps * share)


def mean_velocity(before: LeaderReport | None, report: LeaderReport) -> LeaderReport:
    """A report with the velocity's exponential mean: a leader nearly at rest has noise for a course."""
    if before is None:
        return report
    elapsed_s = max((report.t_ns - before.t_ns) * 1e-9, 0.0)
    gain = elapsed_s / (elapsed_s + COURSE_TIME_S)
    vn_mps = before.vn_mps + gain * (report.vn_mps - before.vn_mps)
    ve_mps = before.ve_mps + gain * (report.ve_mps - before.ve_mps)
    return changed(report, vn_mps=vn_mps, ve_mps=ve_mps)


def carried(report: LeaderReport, t_ns: int) -> Place:
    """Where a report has the station by then."""
    elapsed_s = (t_ns - report.t_ns) * 1e-9
    return report.n_m + report.vn_mps * elapsed_s, report.e_m + report.ve_mps * elapsed_s
