"""What every sensor codec offers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from asvhil.types import Frame, Measurement


class SensorCodec(Protocol):
    """What turns the bytes of a sensor's port into measurements, each with the name of the message it came in."""

    def read(self, frame: Frame) -> Sequence[tuple[str, Measurement]]: ...

    def counters(self) -> tuple[tuple[str, int], ...]: ...
