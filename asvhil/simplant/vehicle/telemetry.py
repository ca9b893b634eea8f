"""The messages that any simulated autopilot sends, built from its sensors and its state."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import GnssSensorConfig
from asvhil.geo import GRAVITY_MPS2, LocalFrame, wrap_2pi, wrap_rad
from asvhil.simplant.boat.devices import UNIX_EPOCH_AT_POWER_ON_US
from asvhil.simplant.boat.sensors import Navigation
from asvhil.simplant.boat.vessel import Vessel
from asvhil.simplant.vehicle.autopilot import Vehicle

U32 = 0xFFFFFFFF
I16_MAX = 0x7FFF
NO_CELL_MV = 0xFFFF


class VehicleTelemetry:
    """Builders of what any vehicle sends, from its sensors and its state."""

    def __init__(
        self, vehicle: Vehicle, nav: Navigation, truth: Vessel, origin: LocalFrame, gnss: GnssSensorConfig
    ) -> None:
        self._vehicle, self._nav, self._truth, self._origin = vehicle, nav, truth, origin
        self._h_acc_mm = max(1, round(1000.0 * math.hypot(gnss.slow_bias_m, gnss.white_m)))
        self._vel_acc_mm = round(1000.0 * gnss.velocity_white_mps)
        self.streamed: dict[int, Callable[[int], Any]] = {}
        self.on_request: dict[int, Callable[[int], Any]] = {}

    def build(self, msg_id: int, t_ns: int) -> Any | None:
        """The message of an id that exists here."""
        return (self.streamed.get(msg_id) or self.on_request[msg_id])(t_ns)

    def __contains__(self, msg_id: int) -> bool:
        return msg_id in self.streamed or msg_id in self.on_request

    # --- clocks and positions ------------------------------------------------------------------------------

    def _us(self, t_ns: int) -> int:
        return (t_ns - self._vehicle.power_on_ns) // 1000

    def _ms(self, t_ns: int) -> int:
        return (t_ns - self._vehicle.power_on_ns) // 1_000_000 & U32

    def _lat_lon(self, n_m: float, e_m: float) -> tuple[int, int]:
        lat_deg, lon_deg = self._origin.to_geodetic(n_m, e_m)
        return round(lat_deg * 1e7), round(lon_deg * 1e7)

    def _battery(self) -> tuple[int, int]:
        """Voltage (mV) and current (10 mA; -1: not measured) of SYS_STATUS."""
        volts, amperes = self._vehicle.battery_v, self._vehicle.battery_a
        return round(1000.0 * volts), -1 if amperes is None else min(round(100.0 * amperes), I16_MAX)

    def _battery_status(self, t_ns: int) -> Any:
        """One battery of unknown cells, as recorded of an ArduRover: its whole voltage is in the place of the first."""
        vehicle = self._vehicle
        mv, centiamperes = self._battery()
        used = (-1, -1)
        if vehicle.battery_a is not None:
            used = round(1000.0 * vehicle.used_ah), round(36.0 * vehicle.used_wh)
        return self._battery_message(dialect.MAV_BATTERY_FUNCTION_UNKNOWN, 0, mv, centiamperes, *used)

    @staticmethod
    def _battery_message(function: int, kind: int, mv: int, centiamperes: int, used_mah: int, used_hj: int) -> Any:
        """BATTERY_STATUS of battery 0; what no autopilot here knows has the mark of that."""
        cells = [mv, *[NO_CELL_MV] * 9]
        charge = dialect.MAV_BATTERY_CHARGE_STATE_OK
        return dialect.MAVLink_battery_status_message(
            0, function, kind, I16_MAX, cells, centiamperes, used_mah, used_hj, -1, 0, charge
        )

    def _nothing(self, t_ns: int) -> None:
        return None

    # --- navigation ----------------------------------------------------------------------------------------

    def _attitude(self, t_ns: int) -> Any:
        nav = self._nav
        angles = nav.roll_rad, nav.pitch_rad, wrap_rad(nav.psi_rad)
        return dialect.MAVLink_attitude_message(self._ms(t_ns), *angles, 0.0, 0.0, nav.r_radps)

    def _attitude_quaternion(self, t_ns: int) -> Any:
        nav = self._nav
        quaternion = quaternion_of(nav.roll_rad, nav.pitch_rad, wrap_rad(nav.psi_rad))
        return dialect.MAVLink_attitude_quaternion_message(self._ms(t_ns), *quaternion, 0.0, 0.0, nav.r_radps)

    def _global_position(self, t_ns: int) -> Any:
        nav = self._nav
        hdg = round(math.degrees(nav.psi_rad) * 100.0) % 36000
        if not self._vehicle.ready(t_ns):
            return dialect.MAVLink_global_position_int_message(self._ms(t_ns), 0, 0, 0, 0, 0, 0, 0, hdg)
        lat, lon = self._lat_lon(nav.n_m, nav.e_m)
        vx, vy = round(100.0 * nav.vn_mps), round(100.0 * nav.ve_mps)
        return dialect.MAVLink_global_position_int_message(self._ms(t_ns), lat, lon, 0, 0, vx, vy, 0, hdg)

    def _local_position(self, t_ns: int) -> Any:
        if not self._vehicle.ready(t_ns):
            return None
        nav = self._nav
        return dialect.MAVLink_local_position_ned_message(
            self._ms(t_ns), nav.n_m, nav.e_m, 0.0, nav.vn_mps, nav.ve_mps, 0.0
        )

    def _gps_raw(self, t_ns: int) -> Any:
        nav = self._nav
        if not self._vehicle.has_fix(t_ns):
            return dialect.MAVLink_gps_raw_int_message(
                0, dialect.GPS_FIX_TYPE_NO_FIX, 0, 0, 0, 65535, 65535, 0, 0, 0, 0, 0, 0, 0, 0, 0
            )
        lat, lon = self._lat_lon(nav.fix_n_m, nav.fix_e_m)
        speed = round(100.0 * math.hypot(nav.fix_vn_mps, nav.fix_ve_mps))
        course = round(math.degrees(wrap_2pi(math.atan2(nav.fix_ve_mps, nav.fix_vn_mps))) * 100.0) % 36000
        return dialect.MAVLink_gps_raw_int_message(
            max(self._us(nav.fix_ns), 0) // 1000 * 1000,  # to the millisecond, as receivers do; of before the boot too
            dialect.GPS_FIX_TYPE_3D_FIX,
            lat,
            lon,
            0,
            121,
            200,
            speed,
            course,
            10,
            0,
            self._h_acc_mm,
            self._h_acc_mm,
            self._vel_acc_mm,
            0,
            0,
        )

    def _vfr_hud(self, t_ns: int) -> Any:
        nav = self._nav
        speed = math.hypot(nav.vn_mps, nav.ve_mps) if self._vehicle.ready(t_ns) else 0.0
        heading = int(math.degrees(nav.psi_rad)) % 360
        return dialect.MAVLink_vfr_hud_message(speed, speed, heading, 0, 0.0, 0.0)

    def _home_position(self, t_ns: int) -> Any:
        if not self._vehicle.ready(t_ns):
            return None
        lat, lon = self._lat_lon(0.0, 0.0)
        attitude = [1.0, 0.0, 0.0, 0.0]
        return dialect.MAVLink_home_position_message(
            lat, lon, 0, 0.0, 0.0, 0.0, attitude, 0.0, 0.0, 0.0, self._us(t_ns)
        )

    def _global_origin(self, t_ns: int) -> Any:
        if not self._vehicle.ready(t_ns):
            return None
        lat, lon = self._lat_lon(0.0, 0.0)
        return dialect.MAVLink_gps_global_origin_message(lat, lon, 0, self._us(t_ns))

    def _sim_state(self, t_ns: int) -> Any:
        truth = self._truth
        psi = wrap_rad(truth.psi_rad)
        vn, ve = truth.ground_velocity_ned()
        lat, lon = self._lat_lon(truth.n_m, truth.e_m)
        return dialect.MAVLink_sim_state_message(
            math.cos(0.5 * psi),
            0.0,
            0.0,
            math.sin(0.5 * psi),
            0.0,
            0.0,
            psi,
            truth.ax_mps2,
            truth.ay_mps2,
            -GRAVITY_MPS2,
            0.0,
            0.0,
            truth.r_radps,
            lat * 1e-7,
            lon * 1e-7,
            0.0,
            0.0,
            0.0,
            vn,
            ve,
            0.0,
            lat,
            lon,
        )

    # --- inertial sensors ----------------------------------------------------------------------------------

    def _imu_fields(self) -> tuple[int, ...]:
        """Specific force (milli-g), rates (mrad/s) and an absent compass, as the raw messages carry them."""
        nav = self._nav
        to_mg = 1000.0 / GRAVITY_MPS2
        x_mg, y_mg, z_mg = round(nav.ax_mps2 * to_mg), round(nav.ay_mps2 * to_mg), round(nav.az_mps2 * to_mg)
        return x_mg, y_mg, z_mg, 0, 0, round(1000.0 * nav.r_radps), 0, 0, 0

    def _raw_imu(self, t_ns: int) -> Any:
        if self._nav.imu_silent:
            return None
        return dialect.MAVLink_raw_imu_message(self._us(t_ns), *self._imu_fields(), 0, 2500)

    def _scaled_imu(self, t_ns: int) -> Any:
        if self._nav.imu_silent:
            return None
        return dialect.MAVLink_scaled_imu_message(self._ms(t_ns), *self._imu_fields(), 2500)

    def _scaled_imu2(self, t_ns: int) -> Any:
        if self._nav.imu_silent:
            return None
        return dialect.MAVLink_scaled_imu2_message(self._ms(t_ns), *self._imu_fields(), 2500)

    def _specific_force(self, t_ns: int) -> tuple[float, float]:
        """Along body x and y (m/s^2), as HIGHRES_IMU has it: here as measured."""
        return self._nav.ax_mps2, self._nav.ay_mps2

    def _highres_imu(self, t_ns: int) -> Any:
        if self._nav.imu_silent:
            return None
        acceleration_and_rates = 0x3F
        return dialect.MAVLink_highres_imu_message(
            self._us(t_ns),
            *self._specific_force(t_ns),
            self._nav.az_mps2,
            0.0,
            0.0,
            self._nav.r_radps,
            *[0.0] * 7,
            acceleration_and_rates,
        )

    # --- vehicle -------------------------------------------------------------------------------------------

    def _servo_output(self, t_ns: int) -> Any:
        servo_us = self._vehicle.servo_us
        return dialect.MAVLink_servo_output_raw_message(self._us(t_ns) & U32, 0, *servo_us)

    def _rc_channels(self, t_ns: int) -> Any:
        rc = self._vehicle.rc
        channels = 8 if rc.heard else 0  # of the last frame that a receiver has ever sent
        return dialect.MAVLink_rc_channels_message(self._ms(t_ns), channels, *rc.radio_us, rc.rssi)

    def _system_time(self, t_ns: int) -> Any:
        unix_us = UNIX_EPOCH_AT_POWER_ON_US + self._us(t_ns) if self._vehicle.has_fix(t_ns) else 0
        return dialect.MAVLink_system_time_message(unix_us, self._ms(t_ns))


def quaternion_of(roll_rad: float, pitch_rad: float, psi_rad: float) -> tuple[float, float, float, float]:
    """The attitude as a unit quaternion, w first (Fossen 2011, section 2.2.2)."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(0.5 * a), math.sin(0.5 * a)) for a in (roll_rad, pitch_rad, psi_rad))
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
