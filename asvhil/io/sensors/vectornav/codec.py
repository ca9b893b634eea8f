"""A VectorNav INS on a serial line: binary messages and ASCII sentences, mixed as they come, to measurements. Sans-IO.

The sources that it gives, by name:
- BINARY: the INS solution of a binary message (Common, Attitude, Ins and Imu groups): position, velocity, heading,
  yaw rate, specific force, whatever of them the message holds;
- GNSS1: the position and velocity of the receiver alone, where a binary message holds them;
- VNINS: the ASCII INS solution, also as the answer to reading register 63: position, velocity, heading;
- VNYMR: yaw rate and specific force in ASCII. Its heading comes without a status, so it is not used.
"""

from __future__ import annotations

import dataclasses
import math
import re

from asvhil.config import Section
from asvhil.geo import is_place
from asvhil.io.sensors.levelling import Level
from asvhil.io.sensors.nmea_fields import Refused
from asvhil.io.sensors.protocol import NamedMeasurement
from asvhil.io.sensors.vectornav import binary, sentences
from asvhil.types import Frame, GroundVelocity, Heading, Position, SpecificForce, YawRate, record

# Bits of the INS status word.
MODE = 0x0003
GNSS_FIX = 0x0004
IMU_ERROR = 0x0010
GNSS_ERROR = 0x0040
NOT_TRACKING, ALIGNING, TRACKING, GNSS_LOST = range(4)

FIX_2D = 2
FIX_TYPES = 10  # 0 none, 1 time alone, 2 2D, 3 3D, then kinds of 3D with corrections

# What each part of a sample can be: half or whole circles, the sensor's own ranges, and where receivers must stop.
RANGES = {
    "ypr_deg": (-360.0, 360.0),
    "tilt_deg": (-360.0, 360.0),
    "rate_radps": (-40.0, 40.0),
    "velocity_mps": (-515.0, 515.0),
    "accel_mps2": (-200.0, 200.0),
}

_START = re.compile(rb"[\xfa$]")
_LINE_END = re.compile(rb"[\r\n]")
_NO_TEXT = re.compile(rb"[^\x20-\x7e\r\n]")


@record
class InsSample:
    """What one message of the INS says; a part that it does not hold is None. Angles in degrees, as on the wire."""

    ypr_deg: tuple[float, ...] | None = None
    tilt_deg: tuple[float, ...] | None = None  # pitch and roll of a message whose heading is not used
    rate_radps: tuple[float, ...] | None = None
    lla: tuple[float, ...] | None = None
    velocity_mps: tuple[float, ...] | None = None
    accel_mps2: tuple[float, ...] | None = None
    status: int | None = None
    position_u_m: float | None = None

    @property
    def position_valid(self) -> bool:
        """Position and velocity are kept up to date: the filter runs and has GNSS. Without a status: assumed."""
        if self.status is None:
            return True
        running = self.status & MODE in (ALIGNING, TRACKING)
        return running and bool(self.status & GNSS_FIX) and not self.status & GNSS_ERROR

    @property
    def heading_valid(self) -> bool:
        """Heading is within specification; it stays so for a while after GNSS is lost. Without a status: assumed."""
        return self.status is None or self.status & MODE in (TRACKING, GNSS_LOST)

    @property
    def inertial_valid(self) -> bool:
        """Rates and specific force are measured. Without a status: assumed."""
        return self.status is None or not self.status & IMU_ERROR


def sample_of(values: binary.Values) -> InsSample:
    """The INS solution in the fields of a binary message; the same quantity in two groups is taken from the first."""

    def vector(*names: str) -> tuple[float, ...] | None:
        for name in names:
            if name in values:
                return tuple(values[name])
        return None

    def number(*names: str) -> float | None:
        found = vector(*names)
        return None if found is None else found[0]

    status = number("Common.InsStatus", "Ins.InsStatus")
    return InsSample(
        ypr_deg=vector("Common.YawPitchRoll", "Attitude.YawPitchRoll"),
        rate_radps=vector("Common.AngularRate", "Imu.AngularRate"),
        lla=vector("Common.PosLla", "Ins.PosLla"),
        velocity_mps=vector("Common.VelNed", "Ins.VelNed"),
        accel_mps2=vector("Common.Accel", "Imu.Accel"),
        status=None if status is None else int(status),
        position_u_m=number("Ins.PosU"),
    )


