"""What ground stations send to have a station kept or let go, as requests. Pure functions."""

from __future__ import annotations

import math
from typing import Any

from asvhil.geo import is_place
from asvhil.io.mavlink.frames import decode, dialect, message_id
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.types import HoldCommand, LeaderMessage, MoveCommand, NeutralCommand, ReleaseCommand, changed, record

HERE = 2**31 - 1  # INT32_MAX: "no value" of a COMMAND_INT coordinate
REPOSITION, LOITER = dialect.MAV_CMD_DO_REPOSITION, dialect.MAV_CMD_NAV_LOITER_UNLIM
GUIDED = dialect.MAV_CMD_NAV_GUIDED_ENABLE
ARMING = dialect.MAV_CMD_COMPONENT_ARM_DISARM
LOCAL_SETPOINT = dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED
SETPOINT = dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT
COMMANDS = (dialect.MAVLINK_MSG_ID_COMMAND_INT, dialect.MAVLINK_MSG_ID_COMMAND_LONG)
# Latitude and longitude, whatever the height is above: a boat has none.
GLOBAL_FRAMES = frozenset(
    {
        dialect.MAV_FRAME_GLOBAL,
        dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT,
        dialect.MAV_FRAME_GLOBAL_INT,
        dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT,
        dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
    }
)
DENIED = int(dialect.MAV_RESULT_DENIED)
IGNORE_XY = dialect.POSITION_TARGET_TYPEMASK_X_IGNORE | dialect.POSITION_TARGET_TYPEMASK_Y_IGNORE
IGNORE_YAW = dialect.POSITION_TARGET_TYPEMASK_YAW_IGNORE
IGNORE_VELOCITY = dialect.POSITION_TARGET_TYPEMASK_VX_IGNORE | dialect.POSITION_TARGET_TYPEMASK_VY_IGNORE
# What a station cannot follow: bit that leaves it out, field.
RATES = (
    (dialect.POSITION_TARGET_TYPEMASK_AX_IGNORE, "afx"),
    (dialect.POSITION_TARGET_TYPEMASK_AY_IGNORE, "afy"),
    (dialect.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE, "yaw_rate"),
)
FOLLOW_TARGET = dialect.MAVLINK_MSG_ID_FOLLOW_TARGET
HAS_POSITION, HAS_VELOCITY = 1, 2  # bits of its est_capabilities
YAW_MAX_RAD = 2.0 * math.pi + 1e-6


@record
class Refusal:
    """Why a request makes no sense, and the MAV_RESULT that says so."""

    why: Explanation
    result: int = DENIED


Meaning = HoldCommand | MoveCommand | NeutralCommand | ReleaseCommand | Refusal


def is_goto(data: bytes) -> bool:
    """Whether a complete frame asks a vehicle to go somewhere and stay there."""
    msg_id = message_id(data)
    if msg_id == SETPOINT:
        return True
    message = decode(data) if msg_id in COMMANDS else None
    return message is not None and message.command in (REPOSITION, LOITER)


def meaning_of_command(t_ns: int, m: Any) -> Meaning | None:
    """The request of a COMMAND_INT or COMMAND_LONG; None where the command is about something else."""
    if m.command == GUIDED:
        if m.param1 == 0.0:
            return ReleaseCommand(t_ns=t_ns)
        return HoldCommand(t_ns=t_ns) if m.param1 == 1.0 else Refusal(why=explain(Reason.GUIDED_ENABLE_VALUE))
    if m.command == ARMING and m.param1 == 0.0:  # a component that is disarmed moves nothing
        return NeutralCommand(t_ns=t_ns)
    if m.command not in (REPOSITION, LOITER):
        return None
    whole = m.get_type() == "COMMAND_INT"
    if m.command == REPOSITION and not whole:
        return Refusal(why=explain(Reason.COMMAND_INT_ONLY), result=int(dialect.MAV_RESULT_COMMAND_INT_ONLY))
    if whole and m.frame not in GLOBAL_FRAMES:
        return Refusal(why=explain(Reason.FRAME_NOT_GLOBAL, frame=m.frame))
    # By the protocol the heading of DO_REPOSITION is in radians and that of NAV_LOITER_UNLIM in degrees.
    yaw_rad = m.param4 if m.command == REPOSITION else math.radians(m.param4)
    if whole:
        here = m.x == HERE and m.y == HERE
        lat_deg, lon_deg = m.x * 1e-7, m.y * 1e-7
    else:
        here = math.isnan(m.param5) and math.isnan(m.param6)
        lat_deg, lon_deg = m.param5, m.param6
    if m.command == LOITER:
        here = here or (lat_deg == 0.0 and lon_deg == 0.0)
    # The radius of a loiter means nothing to a boat; the distance that is confirmed stands there.
    within_m = m.param3 if m.command == REPOSITION and m.param3 > 0.0 else 0.0  # False for NaN
    return _hold(t_ns, None if here else (lat_deg, lon_deg), yaw_rad, within_m)


