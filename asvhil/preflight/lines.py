"""What came down the line of a sensor that gives nothing, and what to do about it: in words, for each cause."""

from __future__ import annotations

import math

from asvhil.config import Config, Quantity, SourceConfig
from asvhil.config.registry import SENSORS
from asvhil.io.mavlink.frames import FrameSplitter
from asvhil.io.sensors.nmea import NmeaCodec
from asvhil.io.sensors.nmea_framing import DropCause
from asvhil.io.sensors.nmea_sentences import EVERYTHING
from asvhil.io.sensors.vectornav.codec import VectorNavCodec
from asvhil.types import Frame, record

S = 1_000_000_000
SILENT_S = 2.0
ODD_SHARE = 0.15  # of bytes that are no text: what another speed makes of it
FEW_BYTES = 12
SAMPLE_BYTES = 4096
UBX = b"\xb5\x62"
SHOWN = 24

_TEXT = frozenset(range(0x20, 0x7F)) | {0x09, 0x0A, 0x0D}
_REFUSED = {
    DropCause.VOID: (
        "marked as not valid by the instrument itself (status V, no fix)",
        "wait for it, or look at what it measures with: its sensor, its antenna under open sky, its own settings",
    ),
    DropCause.OUT_OF_RANGE: (
        "with a value that no instrument can mean",
        "look at its settings and its sensor: it sends nonsense with a right checksum",
    ),
    DropCause.MISSING_FIELD: (
        "with an empty field that is needed",
        "it measures nothing yet, or sends an abridged sentence: look at its settings",
    ),
    DropCause.MALFORMED: ("with a field that cannot be read", "look at its settings: this is not the standard's form"),
    DropCause.NO_DECLINATION: (
        "with a magnetic direction",
        "give {key}.declination_deg, so that it becomes a true one",
    ),
}


@record
class Diagnosis:
    """What came, and what to do."""

    found: str
    todo: str


