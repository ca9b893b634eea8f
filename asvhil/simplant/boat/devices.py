"""Navigation sensors beside the autopilot, each on a line of its own: a VN-300 (binary), an NMEA GNSS with a compass.

They measure the same true state as the autopilot's sensors, with errors of their own. Sans-IO: `advance` gives frames.
"""

from __future__ import annotations

import datetime
import math

import numpy as np

from asvhil.config import InsDeviceConfig, NmeaDeviceConfig, SensorLinkConfig, SensorsConfig
from asvhil.config.fault_spans import Present, SensorFaults
from asvhil.config.ports import GNSS, INS
from asvhil.config.registry import SensorKind
from asvhil.geo import LocalFrame, wrap_2pi, wrap_rad
from asvhil.io.sensors.nmea_checksum import nmea_sentence
from asvhil.io.sensors.nmea_fields import KNOTS_TO_MPS
from asvhil.io.sensors.vectornav import binary
from asvhil.io.sensors.vectornav.codec import (
    ALIGNING,
    GNSS_ERROR,
    GNSS_FIX,
    GNSS_LOST,
    IMU_ERROR,
    NOT_TRACKING,
    TRACKING,
)
from asvhil.simplant.boat.metronome import Metronome
from asvhil.simplant.boat.sensors import Anemometer, Navigation, SensorReading, TrueMotion
from asvhil.types import Frame

NS_PER_S = 1_000_000_000
UNIX_EPOCH_AT_POWER_ON_US = 1_767_225_600_000_000  # 2026-01-01, the date of every simulation
GPS_EPOCH_UNIX_S = 315_964_800  # 1980-01-06
LEAP_S = 18  # GPS ahead of UTC since 2017
COMPASS_HEADING = 0x0300  # of the INS status: the two antennas give a heading, and it is used


def _errors(sensors: SensorsConfig, device: InsDeviceConfig | NmeaDeviceConfig) -> SensorsConfig:
    """The sensors of a device: its own sections, else those of the autopilot."""
    own = {name: getattr(device, name) or getattr(sensors, name) for name in ("gnss", "heading", "imu")}
    return sensors.model_copy(update=own)


class SimulatedVn300:
    """A VN-300 that sends one binary message at its rate: all fields that the codec uses, with uncertainties."""

    def __init__(self, sensors: SensorsConfig, origin: LocalFrame, t_ns: int, seed: np.random.SeedSequence) -> None:
        config = sensors.ins
        self._sensors = _errors(sensors, config)
        self._origin = origin
        self._start_ns = t_ns
        self._align_ns = round(config.align_s * NS_PER_S)
        self._beat = Metronome(t_ns, config.rate_hz)
        self._navigation = Navigation(self._sensors, config.rate_hz, t_ns, seed)

    def advance(self, t_ns: int, truth: TrueMotion, faults: Present) -> list[Frame]:
        """The message that is due, if one is and the sensor is not silent."""
        if not self._beat.take_due(t_ns):
            return []
        ails = faults.of("ins")
        self._navigation.sample(t_ns, truth, ails)
        if "ins" in faults:
            return []
        return [Frame(t_ns=t_ns, port=INS, data=self._message(t_ns, ails))]

    def _message(self, t_ns: int, ails: SensorFaults) -> bytes:
        """Faults that the sensor knows are in the status; a jump is not."""
        nav, gnss = self._navigation, self._sensors.gnss
        since_ns = t_ns - self._start_ns
        aligned = since_ns >= self._align_ns
        lat_deg, lon_deg = self._origin.to_geodetic(nav.n_m, nav.e_m) if aligned else (0.0, 0.0)
        if not aligned:
            status = NOT_TRACKING | GNSS_FIX * (not ails.gnss_silent)
        elif ails.gnss_silent:
            status = NOT_TRACKING if ails.heading_silent else GNSS_LOST
            status |= GNSS_ERROR
        elif ails.heading_silent:
            status = ALIGNING | GNSS_FIX
        else:
            status = TRACKING | GNSS_FIX | COMPASS_HEADING
        status |= IMU_ERROR * ails.imu_silent
        heading_u_deg = self._sensors.heading.white_deg
        unix_ns = UNIX_EPOCH_AT_POWER_ON_US * 1000 + since_ns
        return binary.encode(
            {
                "Common.TimeStartup": (since_ns,),
                "Common.TimeGps": (unix_ns - (GPS_EPOCH_UNIX_S - LEAP_S) * NS_PER_S,),
                "Common.YawPitchRoll": tuple(
                    math.degrees(angle) for angle in (wrap_rad(nav.psi_rad), nav.pitch_rad, nav.roll_rad)
                ),
                "Common.AngularRate": (0.0, 0.0, nav.r_radps),
                "Common.PosLla": (lat_deg, lon_deg, 0.0),
                "Common.VelNed": (nav.vn_mps, nav.ve_mps, 0.0),
                "Common.Accel": (nav.ax_mps2, nav.ay_mps2, nav.az_mps2),
                "Common.InsStatus": (status,),
                "Attitude.YprU": (heading_u_deg, heading_u_deg, heading_u_deg),
                "Ins.PosU": (math.hypot(gnss.slow_bias_m, gnss.white_m),),
                "Ins.VelU": (gnss.velocity_white_mps,),
            }
        )


