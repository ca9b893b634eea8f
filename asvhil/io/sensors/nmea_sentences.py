"""What NMEA 0183 sentences of GNSS receivers, compasses and anemometers mean, as measurements. No state, no framing.

A function per sentence takes the time and the fields as pynmeagps names them, and gives the measurements in it, none
where the instrument itself marks its values as not valid. ValueError on values that cannot be: the parser knows the
fields, but takes latitude 100, an empty hemisphere (as north or east) and `inf`, so whatever is used is checked here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from asvhil.geo import is_place
from asvhil.types import ApparentWind, BowWind, GroundVelocity, Heading, Measurement, Position, TrueWind, record

Found = Sequence[Measurement]

KNOTS_TO_MPS = 1852.0 / 3600.0
TO_MPS = {"M": 1.0, "N": KNOTS_TO_MPS, "K": 1.0 / 3.6, "S": 0.44704}
NO_FIX_QUALITIES = frozenset({0, 6, 7, 8})  # of GGA: none, dead reckoning, typed in, simulator
NO_FIX_MODES = frozenset("NEMS")  # of RMC and VTG: the same
SLOW_MPS = 0.2  # receivers leave the course empty at rest: below this speed it is taken for none


@record
class Compass:
    """What turns a magnetic direction into a true one: east of true north is positive, None where not known."""

    declination_rad: float | None = None


def _number(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError("not a finite number")
    return number


def _optional(value: Any) -> float | None:
    return None if value == "" else _number(value)


def _signed(value: Any, side: Any, positive: str, negative: str) -> float:
    """A magnitude and its letter as one number."""
    if side not in (positive, negative):
        raise ValueError(f"{side!r} is neither {positive} nor {negative}")
    return _number(value) if side == positive else -_number(value)


def _place(m: Any) -> tuple[float, float]:
    """Latitude and longitude in degrees; the parser has applied the hemispheres that are there."""
    lat_deg, lon_deg = _number(m.lat), _number(m.lon)
    if m.NS not in ("N", "S") or m.EW not in ("E", "W") or not is_place(lat_deg, lon_deg):
        raise ValueError("no place on earth")
    return lat_deg, lon_deg


def _direction(value: Any, letter: Any, expected: str) -> float | None:
    """A direction of 0 to 360 degrees by its letter, true (T) or magnetic (M); None where the field is empty."""
    degrees = _optional(value)
    if degrees is not None and (letter != expected or not 0.0 <= degrees <= 360.0):
        raise ValueError(f"{degrees:g},{letter} is no direction ({expected}, 0 to 360)")
    return degrees


def _speed(value: Any, letter: Any, expected: str) -> float | None:
    """A speed in the unit of its letter; None where the field is empty."""
    speed = _optional(value)
    if speed is not None and letter != expected:
        raise ValueError(f"{speed:g},{letter} is no speed in {expected}")
    return speed


def _velocity(t_ns: int, speed_mps: float | None, course_deg: float | None) -> tuple[GroundVelocity, ...]:
    """The velocity of a speed and a course over ground; empty where it is not known."""
    if speed_mps is None or speed_mps < 0.0:
        return ()
    if course_deg is None:
        return (GroundVelocity(t_ns=t_ns, vn_mps=0.0, ve_mps=0.0),) if speed_mps < SLOW_MPS else ()
    course_rad = math.radians(course_deg)
    vn_mps, ve_mps = speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad)
    return (GroundVelocity(t_ns=t_ns, vn_mps=vn_mps, ve_mps=ve_mps),)


def _gga(t_ns: int, m: Any, compass: Compass) -> Found:
    if int(_number(m.quality)) in NO_FIX_QUALITIES:
        return ()
    lat_deg, lon_deg = _place(m)
    return (Position(t_ns=t_ns, lat_deg=lat_deg, lon_deg=lon_deg),)


def _rmc(t_ns: int, m: Any, compass: Compass) -> Found:
    if m.status != "A" or getattr(m, "posMode", "A") in NO_FIX_MODES:
        return ()
    lat_deg, lon_deg = _place(m)
    knots = _optional(m.spd)
    velocity = _velocity(t_ns, None if knots is None else knots * KNOTS_TO_MPS, _optional(m.cog))
    return (Position(t_ns=t_ns, lat_deg=lat_deg, lon_deg=lon_deg), *velocity)


def _vtg(t_ns: int, m: Any, compass: Compass) -> Found:
    if (getattr(m, "posMode", "A") or "A") in NO_FIX_MODES:
        return ()
    knots, km_h = _speed(m.sogn, m.sognUnit, "N"), _speed(m.sogk, m.sogkUnit, "K")
    speed_mps = km_h / 3.6 if knots is None and km_h is not None else None if knots is None else knots * KNOTS_TO_MPS
    course_deg = _direction(m.cogt, m.cogtUnit, "T")
    magnetic_deg = _direction(m.cogm, m.cogmUnit, "M")
    if course_deg is None and magnetic_deg is not None and compass.declination_rad is not None:
        course_deg = magnetic_deg + math.degrees(compass.declination_rad)
    return _velocity(t_ns, speed_mps, course_deg)


def _heading(t_ns: int, degrees: float) -> Found:
    return (Heading(t_ns=t_ns, psi_rad=math.radians(degrees % 360.0)),)


def _hdt(t_ns: int, m: Any, compass: Compass) -> Found:
    degrees = _direction(m.headingT, m.headingTu, "T")
    return () if degrees is None else _heading(t_ns, degrees)


def _hdm(t_ns: int, m: Any, compass: Compass) -> Found:
    degrees = _direction(m.headingM, m.headingMag, "M")
    if degrees is None or compass.declination_rad is None:
        return ()
    return _heading(t_ns, degrees + math.degrees(compass.declination_rad))


def _hdg(t_ns: int, m: Any, compass: Compass) -> Found:
    degrees = _optional(m.headingM)
    declination_rad = variation_of(m)
    if declination_rad is None:
        declination_rad = compass.declination_rad
    if degrees is None or declination_rad is None:
        return ()
    deviation_deg = 0.0 if m.deviation == "" else _signed(m.deviation, m.deviationEW, "E", "W")
    return _heading(t_ns, degrees + deviation_deg + math.degrees(declination_rad))


def _mwv(t_ns: int, m: Any, compass: Compass) -> Found:
    scale = TO_MPS.get(str(m.speedu))
    if m.status != "A" or scale is None:
        return ()
    angle, speed = float(m.angle), float(m.speed)
    if not (math.isfinite(angle) and math.isfinite(speed)) or speed < 0.0:
        return ()
    kind = ApparentWind if m.reference == "R" else BowWind
    return (kind(t_ns=t_ns, speed_mps=speed * scale, from_rad=math.radians(angle % 360.0)),)


def _mwd(t_ns: int, m: Any, compass: Compass) -> Found:
    from_deg, magnetic_deg = _direction(m.dirT, m.dirTu, "T"), _direction(m.dirM, m.dirMu, "M")
    if from_deg is None and magnetic_deg is not None and compass.declination_rad is not None:
        from_deg = magnetic_deg + math.degrees(compass.declination_rad)
    speed_mps, knots = _speed(m.speedM, m.speedMu, "M"), _speed(m.speedN, m.speedNu, "N")
    if speed_mps is None and knots is not None:
        speed_mps = knots * KNOTS_TO_MPS
    if from_deg is None or speed_mps is None or speed_mps < 0.0:
        return ()
    toward_rad = math.radians(from_deg) + math.pi
    return (TrueWind(t_ns=t_ns, vn_mps=speed_mps * math.cos(toward_rad), ve_mps=speed_mps * math.sin(toward_rad)),)


def variation_of(m: Any) -> float | None:
    """The magnetic variation that RMC and HDG may carry (rad, east positive), None where the field is empty."""
    if m.msgID == "RMC":
        value, side = m.mv, m.mvEW
    else:
        value, side = m.variation, m.variationEW
    return None if value == "" or side == "" else math.radians(_signed(value, side, "E", "W"))


DECODERS: dict[str, Callable[[int, Any, Compass], Found]] = {
    "GGA": _gga,
    "RMC": _rmc,
    "VTG": _vtg,
    "HDT": _hdt,
    "HDM": _hdm,
    "HDG": _hdg,
    "MWV": _mwv,  # reference R: apparent
    "MWV_T": _mwv,  # reference T: true, but from the bow
    "MWD": _mwd,
}
VARIATION = frozenset({"RMC", "HDG"})
EVERYTHING = frozenset(DECODERS)
