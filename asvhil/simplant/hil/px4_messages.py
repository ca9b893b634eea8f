"""What PX4's simulator interface is told: sensors as HIL_SENSOR and HIL_GPS, the truth as HIL_STATE_QUATERNION.

Every value carries noise, because PX4 takes a sensor that repeats itself for a dead one.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from asvhil.config import Config
from asvhil.geo import GRAVITY_MPS2, ned_to_body, wrap_2pi
from asvhil.io.mavlink.frames import dialect
from asvhil.simplant.boat.devices import UNIX_EPOCH_AT_POWER_ON_US
from asvhil.simplant.boat.earth_field import earth_field_gauss
from asvhil.simplant.boat.noise import NormalSource
from asvhil.simplant.hil.plant import HilPlant

YEAR = 2026.0  # of the epoch at power-on
INERTIAL = 0b111111  # bits of fields_updated: accelerometer and gyro
COMPASS = 0b111000000
BAROMETER = 0b1101000000000  # pressure, pressure altitude, temperature
SATELLITES = 12
VERTICAL_ACCURACY = 1.5  # of a GNSS receiver, times its horizontal one
SEED = 0x48494C  # keeps these sensors' noise apart from that of the others, which plant.seed alone makes


def standard_pressure_pa(altitude_m: float) -> float:
    """Static pressure of the ICAO standard atmosphere below 11 km."""
    return 101_325.0 * float((1.0 - 2.25577e-5 * altitude_m) ** 5.25588)


class HilMessages:
    """One builder a message, from the plant as it is after its last step."""

    def __init__(self, config: Config, plant: HilPlant) -> None:
        section = config.plant
        self._plant = plant
        self._altitude_m = section.hil.px4.altitude_m
        self._field = earth_field_gauss(section.origin_lat_deg, section.origin_lon_deg, YEAR)
        self._pressure_pa = standard_pressure_pa(self._altitude_m)
        self._gyro_std, self._accel_std = section.sensors.imu.gyro_white_radps, section.sensors.imu.accel_white_mps2
        self._mag_std, self._baro_std_pa = section.hil.px4.mag_white_gauss, section.hil.px4.baro_white_pa
        gnss = section.sensors.gnss
        self._h_acc_m = max(0.01, math.hypot(gnss.slow_bias_m, gnss.white_m))
        inertial, mag, baro = np.random.SeedSequence((section.seed, SEED)).spawn(3)
        self._inertial, self._mag, self._baro = NormalSource(inertial), NormalSource(mag), NormalSource(baro)

    def sensor(self, *, slow: bool) -> Any:
        """HIL_SENSOR: m/s^2 (specific force: level and at rest -g on z), rad/s; if `slow` also gauss, hPa, m, deg C."""
        navigation, noise = self._plant.navigation, self._inertial.next
        updated = 0 if navigation.imu_silent else INERTIAL
        field = (0.0, 0.0, 0.0)
        pressure_hpa = altitude_m = temperature_degc = 0.0
        if slow:
            updated |= BAROMETER if navigation.compass_silent else BAROMETER | COMPASS
            heading_rad = self._plant.motion.psi_rad + navigation.compass_error_rad
            ahead, abeam = ned_to_body(heading_rad, self._field[0], self._field[1])
            white, std = self._mag.next, self._mag_std
            field = (ahead + std * white(), abeam + std * white(), self._field[2] + std * white())
            error_pa = self._baro_std_pa * self._baro.next()
            pressure_hpa = 0.01 * (self._pressure_pa + error_pa)
            altitude_m = self._altitude_m - error_pa / (1.225 * GRAVITY_MPS2)
            temperature_degc = 15.0 - 0.0065 * self._altitude_m
        return dialect.MAVLink_hil_sensor_message(
            self._plant.t_ns // 1000,
            navigation.ax_mps2,
            navigation.ay_mps2,
            -GRAVITY_MPS2 + self._accel_std * noise(),
            self._gyro_std * noise(),
            self._gyro_std * noise(),
            navigation.r_radps,
            *field,
            pressure_hpa,
            0.0,
            altitude_m,
            temperature_degc,
            updated,
            0,
        )

    def gps(self) -> Any:
        """HIL_GPS of the last fix: degE7, mm, cm, cm/s, centidegrees."""
        navigation = self._plant.navigation
        lat, lon = self._plant.lat_lon_e7(navigation.fix_n_m, navigation.fix_e_m)
        vn, ve = navigation.fix_vn_mps, navigation.fix_ve_mps
        return dialect.MAVLink_hil_gps_message(
            UNIX_EPOCH_AT_POWER_ON_US + navigation.fix_ns // 1000,
            dialect.GPS_FIX_TYPE_3D_FIX,
            lat,
            lon,
            round(1000.0 * self._altitude_m),
            _u16(100.0 * self._h_acc_m),
            _u16(100.0 * VERTICAL_ACCURACY * self._h_acc_m),
            _u16(100.0 * math.hypot(vn, ve)),
            _i16(100.0 * vn),
            _i16(100.0 * ve),
            0,
            round(100.0 * math.degrees(wrap_2pi(math.atan2(ve, vn)))) % 36000,
            SATELLITES,
            0,
            0,
        )

    def truth(self) -> Any:
        """HIL_STATE_QUATERNION: what really is, of which PX4 only keeps a log. Accelerations in mg, without gravity."""
        motion, truth = self._plant.motion, self._plant.truth
        vn, ve = motion.ground_velocity_ned()
        lat, lon = self._plant.lat_lon_e7(motion.n_m, motion.e_m)
        half = 0.5 * truth.psi_rad
        airspeed = _u16(100.0 * math.hypot(truth.wind_n_mps - vn, truth.wind_e_mps - ve))
        to_mg = 1000.0 / GRAVITY_MPS2
        return dialect.MAVLink_hil_state_quaternion_message(
            self._plant.t_ns // 1000,
            [math.cos(half), 0.0, 0.0, math.sin(half)],
            0.0,
            0.0,
            motion.r_radps,
            lat,
            lon,
            round(1000.0 * self._altitude_m),
            _i16(100.0 * vn),
            _i16(100.0 * ve),
            0,
            airspeed,
            airspeed,
            _i16(to_mg * motion.ax_mps2),
            _i16(to_mg * motion.ay_mps2),
            0,
        )


def _i16(value: float) -> int:
    return max(-32767, min(32767, round(value)))


def _u16(value: float) -> int:
    return max(0, min(65534, round(value)))
