"""The boat's sensors: a GNSS/INS with the errors of a VN-300, and an anemometer on the mast."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from asvhil.autopilot.jump_follower import SOUND_JUMP, JumpFollower
from asvhil.config import AnemometerSensorConfig, SensorsConfig, TiltConfig
from asvhil.config.fault_spans import SOUND, SensorFaults
from asvhil.geo import GRAVITY_MPS2, ned_to_body, wrap_2pi
from asvhil.io.sensors.levelling import tilted
from asvhil.io.sensors.nmea_checksum import nmea_sentence
from asvhil.simplant.boat.noise import NormalSource, OrnsteinUhlenbeck
from asvhil.types import record

FUSION_S = 1.0  # time constant by which a filter's position follows the integral of its velocity
EVEN = TiltConfig()
NO_DEVIATION = (0.0, 0.0, 0.0, 0.0)
VANE_STALL_MPS = 0.01  # below it the vane does not turn


class TrueMotion(Protocol):
    """The true motion that sensors measure."""

    n_m: float
    e_m: float
    psi_rad: float
    r_radps: float
    ax_mps2: float
    ay_mps2: float
    roll_rad: float
    pitch_rad: float

    @property
    def motor_commands(self) -> tuple[float, float]:
        """Of port and starboard, in [-1, 1]."""

    def ground_velocity_ned(self) -> tuple[float, float]: ...


class Navigation:
    """GNSS/INS, sampled at each loop of the autopilot; the attributes are the latest measurements, NED and body axes.

    Fixes come at `gnss.rate_hz`; their errors (slow bias, white position and velocity noise) are also in the fused
    position, which follows the truth between fixes. Each error has its own seeded source, drawn at the sensor's own
    rate, so neither another sensor's rate nor a telemetry stream changes it.

    A jump shows in the fix at once. A `filtered` set of sensors, as of an autopilot, has the estimate of a filter: a
    jump shows in fused position and heading only after the 10 s for which ArduPilot's filter rejects it. Its velocity
    has a slow error of its own (`FusedVelocityConfig`), and its position the integral of that.
    """

    __slots__ = (
        "_accel_std",
        "_attitude",
        "_bias_e",
        "_bias_n",
        "_deviation",
        "_err_e",
        "_err_n",
        "_err_ve",
        "_err_vn",
        "_fix_due_ns",
        "_follower",
        "_gyro_std",
        "_heading_bias",
        "_heading_std",
        "_imu_tilt",
        "_is_level",
        "_motor_pull",
        "_no_deviation",
        "_period_ns",
        "_slow_ve",
        "_slow_vn",
        "_sources",
        "_velocity_std",
        "_white_std",
        "accel_bias_mps2",
        "ax_mps2",
        "ay_mps2",
        "az_mps2",
        "compass_error_rad",
        "compass_silent",
        "e_m",
        "fix_e_m",
        "fix_n_m",
        "fix_ns",
        "fix_ve_mps",
        "fix_vn_mps",
        "fixes",
        "imu_silent",
        "n_m",
        "pitch_rad",
        "psi_rad",
        "r_radps",
        "roll_rad",
        "ve_mps",
        "vn_mps",
    )

    def __init__(
        self,
        config: SensorsConfig,
        loop_hz: float,
        t_ns: int,
        seed: np.random.SeedSequence,
        *,
        filtered: bool = False,
        tilt: TiltConfig = EVEN,
        level: bool = False,
    ) -> None:
        """`level`: it takes gravity out of the specific force by itself."""
        gnss, imu = config.gnss, config.imu
        bias_n, bias_e, white, velocity, heading, gyro, accel, turn_on, slow_n, slow_e = (
            NormalSource(part) for part in seed.spawn(10)
        )
        self._sources = white, velocity, heading, gyro, accel
        period_s = 1.0 / min(gnss.rate_hz, loop_hz)  # fixes faster than the loop that reads them would be lost
        self._period_ns = round(1e9 * period_s)
        self._fix_due_ns = t_ns
        self._bias_n = OrnsteinUhlenbeck(gnss.slow_bias_m, gnss.slow_bias_time_s, period_s, bias_n)
        self._bias_e = OrnsteinUhlenbeck(gnss.slow_bias_m, gnss.slow_bias_time_s, period_s, bias_e)
        self._white_std, self._velocity_std = gnss.white_m, gnss.velocity_white_mps
        self._heading_std = math.radians(config.heading.white_deg)
        self._heading_bias = math.radians(config.heading.bias_deg)
        self._deviation = tuple(math.radians(part) for part in config.heading.deviation_deg)
        self._motor_pull = tuple(math.radians(part) for part in config.heading.motor_deg)
        self._no_deviation = self._deviation == NO_DEVIATION and not any(self._motor_pull)
        self._follower = JumpFollower() if filtered else None
        fused, slow_mps = config.fused_velocity, config.fused_velocity.slow_bias_mps if filtered else 0.0
        self._slow_vn = OrnsteinUhlenbeck(slow_mps, fused.slow_bias_time_s, period_s, slow_n)
        self._slow_ve = OrnsteinUhlenbeck(slow_mps, fused.slow_bias_time_s, period_s, slow_e)
        self._gyro_std, self._accel_std = imu.gyro_white_radps, imu.accel_white_mps2
        self.accel_bias_mps2 = imu.accel_bias_mps2 * turn_on.next(), imu.accel_bias_mps2 * turn_on.next()
        self._err_n = self._err_e = self._err_vn = self._err_ve = 0.0
        self.fixes = 0
        self.imu_silent = self.compass_silent = False
        self.compass_error_rad = 0.0  # of the compass alone, before any filter
        self.fix_ns = t_ns
        self.fix_n_m = self.fix_e_m = self.fix_vn_mps = self.fix_ve_mps = 0.0
        self.n_m = self.e_m = self.vn_mps = self.ve_mps = 0.0
        self.psi_rad = self.r_radps = self.ax_mps2 = self.ay_mps2 = 0.0
        self.roll_rad = self.pitch_rad = 0.0
        self.az_mps2 = -GRAVITY_MPS2
        self._is_level = level
        self._imu_tilt = math.radians(tilt.imu_roll_deg), math.radians(tilt.imu_pitch_deg)
        std_rad = math.radians(tilt.attitude_deg)
        self._attitude = [
            OrnsteinUhlenbeck(std_rad, tilt.attitude_time_s, 1.0 / loop_hz, NormalSource(part))
            for part in (seed.spawn(2) if std_rad else ())
        ]

    def sample(self, t_ns: int, truth: TrueMotion, faults: SensorFaults = SOUND) -> None:
        """Measure the truth at a loop of the autopilot; psi in [0, 2 pi).

        Without satellites the last fix stays; a frozen receiver repeats it as if it were new.
        """
        white, velocity, heading, gyro, accel = self._sources
        vn, ve = truth.ground_velocity_ned()
        jump = SOUND_JUMP if faults is SOUND else (faults.jump_n_m, faults.jump_e_m, faults.turn_rad)
        fused_n_m, fused_e_m, turn_rad = jump if self._follower is None else self._follower.step(t_ns, jump)
        due = t_ns >= self._fix_due_ns
        if due:
            self._fix_due_ns += self._period_ns
        if due and not faults.gnss_silent:
            if self.fixes:
                for slow in (self._bias_n, self._bias_e, self._slow_vn, self._slow_ve):
                    slow.advance()
            self._err_n = self._bias_n.value + self._white_std * white.next()
            self._err_e = self._bias_e.value + self._white_std * white.next()
            self._err_vn = self._velocity_std * velocity.next()
            self._err_ve = self._velocity_std * velocity.next()
            self.fixes += 1
            self.fix_ns = t_ns
            if not faults.gnss_frozen or self.fixes == 1:
                self.fix_n_m = truth.n_m + self._err_n + faults.jump_n_m
                self.fix_e_m = truth.e_m + self._err_e + faults.jump_e_m
                self.fix_vn_mps, self.fix_ve_mps = vn + self._err_vn, ve + self._err_ve
        if not (faults.gnss_silent or faults.gnss_frozen):
            slow_vn, slow_ve = self._slow_vn.value, self._slow_ve.value
            self.n_m = truth.n_m + self._err_n + fused_n_m + FUSION_S * slow_vn
            self.e_m = truth.e_m + self._err_e + fused_e_m + FUSION_S * slow_ve
            self.vn_mps, self.ve_mps = vn + self._err_vn + slow_vn, ve + self._err_ve + slow_ve
        bias_rad = self._heading_bias
        if not self._no_deviation:
            bias_rad = bias_rad + self._deviation_at(truth.psi_rad) + self._pull_of(truth.motor_commands)
        bias_rad += faults.compass_rad
        self.compass_error_rad = bias_rad + faults.turn_rad
        self.psi_rad = wrap_2pi(truth.psi_rad + bias_rad + turn_rad + self._heading_std * heading.next())
        self.r_radps = truth.r_radps + self._gyro_std * gyro.next()
        ax_mps2, ay_mps2 = self._force(truth)
        self.ax_mps2 = ax_mps2 + self.accel_bias_mps2[0] + self._accel_std * accel.next()
        self.ay_mps2 = ay_mps2 + self.accel_bias_mps2[1] + self._accel_std * accel.next()
        self.imu_silent, self.compass_silent = faults.imu_silent, faults.heading_silent

    def _force(self, truth: TrueMotion) -> tuple[float, float]:
        """The specific force along x and y of the inertial unit, and with it that along z, and the attitude."""
        roll_rad, pitch_rad = truth.roll_rad, truth.pitch_rad
        self.roll_rad, self.pitch_rad = roll_rad, pitch_rad
        if self._attitude:
            self.roll_rad += self._attitude[0].advance()
            self.pitch_rad += self._attitude[1].advance()
        roll_rad, pitch_rad = roll_rad + self._imu_tilt[0], pitch_rad + self._imu_tilt[1]
        if self._is_level or (roll_rad == 0.0 and pitch_rad == 0.0):
            self.az_mps2 = -GRAVITY_MPS2
            return truth.ax_mps2, truth.ay_mps2
        ax_mps2, ay_mps2, self.az_mps2 = tilted(truth.ax_mps2, truth.ay_mps2, roll_rad, pitch_rad)
        return ax_mps2, ay_mps2

    def _deviation_at(self, psi_rad: float) -> float:
        """Compass deviation (rad) by the iron of the boat (`HeadingSensorConfig`), without its constant part."""
        if self._deviation == NO_DEVIATION:
            return 0.0
        b, c, d, e = self._deviation
        s1, c1 = math.sin(psi_rad), math.cos(psi_rad)
        return b * s1 + c * c1 + 2.0 * d * s1 * c1 + e * (c1 * c1 - s1 * s1)

    def _pull_of(self, motor_commands: tuple[float, float]) -> float:
        """What the current of the motors adds to the heading (rad)."""
        port, starboard = self._motor_pull
        return port * abs(motor_commands[0]) + starboard * abs(motor_commands[1])


@record
class SensorReading:
    """The measurements of a simulated sensor of a registered kind, with errors.

    Position in degrees; velocity over ground, NED; true heading in [0, 2 pi) and yaw rate, clockwise; specific force
    ahead and to starboard, without gravity; apparent wind: speed, and the direction it comes FROM, clockwise from the
    bow, in [0, 2 pi).
    """

    lat_deg: float
    lon_deg: float
    vn_mps: float
    ve_mps: float
    psi_rad: float
    r_radps: float
    ax_mps2: float
    ay_mps2: float
    wind_mps: float
    wind_from_rad: float


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
        self._speed_mps = 0.0

    def sample(
        self,
        truth: TrueMotion,
        wind_n_mps: float,
        wind_e_mps: float,
        *,
        vane_stuck: bool = False,
        cups_stuck: bool = False,
    ) -> tuple[float, float]:
        """Speed (m/s) and direction (degrees FROM, clockwise from the bow, [0, 360)) of the apparent wind.

        A stuck part repeats its value.
        """
        vn, ve = truth.ground_velocity_ned()
        ahead, abeam = ned_to_body(truth.psi_rad, wind_n_mps - vn, wind_e_mps - ve)
        apparent_mps = math.hypot(ahead, abeam)
        if apparent_mps > VANE_STALL_MPS and not vane_stuck:
            from_rad = math.atan2(-abeam, -ahead) - self._misalignment_rad
            self._position = round(from_rad * self._positions / math.tau) % self._positions
        speed_mps = max(0.0, apparent_mps + self._speed_std * self._source.next())
        if not cups_stuck:
            self._speed_mps = speed_mps
        return self._speed_mps, self._position * 360.0 / self._positions


def mwv_sentence(speed_mps: float, from_deg: float) -> bytes:
    """NMEA 0183 wind sentence, apparent wind: `$WIMWV,<deg>,R,<m/s>,M,A*hh`."""
    return nmea_sentence(f"WIMWV,{from_deg:.1f},R,{speed_mps:.2f},M,A")
