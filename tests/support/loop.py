"""A boat and a backseat in lockstep, with a ground station beside them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from asvhil.config import Config
from asvhil.geo import LocalFrame
from asvhil.io.mavlink.frames import dialect, renumbered
from asvhil.io.mavlink.texts import TextReader
from asvhil.logs.recorder import Recorder
from asvhil.operator.encoding import encode_hold
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Inputs, Outputs
from tests.support.messages import messages, overrides_us

GROUND_STATION = "10.0.0.9:14550"
# For tests of what the controller plays no part in: no model, no optimisation, and so a third of the time.
PLAIN_CONTROLLER = "controller.name=backstepping"
DEFAULT_CONTROLLER = "controller.name=lagnet-mpc"
STATION_DEG = (40.4237, -86.9212)  # latitude and longitude of the simulated boat's start


class GroundStationLoop(Lockstep):
    """Lockstep with an operator: sends commands, and keeps what the backseat sends.

    `outputs` are those of the last tick. `heard` (messages to operators), `texts` and `results` (MAV_RESULT) are all
    since the start, `overrides_us` (port, starboard) those of each tick.
    """

    def __init__(self, config: Config, recorder: Recorder | None = None) -> None:
        super().__init__(config, recorder)
        self.outputs: Outputs | None = None
        self.heard: list[Any] = []
        self.texts: list[str] = []
        self.results: list[int] = []
        self.overrides_us: list[list[tuple[int, int]]] = []
        self._reader = TextReader()
        self._sender = dialect.MAVLink(None, srcSystem=255, srcComponent=190)

    def tick(self) -> tuple[Inputs, Outputs]:
        inputs, self.outputs = super().tick()
        self.overrides_us.append(overrides_us(self.outputs.frames))
        for message in messages(self.outputs.frames, "operator"):
            self.heard.append(message)
            if message.get_type() == "COMMAND_ACK":
                self.results.append(message.result)
            elif message.get_type() == "STATUSTEXT" and (text := self._reader.receive(message)) is not None:
                self.texts.append(text)
        return inputs, self.outputs

    @property
    def frontseat(self) -> Any:
        """The simulated autopilot."""
        return self.plant.frontseat

    def step(self) -> Outputs:
        """The outputs of one more tick."""
        return self.tick()[1]

    def wait(self, seconds: float, until: Callable[[Outputs], bool] = lambda outputs: False) -> Outputs:
        """Tick for a time, or until the outputs meet a condition: the last outputs."""
        for _ in range(round(seconds * self.config.daemon.tick_hz)):
            if until(self.step()):
                break
        assert self.outputs is not None
        return self.outputs

    def say(self, message: Any) -> None:
        """Send a message, or a frame, from the ground station. Frames are numbered, as a ground station does."""
        data = message if isinstance(message, bytes) else bytes(message.pack(self._sender))
        self.inject("operator", renumbered(data, self._sender.seq), GROUND_STATION)
        self._sender.seq = (self._sender.seq + 1) % 256

    def ask_to_hold(self, at_deg: tuple[float, float] | None = None, psi_rad: float | None = None) -> Outputs:
        """Send a hold command and tick: the outputs. None: as the boat is now."""
        lat_deg, lon_deg = (None, None) if at_deg is None else at_deg
        self.say(encode_hold(self.config.links.autopilot, lat_deg, lon_deg, psi_rad))
        return self.step()


def place_error_m(loop: Lockstep, outputs: Outputs) -> float | None:
    """How far (m) the estimate is from where the boat truly is; None while it is not valid."""
    estimate, truth = outputs.estimate, loop.plant.truth
    if estimate is None or not estimate.valid or outputs.origin_deg is None:
        return None
    lat_deg, lon_deg = outputs.origin_deg
    place = LocalFrame(lat_deg=lat_deg, lon_deg=lon_deg).to_geodetic(estimate.n_m, estimate.e_m)
    n_m, e_m = loop.plant.origin.to_ned(*place)
    return math.hypot(n_m - truth.n_m, e_m - truth.e_m)
