"""The fields of an NMEA 0183 sentence: one grammar for all sentences, and one table of what an instrument can mean."""

from __future__ import annotations

import re
from collections.abc import Collection

from asvhil.geo import is_place
from asvhil.io.sensors.nmea_framing import DropCause

KNOTS_TO_MPS = 1852.0 / 3600.0
TO_MPS = {"M": 1.0, "N": KNOTS_TO_MPS, "K": 1.0 / 3.6, "S": 0.44704}

# The least and the most of each quantity. A speed beyond is no boat's and no gale's, but an instrument could tell it.
RANGES: dict[str, tuple[float, float]] = {
    "direction": (0.0, 360.0),  # degrees, of headings, courses, and winds from north or the bow
    "half circle": (0.0, 180.0),  # degrees to one side
    "variation": (0.0, 180.0),  # degrees, and the deviation of a compass
    "ground speed": (0.0, 515.0),  # m/s, where receivers must stop working
    "wind speed": (0.0, 100.0),  # m/s
    "turn rate": (-20000.0, 20000.0),  # degrees per minute
    "quality": (0.0, 9.0),
}

_NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)", re.ASCII)
_ADDRESS = re.compile(r"[A-Z0-9]{0,10}", re.ASCII)
_ANGLE = re.compile(r"([0-9]{0,3}?)([0-9]{1,2}(\.[0-9]*)?)", re.ASCII)  # degrees and minutes: 4025.422
_MOST_CHARACTERS = 30


class Refused(ValueError):
    """A sentence that gives nothing, with the cause to count."""

    def __init__(self, cause: DropCause) -> None:
        super().__init__(cause.value)
        self.cause = cause


class Fields:
    """The fields of a sentence, from 0, without blanks around them; a field that is not there is an empty one."""

    def __init__(self, body: bytes) -> None:
        """Refused (malformed) where the body is no ASCII text, or begins with no name."""
        try:
            address, *values = body.decode("ascii").split(",")
        except UnicodeDecodeError:
            raise Refused(DropCause.MALFORMED) from None
        address = address.strip().upper()
        if not _ADDRESS.fullmatch(address):
            raise Refused(DropCause.MALFORMED)
        # Two letters of a talker, then three of the sentence; P stands before what is a maker's own.
        self.name = address[2:] if len(address) == 5 and address[0] != "P" else address
        self._values = [value.strip() for value in values]

    def text(self, at: int) -> str:
        """A field as it is, in capitals."""
        return self._values[at].upper() if at < len(self._values) else ""

    def number(self, at: int, quantity: str, scale: float = 1.0) -> float | None:
        """A field as a number times `scale`, None where it is empty. Refused where it is none, or out of its range."""
        text = self.text(at)
        if not text:
            return None
        value = decimal(text) * scale
        least, most = RANGES[quantity]
        if not least <= value <= most:
            raise Refused(DropCause.OUT_OF_RANGE)
        return value

    def needed(self, at: int, quantity: str, scale: float = 1.0) -> float:
        """As `number`; Refused where it is empty."""
        return known(self.number(at, quantity, scale))

    def letter(self, at: int, letters: str) -> str:
        """A field that must be one of some letters. Refused where it is empty, or another."""
        text = self.text(at)
        if not text:
            raise Refused(DropCause.MISSING_FIELD)
        if len(text) != 1 or text not in letters:
            raise Refused(DropCause.MALFORMED)
        return text

    def unit(self, at: int, letter: str) -> None:
        """The letter behind a value; its place says as much, so it may be left out. Refused where it is another."""
        if self.text(at) not in ("", letter):
            raise Refused(DropCause.MALFORMED)

    def status(self, at: int, good: Collection[str] = ("A",)) -> None:
        """A status that came late to the standard: good where there is none. Refused (void) where it is another."""
        if self.text(at) and self.text(at) not in good:
            raise Refused(DropCause.VOID)

    def signed(self, at: int, quantity: str, positive: str, negative: str) -> float | None:
        """A magnitude and the letter of its side as one number, None where it is empty."""
        value = self.number(at, quantity)
        if not value:
            return value
        return value if self.letter(at + 1, positive + negative) == positive else -value

    def place(self, at: int) -> tuple[float, float]:
        """Latitude and longitude (degrees) in four fields: 4025.422,N,08655.272,W."""
        lat_deg, lon_deg = self._angle(at, 90.0), self._angle(at + 2, 180.0)
        lat_deg *= 1.0 if self.letter(at + 1, "NS") == "N" else -1.0
        lon_deg *= 1.0 if self.letter(at + 3, "EW") == "E" else -1.0
        if not is_place(lat_deg, lon_deg):
            raise Refused(DropCause.VOID)  # 0, 0: what receivers send before they have a fix
        return lat_deg, lon_deg

    def _angle(self, at: int, most_deg: float) -> float:
        text = self.text(at)
        if not text:
            raise Refused(DropCause.MISSING_FIELD)
        found = _ANGLE.fullmatch(text) if len(text) <= _MOST_CHARACTERS else None
        if found is None:
            raise Refused(DropCause.MALFORMED)
        minutes = float(found[2])
        degrees = float(found[1] or 0) + minutes / 60.0
        if minutes >= 60.0 or degrees > most_deg:
            raise Refused(DropCause.OUT_OF_RANGE)
        return degrees


def decimal(text: str) -> float:
    """A decimal number: digits with a sign and a point, and nothing else that Python takes for one. Refused else."""
    if len(text) > _MOST_CHARACTERS or not _NUMBER.fullmatch(text):
        raise Refused(DropCause.MALFORMED)
    return float(text)


def known(value: float | None) -> float:
    """A value that must be there."""
    if value is None:
        raise Refused(DropCause.MISSING_FIELD)
    return value
