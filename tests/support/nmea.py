"""NMEA sentences for tests, framed without the package under test."""

from __future__ import annotations

import functools
import operator


def checksum(body: str) -> str:
    """The two hex digits behind the star."""
    return f"{functools.reduce(operator.xor, body.encode(), 0):02X}"


def sentence(body: str) -> bytes:
    """A sentence around its body, with its checksum and the line's end."""
    return f"${body}*{checksum(body)}\r\n".encode()