class VectorNavCodec:
    """Bytes of one port to (source, measurement). Never raises; what is damaged or not valid is dropped and counted.

    The buffer never holds more than one message of the largest size.
    """

    MAX_BUFFER = binary.MAX_PACKET

    def __init__(self, port: str) -> None:
        self._port = port
        self._buffer = b""
        self._level = Level()
        self.packets = 0
        self.sentences = 0
        self.bad_crc = 0
        self.garbage_bytes = 0
        self.invalid = 0  # parts that the sensor itself does not stand by, or that are no numbers
        self.errors = 0  # $VNERR
        self.ignored = 0  # sentences of other kinds
        self.malformed = 0  # sentences with fields that are missing, or no numbers
        self.out_of_range = 0  # parts that no such sensor can mean

    def decode(self, frame: Frame) -> list[NamedMeasurement]:
        """Measurements in one chunk of the stream, each with the name of its source."""
        buffer = self._buffer + frame.data if self._buffer else frame.data
        found: list[NamedMeasurement] = []
        at = 0
        while True:
            start = _START.search(buffer, at)
            if start is None:
                self.garbage_bytes += _odd_bytes(buffer[at:])
                at = len(buffer)
                break
            self.garbage_bytes += _odd_bytes(buffer[at : start.start()])
            at = start.start()
            length = binary.measure(buffer, at) if buffer[at] == binary.SYNC else _measure_sentence(buffer, at)
            if length == binary.INCOMPLETE or at + length > len(buffer):
                break
            if length == binary.IMPOSSIBLE or not self._take(frame.t_ns, buffer[at : at + length], found):
                self.garbage_bytes += 1
                length = 1  # what is inside may be a message all the same
            at += length
        self._buffer = bytes(buffer[at:])
        return found

    def counters(self) -> tuple[tuple[str, int], ...]:
        """Cumulative counts of what came in and what was dropped."""
        names = (
            *("packets", "sentences", "bad_crc", "garbage_bytes", "invalid", "errors", "ignored"),
            *("malformed", "out_of_range"),
        )
        return tuple((f"{self._port}.{name}", getattr(self, name)) for name in names)

    def _take(self, t_ns: int, message: bytes, found: list[NamedMeasurement]) -> bool:
        """Take in a complete message; False where its checksum does not hold."""
        if message[0] == binary.SYNC:
            if not binary.is_intact(message):
                self.bad_crc += 1
                return False
            self.packets += 1
            self._binary(t_ns, binary.decode(message), found)
            return True
        parts = sentences.split(message)
        if parts is None:
            self.bad_crc += 1
            return False
        self.sentences += 1
        self._sentence(t_ns, parts, found)
        return True

    def _binary(self, t_ns: int, values: binary.Values, found: list[NamedMeasurement]) -> None:
        self._measurements("BINARY", t_ns, sample_of(values), found)
        lla, fix = values.get("Gnss1.PosLla"), values.get("Gnss1.Fix")
        if lla is None:
            return
        velocity = values.get("Gnss1.VelNed")
        if fix is None or not FIX_2D <= int(fix[0]) < FIX_TYPES:
            self.invalid += 1
            return
        uncertainty = tuple(values.get("Gnss1.PosU", ()))
        radius_m = math.hypot(*uncertainty[:2]) if uncertainty else None
        sample = InsSample(lla=tuple(lla), velocity_mps=tuple(velocity) if velocity else None, position_u_m=radius_m)
        self._measurements("GNSS1", t_ns, sample, found)

    def _sentence(self, t_ns: int, parts: list[str], found: list[NamedMeasurement]) -> None:
        if parts[0] == "VNERR":
            self.errors += 1
            return
        try:
            solution, inertial = sentences.ins_solution(parts), sentences.inertial(parts)
        except Refused:
            self.malformed += 1
            return
        if solution is not None:
            sample = InsSample(
                ypr_deg=solution.ypr_deg,
                lla=solution.lla,
                velocity_mps=solution.velocity_mps,
                status=solution.status,
                position_u_m=solution.position_u_m,
            )
            self._measurements("VNINS", t_ns, sample, found)
        elif inertial is not None:
            sample = InsSample(
                tilt_deg=inertial.tilt_deg, accel_mps2=inertial.accel_mps2, rate_radps=inertial.rate_radps
            )
            self._measurements("VNYMR", t_ns, sample, found)
        else:
            self.ignored += 1

    def _measurements(self, source: str, t_ns: int, sample: InsSample, found: list[NamedMeasurement]) -> None:
        """Everything in a sample that its status says is valid and that can be a measurement."""
        sample, beyond = within_range(sample)
        self.out_of_range += beyond
        rate, accel = sample.rate_radps, sample.accel_mps2
        fix = _fix(t_ns, sample)
        found += [(source, measurement) for measurement in fix]
        if not fix and (sample.lla is not None or sample.velocity_mps is not None):
            self.invalid += 1
        if sample.ypr_deg is not None:
            if sample.heading_valid and _finite(sample.ypr_deg):
                found.append((source, Heading(t_ns=t_ns, psi_rad=math.radians(sample.ypr_deg[0]))))
            else:
                self.invalid += 1
        if rate is not None and sample.inertial_valid and _finite(rate):
            found.append((source, YawRate(t_ns=t_ns, r_radps=rate[2])))
        tilt_deg = sample.tilt_deg if sample.ypr_deg is None else sample.ypr_deg[1:]
        if tilt_deg is not None:
            self._level.note(t_ns, math.radians(tilt_deg[1]), math.radians(tilt_deg[0]))
        if accel is not None:
            if sample.inertial_valid and _finite(accel):
                ax_mps2, ay_mps2 = self._level.force(t_ns, *accel)
                found.append((source, SpecificForce(t_ns=t_ns, ax_mps2=ax_mps2, ay_mps2=ay_mps2)))
            else:
                self.invalid += 1


