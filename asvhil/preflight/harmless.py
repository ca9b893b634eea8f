"""All that a preflight may say: nothing that arms the vehicle or moves a motor."""

from __future__ import annotations

from asvhil.io.mavlink.frames import decode, dialect, message_id

ALLOWED = frozenset(
    {
        dialect.MAVLINK_MSG_ID_HEARTBEAT,
        dialect.MAVLINK_MSG_ID_TIMESYNC,
        dialect.MAVLINK_MSG_ID_REQUEST_DATA_STREAM,
        dialect.MAVLINK_MSG_ID_PARAM_REQUEST_READ,
        dialect.MAVLINK_MSG_ID_PARAM_SET,
    }
)
ALLOWED_COMMANDS = frozenset(
    {
        dialect.MAV_CMD_SET_MESSAGE_INTERVAL,
        dialect.MAV_CMD_REQUEST_MESSAGE,
        dialect.MAV_CMD_RUN_PREARM_CHECKS,  # makes it say what fails
    }
)


def may_be_said(data: bytes) -> bool:
    """Whether a complete frame may leave; whatever else a profile would send is kept back."""
    msg_id = message_id(data)
    if msg_id != dialect.MAVLINK_MSG_ID_COMMAND_LONG:
        return msg_id in ALLOWED
    message = decode(data)
    return message is not None and message.command in ALLOWED_COMMANDS