class SimulatedNmea:
    """A GNSS receiver (GGA, RMC, VTG with each fix, ZDA each second) and a magnetic compass (HDG) on one line."""

    def __init__(self, sensors: SensorsConfig, origin: LocalFrame, t_ns: int, seed: np.random.SeedSequence) -> None:
        config = sensors.nmea
        self._declination_deg = config.declination_deg
        self._origin = origin
        self._start_ns = t_ns
        errors = _errors(sensors, config)
        self._fix = Metronome(t_ns, errors.gnss.rate_hz)
        self._compass = Metronome(t_ns, config.compass_hz)
        self._clock = Metronome(t_ns, 1.0)
        fix_seed, compass_seed = seed.spawn(2)
        self._receiver = Navigation(errors, errors.gnss.rate_hz, t_ns, fix_seed)
        self._needle = Navigation(errors, config.compass_hz, t_ns, compass_seed)

    def advance(self, t_ns: int, truth: TrueMotion, faults: Present) -> list[Frame]:
        """The sentences that are due, in one frame."""
        bodies: list[str] = []
        ails = faults.of("nmea")
        if self._fix.take_due(t_ns):
            self._receiver.sample(t_ns, truth, ails)
            bodies += self._no_fix_sentences(t_ns) if ails.gnss_silent else self._fix_sentences(t_ns)
        if self._clock.take_due(t_ns):
            bodies.append(f"GPZDA,{self._utc(t_ns):%H%M%S.00,%d,%m,%Y},00,00")
        if self._compass.take_due(t_ns):
            self._needle.sample(t_ns, truth, ails)
            magnetic_deg = math.degrees(wrap_2pi(self._needle.psi_rad)) - self._declination_deg
            if not ails.heading_silent:
                bodies.append(f"HCHDG,{magnetic_deg % 360.0:.1f},,,{self._variation()}")
        if not bodies or "nmea" in faults:
            return []
        return [Frame(t_ns=t_ns, port=GNSS, data=b"".join(nmea_sentence(body) for body in bodies))]

    def _fix_sentences(self, t_ns: int) -> list[str]:
        nav, utc = self._receiver, self._utc(t_ns)
        lat_deg, lon_deg = self._origin.to_geodetic(nav.fix_n_m, nav.fix_e_m)
        place = f"{_angle(lat_deg, 2)},{'NS'[lat_deg < 0.0]},{_angle(lon_deg, 3)},{'EW'[lon_deg < 0.0]}"
        speed_mps = math.hypot(nav.fix_vn_mps, nav.fix_ve_mps)
        course_deg = math.degrees(wrap_2pi(math.atan2(nav.fix_ve_mps, nav.fix_vn_mps)))
        magnetic_deg = (course_deg - self._declination_deg) % 360.0
        knots, time = speed_mps / KNOTS_TO_MPS, f"{utc:%H%M%S}.{utc.microsecond // 10_000:02d}"
        return [
            f"GPGGA,{time},{place},1,12,0.8,0.0,M,0.0,M,,",
            f"GPRMC,{time},A,{place},{knots:.3f},{course_deg:.2f},{utc:%d%m%y},{self._variation()},A",
            f"GPVTG,{course_deg:.2f},T,{magnetic_deg:.2f},M,{knots:.3f},N,{speed_mps * 3.6:.3f},K,A",
        ]

    def _no_fix_sentences(self, t_ns: int) -> list[str]:
        """The sentences of a receiver without satellites: empty, and marked as not valid."""
        utc = self._utc(t_ns)
        time = f"{utc:%H%M%S}.{utc.microsecond // 10_000:02d}"
        return [
            f"GPGGA,{time},,,,,0,00,99.9,,M,,M,,",
            f"GPRMC,{time},V,,,,,,,{utc:%d%m%y},,,N",
            "GPVTG,,T,,M,,N,,K,N",
        ]

    def _variation(self) -> str:
        return f"{abs(self._declination_deg):.1f},{'EW'[self._declination_deg < 0.0]}"

    def _utc(self, t_ns: int) -> datetime.datetime:
        since_us = (t_ns - self._start_ns) // 1000
        unix_s = (UNIX_EPOCH_AT_POWER_ON_US + since_us) * 1e-6
        return datetime.datetime.fromtimestamp(unix_s, datetime.UTC)


