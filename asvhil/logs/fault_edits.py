"""Faults of sensors and links put into the recorded frames of a log, as the simulated boat shows them.

Each kind does to the bytes of a device what docs/sensors.md says of it. The motion of the boat stays as recorded, so a
fault of the motors cannot be put in: it would have moved the boat otherwise.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from asvhil.config import Config, FaultConfig
from asvhil.config.fault_spans import Faults, Present
from asvhil.config.ports import ANEMOMETER, AUTOPILOT
from asvhil.errors import ConfigError
from asvhil.logs.clock import TickClock
from asvhil.logs.fault_messages import MessageEdits
from asvhil.logs.fault_sentences import SentenceEdits
from asvhil.types import Frame, Inputs, changed

SENSORS = (
    *("gnss-jump", "gnss-frozen", "gnss-silent", "imu-silent"),
    *("heading-jump", "heading-drift", "heading-silent", "compass-turned"),
)
EDITS = (*SENSORS, "gnss", "ins-gnss", "anemometer", "anemometer-stuck", "vane", "cups", "ins", "nmea")
SENTENCES, BINARY = "nmea", "vectornav"  # kinds of link


class Edits(Protocol):
    """The edits of one port: the bytes of a frame with the faults that are present in it."""

    def apply(self, frame: Frame, present: Present) -> bytes: ...


class Lines:
    """A line that is all silent, or as it was recorded."""

    def __init__(self, kind: str) -> None:
        self._kind = kind

    def apply(self, frame: Frame, present: Present) -> bytes:
        """Nothing while the line is silent."""
        return b"" if self._kind in present else frame.data


class FaultEdits:
    """`apply` gives the inputs of a tick with the faults in them; their times are those of `clock`.

    `edited` counts the frames that are not as recorded. `untouched` are the ports of sensors whose bytes have a form
    that no edit of these faults knows. ConfigError for a kind that cannot be put into a log.
    """

    def __init__(self, faults: Iterable[FaultConfig], config: Config) -> None:
        self._faults = tuple(faults)
        for fault in self._faults:
            if fault.kind not in EDITS:
                known = ", ".join(EDITS)
                raise ConfigError(
                    f"--fault {fault.kind}: cannot be put into a log, whose boat moves as recorded (these can: {known})"
                )
        self._spans = Faults(self._faults, 0)
        self.clock = TickClock(1.0 / config.daemon.tick_hz)
        self._edits: dict[str, Edits] = {AUTOPILOT: MessageEdits()}
        untouched = []
        kinds = {fault.kind for fault in self._faults}
        for port in config.links.sensor_links():
            kind = config.links.kind_of(port)
            if kind == SENTENCES:
                self._edits[port] = SentenceEdits(silenced_by="anemometer" if port == ANEMOMETER else "nmea")
            else:
                self._edits[port] = Lines("ins" if kind == BINARY else "")
                if not kinds.isdisjoint((*SENSORS, "ins-gnss")):
                    untouched.append(port)
        self.untouched = tuple(untouched)
        self.edited = 0

    def apply(self, inputs: Inputs) -> Inputs:
        """The inputs with the faults that are present; without a change, the very same."""
        self.clock.tick(inputs.t_ns)
        frames: list[Frame] = []
        edited = 0
        for frame in inputs.frames:
            edits = self._edits.get(frame.port)
            data = frame.data if edits is None else edits.apply(frame, self._spans.at(self.clock.since_ns(frame.t_ns)))
            if data == frame.data:
                frames.append(frame)
                continue
            edited += 1
            if data:
                frames.append(changed(frame, data=data))
        self.edited += edited
        return changed(inputs, frames=tuple(frames)) if edited else inputs
