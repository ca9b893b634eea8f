"""MAVLink messages of an autopilot's sensors, as measurements: all that need nothing of the conversation.

Units and frames by the message definitions (common.xml, ardupilotmega.xml). WIND is degrees FROM; what ArduPilot puts
into it is the true wind of its vane, low-passed at 0.05 Hz. WIND_COV is the velocity of the air, NED.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from asvhil.geo import GRAVITY_MPS2, is_place
from asvhil.io.mavlink.frames import dialect
from asvhil.types import Attitude, GnssFix, Imu, Measurement, TrueWind

UNKNOWN_U16 = 65535
HIGHRES_ACCEL_XY = 0b11  # bits of fields_updated
HIGHRES_GYRO_Z = 0b100000


def _raw_fix(t_ns: int, m: Any) -> GnssFix:
    """GPS_RAW_INT or GPS2_RAW as a fix; velocity from speed and course over ground, NaN where they are not known."""
    course_rad = math.radians(m.cog * 0.01)
    speed_mps = m.vel * 0.01
    known = UNKNOWN_U16 not in (m.vel, m.cog)
    return GnssFix(
        t_ns=t_ns,
        lat_deg=m.lat * 1e-7,
        lon_deg=m.lon * 1e-7,
        vn_mps=speed_mps * math.cos(course_rad) if known else math.nan,
        ve_mps=speed_mps * math.sin(course_rad) if known else math.nan,
        h_acc_m=m.h_acc * 1e-3,
    )


def _scaled_imu(t_ns: int, m: Any) -> Imu:
    """RAW_IMU and SCALED_IMU as ArduPilot fills them: milli-g and mrad/s."""
    return Imu(
        t_ns=t_ns,
        ax_mps2=m.xacc * 1e-3 * GRAVITY_MPS2,
        ay_mps2=m.yacc * 1e-3 * GRAVITY_MPS2,
        r_radps=m.zgyro * 1e-3,
    )


class MavlinkSensors:
    """Handlers by message id: (time, message) to a measurement, or None where it holds nothing that is valid.

    `ready` tells whether the autopilot's own estimator is: until then its position and attitude are guesses.
    """

    def __init__(self, ready: Callable[[], bool]) -> None:
        self._ready = ready
        self._h_acc_m = 0.0
        self._fix_times_us: dict[int, int] = {}  # of the last fix, by message
        self.handlers: dict[int, Callable[[int, Any], Measurement | None]] = {
            dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position,
            dialect.MAVLINK_MSG_ID_GPS_RAW_INT: self._gps_raw,
            dialect.MAVLINK_MSG_ID_GPS2_RAW: self._new_fix,
            dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: self._attitude_quaternion,
            dialect.MAVLINK_MSG_ID_RAW_IMU: _scaled_imu,
            dialect.MAVLINK_MSG_ID_SCALED_IMU: _scaled_imu,
            dialect.MAVLINK_MSG_ID_SCALED_IMU2: _scaled_imu,
            dialect.MAVLINK_MSG_ID_SCALED_IMU3: _scaled_imu,
            dialect.MAVLINK_MSG_ID_HIGHRES_IMU: _highres_imu,
            dialect.MAVLINK_MSG_ID_WIND: _wind,
            dialect.MAVLINK_MSG_ID_WIND_COV: _wind_cov,
        }

    def _global_position(self, t_ns: int, m: Any) -> Measurement | None:
        lat_deg, lon_deg = m.lat * 1e-7, m.lon * 1e-7
        if not self._ready() or not is_place(lat_deg, lon_deg):
            return None
        return GnssFix(
            t_ns=t_ns,
            lat_deg=lat_deg,
            lon_deg=lon_deg,
            vn_mps=m.vx * 0.01,
            ve_mps=m.vy * 0.01,
            h_acc_m=self._h_acc_m,
        )

    def _gps_raw(self, t_ns: int, m: Any) -> Measurement | None:
        self._h_acc_m = m.h_acc * 1e-3
        return self._new_fix(t_ns, m)

    def _new_fix(self, t_ns: int, m: Any) -> Measurement | None:
        message = m.get_msgId()
        if m.fix_type < dialect.GPS_FIX_TYPE_3D_FIX or m.time_usec == self._fix_times_us.get(message):
            return None  # none, or the same fix streamed again
        self._fix_times_us[message] = m.time_usec
        fix = _raw_fix(t_ns, m)
        return fix if is_place(fix.lat_deg, fix.lon_deg) else None

    def _attitude_quaternion(self, t_ns: int, m: Any) -> Measurement | None:
        w, x, y, z = m.q1, m.q2, m.q3, m.q4
        norm2 = w * w + x * x + y * y + z * z
        if not self._ready() or not 0.5 < norm2 < 2.0:
            return None
        psi_rad = math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
        return Attitude(t_ns=t_ns, psi_rad=psi_rad, r_radps=m.yawspeed)


def _highres_imu(t_ns: int, m: Any) -> Measurement | None:
    has_accel = m.fields_updated & HIGHRES_ACCEL_XY == HIGHRES_ACCEL_XY
    has_rate = bool(m.fields_updated & HIGHRES_GYRO_Z)
    if not (has_accel or has_rate):
        return None
    return Imu(
        t_ns=t_ns,
        ax_mps2=m.xacc if has_accel else math.nan,
        ay_mps2=m.yacc if has_accel else math.nan,
        r_radps=m.zgyro if has_rate else math.nan,
    )


def _wind(t_ns: int, m: Any) -> Measurement | None:
    if not (math.isfinite(m.direction) and math.isfinite(m.speed)) or m.speed < 0.0:
        return None
    toward_rad = math.radians(m.direction) + math.pi
    return TrueWind(t_ns=t_ns, vn_mps=m.speed * math.cos(toward_rad), ve_mps=m.speed * math.sin(toward_rad))


def _wind_cov(t_ns: int, m: Any) -> Measurement | None:
    if not (math.isfinite(m.wind_x) and math.isfinite(m.wind_y)):
        return None
    return TrueWind(t_ns=t_ns, vn_mps=m.wind_x, ve_mps=m.wind_y)
