"""Clients of the simulator interfaces for tests, with the messages and timing of the real autopilots."""

from __future__ import annotations

import asyncio
import json
import re
import socket
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from asvhil.io.mavlink.frames import FrameSplitter, decode
from asvhil.io.mavlink.frames import dialect as mav
from asvhil.simplant.hil.server import HilServer
from asvhil.types import Frame

NEUTRAL = (1500, 1500)
MAGIC = {16: 18458, 32: 29569}
NUMBER = r"-?[0-9]+(?:\.[0-9]+)?"


class FixedOutputs:
    """An autopilot for a plant in this process: its outputs are what a test sets, and it sends nothing."""

    outputs_us = NEUTRAL

    def receive(self, frame: Frame) -> None:
        pass

    def loop(self, t_ns: int) -> list[Frame]:
        return []


def servo_frame(count: int, pulses_us: tuple[int, int] = NEUTRAL, rate_hz: int = 400, channels: int = 16) -> bytes:
    """A frame with the port motor on channel 1 and the starboard motor on channel 3, the others at 1000."""
    pwm = [1000] * channels
    pwm[0], pwm[2] = pulses_us
    return struct.pack(f"<HHI{channels}H", MAGIC[channels], rate_hz, count, *pwm)


def as_ardupilot_reads(reply: bytes) -> dict[str, Any]:
    """The values that ArduPilot's text search finds in a reply, and a check that they are what JSON says.

    It looks for the key's section first, then for the first `"key":` behind it, and reads there what it can.
    """
    assert reply.startswith(b"\n{") and reply.endswith(b"}\n") and reply.count(b"\n") == 2 and len(reply) < 1000
    text = reply.decode("ascii")
    tree = json.loads(text)

    def find(section: str, key: str) -> str:
        at = text.index(section) + len(section) + 1 if section else 0
        at = text.index(key, at)
        return text[at + len(key) + 2 :]  # behind `":`

    def vector(section: str, key: str) -> list[float]:
        match = re.match(rf"\[\s*({NUMBER}),\s*({NUMBER}),\s*({NUMBER})\]", find(section, key))
        assert match, key
        return [float(part) for part in match.groups()]

    def scalar(section: str, key: str) -> float:
        match = re.match(NUMBER, find(section, key))
        assert match, key
        return float(match[0])

    found: dict[str, Any] = {
        "timestamp": scalar("", "timestamp"),
        "imu": {"gyro": vector("imu", "gyro"), "accel_body": vector("imu", "accel_body")},
        "position": vector("", "position"),
        "attitude": vector("", "attitude"),
        "velocity": vector("", "velocity"),
    }
    if "windvane" in tree:
        found["windvane"] = {key: scalar("windvane", key) for key in ("direction", "speed")}
    assert found == {key: tree[key] for key in found}
    return found | {key: value for key, value in tree.items() if key not in found}


class JsonAutopilot:
    """ArduPilot's side over UDP: sends a frame, waits for the answer; `resend` is what it does after a second."""

    def __init__(self, address: str, *, rate_hz: int = 400, channels: int = 16) -> None:
        host, _, port = address.rpartition(":")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect((host, int(port)))
        self._socket.settimeout(5.0)
        self.rate_hz, self.channels = rate_hz, channels
        self.count = -1
        self._last = b""

    def __enter__(self) -> JsonAutopilot:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def send(self, data: bytes) -> None:
        self._socket.send(data)

    def recv(self) -> bytes:
        return self._socket.recv(4096)

    def silent(self) -> bool:
        """Nothing comes for a while."""
        self._socket.settimeout(0.2)
        try:
            self._socket.recv(4096)
        except TimeoutError:
            return True
        finally:
            self._socket.settimeout(5.0)
        return False

    def post(self, pulses_us: tuple[int, int] = NEUTRAL) -> None:
        """Send the next frame and do not wait."""
        self.count += 1
        self._last = servo_frame(self.count, pulses_us, self.rate_hz, self.channels)
        self.send(self._last)

    def frame(self, pulses_us: tuple[int, int] = NEUTRAL) -> bytes:
        """The next frame and its answer."""
        self.post(pulses_us)
        return self.recv()

    def resend(self) -> bytes:
        self.send(self._last)
        return self.recv()

    def run(self, frames: int, pulses_us: tuple[int, int] = NEUTRAL) -> dict[str, Any]:
        reply = b""
        for _ in range(frames):
            reply = self.frame(pulses_us)
        return as_ardupilot_reads(reply)


class Px4:
    """PX4's side over a stream socket. `answer_every`: a rover's loop that runs on each n-th sample only."""

    def __init__(self, stream: socket.socket, *, lockstep: bool = True, answer_every: int = 1) -> None:
        self._stream = stream
        self._stream.settimeout(5.0)
        self._mav = mav.MAVLink(None, srcSystem=1, srcComponent=1)
        self._splitter = FrameSplitter()
        self._flags = 1 if lockstep else 0
        self._answer_every = answer_every
        self.seen: list[Any] = []
        self.samples = 0
        self.time_us = 0
        self.controls = [0.0] * 16
        self.armed = False

    @classmethod
    def connect(cls, address: str, **kind: Any) -> Px4:
        host, _, port = address.rpartition(":")
        return cls(socket.create_connection((host, int(port)), timeout=5.0), **kind)

    def __enter__(self) -> Px4:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    def send(self, message: Any) -> None:
        self._stream.sendall(message.pack(self._mav))

    def send_bytes(self, data: bytes) -> None:
        self._stream.sendall(data)

    def boot(self) -> None:
        """What it says first: one heartbeat, and the wish to be told the truth each 5 ms."""
        self.send(mav.MAVLink_heartbeat_message(0, mav.MAV_AUTOPILOT_PX4, 0, 0, 0, 3))
        self.send(mav.MAVLink_command_long_message(0, 0, 511, 0, 115, 5e3, 0, 0, 0, 0, 0))

    def drive(self, port: float, starboard: float) -> None:
        self.armed = True
        self.controls[0], self.controls[1] = port, starboard

    def answer(self, time_us: int | None = None) -> None:
        """HIL_ACTUATOR_CONTROLS; all zero while disarmed, as PX4 does."""
        controls = self.controls if self.armed else [0.0] * 16
        mode = 129 if self.armed else 1
        time_us = self.time_us if time_us is None else time_us
        self.send(mav.MAVLink_hil_actuator_controls_message(time_us, controls, mode, self._flags))

    def receive(self) -> list[Any]:
        """What one read of the socket brings."""
        data = self._stream.recv(4096)
        assert data, "the simulator closed the connection"
        found = [decode(frame) for frame in self._splitter.receive(data)]
        self.seen += found
        return found

    def run(self, samples: int) -> None:
        """Take samples and answer them until so many more have come."""
        end = self.samples + samples
        while self.samples < end:
            for message in self.receive():
                if message.get_type() == "HIL_SENSOR":
                    assert message.time_usec > self.time_us
                    self.time_us = message.time_usec
                    self.samples += 1
                    if self.samples % self._answer_every == 0:
                        self.answer()

    def of(self, name: str) -> list[Any]:
        return [message for message in self.seen if message.get_type() == name]


@asynccontextmanager
async def serving(server: HilServer) -> AsyncIterator[str]:
    """The address of a running server; clients are to run in threads. An error of the server is raised at the end."""
    task = asyncio.create_task(server.run())
    while not server.address and not task.done():
        await asyncio.sleep(0.005)
    try:
        yield server.address
    finally:
        server.stop()
        await task
