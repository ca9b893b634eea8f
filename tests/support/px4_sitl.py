"""PX4's side of HIL on MAVLink, as a script of what it sends and hears."""

from __future__ import annotations

from typing import Any

from asvhil.config import load_config
from asvhil.io.mavlink.frames import FrameSplitter, decode
from asvhil.io.mavlink.frames import dialect as mav
from asvhil.simplant.hil.px4 import Px4Hil
from asvhil.types import Frame

MS = 1_000_000
SECOND = 1000 * MS
FREE = "plant.hil.neutral_first_s=0"
CALM = "plant.weather.wind.speed_mps=0"
FAST = "plant.hil.px4.speed=0"
ARMED = 129
INERTIAL, ALL = 0x3F, 0x1BFF
COMPASS = 0b111000000


class Sitl:
    """A client without a network, on a clock of its own."""

    def __init__(self, *overrides: str, boot: bool = True) -> None:
        self.hil = Px4Hil(load_config("sitl", overrides))
        self.mav = mav.MAVLink(None, srcSystem=1, srcComponent=1)
        self.splitter = FrameSplitter()
        self.t_ns = 5 * SECOND
        self.flags = 1
        self.ports: list[str] = []
        self.hil.connect(self.t_ns)
        if boot:
            self.send(mav.MAVLink_heartbeat_message(0, mav.MAV_AUTOPILOT_PX4, 0, 0, 0, 3))

    def send_bytes(self, data: bytes) -> list[Any]:
        return self.read(self.hil.receive(Frame(t_ns=self.t_ns, port="physics", data=data)))

    def send(self, message: Any) -> list[Any]:
        return self.send_bytes(bytes(message.pack(self.mav)))

    def read(self, frames: list[Frame]) -> list[Any]:
        self.ports += [frame.port for frame in frames]
        data = b"".join(frame.data for frame in frames if frame.port == "physics")
        return [decode(part) for part in self.splitter.receive(data)]

    def wait(self, span_ns: int) -> list[Any]:
        """All that goes out while so much time passes and nothing comes."""
        end_ns, found = self.t_ns + span_ns, []
        while self.hil.next_ns <= end_ns:
            self.t_ns = max(self.t_ns, self.hil.next_ns)
            found += self.read(self.hil.poll(self.t_ns))
        self.t_ns = end_ns
        return found

    def next(self) -> list[Any]:
        """What goes out until the next sample has, which is the last of it."""
        found: list[Any] = []
        while not of(found, "HIL_SENSOR"):
            self.t_ns = max(self.t_ns, self.hil.next_ns)
            found += self.poll()
        return found

    def poll(self) -> list[Any]:
        return self.read(self.hil.poll(self.t_ns))

    def answer(self, time_us: int, port: float = 0.0, starboard: float = 0.0, mode: int = ARMED) -> None:
        controls = [port, starboard, *[0.0] * 14]
        assert self.send(mav.MAVLink_hil_actuator_controls_message(time_us, controls, mode, self.flags)) == []

    def lockstep(self, samples: int, port: float = 0.0, starboard: float = 0.0, mode: int = ARMED) -> list[Any]:
        """Answer sample by sample; all that was sent."""
        found: list[Any] = []
        for _ in range(samples):
            new = self.next()
            sample = new[-1]
            found += new
            self.answer(sample.time_usec, port, starboard, mode)
        return found

    def ask(self, msg_id: float, interval_us: float, command: int = 511) -> int:
        (ack,) = self.send(mav.MAVLink_command_long_message(0, 0, command, 0, msg_id, interval_us, 0, 0, 0, 0, 0))
        assert ack.command == command
        return int(ack.result)


def of(messages: list[Any], name: str) -> list[Any]:
    return [message for message in messages if message.get_type() == name]


def samples_us(messages: list[Any]) -> list[int]:
    return [message.time_usec for message in of(messages, "HIL_SENSOR")]


def mean_of(samples: list[Any], name: str) -> float:
    return sum(getattr(sample, name) for sample in samples) / len(samples)
