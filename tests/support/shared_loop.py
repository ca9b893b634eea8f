"""A loop whose link to the autopilot is shared with others."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable

from asvhil.config import load_config
from asvhil.simplant.plant import Plant
from asvhil.types import Frame, Outputs, Phase
from tests.support.loop import PLAIN_CONTROLLER, GroundStationLoop
from tests.support.lossy_plant import Way, whole

S = 1_000_000_000
BOAT, OTHER_BOAT = "10.0.0.1:14550", "10.0.0.2:14550"
Talk = Callable[[int, int], Iterable[Frame]]  # (tick, t_ns) to what others send
NEUTRAL = (1500, 1500)
HOLD_MODE = 4  # of an ArduRover


class SharedLoop(GroundStationLoop):
    """A boat at a peer of its own, and whoever talks beside it.

    `way` gives what becomes of a frame of the boat. `others` are boats at one more peer, and `talk` anybody else.
    """

    def __init__(self, *overrides: str, config: str = "sitl") -> None:
        super().__init__(load_config(config, (PLAIN_CONTROLLER, "supervisor.engage=command", *overrides)))
        self.talk: Talk = lambda tick, t_ns: ()
        self.way: Way = whole
        self.sent: list[bytes] = []  # to the autopilot, in the last tick
        self.others: list[Plant] = []
        self.peers = (BOAT, OTHER_BOAT)

    def receive(self) -> tuple[Frame, ...]:
        frames: list[Frame] = []
        for frame in super().receive():
            if frame.port == "autopilot":
                frames += self.way(dataclasses.replace(frame, peer=self.peers[0]))
            else:
                frames.append(frame)
        for other in self.others:
            frames += [
                dataclasses.replace(frame, peer=self.peers[1])
                for frame in other.advance(self.t_ns)
                if frame.port == "autopilot"
            ]
        return (*frames, *self.talk(self.ticks, self.t_ns))

    def deliver(self, frames: tuple[Frame, ...]) -> None:
        super().deliver(frames)
        self.sent = [frame.data for frame in frames if frame.port == "autopilot"]
        for frame in frames:
            for boat in self.others:
                boat.receive(frame)

    def ready(self) -> SharedLoop:
        """Armed, and ready for a hold."""
        self.wait(7.5)
        for boat in (self.plant, *self.others):
            assert boat.frontseat.arm(True)
        self.wait(0.5)
        return self

    def held(self, seconds: float) -> Outputs:
        """Ticks for a time in which the station is held throughout: the last outputs."""
        outputs = self.wait(seconds, lambda outputs: outputs.phase is not Phase.HOLD)
        assert outputs.phase is Phase.HOLD, outputs.health.reason
        return outputs

    def neutral_at_the_end(self) -> None:
        """The last tick has sent neutral, then release."""
        assert self.overrides_us[-1][0] == NEUTRAL and self.overrides_us[-1][-1] == (0, 0)
