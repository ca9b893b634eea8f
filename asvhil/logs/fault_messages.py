"""Faults in an autopilot's MAVLink: its receiver and its IMU show them at once, its filter as `JumpFollower` does."""

from __future__ import annotations

import math
from typing import Any

from asvhil.autopilot.jump_follower import JumpFollower
from asvhil.config.fault_spans import Present, SensorFaults
from asvhil.geo import LocalFrame, wrap_rad
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect, message_id, pack, sequence, source
from asvhil.types import Frame

_D = dialect
FIXES = frozenset({_D.MAVLINK_MSG_ID_GPS_RAW_INT, _D.MAVLINK_MSG_ID_GPS2_RAW})  # of a receiver
FUSED = _D.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
ATTITUDE, QUATERNION = _D.MAVLINK_MSG_ID_ATTITUDE, _D.MAVLINK_MSG_ID_ATTITUDE_QUATERNION
INERTIAL = frozenset(
    {
        *(_D.MAVLINK_MSG_ID_RAW_IMU, _D.MAVLINK_MSG_ID_HIGHRES_IMU, _D.MAVLINK_MSG_ID_SCALED_IMU),
        *(_D.MAVLINK_MSG_ID_SCALED_IMU2, _D.MAVLINK_MSG_ID_SCALED_IMU3),
    }
)
WATCHED = FIXES | INERTIAL | {FUSED, ATTITUDE, QUATERNION}
MOTION = ("lat", "lon", "alt", "vel", "cog", "vx", "vy", "vz")  # what a receiver that stands still repeats
Edited = bytes | None  # None: not sent


class MessageEdits:
    """The edits of the autopilot's port, for all its peers."""

    def __init__(self) -> None:
        self._splitters: dict[tuple[str, str], FrameSplitter] = {}
        self._filter = JumpFollower()
        self._fixes: dict[tuple[int, int, int], dict[str, Any]] = {}  # the last sound one, by sender and message

    def apply(self, frame: Frame, present: Present) -> bytes:
        """The bytes of a frame with its faults.

        Messages are put together all the time, so that one which is cut by the begin of a fault is known. It is sent
        whole then: whoever reads the frames drops the part of it that came before.
        """
        faults = present.of("autopilot")
        n_m, e_m, turn_rad = self._filter.step(frame.t_ns, (faults.jump_n_m, faults.jump_e_m, faults.turn_rad))
        turn_rad += faults.compass_rad
        splitter = self._splitters.setdefault((frame.via, frame.peer), FrameSplitter(datagrams=bool(frame.via)))
        whole = splitter.receive(frame.data)
        edited = [self._edit(message, faults, (n_m, e_m), turn_rad) for message in whole]
        if edited == whole:
            return frame.data
        rest = frame.data[-splitter.held :] if splitter.held else b""
        return b"".join(message for message in edited if message is not None) + rest

    def _edit(self, data: bytes, faults: SensorFaults, moved_m: tuple[float, float], turn_rad: float) -> Edited:
        number = message_id(data)
        if number not in WATCHED:
            return data
        if number in INERTIAL:
            return None if faults.imu_silent else data
        message = decode(data)
        if message is None:
            return data
        if number in FIXES or number == FUSED:
            edited = self._stopped(data, message, faults)
            if not (faults.gnss_silent or faults.gnss_frozen):
                metres = (faults.jump_n_m, faults.jump_e_m) if number in FIXES else moved_m
                edited = edited or any(metres)
                _move(message, *metres)
        else:
            edited = turn_rad != 0.0
            _turn(message, turn_rad)
        if not edited:
            return data
        sender = _D.MAVLink(None, *source(data))
        sender.seq = sequence(data)
        return pack(message, sender)

    def _stopped(self, data: bytes, message: Any, faults: SensorFaults) -> bool:
        """Repeat the last sound fix in a message where the receiver stands still; without satellites its time too.

        True where the message has been changed. A receiver that has had no fix has none.
        """
        key = (*source(data), message_id(data))
        if not (faults.gnss_silent or faults.gnss_frozen):
            names = (*MOTION, "time_usec") if hasattr(message, "time_usec") else MOTION
            self._fixes[key] = {name: getattr(message, name) for name in names if hasattr(message, name)}
            return False
        last = self._fixes.get(key)
        if last is None and hasattr(message, "fix_type"):
            message.fix_type = _D.GPS_FIX_TYPE_NO_FIX
        for name, value in (last or {}).items():
            if name != "time_usec" or faults.gnss_silent:
                setattr(message, name, value)
        return True


def _move(message: Any, n_m: float, e_m: float) -> None:
    """The position of a message, moved on the ground."""
    if n_m == e_m == 0.0:
        return
    lat_deg, lon_deg = LocalFrame(lat_deg=message.lat * 1e-7, lon_deg=message.lon * 1e-7).to_geodetic(n_m, e_m)
    message.lat, message.lon = round(lat_deg * 1e7), round(lon_deg * 1e7)


def _turn(message: Any, turn_rad: float) -> None:
    """The attitude of a message, turned clockwise about the vertical."""
    if hasattr(message, "yaw"):
        message.yaw = wrap_rad(message.yaw + turn_rad)
        return
    c, s = math.cos(0.5 * turn_rad), math.sin(0.5 * turn_rad)
    w, x, y, z = message.q1, message.q2, message.q3, message.q4
    message.q1, message.q2, message.q3, message.q4 = c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w
