"""What NMEA 0183 sentences of GNSS receivers, compasses and anemometers mean, as measurements. No state, no framing.

A function per sentence takes the time and the fields, and gives the measurements in it. It raises Refused, with the
cause, where the instrument marks its values as not valid, or where they are missing or cannot be.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from asvhil.io.sensors.nmea_fields import KNOTS_TO_MPS, TO_MPS, Fields, Refused, known
from asvhil.io.sensors.nmea_framing import DropCause
from asvhil.types import (
    ApparentWind,
    BowWind,
    GroundVelocity,
    Heading,
    Measurement,
    Position,
    TrueWind,
    YawRate,
    record,
)

Found = Sequence[Measurement]

NO_FIX_QUALITIES = frozenset({0, 6, 7, 8})  # of GGA: none, dead reckoning, typed in, simulator
NO_FIX_MODES = frozenset("NEMSV")  # of RMC, VTG, GLL, GNS: the same
SLOW_MPS = 0.2  # receivers leave the course empty at rest: below this speed it is taken for none
MWV_GOOD = ("A", "00")  # Gill's anemometers have two digits there in their extended format
CALM_MPS = 0.5  # ultrasonic anemometers leave the angle empty in a calm: below this speed any one does
KMH_TO_MPS = TO_MPS["K"]


@record
class Compass:
    """What turns a magnetic direction into a true one: east of true north is positive, None where not known."""

    declination_rad: float | None = None

    def true_deg(self, magnetic_deg: float) -> float:
        """Refused where the declination is not known."""
        if self.declination_rad is None:
            raise Refused(DropCause.NO_DECLINATION)
        return magnetic_deg + math.degrees(self.declination_rad)


def _fix_mode(f: Fields, at: int) -> None:
    if f.text(at) in NO_FIX_MODES:
        raise Refused(DropCause.VOID)


def _position(t_ns: int, f: Fields, at: int) -> Position:
    lat_deg, lon_deg = f.place(at)
    return Position(t_ns=t_ns, lat_deg=lat_deg, lon_deg=lon_deg)


def _velocity(t_ns: int, speed_mps: float, course_deg: float | None) -> GroundVelocity:
    """The velocity of a speed and a course over ground."""
    if course_deg is None and speed_mps < SLOW_MPS:
        return GroundVelocity(t_ns=t_ns, vn_mps=0.0, ve_mps=0.0)
    course_rad = math.radians(known(course_deg))
    vn_mps, ve_mps = speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad)
    return GroundVelocity(t_ns=t_ns, vn_mps=vn_mps, ve_mps=ve_mps)


def _gga(t_ns: int, f: Fields, compass: Compass) -> Found:
    if int(f.needed(5, "quality")) in NO_FIX_QUALITIES:
        raise Refused(DropCause.VOID)
    return (_position(t_ns, f, 1),)


def _gll(t_ns: int, f: Fields, compass: Compass) -> Found:
    f.status(5)
    _fix_mode(f, 6)
    return (_position(t_ns, f, 0),)


def _gns(t_ns: int, f: Fields, compass: Compass) -> Found:
    modes = f.text(5)  # a letter for each system of satellites
    if not modes:
        raise Refused(DropCause.MISSING_FIELD)
    if all(mode in NO_FIX_MODES for mode in modes):
        raise Refused(DropCause.VOID)
    return (_position(t_ns, f, 1),)


def _rmc(t_ns: int, f: Fields, compass: Compass) -> Found:
    if f.letter(1, "AV") == "V":
        raise Refused(DropCause.VOID)
    _fix_mode(f, 11)
    variation_of(f)
    position = _position(t_ns, f, 2)
    speed_mps, course_deg = f.number(6, "ground speed", KNOTS_TO_MPS), f.number(7, "direction")
    if speed_mps is None or (course_deg is None and speed_mps >= SLOW_MPS):
        return (position,)
    return position, _velocity(t_ns, speed_mps, course_deg)


def _vtg(t_ns: int, f: Fields, compass: Compass) -> Found:
    if f.text(1)[:1].isdigit():
        true_at, magnetic_at, knots_at, kmh_at = 0, 1, 2, 3  # before version 2 it had no letters
    else:
        true_at, magnetic_at, knots_at, kmh_at = 0, 2, 4, 6
        for at, letter in ((1, "T"), (3, "M"), (5, "N"), (7, "K")):
            f.unit(at, letter)
        _fix_mode(f, 8)
    speed_mps = f.number(knots_at, "ground speed", KNOTS_TO_MPS)
    kmh_mps = f.number(kmh_at, "ground speed", KMH_TO_MPS)
    course_deg, magnetic_deg = f.number(true_at, "direction"), f.number(magnetic_at, "direction")
    if course_deg is None and magnetic_deg is not None:
        course_deg = compass.true_deg(magnetic_deg)
    return (_velocity(t_ns, known(kmh_mps if speed_mps is None else speed_mps), course_deg),)


def _heading(t_ns: int, degrees: float) -> Found:
    return (Heading(t_ns=t_ns, psi_rad=math.radians(degrees % 360.0)),)


def _hdt(t_ns: int, f: Fields, compass: Compass) -> Found:
    f.unit(1, "T")
    return _heading(t_ns, f.needed(0, "direction"))


def _ths(t_ns: int, f: Fields, compass: Compass) -> Found:
    f.status(1)
    return _heading(t_ns, f.needed(0, "direction"))


def _hdm(t_ns: int, f: Fields, compass: Compass) -> Found:
    f.unit(1, "M")
    return _heading(t_ns, compass.true_deg(f.needed(0, "direction")))


def _hdg(t_ns: int, f: Fields, compass: Compass) -> Found:
    degrees = f.needed(0, "direction") + (f.signed(1, "variation", "E", "W") or 0.0)
    variation_rad = variation_of(f)
    return _heading(t_ns, compass.true_deg(degrees) if variation_rad is None else degrees + math.degrees(variation_rad))


def _rot(t_ns: int, f: Fields, compass: Compass) -> Found:
    f.status(1)
    return (YawRate(t_ns=t_ns, r_radps=math.radians(f.needed(0, "turn rate") / 60.0)),)


def _mwv(t_ns: int, f: Fields, compass: Compass) -> Found:
    f.status(4, MWV_GOOD)
    kind = ApparentWind if f.letter(1, "RT") == "R" else BowWind
    speed_mps = f.needed(2, "wind speed", TO_MPS[f.letter(3, "MNKS")])
    angle_deg = f.number(0, "direction")
    if angle_deg is None and speed_mps < CALM_MPS:
        angle_deg = 0.0
    angle_deg = known(angle_deg)
    return (kind(t_ns=t_ns, speed_mps=speed_mps, from_rad=math.radians(angle_deg % 360.0)),)


def _of_a_side(kind: type[ApparentWind] | type[BowWind], t_ns: int, f: Fields) -> Found:
    """VWR and VWT: the angle to one side of the bow, then the speed in knots, m/s and km/h."""
    angle_deg = f.signed(0, "half circle", "R", "L")
    speeds = []
    for at, letter in ((2, "N"), (4, "M"), (6, "K")):
        f.unit(at + 1, letter)
        speeds.append(f.number(at, "wind speed", TO_MPS[letter]))
    speed_mps = known(next((speed for speed in speeds if speed is not None), None))
    return (kind(t_ns=t_ns, speed_mps=speed_mps, from_rad=math.radians(known(angle_deg) % 360.0)),)


def _vwr(t_ns: int, f: Fields, compass: Compass) -> Found:
    return _of_a_side(ApparentWind, t_ns, f)


def _vwt(t_ns: int, f: Fields, compass: Compass) -> Found:
    return _of_a_side(BowWind, t_ns, f)


def _mwd(t_ns: int, f: Fields, compass: Compass) -> Found:
    for at, letter in ((1, "T"), (3, "M"), (5, "N"), (7, "M")):
        f.unit(at, letter)
    from_deg, magnetic_deg = f.number(0, "direction"), f.number(2, "direction")
    if from_deg is None:
        from_deg = compass.true_deg(known(magnetic_deg))
    knots_mps, speed_mps = f.number(4, "wind speed", KNOTS_TO_MPS), f.number(6, "wind speed")
    speed_mps = known(knots_mps if speed_mps is None else speed_mps)
    toward_rad = math.radians(from_deg) + math.pi
    return (TrueWind(t_ns=t_ns, vn_mps=speed_mps * math.cos(toward_rad), ve_mps=speed_mps * math.sin(toward_rad)),)


def variation_of(f: Fields) -> float | None:
    """The magnetic variation that RMC and HDG may carry (rad, east positive), None where value or side is empty."""
    at = VARIATION_AT[f.name]
    if not f.text(at + 1):
        return None
    degrees = f.signed(at, "variation", "E", "W")
    return None if degrees is None else math.radians(degrees)


DECODERS: dict[str, Callable[[int, Fields, Compass], Found]] = {
    "GGA": _gga,
    "GLL": _gll,
    "GNS": _gns,
    "RMC": _rmc,
    "VTG": _vtg,
    "HDT": _hdt,
    "HDM": _hdm,
    "HDG": _hdg,
    "THS": _ths,
    "ROT": _rot,
    "MWV": _mwv,  # reference R: apparent
    "MWV_T": _mwv,  # reference T: true, but from the bow
    "MWD": _mwd,
    "VWR": _vwr,
    "VWT": _vwt,
}
VARIATION_AT = {"RMC": 9, "HDG": 3}
VARIATION = frozenset(VARIATION_AT)
EVERYTHING = frozenset(DECODERS)
