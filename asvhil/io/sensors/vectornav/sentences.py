"""VectorNav ASCII sentences: `$VNxxx,...*hh` with an XOR of 8 bits, or `*hhhh` with the CRC of the binary messages."""

from __future__ import annotations

import re

from fastcrc.crc16 import xmodem

from asvhil.io.sensors.nmea_checksum import nmea_checksum
from asvhil.io.sensors.nmea_fields import Refused, decimal
from asvhil.io.sensors.nmea_framing import DropCause
from asvhil.types import record

MAX_SENTENCE = 256  # VNINS, the longest that is used, has less than 160
INS_REGISTER = 63  # what $VNRRG answers with the content of $VNINS
INS_FIELDS, YMR_FIELDS = 15, 12

_FORM = re.compile(rb"\$(VN[A-Z]{3}[^*$]*)\*([0-9A-Fa-f]{4}|[0-9A-Fa-f]{2})[ \t]*(\r?\n|\r)\Z")
_STATUS = re.compile(r"(0[xX])?[0-9A-Fa-f]{1,8}")


@record
class InsSolution:
    """Register 63: the INS solution. Angles and positions in degrees, velocity NED; uncertainties are the sensor's."""

    status: int
    ypr_deg: tuple[float, float, float]
    lla: tuple[float, float, float]
    velocity_mps: tuple[float, float, float]
    position_u_m: float


@record
class Inertial:
    """VNYMR: specific force (m/s^2) and rates (rad/s) in body axes, and how these are tilted: pitch and roll (degrees).

    The heading, which has no status here, and the magnetic field are left out.
    """

    tilt_deg: tuple[float, float]
    accel_mps2: tuple[float, float, float]
    rate_radps: tuple[float, float, float]


def split(line: bytes) -> list[str] | None:
    """The comma-separated parts of a sentence, header without `$` first; None where form or checksum is wrong.

    The letters XX in place of a checksum, with which a person may type commands, are no checksum here.
    """
    match = _FORM.match(line)
    if match is None:
        return None
    body, check = match[1], match[2]
    bodies = (body, body.rstrip())  # a blank before the star may be counted, or not
    computed = [nmea_checksum(one) if len(check) == 2 else int(xmodem(one)) for one in bodies]
    if int(check, 16) not in computed:
        return None
    return [part.strip() for part in body.decode("ascii", "replace").split(",")]


def ins_solution(parts: list[str]) -> InsSolution | None:
    """The content of VNINS, or of VNRRG with register 63; None where it is something else. Refused on a wrong field."""
    if parts[0] == "VNINS":
        words = parts[1:]
    elif parts[0] == "VNRRG" and len(parts) > 1 and parts[1].lstrip("0") == str(INS_REGISTER):
        words = parts[2:]
    else:
        return None
    if len(words) < INS_FIELDS:
        raise Refused(DropCause.MISSING_FIELD)
    if not _STATUS.fullmatch(words[2]):
        raise Refused(DropCause.MALFORMED)
    status = int(words[2], 16)
    n = [decimal(word) for word in (*words[:2], *words[3:INS_FIELDS])]  # time of week and week are checked, not used
    return InsSolution(
        status=status,
        ypr_deg=(n[2], n[3], n[4]),
        lla=(n[5], n[6], n[7]),
        velocity_mps=(n[8], n[9], n[10]),
        position_u_m=n[12],
    )


def inertial(parts: list[str]) -> Inertial | None:
    """The content of VNYMR; None where it is something else. Refused on a wrong field."""
    if parts[0] != "VNYMR":
        return None
    if len(parts) <= YMR_FIELDS:
        raise Refused(DropCause.MISSING_FIELD)
    n = [decimal(word) for word in parts[1 : 1 + YMR_FIELDS]]
    return Inertial(tilt_deg=(n[1], n[2]), accel_mps2=(n[6], n[7], n[8]), rate_radps=(n[9], n[10], n[11]))
