"""Frames that ask the daemon for something, as a ground station or the shell sends them."""

from __future__ import annotations

import math
from typing import Any

from asvhil.config import AutopilotLinkConfig
from asvhil.io.mavlink.frames import dialect
from asvhil.operator.goto import HERE, IGNORE_XY, IGNORE_YAW

SOLVE_TIME = "solve_ms"
# Type mask of a station: position and yaw are meant, nothing else.
STATION_ONLY = sum(
    getattr(dialect, f"POSITION_TARGET_TYPEMASK_{name}_IGNORE")
    for name in ("Z", "VX", "VY", "VZ", "AX", "AY", "AZ", "YAW_RATE")
)


def encode_hold(
    config: AutopilotLinkConfig,
    lat_deg: float | None,
    lon_deg: float | None,
    psi_rad: float | None,
    within_m: float = 0.0,
) -> bytes:
    """The frame that asks the daemon to hold a station; None means as the boat is now.

    `within_m`: the distance that it is known to lie within, 0 for the one of the config.
    """
    message = dialect.MAVLink_command_int_message(
        config.system_id,
        config.component_id,
        dialect.MAV_FRAME_GLOBAL,
        dialect.MAV_CMD_DO_REPOSITION,
        0,
        0,
        -1.0,
        0.0,
        within_m,
        math.nan if psi_rad is None else psi_rad,
        HERE if lat_deg is None else round(lat_deg * 1e7),
        HERE if lon_deg is None else round(lon_deg * 1e7),
        0.0,
    )
    return _pack_as_ground_station(message)


FINAL_TICKS = 3  # of a run, after a release at its end: the autopilot is asked more than once


def encode_release(config: AutopilotLinkConfig) -> bytes:
    """The frame that asks the daemon to let go of the motors."""
    message = dialect.MAVLink_command_long_message(
        config.system_id, config.component_id, dialect.MAV_CMD_NAV_GUIDED_ENABLE, 0, 0, 0, 0, 0, 0, 0, 0
    )
    return _pack_as_ground_station(message)


def encode_neutral(config: AutopilotLinkConfig) -> bytes:
    """The frame that asks the daemon for neutral at once."""
    message = dialect.MAVLink_command_long_message(
        config.system_id, config.component_id, dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0, 0, 0, 0, 0, 0, 0, 0
    )
    return _pack_as_ground_station(message)


def encode_move(
    config: AutopilotLinkConfig, place_m: tuple[float, float] | None = None, psi_rad: float | None = None
) -> bytes:
    """The frame that moves the station that is held: north and east in the local frame (m), heading; None: as it is."""
    n_m, e_m = place_m or (0.0, 0.0)
    mask = STATION_ONLY | (IGNORE_XY if place_m is None else 0) | (IGNORE_YAW if psi_rad is None else 0)
    rest = (0.0,) * 7  # z, velocity, acceleration
    message = dialect.MAVLink_set_position_target_local_ned_message(
        0,
        config.system_id,
        config.component_id,
        dialect.MAV_FRAME_LOCAL_NED,
        mask,
        n_m,
        e_m,
        *rest,
        psi_rad or 0.0,
        0.0,
    )
    return _pack_as_ground_station(message)


def encode_parameter(config: AutopilotLinkConfig, name: str, value: float) -> bytes:
    """The frame that sets a parameter of the daemon."""
    kind = dialect.MAV_PARAM_TYPE_REAL32
    message = dialect.MAVLink_param_set_message(config.system_id, config.component_id, name.encode(), value, kind)
    return _pack_as_ground_station(message)


def encode_parameter_question(config: AutopilotLinkConfig, name: str) -> bytes:
    """The frame that asks for a parameter of the daemon; nothing answers where it has none of that name."""
    message = dialect.MAVLink_param_request_read_message(config.system_id, config.component_id, name.encode(), -1)
    return _pack_as_ground_station(message)


def encode_solve_time(config: AutopilotLinkConfig, solve_ms: float) -> bytes:
    """The frame by which the shell tells how long solving takes."""
    message = dialect.MAVLink_named_value_float_message(0, SOLVE_TIME.encode(), solve_ms)
    return bytes(message.pack(dialect.MAVLink(None, srcSystem=config.system_id, srcComponent=config.component_id)))


def encode_question(config: AutopilotLinkConfig, msg_id: int) -> bytes:
    """The frame that asks the daemon for a message; STATUSTEXT: its phase with the reason, and its notes."""
    message = dialect.MAVLink_command_long_message(
        config.system_id, config.component_id, dialect.MAV_CMD_REQUEST_MESSAGE, 0, float(msg_id), 0, 0, 0, 0, 0, 0
    )
    return _pack_as_ground_station(message)


def encode_presence() -> bytes:
    """The heartbeat of a ground station, to which the daemon sends its reports."""
    kind, none = dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID
    return _pack_as_ground_station(dialect.MAVLink_heartbeat_message(kind, none, 0, 0, dialect.MAV_STATE_ACTIVE, 3))


def _pack_as_ground_station(message: Any) -> bytes:
    ground_station = dialect.MAVLink(None, srcSystem=255, srcComponent=dialect.MAV_COMP_ID_MISSIONPLANNER)
    return bytes(message.pack(ground_station))
