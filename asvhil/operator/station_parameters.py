"""The station that is held as parameters on the operator's link: read, and set to move it. Pure functions."""

from __future__ import annotations

import math

from asvhil.config.heading import POLICIES
from asvhil.config.registry import OperatorParameter
from asvhil.geo import LocalFrame, wrap_rad
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.types import CourseCommand, HeadingCommand, MoveCommand, ParameterChange, Station

# Degrees on the ellipsoid, and metres from the first position heard, which a 32-bit float tells to a tenth of a
# millimetre while it tells degrees to half a metre.
PLACE_PARAMETERS = ("ST_LAT", "ST_LON", "ST_HDG", "ST_NORTH", "ST_EAST")
POLICY_PARAMETER = "ST_POLICY"
_POLICY = OperatorParameter(name=POLICY_PARAMETER, path=(), least=0.0, most=len(POLICIES) - 1.0, choices=POLICIES)
SPEED_PARAMETER, COURSE_PARAMETER, WAY_PARAMETER = "ST_SPEED", "ST_COURSE", "ST_WAY"
FOLLOW_PARAMETER = "ST_FOLLOW"
# Of a station that moves, with the largest value of each; none is negative.
COURSE_PARAMETERS = {SPEED_PARAMETER: math.inf, COURSE_PARAMETER: 360.0, WAY_PARAMETER: 1e6, FOLLOW_PARAMETER: 255.0}
MOST_SPEED_PARAMETER = "ST_SPEED_MAX"  # of ST_SPEED: asked for before a hold, so that one is not taken in vain
LIMIT_PARAMETERS = (MOST_SPEED_PARAMETER,)  # to be read only
STATION_PARAMETERS = (*PLACE_PARAMETERS, POLICY_PARAMETER, *COURSE_PARAMETERS)
BOUNDS_DEG = {"ST_LAT": 90.0, "ST_LON": 180.0, "ST_HDG": 360.0}


def station_value(
    name: str, station: Station | None, frame: LocalFrame | None, policy: str, course: CourseCommand | None = None
) -> float:
    """The value of one of STATION_PARAMETERS; those of the place are NaN while no station is held."""
    if name == POLICY_PARAMETER:
        return _POLICY.on_link(policy)
    if name in COURSE_PARAMETERS:
        return _course_value(name, course)
    if station is None or frame is None:
        return math.nan
    lat_deg, lon_deg = frame.to_geodetic(station.n_m, station.e_m)
    values = (lat_deg, lon_deg, math.degrees(station.psi_rad) % 360.0, station.n_m, station.e_m)
    return values[PLACE_PARAMETERS.index(name)]


def _course_value(name: str, course: CourseCommand | None) -> float:
    if course is None:
        return 0.0
    values = course.speed_mps, math.degrees(course.course_rad or 0.0) % 360.0, course.way_m, course.leader
    return float(values[list(COURSE_PARAMETERS).index(name)] or 0.0)


def request_of_change(change: ParameterChange) -> MoveCommand | HeadingCommand | CourseCommand | Explanation:
    """The move, course or heading policy that setting one of these parameters asks for, or why there is none."""
    name, value = change.name, change.value
    if name in LIMIT_PARAMETERS:
        return explain(Reason.PARAMETER_READ_ONLY, name=name)
    if name == POLICY_PARAMETER:
        if _POLICY.allows(value):
            return HeadingCommand(t_ns=change.t_ns, policy=str(_POLICY.from_link(value)))
        return explain(Reason.PARAMETER_OUT_OF_RANGE, name=name, range=_POLICY.range)
    if name in COURSE_PARAMETERS:
        return _course_of_change(change)
    most_deg = BOUNDS_DEG.get(name)
    if not math.isfinite(value) or (most_deg is not None and abs(value) > most_deg):
        allowed = "a finite number" if most_deg is None else f"{-most_deg:g} to {most_deg:g}"
        return explain(Reason.PARAMETER_OUT_OF_RANGE, name=name, range=allowed)
    match name:
        case "ST_LAT":
            return MoveCommand(t_ns=change.t_ns, lat_deg=value)
        case "ST_LON":
            return MoveCommand(t_ns=change.t_ns, lon_deg=value)
        case "ST_HDG":
            return MoveCommand(t_ns=change.t_ns, psi_rad=wrap_rad(math.radians(value)))
        case "ST_NORTH":
            return MoveCommand(t_ns=change.t_ns, n_m=value)
        case _:
            return MoveCommand(t_ns=change.t_ns, e_m=value)


def _course_of_change(change: ParameterChange) -> CourseCommand | Explanation:
    name, value, most = change.name, change.value, COURSE_PARAMETERS[change.name]
    odd = name == FOLLOW_PARAMETER and value != round(value) if math.isfinite(value) else True
    if odd or not 0.0 <= value <= most:
        allowed = "0 or more" if math.isinf(most) else f"0 to {most:g}"
        return explain(Reason.PARAMETER_OUT_OF_RANGE, name=name, range=allowed)
    match name:
        case "ST_SPEED":
            return CourseCommand(t_ns=change.t_ns, speed_mps=value)
        case "ST_COURSE":
            return CourseCommand(t_ns=change.t_ns, course_rad=math.radians(value))
        case "ST_WAY":
            return CourseCommand(t_ns=change.t_ns, way_m=value)
        case _:
            return CourseCommand(t_ns=change.t_ns, leader=round(value))