def meaning_of_setpoint(t_ns: int, m: Any, *, streaming: bool) -> HoldCommand | MoveCommand | Refusal:
    """The request of a SET_POSITION_TARGET_GLOBAL_INT; its type mask tells which fields are meant.

    `streaming`: it is not the first of its stream, and so only moves the station that the first took.
    """
    if m.coordinate_frame not in GLOBAL_FRAMES:
        return Refusal(why=explain(Reason.FRAME_NOT_GLOBAL, frame=m.coordinate_frame))
    if m.type_mask & IGNORE_XY:
        return Refusal(why=explain(Reason.SETPOINT_WITHOUT_POSITION))
    rate = _refusal_of_rates(m)
    if rate is not None:
        return rate
    yaw_rad = math.nan if m.type_mask & IGNORE_YAW else m.yaw
    hold = _hold(t_ns, (m.lat_int * 1e-7, m.lon_int * 1e-7), yaw_rad)
    if isinstance(hold, Refusal):
        return hold
    velocity_mps = _velocity(m)
    if isinstance(velocity_mps, Refusal):
        return velocity_mps
    if not streaming:
        return changed(hold, velocity_mps=velocity_mps, by_setpoint=True)
    return MoveCommand(
        t_ns=t_ns, lat_deg=hold.lat_deg, lon_deg=hold.lon_deg, psi_rad=hold.psi_rad, velocity_mps=velocity_mps
    )


def meaning_of_local_setpoint(t_ns: int, m: Any) -> MoveCommand | Refusal:
    """The request of a SET_POSITION_TARGET_LOCAL_NED: it moves a station that is held, and never takes one."""
    if m.coordinate_frame != dialect.MAV_FRAME_LOCAL_NED:
        return Refusal(why=explain(Reason.FRAME_NOT_LOCAL, frame=m.coordinate_frame))
    no_place, no_yaw = m.type_mask & IGNORE_XY, m.type_mask & IGNORE_YAW or math.isnan(m.yaw)
    if no_place and (no_yaw or no_place != IGNORE_XY):
        return Refusal(why=explain(Reason.SETPOINT_WITHOUT_POSITION))
    rate = _refusal_of_rates(m)
    if rate is not None:
        return rate
    if not no_place and not (math.isfinite(m.x) and math.isfinite(m.y)):
        return Refusal(why=explain(Reason.PLACE_IMPOSSIBLE))
    if not no_yaw and not abs(m.yaw) <= YAW_MAX_RAD:
        return Refusal(why=explain(Reason.HEADING_IMPOSSIBLE))
    velocity_mps = _velocity(m)
    if isinstance(velocity_mps, Refusal):
        return velocity_mps
    n_m, e_m = (None, None) if no_place else (m.x, m.y)
    psi_rad = None if no_yaw else m.yaw
    return MoveCommand(t_ns=t_ns, n_m=n_m, e_m=e_m, psi_rad=psi_rad, velocity_mps=velocity_mps)


def meaning_of_leader(t_ns: int, system_id: int, m: Any) -> LeaderMessage | None:
    """Where a FOLLOW_TARGET has its sender, and how fast; None where it does not tell a place.

    A velocity that is not told, or is no number, is of zero: that of its places then counts.
    """
    lat_deg, lon_deg = m.lat * 1e-7, m.lon * 1e-7
    if not m.est_capabilities & HAS_POSITION or not is_place(lat_deg, lon_deg):
        return None
    told = m.est_capabilities & HAS_VELOCITY and math.isfinite(m.vel[0]) and math.isfinite(m.vel[1])
    velocity_mps = (m.vel[0], m.vel[1]) if told else (0.0, 0.0)
    return LeaderMessage(t_ns=t_ns, system_id=system_id, lat_deg=lat_deg, lon_deg=lon_deg, velocity_mps=velocity_mps)


def _velocity(m: Any) -> tuple[float, float] | Refusal | None:
    """The station's velocity over ground (north, east), None where none is meant; one of zero is that of rest."""
    ignored = m.type_mask & IGNORE_VELOCITY
    if ignored == IGNORE_VELOCITY or (ignored == 0 and m.vx == 0.0 and m.vy == 0.0):
        return None
    if ignored or not (math.isfinite(m.vx) and math.isfinite(m.vy)):
        return Refusal(why=explain(Reason.VELOCITY_IMPOSSIBLE))
    return m.vx, m.vy


def _refusal_of_rates(m: Any) -> Refusal | None:
    """Why a set-point asks for more than a station with a velocity."""
    for bit, field in RATES:
        value = getattr(m, field)
        if not m.type_mask & bit and value != 0.0 and not math.isnan(value):
            return Refusal(why=explain(Reason.SETPOINT_WITH_RATE, field=field))
    return None


def _hold(
    t_ns: int, place_deg: tuple[float, float] | None, yaw_rad: float, within_m: float = 0.0
) -> HoldCommand | Refusal:
    lat_deg, lon_deg = place_deg if place_deg is not None else (None, None)
    if lat_deg is not None and lon_deg is not None:
        on_earth = abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0
        if not on_earth or (lat_deg == 0.0 and lon_deg == 0.0):
            return Refusal(why=explain(Reason.PLACE_IMPOSSIBLE))
    if not math.isnan(yaw_rad) and not abs(yaw_rad) <= YAW_MAX_RAD:
        return Refusal(why=explain(Reason.HEADING_IMPOSSIBLE))
    psi_rad = None if math.isnan(yaw_rad) else yaw_rad
    return HoldCommand(t_ns=t_ns, lat_deg=lat_deg, lon_deg=lon_deg, psi_rad=psi_rad, within_m=within_m)