class SimulatedSensor:
    """A sensor of a registered kind, which encodes its messages; its errors are those of the boat's other sensors."""

    def __init__(
        self,
        port: str,
        kind: SensorKind,
        settings: SensorLinkConfig,
        sensors: SensorsConfig,
        origin: LocalFrame,
        t_ns: int,
        seed: np.random.SeedSequence,
    ) -> None:
        self._port, self._kind, self._settings, self._origin = port, kind, settings, origin
        self._beat = Metronome(t_ns, kind.rate_hz)
        navigation_seed, wind_seed = seed.spawn(2)
        self._navigation = Navigation(sensors, kind.rate_hz, t_ns, navigation_seed, level=True)
        self._anemometer = Anemometer(sensors.anemometer, wind_seed)

    def advance(self, t_ns: int, truth: TrueMotion, wind_ned: tuple[float, float]) -> list[Frame]:
        """The frame that is due; none if the kind has no `simulate`."""
        if self._kind.simulate is None or not self._beat.take_due(t_ns):
            return []
        nav = self._navigation
        nav.sample(t_ns, truth)
        lat_deg, lon_deg = self._origin.to_geodetic(nav.n_m, nav.e_m)
        speed_mps, from_deg = self._anemometer.sample(truth, *wind_ned)
        reading = SensorReading(
            lat_deg=lat_deg,
            lon_deg=lon_deg,
            vn_mps=nav.vn_mps,
            ve_mps=nav.ve_mps,
            psi_rad=nav.psi_rad,
            r_radps=nav.r_radps,
            ax_mps2=nav.ax_mps2,
            ay_mps2=nav.ay_mps2,
            wind_mps=speed_mps,
            wind_from_rad=math.radians(from_deg),
        )
        data = self._kind.simulate(self._settings, t_ns, reading)
        return [Frame(t_ns=t_ns, port=self._port, data=data)] if data else []


def _angle(degrees: float, width: int) -> str:
    """Degrees and minutes as NMEA writes them, without the hemisphere; minutes to 1e-5 (2 cm), never 60."""
    hundred_thousandths = round(abs(degrees) * 6_000_000)
    whole, minutes = divmod(hundred_thousandths, 6_000_000)
    return f"{whole:0{width}d}{minutes / 100_000:08.5f}"
