"""NMEA 0183 sentences to measurements, sans-IO; parsing is pynmeagps's."""

from __future__ import annotations

import math

from pynmeagps import NMEAMessage, NMEAReader

from asvhil.types import Frame, WindSample

MAX_LINE = 256  # three times the longest legal sentence: beyond it the line end was lost
KNOTS_TO_MPS = 1852.0 / 3600.0
TO_MPS = {"M": 1.0, "N": KNOTS_TO_MPS, "K": 1.0 / 3.6, "S": 0.44704}


class NmeaCodec:
    """Wind from `$--MWV` sentences with reference R (apparent). Bad bytes are dropped and counted."""

    def __init__(self, port: str) -> None:
        self._port = port
        self._buffer = b""
        self.sentences = 0
        self.bad = 0
        self.invalid = 0
        self.ignored = 0

    def decode(self, frame: Frame) -> list[WindSample]:
        """Samples in one chunk of the stream."""
        lines = (self._buffer + frame.data).split(b"\n")
        rest = lines.pop()
        if len(rest) > MAX_LINE:
            self.bad += 1
            rest = b""
        self._buffer = rest
        samples = (self._sample(frame.t_ns, line) for line in lines)
        return [sample for sample in samples if sample is not None]

    def counters(self) -> tuple[tuple[str, int], ...]:
        return (
            (f"{self._port}.sentences", self.sentences),
            (f"{self._port}.bad", self.bad),
            (f"{self._port}.invalid", self.invalid),
            (f"{self._port}.ignored", self.ignored),
        )

    def _sample(self, t_ns: int, line: bytes) -> WindSample | None:
        start = line.rfind(b"$")
        if start < 0 or len(line) - start > MAX_LINE:
            self.bad += bool(line.strip())
            return None
        try:
            message = NMEAReader.parse(line[start:].rstrip() + b"\r\n")
            if not isinstance(message, NMEAMessage) or message.msgID != "MWV" or message.reference != "R":
                self.sentences += 1
                self.ignored += 1
                return None
            scale = TO_MPS.get(str(message.speedu))
            valid = message.status == "A"
            angle_deg, speed = (float(message.angle), float(message.speed)) if valid else (math.nan, math.nan)
        except Exception:  # the parser's many errors on hostile bytes all mean one thing: a bad line
            self.bad += 1
            return None
        self.sentences += 1
        if not valid or scale is None:
            self.invalid += 1
            return None
        if not (math.isfinite(angle_deg) and math.isfinite(speed)) or speed < 0.0:
            self.invalid += 1
            return None
        return WindSample(t_ns=t_ns, speed_mps=speed * scale, from_rad=math.radians(angle_deg % 360.0))
