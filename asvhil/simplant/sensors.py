"""What the boat's sensors say of the truth: a GNSS/INS as good as a VN-300, and an anemometer on the mast."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from asvhil.config import AnemometerSensorConfig, SensorsConfig
from asvhil.geo import ned_to_body, wrap_2pi
from asvhil.simplant.noise import NormalSource, OrnsteinUhlenbeck

VANE_STALL_MPS = 0.01  # without wind nothing turns the vane: it stays where it was


class Motion(Protocol):
    """The truth that sensors look at."""

    n_m: float
    e_m: float
    psi_rad: float
    r_radps: float
    ax_mps2: float
    ay_mps2: float

    def ground_velocity_ned(self) -> tuple[float, float]: ...


class Navigation:
    """GNSS/INS, sampled at each loop of the autopilot; the attributes are the latest measurements, NED and body axes.

    Fixes come at `gnss.rate_hz`; their errors (slow bias, white position and velocity noise) also ride on the fused
    position, which follows the truth between fixes. Each error has its own seeded source, drawn at the sensor's own
    rate, so neither another sensor's rate nor a telemetry stream changes it.
    """

    __slots__ = (
        "_accel_bias",
        "_accel_std",
        "_bias_e",
        "_bias_n",
        "_err_e",
        "_err_n",
        "_err_ve",
        "_err_vn",
        "_fix_due_ns",
        "_gyro_std",
        "_heading_bias",
        "_heading_std",
        "_period_ns",
        "_sources",
        "_velocity_std",
        "_white_std",
        "ax_mps2",
        "ay_mps2",
        "e_m",
        "fix_e_m",
        "fix_n_m",
        "fix_ns",
        "fix_ve_mps",
        "fix_vn_mps",
        "fixes",
        "n_m",
        "psi_rad",
        "r_radps",
        "ve_mps",
        "vn_mps",
    )

    def __init__(self, config: SensorsConfig, loop_hz: float, t_ns: int, seed: np.random.SeedSequence) -> None:
        gnss, imu = config.gnss, config.imu
        bias_n, bias_e, white, velocity, heading, gyro, accel, turn_on = (NormalSource(part) for part in seed.spawn(8))
        self._sources = white, velocity, heading, gyro, accel
        period_s = 1.0 / min(gnss.rate_hz, loop_hz)  # a fix faster than the loop that reads it would be lost
        self._period_ns = round(1e9 * period_s)
        self._fix_due_ns = t_ns
        self._bias_n = OrnsteinUhlenbeck(gnss.slow_bias_m, gnss.slow_bias_time_s, period_s, bias_n)
        self._bias_e = OrnsteinUhlenbeck(gnss.slow_bias_m, gnss.slow_bias_time_s, period_s, bias_e)
        self._white_std, self._velocity_std = gnss.white_m, gnss.velocity_white_mps
        self._heading_std = math.radians(config.heading.white_deg)
        self._heading_bias = math.radians(config.heading.bias_deg)
        self._gyro_std, self._accel_std = imu.gyro_white_radps, imu.accel_white_mps2
        self._accel_bias = imu.accel_bias_mps2 * turn_on.next(), imu.accel_bias_mps2 * turn_on.next()
        self._err_n = self._err_e = self._err_vn = self._err_ve = 0.0
        self.fixes = 0
        self.fix_ns = t_ns
        self.fix_n_m = self.fix_e_m = self.fix_vn_mps = self.fix_ve_mps = 0.0
        self.n_m = self.e_m = self.vn_mps = self.ve_mps = 0.0
        self.psi_rad = self.r_radps = self.ax_mps2 = self.ay_mps2 = 0.0

    def sample(self, t_ns: int, truth: Motion, *, fixes: bool = True) -> None:
        """Measure the truth at a loop of the autopilot; psi in [0, 2 pi). Without fixes, what came of them stays."""
        white, velocity, heading, gyro, accel = self._sources
        vn, ve = truth.ground_velocity_ned()
        due = t_ns >= self._fix_due_ns
        if due:
            self._fix_due_ns += self._period_ns
        if due and fixes:
            if self.fixes:
                self._bias_n.advance()
                self._bias_e.advance()
            self._err_n = self._bias_n.value + self._white_std * white.next()
            self._err_e = self._bias_e.value + self._white_std * white.next()
            self._err_vn = self._velocity_std * velocity.next()
            self._err_ve = self._velocity_std * velocity.next()
            self.fixes += 1
            self.fix_ns = t_ns
            self.fix_n_m, self.fix_e_m = truth.n_m + self._err_n, truth.e_m + self._err_e
            self.fix_vn_mps, self.fix_ve_mps = vn + self._err_vn, ve + self._err_ve
        if fixes:
            self.n_m, self.e_m = truth.n_m + self._err_n, truth.e_m + self._err_e
            self.vn_mps, self.ve_mps = vn + self._err_vn, ve + self._err_ve
        self.psi_rad = wrap_2pi(truth.psi_rad + self._heading_bias + self._heading_std * heading.next())
        self.r_radps = truth.r_radps + self._gyro_std * gyro.next()
        self.ax_mps2 = truth.ax_mps2 + self._accel_bias[0] + self._accel_std * accel.next()
        self.ay_mps2 = truth.ay_mps2 + self._accel_bias[1] + self._accel_std * accel.next()


class Anemometer:
    """Cup and vane on the moving, turning boat: apparent wind against the velocity over ground.

    The vane has `directions` positions; its zero is turned clockwise from the bow by `misalignment_deg`, so it reads
    that much less than the true angle.
    """

    def __init__(self, config: AnemometerSensorConfig, seed: np.random.SeedSequence) -> None:
        self._speed_std = config.speed_white_mps
        self._positions = config.directions
        self._misalignment_rad = math.radians(config.misalignment_deg)
        self._source = NormalSource(seed)
        self._position = 0

    def sample(
        self, truth: Motion, wind_n_mps: float, wind_e_mps: float, *, stuck: bool = False
    ) -> tuple[float, float]:
        """Speed (m/s) and direction (degrees FROM, clockwise from the bow, [0, 360)) of the apparent wind."""
        vn, ve = truth.ground_velocity_ned()
        ahead, abeam = ned_to_body(truth.psi_rad, wind_n_mps - vn, wind_e_mps - ve)
        apparent_mps = math.hypot(ahead, abeam)
        if apparent_mps > VANE_STALL_MPS and not stuck:
            from_rad = math.atan2(-abeam, -ahead) - self._misalignment_rad
            self._position = round(from_rad * self._positions / math.tau) % self._positions
        speed_mps = max(0.0, apparent_mps + self._speed_std * self._source.next())
        return speed_mps, self._position * 360.0 / self._positions


def mwv_sentence(speed_mps: float, from_deg: float) -> bytes:
    """NMEA 0183 wind sentence, apparent wind: `$WIMWV,<deg>,R,<m/s>,M,A*hh`."""
    body = f"WIMWV,{from_deg:.1f},R,{speed_mps:.2f},M,A".encode()
    checksum = 0
    for byte in body:
        checksum ^= byte
    return b"$%s*%02X\r\n" % (body, checksum)
