"""The interface of a sensor codec."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from asvhil.types import Frame, Measurement

NamedMeasurement = tuple[str, Measurement]  # with the name of the message that it came in


class SensorCodec(Protocol):
    """Turns the bytes of a sensor's port into measurements. Never raises on bad bytes: it drops and counts them."""

    def decode(self, frame: Frame) -> Sequence[NamedMeasurement]:
        """(message name, measurement) of all in one chunk of the stream, in the order of the bytes."""

    def counters(self) -> tuple[tuple[str, int], ...]:
        """Cumulative counts of what came in and what was dropped."""
