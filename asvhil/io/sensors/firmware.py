"""The version of the firmware at the other end of a line: read, asked for, compared. Sans-IO."""

from __future__ import annotations

import re

from asvhil.io.sensors.nmea_framing import DropCause, NmeaFramer
from asvhil.types import Frame, Note

FIRMWARE = "arduino_anemometer"
VERSION = "1.0.1"  # of the firmware in this tree; a test compares the two
QUERY = b"$PASVQ,V*3F\r\n"
ASK_NS = 2_000_000_000
PATIENCE = 3  # questions without an answer
FIELD = r"([A-Za-z0-9_.+-]{1,40})"  # it goes to screens and logs: nothing else is let in
NAME = b"PASVV,"
SENTENCE = re.compile(f"PASVV,{FIELD},{FIELD},{FIELD}")


class FirmwareWatch:
    """Reads `$PASVV,<name>,<version>,<start>*hh` on one port, and asks for it where our own firmware is expected.

    `expected` is the firmware's name, or None for an instrument of which nothing is known: that is never asked.
    """

    def __init__(self, port: str, expected: str | None) -> None:
        self.port = port
        self._expected = expected
        self._framer = NmeaFramer()
        self._heard = False
        self._asked = 0
        self._asked_ns: int | None = None
        self._told: tuple[str, str, str] | None = None  # name, version, what made it start

    def receive(self, frame: Frame) -> None:
        """Look for a version sentence in one chunk of the stream; what is none, or damaged, is left alone."""
        self._heard = True
        for body in self._framer.receive(frame.data):
            told = None if isinstance(body, DropCause) else _version(body)
            if told is None:
                continue
            # An answer says nothing of the start: that is still the one before.
            start = self._told[2] if told[2] == "request" and self._told is not None else told[2]
            self._told = (told[0], told[1], start)

    def data_to_send(self, t_ns: int) -> list[Frame]:
        """The question, every 2 s until it is answered, once anything was heard on the port."""
        if self._expected is None or self._told is not None or not self._heard:
            return []
        if self._asked_ns is not None and t_ns - self._asked_ns < ASK_NS:
            return []
        self._asked_ns = t_ns
        self._asked += 1
        return [Frame(t_ns=t_ns, port=self.port, data=QUERY)]

    def note(self) -> Note | None:
        """What is known of the firmware, in words; None while there is nothing to say."""
        subject = f"{self.port} firmware"
        if self._told is None:
            if self._asked <= PATIENCE:
                return None
            text = f"tells no version; links.{self.port}.firmware expects {self._expected} {VERSION}"
            return Note(subject=subject, text=text, ok=False)
        name, version, start = self._told
        if self._expected is not None and (name, version) != (self._expected, VERSION):
            text = f"{name} {version} instead of {self._expected} {VERSION}: flash it (docs/anemometer.md)"
            return Note(subject=subject, text=text, ok=False)
        if start == "watchdog":
            return Note(subject=subject, text=f"{name} {version}, restarted by its watchdog", ok=False)
        return Note(subject=subject, text=f"{name} {version}", ok=True)


def _version(body: bytes) -> tuple[str, str, str] | None:
    if not body.startswith(NAME):  # as of all sentences but a few at the start
        return None
    found = SENTENCE.fullmatch(body.decode("latin-1"))
    return None if found is None else (found[1], found[2], found[3])
