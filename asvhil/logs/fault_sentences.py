"""Faults in the NMEA sentences of a receiver, a compass or an anemometer."""

from __future__ import annotations

import math

from asvhil.config.fault_spans import Present, SensorFaults
from asvhil.geo import LocalFrame
from asvhil.io.sensors.nmea_checksum import nmea_sentence
from asvhil.io.sensors.nmea_fields import Fields, Refused
from asvhil.io.sensors.nmea_framing import NmeaFramer
from asvhil.types import Frame

# Of each sentence with a fix: where the position and its status stand, the status without one, and what is its time.
PLACE = {"RMC": 3, "GGA": 2, "GLL": 1, "GNS": 2}
VOID = {"RMC": (2, "V"), "GGA": (6, "0"), "GLL": (6, "V"), "GNS": (6, "N"), "VTG": (9, "N")}
EMPTY = {"RMC": (3, 4, 5, 6, 7, 8), "GGA": (2, 3, 4, 5), "GLL": (1, 2, 3, 4), "GNS": (2, 3, 4, 5), "VTG": (1, 3, 5, 7)}
TIMES = {"RMC": (1, 9), "GGA": (1,), "GLL": (5,), "GNS": (1,), "VTG": ()}
HEADINGS = frozenset({"HDT", "HDG", "HDM", "THS"})
WINDS = frozenset({"MWV", "VWR", "VWT", "MWD"})
VANE, CUPS = {"MWV": (1,), "VWR": (1, 2), "VWT": (1, 2), "MWD": (1, 3)}, {"MWV": (3,), "VWR": (3,), "VWT": (3,)}


class SentenceEdits:
    """The edits of one line; `silenced_by` is the kind of fault that silences all of it."""

    def __init__(self, *, silenced_by: str) -> None:
        self._silenced_by = silenced_by
        self._framer = NmeaFramer()
        self._last: dict[str, list[str]] = {}  # the last sound sentence, by its address

    def apply(self, frame: Frame, present: Present) -> bytes:
        """The bytes of a frame with its faults; where one is changed, what is no sentence is left out."""
        bodies = [body for body in self._framer.receive(frame.data) if isinstance(body, bytes)]
        edited = [self._edit(body, present) for body in bodies]
        if self._silenced_by in present:
            return b""
        if edited == bodies:
            return frame.data
        held = self._framer.held
        rest = frame.data[-held:] if held else b""
        return b"".join(nmea_sentence(body.decode()) for body in edited if body is not None) + rest

    def _edit(self, body: bytes, present: Present) -> bytes | None:
        try:
            fields = Fields(body)
        except Refused:
            return body
        parts = body.decode().split(",")
        if fields.name in WINDS:
            edited = self._wind(fields.name, parts, present)
        elif fields.name in VOID:
            edited = self._fix(fields, parts, present.of("nmea"))
        elif fields.name in HEADINGS:
            edited = _heading(fields, parts, present.of("nmea"))
        else:
            return body
        return None if edited is None else ",".join(edited).encode()

    def _wind(self, name: str, parts: list[str], present: Present) -> list[str] | None:
        if "anemometer" in present:
            return None
        stuck = "anemometer-stuck" in present
        vane = VANE.get(name, ()) if stuck or "vane" in present else ()
        cups = CUPS.get(name, ()) if stuck or "cups" in present else ()
        last = self._last.get(parts[0], parts)
        for at in (*vane, *cups):
            if at < min(len(parts), len(last)):
                parts[at] = last[at]
        self._last[parts[0]] = list(parts)
        return parts

    def _fix(self, fields: Fields, parts: list[str], faults: SensorFaults) -> list[str]:
        name = fields.name
        if faults.gnss_silent:
            at, status = VOID[name]
            parts += [""] * (at + 1 - len(parts))
            for empty in EMPTY[name]:
                parts[empty] = ""
            parts[at] = status
            return parts
        if faults.gnss_frozen and (last := self._last.get(parts[0])) is not None:
            return [parts[at] if at in TIMES[name] and at < len(parts) else word for at, word in enumerate(last)]
        self._last[parts[0]] = list(parts)
        if name in PLACE and (faults.jump_n_m or faults.jump_e_m):
            _move(fields, parts, PLACE[name], (faults.jump_n_m, faults.jump_e_m))
        return parts


def _move(fields: Fields, parts: list[str], at: int, metres: tuple[float, float]) -> None:
    """The position in four fields from `at` on (with the address), moved on the ground; what is none stays."""
    try:
        lat_deg, lon_deg = fields.place(at - 1)
    except Refused:
        return
    lat_deg, lon_deg = LocalFrame(lat_deg=lat_deg, lon_deg=lon_deg).to_geodetic(*metres)
    parts[at : at + 4] = [_angle(lat_deg, 2), "NS"[lat_deg < 0.0], _angle(lon_deg, 3), "EW"[lon_deg < 0.0]]


def _heading(fields: Fields, parts: list[str], faults: SensorFaults) -> list[str] | None:
    if faults.heading_silent:
        return None
    turn_deg = math.degrees(faults.turn_rad + faults.compass_rad)
    if turn_deg:
        try:
            parts[1] = f"{(fields.needed(0, 'direction') + turn_deg) % 360.0:.2f}"
        except Refused:
            return parts
    return parts


def _angle(degrees: float, width: int) -> str:
    """Degrees and minutes as NMEA writes them, without the hemisphere; minutes to 1e-6 (2 mm), never 60."""
    whole, minutes = divmod(round(abs(degrees) * 60_000_000), 60_000_000)
    return f"{whole:0{width}d}{minutes / 1_000_000:09.6f}"
