"""What the backseat asks of an autopilot."""

from __future__ import annotations

from typing import Protocol

from asvhil.autopilot.requirements import Finding
from asvhil.io.sensors.protocol import NamedMeasurement
from asvhil.types import Frame, Note, TimeOffset


class Autopilot(Protocol):
    """What the backseat asks of an autopilot, whatever its make."""

    @property
    def autopilot_heartbeat_ns(self) -> int | None:
        """When the autopilot's heartbeat was last heard."""
        ...

    @property
    def clock(self) -> TimeOffset | None:
        """How far the autopilot's clock is from ours."""
        ...

    @property
    def notes(self) -> tuple[Note, ...]:
        """What is worth a line of words: hazards and refusals."""
        ...

    @property
    def findings(self) -> list[Finding]:
        """The autopilot's parameters that matter, held against what they must be."""
        ...

    def receive(self, frame: Frame) -> list[NamedMeasurement]:
        """(message name, measurement) of all in one frame."""
        ...

    def counters(self) -> tuple[tuple[str, int], ...]: ...

    def poll(self, t_ns: int) -> list[Frame]:
        """What is due without being asked for; after the motors of the tick."""
        ...

    def drive(self, t_ns: int, port_us: int, starboard_us: int) -> list[Frame]:
        """Both motors, as pulse widths (us)."""
        ...

    def release(self, t_ns: int) -> list[Frame]:
        """Let go of the motors."""
        ...

    def request_mode(self, t_ns: int, mode: str) -> list[Frame]:
        """Ask for a mode by name, at most once a second; nothing for a name that the autopilot does not have."""
        ...

    def request_arming(self, t_ns: int) -> list[Frame]:
        """Ask to arm, with all checks, at most once a second."""
        ...
