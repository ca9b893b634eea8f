"""The frame of an NMEA 0183 sentence: `$<body>*hh`, hh the exclusive or of the body's bytes."""

from __future__ import annotations

import functools
import operator


def nmea_checksum(body: bytes) -> int:
    """The exclusive or of all bytes between `$` and `*`."""
    return functools.reduce(operator.xor, body, 0)


def nmea_sentence(body: str) -> bytes:
    """The sentence around its body, with the line's end."""
    data = body.encode()
    return b"$%s*%02X\r\n" % (data, nmea_checksum(data))
