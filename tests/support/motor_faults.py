"""A boat whose autopilot is set wrong, in lockstep, and a link that loses chosen messages."""

from __future__ import annotations

import random
from collections.abc import Collection
from typing import Any

from asvhil.config import load_config
from asvhil.io.mavlink.frames import FrameSplitter, checksum, decode, dialect, message_id
from asvhil.operator.session import encode_hold
from asvhil.simplant.lockstep import Lockstep
from asvhil.supervisor.reasons import Reason
from asvhil.types import Frame, Outputs, Phase

# What may be wrong: parameters of the vehicle, and the reason that is found without reading them.
WRONG: dict[str, tuple[dict[str, float], Reason]] = {
    "overrides ignored": ({"SYSID_MYGCS": 255}, Reason.OVERRIDES_IGNORED),
    "RC_OPTIONS": ({"RC_OPTIONS": 34}, Reason.OVERRIDES_IGNORED),
    "dead zones": ({"RC1_DZ": 30, "RC3_DZ": 30}, Reason.OUTPUTS_DIFFER),
    "one dead zone": ({"RC3_DZ": 40}, Reason.OUTPUTS_DIFFER),
    "slew": ({"MOT_SLEWRATE": 100}, Reason.OUTPUTS_DIFFER),
    "swapped": ({"SERVO1_FUNCTION": 74, "SERVO3_FUNCTION": 73}, Reason.OUTPUTS_SWAPPED),
    "reversed": ({"SERVO1_REVERSED": 1}, Reason.OUTPUT_REVERSED),
    "both reversed": ({"SERVO1_REVERSED": 1, "SERVO3_REVERSED": 1}, Reason.OUTPUT_REVERSED),
    "mixed": ({"PILOT_STEER_TYPE": 0}, Reason.COMMANDS_MIXED),
    "no motor": ({"SERVO1_FUNCTION": 0, "SERVO3_FUNCTION": 0}, Reason.OUTPUT_STUCK),
    "no port motor": ({"SERVO1_FUNCTION": 0}, Reason.OUTPUT_STUCK),
    "scaled": (
        {f"SERVO{n}_{end}": us for n in (1, 3) for end, us in (("MIN", 1100), ("MAX", 1900))},
        Reason.OUTPUTS_DIFFER,
    ),
}

# As much as can be known of overrides that are ignored where neither parameters nor sticks are reported.
BLIND_REASON = Reason.OUTPUTS_UNCHANGED


class Lossy:
    """A plant that some messages of the autopilot never leave, and others by chance."""

    def __init__(self, plant: Any, lost: Collection[str], loss: float = 0.0) -> None:
        self._plant = plant
        self._lost = {getattr(dialect, f"MAVLINK_MSG_ID_{name}") for name in lost}
        self._loss, self._chance = loss, random.Random(3)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plant, name)

    def advance(self, t_ns: int) -> list[Frame]:
        return [frame for frame in self._plant.advance(t_ns) if frame.port != "autopilot" or self._passes(frame)]

    def _passes(self, frame: Frame) -> bool:
        return message_id(frame.data) not in self._lost and self._chance.random() >= self._loss


class Trial:
    """Wait until all is ready, arm, ask to hold, and see what becomes of it."""

    def __init__(self, parameters: dict[str, float], *overrides: str, lost: Collection[str] = ()) -> None:
        values = ", ".join(f"{name}: {value}" for name, value in parameters.items())
        settings = ("supervisor.engage=command", f"plant.frontseat.parameters={{{values}}}", *overrides)
        self.loop = Lockstep(load_config("sitl", settings))
        self.loop.plant = Lossy(self.loop.plant, lost)  # type: ignore[assignment]
        self.words: list[str] = []
        self.commands = 0
        self.results: list[int] = []
        self.overrides: list[list[tuple[int, int]]] = []  # of each tick
        for _ in range(140):
            self.tick()
        assert self.loop.plant.frontseat.rover.arm(force=True)  # a real one refuses some of these
        for _ in range(10):
            self.tick()
        self.words.clear()

    def tick(self) -> Outputs:
        _, outputs = self.loop.tick()
        self.overrides.append([])
        for frame in outputs.frames:
            for data in FrameSplitter().receive(frame.data):
                message = decode(data)
                assert message is not None
                if message.get_type() == "STATUSTEXT":
                    self.words.append(message.text)
                elif message.get_type() == "COMMAND_ACK":
                    self.results.append(message.result)
                elif message.get_type() == "RC_CHANNELS_OVERRIDE":
                    self.overrides[-1].append((message.chan1_raw, message.chan3_raw))
        return outputs

    def hold(self, limit_s: float = 6.0) -> tuple[float | None, Outputs]:
        """Seconds until the motors are let go after a hold (0: refused; None: it goes on), and the last outputs."""
        self.commands += 1  # numbered, as `asvhil hold` does: the same bytes again would be a repetition
        asked = encode_hold(self.loop.config.links.autopilot, 40.4237, -86.9212, 0.0)
        body = asked[:4] + bytes([self.commands % 256]) + asked[5:-2]
        self.loop.inject("operator", body + checksum(body), "10.0.0.1:9")
        start_ns = self.loop.t_ns
        outputs = self.tick()
        if self.results[-1] != 0:
            return 0.0, outputs
        while (self.loop.t_ns - start_ns) * 1e-9 < limit_s:
            if outputs.phase is Phase.STANDBY:
                return (self.loop.t_ns - start_ns) * 1e-9, outputs
            outputs = self.tick()
        return None, outputs
