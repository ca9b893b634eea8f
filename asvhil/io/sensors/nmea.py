"""NMEA 0183 on a serial line to measurements, sans-IO: framing and counting here, parsing is pynmeagps's.

Any talker id is taken. What the sentences mean, and what is checked of them, is in `nmea_sentences.py`.
"""

from __future__ import annotations

import math
from collections.abc import Collection

from pynmeagps import NMEAMessage, NMEAReader

from asvhil.config import NmeaLinkConfig
from asvhil.io.sensors.nmea_sentences import (
    DECODERS,
    EVERYTHING,
    KNOTS_TO_MPS,
    TO_MPS,
    VARIATION,
    Compass,
    variation_of,
)
from asvhil.io.sensors.protocol import NamedMeasurement
from asvhil.types import Frame

__all__ = ["APPARENT_WIND", "EVERYTHING", "KNOTS_TO_MPS", "MAX_LINE", "TO_MPS", "NmeaCodec"]

MAX_LINE = 256  # three times the longest legal sentence: beyond it the line end was lost
APPARENT_WIND = frozenset({"MWV"})


class NmeaCodec:
    """Sentences of one port to (source, measurement); the source is the sentence, MWV_T for MWV with reference T.

    `wanted` are the sentences to understand, others are counted as ignored. `declination_rad` (east positive) turns
    magnetic directions into true ones; where None, the variation that RMC or HDG on the same line told last. Bad
    bytes are dropped and counted.
    """

    def __init__(
        self, port: str, wanted: Collection[str] = APPARENT_WIND, declination_rad: float | None = None
    ) -> None:
        self._port = port
        self._wanted = frozenset(wanted)
        self._listens_for_variation = declination_rad is None
        self._compass = Compass(declination_rad=declination_rad)
        self._buffer = b""
        self.sentences = 0
        self.bad = 0
        self.invalid = 0
        self.ignored = 0

    def decode(self, frame: Frame) -> list[NamedMeasurement]:
        """Measurements in one chunk of the stream, each with the name of its sentence."""
        lines = (self._buffer + frame.data).split(b"\n")
        rest = lines.pop()
        if len(rest) > MAX_LINE:
            self.bad += 1
            rest = b""
        self._buffer = rest
        return [named for line in lines for named in self._sentence(frame.t_ns, line)]

    def counters(self) -> tuple[tuple[str, int], ...]:
        """Cumulative counts of what came in and what was dropped."""
        return (
            (f"{self._port}.sentences", self.sentences),
            (f"{self._port}.bad", self.bad),
            (f"{self._port}.invalid", self.invalid),
            (f"{self._port}.ignored", self.ignored),
        )

    def _sentence(self, t_ns: int, line: bytes) -> list[NamedMeasurement]:
        start = line.rfind(b"$")
        if start < 0 or len(line) - start > MAX_LINE:
            self.bad += bool(line.strip())
            return []
        try:
            message = NMEAReader.parse(line[start:].rstrip() + b"\r\n")
            source = _source(message)
            if source is None or source not in self._wanted:
                self.sentences += 1
                self.ignored += 1
                return []
            if self._listens_for_variation and source in VARIATION:
                self._listen(message)
            found = DECODERS[source](t_ns, message, self._compass)
        except Exception:  # the parser's many errors on hostile bytes all mean one thing: a bad line
            self.bad += 1
            return []
        self.sentences += 1
        self.invalid += not found
        return [(source, measurement) for measurement in found]

    def _listen(self, message: NMEAMessage) -> None:
        variation_rad = variation_of(message)
        if variation_rad is not None:
            self._compass = Compass(declination_rad=variation_rad)


def _source(message: object) -> str | None:
    """The name of a sentence as a source, None for what is none."""
    if not isinstance(message, NMEAMessage):
        return None
    name = str(message.msgID)
    if name == "MWV":
        return {"R": "MWV", "T": "MWV_T"}.get(message.reference)
    return name


def build(settings: NmeaLinkConfig, port: str, messages: frozenset[str]) -> NmeaCodec:
    """The codec of a link; RMC and HDG are read for the variation too."""
    declination_deg = settings.declination_deg
    declination_rad = None if declination_deg is None else math.radians(declination_deg)
    return NmeaCodec(port, messages | VARIATION, declination_rad)
