"""What a VectorNav binary output message can hold: the groups, their fields and the size of each.

Source: the binary output chapters of the VN-300 user manual (UM005) and interface control document. A message names
its fields by bits: one bit per group in the groups byte, one bit per field in the 16-bit word of each group. In the
two GNSS groups bit 15 of the word says that a second word follows. All numbers are little-endian.
"""

from __future__ import annotations

import struct

from asvhil.types import record

EXTENSION_BIT = 15
WORD_FIELDS = 16  # bits of one field word, the extension bit among them


@record
class Field:
    """One field: `name` is Group.Field, `form` its little-endian struct format.

    A field of variable size has an empty form: its size is `base` + `each` times the count in the byte at `count_at`,
    which is at most `most`.
    """

    name: str
    group: int
    bit: int
    form: str
    size: int
    base: int = 0
    each: int = 0
    count_at: int = 0
    most: int = 0


_UTC = "bBBBBBH"  # year since 2000, month, day, hour, minute, second, millisecond

# A line per group, in the order of the bits: name and struct format; `-` is a bit that no field has.
_GNSS = (
    f"TimeUtc {_UTC}  Tow Q  Week H  NumSats B  Fix B  PosLla 3d  PosEcef 3d  VelNed 3f  VelEcef 3f  PosU 3f  VelU f  "
    "TimeU f  TimeInfo Bb  Dop 7f  SatInfo *  - -  RawMeas *  Status H  AltMsl d"
)
_TABLE = (
    (
        "Common",
        "TimeStartup Q  TimeGps Q  TimeSyncIn Q  YawPitchRoll 3f  Quaternion 4f  AngularRate 3f  PosLla 3d  VelNed 3f  "
        "Accel 3f  Imu 6f  MagPres 5f  DeltaThetaVel 7f  InsStatus H  SyncInCnt I  TimeGpsPps Q",
    ),
    (
        "Time",
        "TimeStartup Q  TimeGps Q  GpsTow Q  GpsWeek H  TimeSyncIn Q  TimeGpsPps Q  "
        f"TimeUtc {_UTC}  SyncInCnt I  SyncOutCnt I  TimeStatus B",
    ),
    (
        "Imu",
        "ImuStatus H  UncompMag 3f  UncompAccel 3f  UncompGyro 3f  Temperature f  Pressure f  DeltaTheta 4f  "
        "DeltaVel 3f  Mag 3f  Accel 3f  AngularRate 3f  SensSat H  Reserved12 40s",
    ),
    ("Gnss1", _GNSS),
    (
        "Attitude",
        "Reserved0 2s  YawPitchRoll 3f  Quaternion 4f  Dcm 9f  MagNed 3f  AccelNed 3f  LinearAccelBody 3f  "
        "LinearAccelNed 3f  YprU 3f  Reserved9 12s  Reserved10 28s  Reserved11 24s  Heave 3f  AttU f",
    ),
    (
        "Ins",
        "InsStatus H  PosLla 3d  PosEcef 3d  VelBody 3f  VelNed 3f  VelEcef 3f  MagEcef 3f  AccelEcef 3f  "
        "LinearAccelEcef 3f  PosU f  VelU f  Reserved11 68s  Reserved12 64s",
    ),
    ("Gnss2", _GNSS),
)

# Bytes: the fixed part, for each satellite or measurement, where the count stands, and the most that a sensor sends.
_VARIABLE = {"SatInfo": (2, 8, 0, 35), "RawMeas": (12, 28, 10, 55)}


def _fields(group: int, name: str, line: str) -> dict[int, Field]:
    words = line.split()
    found = {}
    for bit, (field, form) in enumerate(zip(words[::2], words[1::2], strict=True)):
        if field == "-":
            continue
        if form == "*":
            base, each, count_at, most = _VARIABLE[field]
            found[bit] = Field(
                name=f"{name}.{field}",
                group=group,
                bit=bit,
                form="",
                size=0,
                base=base,
                each=each,
                count_at=count_at,
                most=most,
            )
        else:
            size = struct.calcsize(f"<{form}")
            found[bit] = Field(name=f"{name}.{field}", group=group, bit=bit, form=f"<{form}", size=size)
    return found


GROUPS: tuple[dict[int, Field], ...] = tuple(_fields(i, name, line) for i, (name, line) in enumerate(_TABLE))
BY_NAME: dict[str, Field] = {field.name: field for group in GROUPS for field in group.values()}
GNSS_GROUPS = frozenset({3, 6})  # the only ones whose field word may be extended