def within_range(sample: InsSample) -> tuple[InsSample, int]:
    """A sample without the parts that no such sensor can mean, and how many these were. What is NaN is left."""
    beyond = {
        name
        for name, (least, most) in RANGES.items()
        if (values := getattr(sample, name)) is not None and any(value < least or value > most for value in values)
    }
    return (dataclasses.replace(sample, **dict.fromkeys(beyond)) if beyond else sample), len(beyond)


def _odd_bytes(between: bytes) -> int:
    """How many bytes between two messages are no line end."""
    return len(between.strip(b"\r\n"))


def _measure_sentence(buffer: bytes, at: int) -> int:
    """The length of the sentence that starts at `at`, as `binary.measure` tells that of a message."""
    found = _LINE_END.search(buffer, at, at + sentences.MAX_SENTENCE)
    end = found.start() if found else -1
    stop = end + 1 if end >= 0 else min(len(buffer), at + sentences.MAX_SENTENCE)
    if _NO_TEXT.search(buffer, at, stop):
        return binary.IMPOSSIBLE
    if end >= 0:
        return end + 1 - at
    return binary.INCOMPLETE if stop - at < sentences.MAX_SENTENCE else binary.IMPOSSIBLE


def _fix(t_ns: int, sample: InsSample) -> list[Position | GroundVelocity]:
    """Position and velocity, as far as the message has them; none beside coordinates that are no place on earth."""
    place, velocity = sample.lla, sample.velocity_mps
    if not sample.position_valid or (place is not None and not is_place(place[0], place[1])):
        return []
    found: list[Position | GroundVelocity] = []
    if place is not None:
        h_acc_m = math.nan if sample.position_u_m is None else sample.position_u_m
        found.append(Position(t_ns=t_ns, lat_deg=place[0], lon_deg=place[1], h_acc_m=h_acc_m))
    if velocity is not None and _finite(velocity):
        found.append(GroundVelocity(t_ns=t_ns, vn_mps=velocity[0], ve_mps=velocity[1]))
    return found


def _finite(values: tuple[float, ...]) -> bool:
    return all(math.isfinite(value) for value in values)


def build(settings: Section, port: str, messages: frozenset[str]) -> VectorNavCodec:
    """The codec of a link; it has no settings, and every message is read."""
    return VectorNavCodec(port)
