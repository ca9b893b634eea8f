"""A simulated vehicle in dock and a preflight's survey of it, in virtual time."""

from collections.abc import Collection

from asvhil.config import load_config
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect, message_id
from asvhil.preflight.checks import checks_of
from asvhil.preflight.survey import Survey
from asvhil.preflight.table import Check, Result
from asvhil.simplant.lockstep import EPOCH_NS
from asvhil.simplant.plant import Plant
from asvhil.types import Frame, Inputs

TICK_NS = 50_000_000
S = 1_000_000_000


class Dock:
    """A simulated vehicle and a survey on one virtual clock; all that the survey says is kept."""

    def __init__(self, *overrides: str, config: str = "sitl", lost: Collection[str] = (), dead: str = "") -> None:
        self.config = load_config(config, overrides)
        self.plant = Plant(self.config, EPOCH_NS)
        self.t_ns = EPOCH_NS
        self.said: list[dialect.MAVLink_message] = []
        self._lost = {getattr(dialect, f"MAVLINK_MSG_ID_{name}") for name in lost}
        self._dead = dead
        self.survey = Survey(self.config)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * S / TICK_NS)):
            self.t_ns += TICK_NS
            frames = [f for f in self.plant.advance(self.t_ns) if f.port != self._dead and not self._is_lost(f)]
            for frame in self.survey.step(Inputs(t_ns=self.t_ns, frames=tuple(frames))):
                if frame.port == "autopilot":
                    self.said += [m for d in FrameSplitter().receive(frame.data) if (m := decode(d)) is not None]
                self.plant.receive(frame)

    def _is_lost(self, frame: Frame) -> bool:
        return frame.port == "autopilot" and message_id(frame.data) in self._lost

    def look(self) -> list[Check]:
        """A survey from the first heartbeat to the end, 25 s at most: what it made of the vehicle."""
        self.survey = Survey(self.config)
        for _ in range(50):
            self.run(0.5)
            if self.survey.stage == "done":
                break
        assert self.survey.stage == "done"
        return checks_of(self.survey)


def bad(checks: list[Check]) -> dict[str, Result]:
    """What did not pass."""
    return {c.item: c.result for c in checks if c.result is not Result.PASS}


def of(checks: list[Check], item: str) -> Check:
    (found,) = [check for check in checks if check.item == item]
    return found
