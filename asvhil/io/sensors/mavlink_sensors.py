"""MAVLink messages of an autopilot's sensors, as measurements: all that need nothing of the conversation.

Units and frames by the message definitions (common.xml, ardupilotmega.xml). WIND is degrees FROM; what ArduPilot puts
into it is the true wind of its vane, low-passed at 0.05 Hz. WIND_COV is the velocity of the air, NED.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from asvhil.geo import GRAVITY_MPS2, is_place
from asvhil.io.mavlink.frames import dialect
from asvhil.io.sensors.levelling import Level
from asvhil.types import GroundVelocity, Heading, Measurement, Position, SpecificForce, TrueWind, YawRate

Found = Sequence[Measurement]

UNKNOWN_U16 = 65535
MOST_COURSE = 36000  # centidegrees
# Of a receiver on a boat: a static one is a base station, and there are none beyond PPP.
GOOD_FIXES = frozenset(
    {
        dialect.GPS_FIX_TYPE_3D_FIX,
        dialect.GPS_FIX_TYPE_DGPS,
        dialect.GPS_FIX_TYPE_RTK_FLOAT,
        dialect.GPS_FIX_TYPE_RTK_FIXED,
        dialect.GPS_FIX_TYPE_PPP,
    }
)
HIGHRES_ACCEL_XY = 0b11  # bits of fields_updated
HIGHRES_ACCEL_Z = 0b100
HIGHRES_GYRO_Z = 0b100000


def _raw_fix(t_ns: int, m: Any, *, late: bool, age_ns: int) -> Found:
    """GPS_RAW_INT or GPS2_RAW; the velocity is that of speed and course over ground, where both are known."""
    lat_deg, lon_deg = m.lat * 1e-7, m.lon * 1e-7
    if not is_place(lat_deg, lon_deg):
        return ()
    position = Position(t_ns=t_ns, lat_deg=lat_deg, lon_deg=lon_deg, h_acc_m=m.h_acc * 1e-3)
    if m.vel == UNKNOWN_U16 or m.cog > MOST_COURSE:
        return (position,)
    course_rad = math.radians(m.cog * 0.01)
    speed_mps = m.vel * 0.01
    vn_mps, ve_mps = speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad)
    return position, GroundVelocity(t_ns=t_ns, vn_mps=vn_mps, ve_mps=ve_mps, fused=late, age_ns=age_ns)


class MavlinkSensors:
    """Handlers by message id: (time, message) to the measurements in it, none where it holds nothing that is valid.

    `knows_position`, at a time, and `knows_attitude` tell what the autopilot's own estimator knows: else its values are
    guesses.
    `late`: whether its messages have come late, so that a velocity times our time is not the way that the boat has
    gone. `age_ns`: how old at our time is what it dates so (us since its start).
    `level`: the boat's tilt by ATTITUDE, which is not handled here; specific forces are told in level axes. `trim_rad`:
    roll and pitch of the board over the axes of that tilt.
    """

    def __init__(
        self,
        knows_position: Callable[[int], bool],
        knows_attitude: Callable[[], bool],
        late: Callable[[int], bool] = lambda t_ns: False,
        age_ns: Callable[[int, int], int] = lambda t_ns, boot_us: 0,
        trim_rad: Callable[[], tuple[float, float]] = lambda: (0.0, 0.0),
    ) -> None:
        self._knows_position, self._knows_attitude = knows_position, knows_attitude
        self._late = late
        self._age_ns = age_ns
        self._trim_rad = trim_rad
        self.level = Level(trim_rad)
        self._h_acc_m = 0.0
        self._last_fixes: dict[int, tuple[int, ...]] = {}  # time and content, by message
        self._units: dict[int, int] = {}  # number of the inertial unit that is heard, by message
        self.handlers: dict[int, Callable[[int, Any], Found]] = {
            dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position,
            dialect.MAVLINK_MSG_ID_GPS_RAW_INT: self._gps_raw,
            dialect.MAVLINK_MSG_ID_GPS2_RAW: self._new_fix,
            dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: self._attitude_quaternion,
            dialect.MAVLINK_MSG_ID_RAW_IMU: self._of_one_unit(self._scaled_imu),
            dialect.MAVLINK_MSG_ID_SCALED_IMU: self._scaled_imu,
            dialect.MAVLINK_MSG_ID_SCALED_IMU2: self._scaled_imu,
            dialect.MAVLINK_MSG_ID_SCALED_IMU3: self._scaled_imu,
            dialect.MAVLINK_MSG_ID_HIGHRES_IMU: self._of_one_unit(self._highres_imu),
            dialect.MAVLINK_MSG_ID_WIND: _wind,
            dialect.MAVLINK_MSG_ID_WIND_COV: _wind_cov,
        }

    def restart(self) -> None:
        """The autopilot has rebooted: it may have been mounted otherwise, and another inertial unit be heard first."""
        self.level = Level(self._trim_rad)
        self._units.clear()

    def _of_one_unit(self, handler: Callable[[int, Any], Found]) -> Callable[[int, Any], Found]:
        """The same for one inertial unit alone: the first that is heard, since several share these messages."""
        units = self._units
        return lambda t_ns, m: handler(t_ns, m) if units.setdefault(m.get_msgId(), m.id) == m.id else ()

    def _global_position(self, t_ns: int, m: Any) -> Found:
        lat_deg, lon_deg = m.lat * 1e-7, m.lon * 1e-7
        if not self._knows_position(t_ns) or not is_place(lat_deg, lon_deg):
            return ()
        return (
            Position(t_ns=t_ns, lat_deg=lat_deg, lon_deg=lon_deg, h_acc_m=self._h_acc_m),
            GroundVelocity(t_ns=t_ns, vn_mps=m.vx * 0.01, ve_mps=m.vy * 0.01, fused=True),
        )

    def _gps_raw(self, t_ns: int, m: Any) -> Found:
        self._h_acc_m = m.h_acc * 1e-3
        return self._new_fix(t_ns, m)

    def _new_fix(self, t_ns: int, m: Any) -> Found:
        """A fix that has not come before.

        Autopilots repeat the last fix at the rate of the stream. Its time alone does not tell: with some receivers it
        stays 0 or stands still. Two fixes of a receiver that works differ in some digit.
        """
        message, fix = m.get_msgId(), (m.time_usec, m.lat, m.lon, m.alt, m.vel, m.cog)
        last = self._last_fixes.get(message)
        if m.fix_type not in GOOD_FIXES or fix == last:
            return ()
        self._last_fixes[message] = fix
        dated = last is not None and m.time_usec > last[0]
        return _raw_fix(t_ns, m, late=self._late(t_ns), age_ns=self._age_ns(t_ns, m.time_usec) if dated else 0)

    def _attitude_quaternion(self, t_ns: int, m: Any) -> Found:
        w, x, y, z = m.q1, m.q2, m.q3, m.q4
        norm2 = w * w + x * x + y * y + z * z
        if not self._knows_attitude() or not 0.5 < norm2 < 2.0:
            return ()
        psi_rad = math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
        roll_rad = math.atan2(2.0 * (w * x + y * z), w * w - x * x - y * y + z * z)
        pitch_rad = math.asin(min(max(2.0 * (w * y - z * x) / norm2, -1.0), 1.0))
        self.level.note(t_ns, roll_rad, pitch_rad)
        return Heading(t_ns=t_ns, psi_rad=psi_rad), YawRate(t_ns=t_ns, r_radps=m.yawspeed)

    def _scaled_imu(self, t_ns: int, m: Any) -> Found:
        """RAW_IMU and SCALED_IMU as ArduPilot fills them: milli-g and mrad/s."""
        x, y = m.xacc * 1e-3 * GRAVITY_MPS2, m.yacc * 1e-3 * GRAVITY_MPS2
        ax_mps2, ay_mps2 = self.level.force(t_ns, x, y, m.zacc * 1e-3 * GRAVITY_MPS2)
        return (
            YawRate(t_ns=t_ns, r_radps=m.zgyro * 1e-3),
            SpecificForce(t_ns=t_ns, ax_mps2=ax_mps2, ay_mps2=ay_mps2),
        )

    def _highres_imu(self, t_ns: int, m: Any) -> Found:
        found: list[Measurement] = []
        if m.fields_updated & HIGHRES_GYRO_Z:
            found.append(YawRate(t_ns=t_ns, r_radps=m.zgyro))
        if m.fields_updated & HIGHRES_ACCEL_XY == HIGHRES_ACCEL_XY:
            z = m.zacc if m.fields_updated & HIGHRES_ACCEL_Z else 0.0
            ax_mps2, ay_mps2 = self.level.force(t_ns, m.xacc, m.yacc, z)
            found.append(SpecificForce(t_ns=t_ns, ax_mps2=ax_mps2, ay_mps2=ay_mps2))
        return found


def _wind(t_ns: int, m: Any) -> Found:
    if not (math.isfinite(m.direction) and math.isfinite(m.speed)) or m.speed < 0.0:
        return ()
    toward_rad = math.radians(m.direction) + math.pi
    return (TrueWind(t_ns=t_ns, vn_mps=m.speed * math.cos(toward_rad), ve_mps=m.speed * math.sin(toward_rad)),)


def _wind_cov(t_ns: int, m: Any) -> Found:
    if not (math.isfinite(m.wind_x) and math.isfinite(m.wind_y)):
        return ()
    return (TrueWind(t_ns=t_ns, vn_mps=m.wind_x, ve_mps=m.wind_y),)