class SensorLine:
    """All that came on the port of one sensor link; `state` is that of the link, where it is not up."""

    def __init__(self, config: Config, port: str) -> None:
        link = config.links.sensor_links()[port]
        declination_deg = getattr(link, "declination_deg", None)
        declination_rad = None if declination_deg is None else math.radians(declination_deg)
        self._key = config.links.key_of(port)
        self._encoding = SENSORS.find(config.links.kind_of(port)).encoding
        self._gives = SENSORS.find(config.links.kind_of(port)).messages
        self._port = port
        self._nmea = NmeaCodec(port, EVERYTHING, declination_rad)
        self._vectornav = VectorNavCodec(port)
        self._mavlink = FrameSplitter()
        self._mavlink_frames = 0
        self._bytes = 0
        self._odd = 0
        self._sample = b""
        self._last_ns: int | None = None
        self.state = "up"

    def receive(self, frame: Frame) -> None:
        """One chunk of the stream."""
        if not frame.data:
            return
        self._last_ns = frame.t_ns
        self._bytes += len(frame.data)
        self._odd += sum(byte not in _TEXT for byte in frame.data)
        self._sample = (self._sample + frame.data)[-SAMPLE_BYTES:]
        self._nmea.decode(frame)
        self._vectornav.decode(frame)
        self._mavlink_frames += len(self._mavlink.receive(frame.data))

    def diagnosis(self, quantity: Quantity, source: SourceConfig, t_ns: int) -> Diagnosis:
        """Why a source on this line gives nothing at t_ns."""
        if self._last_ns is None:
            return self._unheard()
        silent_s = (t_ns - self._last_ns) / S
        if silent_s > max(SILENT_S, source.timeout_s):
            return Diagnosis(
                found=f"silent for {silent_s:.0f} s, after {self._bytes} bytes",
                todo=f"it has stopped: a loose plug, or a supply that drops? ({self._key}.endpoint)",
            )
        if self._encoding == "nmea":
            return self._nothing_read() if not self._nmea.sentences else self._of_sentences(quantity, source.message)
        if self._encoding == "vectornav":
            heard = self._vectornav.packets + self._vectornav.sentences
            return self._nothing_read() if not heard else self._of_an_ins(source.message)
        return Diagnosis(
            found=f"{self._bytes} bytes, nothing valid",
            todo=f"is it set to what its kind reads, and is the speed right? ({self._key}.endpoint)",
        )

    def _unheard(self) -> Diagnosis:
        if self.state not in ("up", "connecting"):
            return Diagnosis(
                found=f"no line: {self.state}", todo=f"is the device there, and free? ({self._key}.endpoint)"
            )
        return Diagnosis(
            found="not one byte",
            todo=f"is it on, is its TX wired to our RX, and does it send by itself? ({self._key}.endpoint)",
        )

    def _nothing_read(self) -> Diagnosis:
        """Bytes, and nothing in them that the kind of this link reads."""
        other = self._other_protocol()
        if other is not None:
            return other
        dropped = self._nmea.dropped
        unchecked, wrong = dropped[DropCause.NO_CHECKSUM], dropped[DropCause.BAD_CHECKSUM]
        share = self._odd / self._bytes
        if self._bytes >= FEW_BYTES and share > ODD_SHARE:
            return Diagnosis(
                found=f"{self._bytes} bytes, {share:.0%} of them no text",
                todo=f"the speed is wrong: set that of {self._key}.endpoint to the instrument's (4800, 9600, ...)",
            )
        if unchecked > wrong:
            return Diagnosis(
                found=f"{unchecked} sentences without a checksum",
                todo="switch its checksum on (*hh at the end): without one a damaged sentence cannot be told",
            )
        if wrong:
            return Diagnosis(
                found=f"{wrong} sentences, all with a wrong checksum",
                todo="a line that disturbs its bytes: look at cable, ground and supply, and for a second sender on it",
            )
        text = "".join(chr(byte) if byte in _TEXT and byte >= 0x20 else " " for byte in self._sample).split()
        shown = " ".join(text)[:SHOWN]
        return Diagnosis(
            found=f"{self._bytes} bytes without a sentence{f', such as {shown!r}' if shown else ''}",
            todo=f"is this the right device, and is it set to send? ({self._key}.endpoint)",
        )

    def _other_protocol(self) -> Diagnosis | None:
        names = {
            "MAVLink": self._mavlink_frames > 0,
            "UBX of a u-blox receiver": self._sample.count(UBX) > 1,
            "binary messages of a VectorNav": self._encoding != "vectornav" and self._vectornav.packets > 0,
            "NMEA sentences": self._encoding != "nmea" and self._nmea.sentences > 0,
        }
        spoken = next((name for name, heard in names.items() if heard), None)
        if spoken is None:
            return None
        kind = "NMEA 0183" if self._encoding == "nmea" else "VectorNav's"
        todo = f"this link reads {kind}: set the sensor to it, or give it another kind ({self._key})"
        return Diagnosis(found=f"{self._bytes} bytes of {spoken}", todo=todo)

    def _of_sentences(self, quantity: Quantity, message: str) -> Diagnosis:
        heard = self._nmea.heard
        if message not in heard:
            names = sorted(heard, key=lambda name: -heard[name])
            able = next((name for name in names if quantity in self._gives.get(name, ())), None)
            take = f"sources.{quantity}: [{self._port}.{able}] takes it as it is, or " if able else ""
            return Diagnosis(
                found=f"sends {', '.join(names[:6])}{' ...' if len(names) > 6 else ''}, and no {message}",
                todo=f"{take}have it send {message}",
            )
        refused = self._nmea.refused.get(message, {})
        if not refused:
            return Diagnosis(found=f"{heard[message]} {message}, none in time", todo="it sends too seldom")
        cause = max(refused, key=lambda cause: refused[cause])
        words, todo = _REFUSED[cause]
        found = f"{heard[message]} {message}, {refused[cause]} {words}"
        return Diagnosis(found=found, todo=todo.format(key=self._key))

    def _of_an_ins(self, message: str) -> Diagnosis:
        codec = self._vectornav
        is_binary = message in ("BINARY", "GNSS1")
        came, others = (codec.packets, codec.sentences) if is_binary else (codec.sentences, codec.packets)
        if not came:
            what = "ASCII sentences" if is_binary else "binary messages"
            return Diagnosis(
                found=f"{others} {what}, and no {message}", todo=f"have it send {message} (docs/sensors.md)"
            )
        if codec.invalid:
            return Diagnosis(
                found=f"{came} messages, {codec.invalid} parts marked as not valid by the INS itself",
                todo="wait until it has aligned, under open sky; see its status",
            )
        if codec.out_of_range or codec.malformed:
            found = f"{came} messages, {codec.out_of_range + codec.malformed} with what no INS can mean"
            return Diagnosis(found=found, todo="look at its settings: it sends nonsense with a right checksum")
        found = f"{came} messages, and none with this quantity"
        return Diagnosis(found=found, todo="have its message hold the field; see docs/sensors.md")
