"""NMEA 0183 as it comes down a line: bytes to sentences with a right checksum, and why the others were dropped.

Taken are line ends of CR, LF, both or none before the next `$`; TAG blocks (`\\...\\`) before a sentence; `!` for `$`;
blanks at either end of the body, inside of the checksum or not; a checksum in lower case or of one digit, and blanks
behind it.
"""

from __future__ import annotations

import enum
import re
from collections.abc import Iterator

from asvhil.io.sensors.nmea_checksum import nmea_checksum

MAX_LINE = 256  # three times the longest legal sentence: beyond it the line end was lost

_LINE_END = re.compile(rb"[\r\n]")
_TAG_BLOCK = re.compile(rb"\\[^\\$]*\\")
_START = re.compile(rb"(?=\$|![A-Za-z]{5},)")
_CHECKSUM = re.compile(rb"[ \t\x00]*([0-9A-Fa-f]{1,2})[ \t\x00]*")
_BLANKS = b" \t\x00"


class DropCause(enum.StrEnum):
    """Why a sentence gives nothing; the names of the counters."""

    GARBAGE = "garbage"  # a line without a sentence
    TOO_LONG = "too_long"
    NO_CHECKSUM = "no_checksum"
    BAD_CHECKSUM = "bad_checksum"
    UNKNOWN = "unknown"  # a sentence that is not understood
    UNUSED = "unused"  # one that is, and that no source of the config names
    VOID = "void"  # the instrument says so itself: status V, no fix, simulated
    MISSING_FIELD = "missing_field"
    MALFORMED = "malformed"  # no number, or a letter that has no meaning there
    OUT_OF_RANGE = "out_of_range"
    NO_DECLINATION = "no_declination"  # a magnetic direction where the declination is not known


class NmeaFramer:
    """Cuts one stream. The buffer holds at most one line."""

    def __init__(self) -> None:
        self._buffer = b""

    @property
    def held(self) -> int:
        """How many bytes wait for the rest of their line."""
        return len(self._buffer)

    def receive(self, data: bytes) -> Iterator[bytes | DropCause]:
        """The body of each sentence that data completes, the part between `$` and `*`, or why it is dropped."""
        *lines, rest = _LINE_END.split(self._buffer + data)
        last = rest.rfind(b"$")
        if last > 0:  # whatever stands before a beginning has come to its end
            lines.append(rest[:last])
            rest = rest[last:]
        if len(rest) > MAX_LINE:
            lines.append(rest)
            rest = b""
        self._buffer = rest
        for line in lines:
            yield from _sentences(line)


def _sentences(line: bytes) -> Iterator[bytes | DropCause]:
    line = line.strip(_BLANKS)
    while block := _TAG_BLOCK.match(line):
        line = line[block.end() :]
    before, *parts = _START.split(line)
    if not parts and before:
        yield DropCause.TOO_LONG if len(before) > MAX_LINE else DropCause.GARBAGE
    for part in parts:
        yield _body(part[1:])


def _body(sentence: bytes) -> bytes | DropCause:
    if len(sentence) > MAX_LINE:
        return DropCause.TOO_LONG
    body, star, rest = sentence.partition(b"*")
    if not star or not rest.strip(_BLANKS):
        return DropCause.NO_CHECKSUM
    found = _CHECKSUM.fullmatch(rest)
    bare = body.strip(_BLANKS)
    if found is None:
        return DropCause.BAD_CHECKSUM
    told = int(found[1], 16)
    # Some instruments count the blanks that they add, others do not.
    if told != nmea_checksum(body) and told != nmea_checksum(bare):
        return DropCause.BAD_CHECKSUM
    return bare
