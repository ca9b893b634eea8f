"""Frames that ask the daemon for something, as a ground station or the shell sends them."""

from __future__ import annotations

import math
from typing import Any

from asvhil.config import AutopilotLinkConfig
from asvhil.io.mavlink.frames import dialect
from asvhil.operator.goto import HERE

SOLVE_TIME = "solve_ms"


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
