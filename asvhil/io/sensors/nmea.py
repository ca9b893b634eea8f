"""NMEA 0183 on a serial line to measurements, sans-IO: what comes in is understood, or dropped and counted by cause.

Any talker id is taken. `nmea_framing.py` cuts the bytes, `nmea_fields.py` reads fields, and `nmea_sentences.py` knows
what the sentences mean.
"""

from __future__ import annotations

import math
from collections.abc import Collection

from asvhil.config import NmeaLinkConfig
from asvhil.io.sensors.nmea_fields import Fields, Refused
from asvhil.io.sensors.nmea_framing import DropCause, NmeaFramer
from asvhil.io.sensors.nmea_sentences import DECODERS, VARIATION, Compass, variation_of
from asvhil.io.sensors.protocol import NamedMeasurement
from asvhil.types import Frame

APPARENT_WIND = frozenset({"MWV"})
BAD_LINES = (DropCause.GARBAGE, DropCause.TOO_LONG, DropCause.NO_CHECKSUM, DropCause.BAD_CHECKSUM)
MOST_NAMES = 40


class NmeaCodec:
    """Sentences of one port to (source, measurement); the source is the sentence, MWV_T for MWV with reference T.

    `wanted` are the sentences to use. `declination_rad` (east positive) turns magnetic directions into true ones; where
    None, the variation that RMC or HDG on the same line told last. `dropped` counts by cause what gave nothing,
    `heard` the sentences with a right checksum by name, and `refused` why those that are wanted gave nothing.
    """

    def __init__(
        self, port: str, wanted: Collection[str] = APPARENT_WIND, declination_rad: float | None = None
    ) -> None:
        self._port = port
        self._wanted = frozenset(wanted)
        self._listens_for_variation = declination_rad is None
        self._compass = Compass(declination_rad=declination_rad)
        self._framer = NmeaFramer()
        self.sentences = 0
        self.dropped: dict[DropCause, int] = dict.fromkeys(DropCause, 0)
        self._counted: tuple[tuple[str, int], ...] | None = None  # of now
        self._counters = tuple(f"{port}.{name}" for name in ("sentences", "bad", *self.dropped))
        self.heard: dict[str, int] = {}
        self.refused: dict[str, dict[DropCause, int]] = {}

    @property
    def held(self) -> int:
        """How many bytes wait for the rest of their sentence."""
        return self._framer.held

    def decode(self, frame: Frame) -> list[NamedMeasurement]:
        """Measurements in one chunk of the stream, each with the name of its sentence."""
        found: list[NamedMeasurement] = []
        self._counted = None
        for body in self._framer.receive(frame.data):
            try:
                if isinstance(body, DropCause):
                    raise Refused(body)
                self.sentences += 1
                found += self._sentence(frame.t_ns, body)
            except Refused as refused:
                self.dropped[refused.cause] += 1
        return found

    def counters(self) -> tuple[tuple[str, int], ...]:
        """Cumulative counts of sentences with a right checksum, of bad lines, and of what gave nothing by cause."""
        if self._counted is None:  # once for each chunk, and not in each tick
            bad = sum([self.dropped[cause] for cause in BAD_LINES])
            counts = self.sentences, bad, *self.dropped.values()
            self._counted = tuple(zip(self._counters, counts, strict=True))
        return self._counted

    def _sentence(self, t_ns: int, body: bytes) -> list[NamedMeasurement]:
        fields = Fields(body)
        source = "MWV_T" if fields.name == "MWV" and fields.text(1) == "T" else fields.name
        if source in self.heard or len(self.heard) < MOST_NAMES:
            self.heard[source] = self.heard.get(source, 0) + 1
        if source not in DECODERS:
            raise Refused(DropCause.UNKNOWN)
        if source not in self._wanted:
            raise Refused(DropCause.UNUSED)
        try:
            found = DECODERS[source](t_ns, fields, self._compass)
            # What is void, estimated or simulated teaches nothing: it was refused above.
            if self._listens_for_variation and source in VARIATION:
                variation_rad = variation_of(fields)
                if variation_rad is not None:
                    self._compass = Compass(declination_rad=variation_rad)
            return [(source, measurement) for measurement in found]
        except Refused as refused:
            causes = self.refused.setdefault(source, {})
            causes[refused.cause] = causes.get(refused.cause, 0) + 1
            raise


def build(settings: NmeaLinkConfig, port: str, messages: frozenset[str]) -> NmeaCodec:
    """The codec of a link; RMC and HDG are read for the variation too."""
    declination_deg = settings.declination_deg
    declination_rad = None if declination_deg is None else math.radians(declination_deg)
    return NmeaCodec(port, messages | VARIATION, declination_rad)
