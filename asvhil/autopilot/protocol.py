"""What the backseat asks of an autopilot."""

from __future__ import annotations

from typing import Protocol

from asvhil.autopilot.requirements import Finding
from asvhil.io.sensors.protocol import NamedMeasurement
from asvhil.supervisor.reasons import Explanation
from asvhil.supervisor.situation import StationSticks
from asvhil.types import Frame, Note, TimeOffset


class Autopilot(Protocol):
    """An autopilot, whatever its make: frames in, measurements and status out, and the frames to send to it."""

    @property
    def autopilot_heartbeat_ns(self) -> int | None:
        """When the last heartbeat was received, which tells mode and arming; None before the first."""
        ...

    @property
    def autopilot_heard_ns(self) -> int | None:
        """When anything was last received of the autopilot's own component; None before its first heartbeat."""
        ...

    @property
    def stranger(self) -> Explanation | None:
        """Why the vehicle on the link is not ours to drive; None where it is."""
        ...

    @property
    def slow_stream(self) -> Explanation | None:
        """A message that comes too slowly to begin a hold, while it is being asked for again."""
        ...

    @property
    def clock(self) -> TimeOffset | None:
        """The autopilot's clock less ours; None before the first exchange."""
        ...

    @property
    def notes(self) -> tuple[Note, ...]:
        """Hazards and refusals, for operators and the log."""
        ...

    @property
    def findings(self) -> list[Finding]:
        """The required parameters, compared with what was read."""
        ...

    @property
    def unbounded(self) -> str:
        """Why nothing would stop the motors if this program died in a hold; empty where something does."""
        ...

    @property
    def unread_wiring(self) -> str:
        """A parameter that tells how the motors are wired, and is still waited for; empty where none is."""
        ...

    @property
    def way_fault(self) -> Explanation | None:
        """Why the way to the motors is shut, as far as it tells by itself; None where it is open."""
        ...

    def receive(self, frame: Frame) -> list[NamedMeasurement]:
        """(message name, measurement) of each measurement in one frame."""
        ...

    def receive_of_operator(self, frame: Frame) -> None:
        """Look at a frame of the operator's port for what the pilot's ground station says."""
        ...

    @property
    def station_heard_ns(self) -> int | None:
        """When a ground station of the pilot was heard last; None: never."""
        ...

    def take_station_sticks(self) -> tuple[StationSticks, ...]:
        """What was heard, since the last call, of sticks of ground stations that the autopilot obeys."""
        ...

    @property
    def keeps_override(self) -> bool:
        """Whether the last override of a stick stands after its release, for want of a receiver to take its place."""
        ...

    @property
    def driven_sticks_us(self) -> tuple[int, int] | None:
        """Where the last command of the motors has put their sticks (RC values); None where it overrides none."""
        ...

    def data_to_send(self, t_ns: int) -> list[Frame]:
        """What is due in this tick besides the motors; called after them."""
        ...

    def counters(self) -> tuple[tuple[str, int], ...]:
        """(name, count) of what was received and dropped."""
        ...

    def drive(self, t_ns: int, port_us: int, starboard_us: int) -> list[Frame]:
        """Both motors, as pulse widths (us)."""
        ...

    def release(self, t_ns: int) -> list[Frame]:
        """Give the motors back."""
        ...

    def last_words(self, t_ns: int, *, neutral: bool) -> list[list[Frame]]:
        """What another process is to send, step by step, if this one dies before its next tick; changes nothing here.

        `neutral`: before the release, since the motors are driven.
        """
        ...

    def request_mode(self, t_ns: int, mode: str) -> list[Frame]:
        """Ask for a mode by name, at most once a second; nothing for a name that the autopilot does not have."""
        ...

    def request_arming(self, t_ns: int) -> list[Frame]:
        """Ask to arm, with all checks, at most once a second."""
        ...
