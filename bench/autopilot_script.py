"""The script on an ArduRover, measured in real time: `python -m bench.autopilot_script`. It arms and moves the motors.

For an autopilot in software in the loop (or the simulated one), on which `asvhil script install` was run, in HOLD or to
be put there. A companion (1/191) sends orders at 20 Hz; a ground station (255/190), on a link of its own where
`--station` names one, has the mode changed, the sticks, the emergency stop and the arming.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import random
import signal
import socket
import statistics
import struct
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from asvhil.autopilot.script_protocol import PAYLOAD_TYPE, AliveSign, Order, ScriptReason
from asvhil.io.mavlink.frames import FrameSplitter, decode, source
from asvhil.io.mavlink.frames import dialect as mav
from bench.ending import end_in_words

OWN, STATION, AUTOPILOT = (1, 191), (255, 190), (1, 1)
EVERY_S = 0.05
HELD, OTHER = (1600, 1400), (1700, 1300)
SERVO_OUTPUT_RAW, RC_CHANNELS = 36, 65
ARM, SET_MODE, AUX_FUNCTION, INTERVAL = 400, 176, 218, 511
EMERGENCY_STOP, HIGH, LOW = 31, 2, 0
HOLD, MANUAL = 4, 0


class Rig:
    """Both ends that speak to the autopilot, polled. `outputs`: the time, and the pulses of port and starboard."""

    def __init__(self, port: int, station: int | None, motors: tuple[int, int], neutral_us: int) -> None:
        self.udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.udp.bind(("127.0.0.1", port))
        self.udp.setblocking(False)
        self.tcp = None if station is None else socket.create_connection(("127.0.0.1", station))
        if self.tcp is not None:
            self.tcp.setblocking(False)
        self.motors, self.neutral = motors, (neutral_us, neutral_us)
        self.peer: Any = None
        self.alive = AliveSign()
        self.armed = False
        self.mode = -1
        self.outputs: list[tuple[float, tuple[int, int]]] = []
        self.boot: list[tuple[float, float]] = []  # our time, and the autopilot's
        self.start = self.count = 0
        self._splitters = FrameSplitter(), FrameSplitter()
        self._acks: list[tuple[int, int]] = []
        self._beat_s = 0.0

    # --- messages ----------------------------------------------------------------------------------------------

    def pump(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Carry messages for a time, or until a condition holds; whether it does."""
        end_s = time.monotonic() + seconds
        while not until():
            if time.monotonic() >= end_s:
                return False
            if self.peer is not None and time.monotonic() >= self._beat_s:
                self._beat_s = time.monotonic() + 1.0
                self.say(mav.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
                self.order_of_station(mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
            if not self._read():
                time.sleep(0.0005)
        return True

    def _read(self) -> bool:
        found = False
        try:
            while True:
                data, self.peer = self.udp.recvfrom(4096)
                found = True
                for frame in self._splitters[0].receive(data):
                    if source(frame) == AUTOPILOT:
                        self._take(decode(frame))
        except BlockingIOError:
            pass
        if self.tcp is not None:
            try:
                self._splitters[1].receive(self.tcp.recv(65536))
                found = True
            except BlockingIOError:
                pass
        return found

    def _take(self, m: Any) -> None:
        now_s = time.monotonic()
        match m.get_type() if m is not None else "":
            case "NAMED_VALUE_FLOAT":
                self.alive.receive(round(now_s * 1e9), m)
            case "SERVO_OUTPUT_RAW":
                port, starboard = (getattr(m, f"servo{n}_raw") for n in self.motors)
                self.outputs.append((now_s, (port, starboard)))
                self.boot.append((now_s, m.time_usec * 1e-6))
            case "HEARTBEAT":
                self.armed, self.mode = bool(m.base_mode & 128), m.custom_mode
            case "COMMAND_ACK":
                self._acks.append((m.command, m.result))

    def say(self, message: Any, sender: tuple[int, int] = OWN) -> None:
        """By the companion's link."""
        self.put(bytes(message.pack(mav.MAVLink(None, *sender))))

    def put(self, frame: bytes) -> None:
        self.udp.sendto(frame, self.peer)

    def order_of_station(self, message: Any) -> None:
        """By the ground station."""
        frame = bytes(message.pack(mav.MAVLink(None, *STATION)))
        if self.tcp is None:
            self.put(frame)
        else:
            self.tcp.sendall(frame)

    def station_command(self, number: int, *values: float) -> None:
        given = [*values, *[0.0] * (7 - len(values))]
        self.order_of_station(mav.MAVLink_command_long_message(*AUTOPILOT, number, 0, *given))

    def command(self, number: int, *values: float) -> int | None:
        """The result of a command of the companion's."""
        self._acks.clear()
        given = [*values, *[0.0] * (7 - len(values))]
        self.say(mav.MAVLink_command_long_message(*AUTOPILOT, number, 0, *given))
        self.pump(2.0, lambda: any(ack[0] == number for ack in self._acks))
        return self._acks[-1][1] if self._acks else None

    # --- orders ------------------------------------------------------------------------------------------------

    @property
    def out(self) -> tuple[int, int]:
        return self.outputs[-1][1]

    @property
    def reason(self) -> ScriptReason | None:
        return None if self.alive.state is None else self.alive.state.reason

    def order(self, pulses: tuple[int, int], order: int = Order.DRIVE, **wrong: Any) -> bytes:
        """The next order as a frame with a right MAVLink checksum, whatever is wrong inside."""
        self.count += 1
        sender, target = wrong.get("sender", OWN), wrong.get("target", AUTOPILOT)
        start, count = wrong.get("start", self.start), wrong.get("count", self.count)
        body = struct.pack("<BBHIHH", wrong.get("version", 1), order, start % 65536, count, *pulses)
        head = struct.pack("<BBHBBB", *sender, PAYLOAD_TYPE, *target, 16)
        check = struct.pack("<I", zlib.crc32(head + body) ^ wrong.get("xor", 0))
        message = mav.MAVLink_tunnel_message(*target, PAYLOAD_TYPE, 16, (body + check).ljust(128, b"\0"))
        return bytes(message.pack(mav.MAVLink(None, *sender)))

    def stream(self, seconds: float, pulses: tuple[int, int], until: Callable[[], bool] = lambda: False) -> bool:
        """Orders at 20 Hz for a time, or until a condition holds."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            self.put(self.order(pulses))
            if self.pump(EVERY_S, until):
                return True
        return False

    def begin(self) -> None:
        """A new session, at the number that the script tells."""
        self.pump(1.2)
        assert self.alive.state is not None, "no alive sign: run `asvhil script install` first"
        self.start, self.count = self.alive.state.start, 0
        if not self.stream(1.5, HELD, lambda: self.out == HELD):
            raise SystemExit(f"no start: {self.alive.state}, outputs {self.out}, mode {self.mode}, armed {self.armed}")

    def arm(self) -> None:
        """In HOLD."""
        for _ in range(60):
            if self.command(SET_MODE, 1, HOLD) == 0 and self.command(ARM, 1) == 0:
                self.pump(1.5, lambda: self.armed and self.mode == HOLD)
                return
            self.pump(1.0)
        raise SystemExit("it does not arm in HOLD: see its texts in a ground station")


def latency(rig: Rig, runs: int, rng: random.Random, travel: tuple[int, int]) -> dict[str, Any]:
    """From an order to SERVO_OUTPUT_RAW with exactly its pulses."""
    rig.begin()
    found, exact = [], 0
    for _ in range(runs):
        pulses = rng.randint(*travel), rng.randint(*travel)
        at_s = time.monotonic()
        rig.put(rig.order(pulses))
        if rig.pump(0.3, lambda pulses=pulses: rig.out == pulses):  # type: ignore[misc]
            exact += 1
            found.append(time.monotonic() - at_s)
        rig.pump(max(0.0, at_s + EVERY_S + 0.02 * rng.random() - time.monotonic()))
    return {"what": "order to SERVO_OUTPUT_RAW", "exact": exact, **_times(found, runs)}


def killed(rig: Rig, runs: int, rng: random.Random) -> dict[str, Any]:
    """kill -9 of the program that sends."""
    found = []
    for _ in range(runs):
        rig.begin()
        child = multiprocessing.get_context("fork").Process(target=_send_on, args=(rig,))
        child.start()
        rig.pump(0.4 + EVERY_S * rng.random())
        assert rig.out == HELD
        os.kill(child.pid or 0, signal.SIGKILL)
        at_s = time.monotonic()
        if not rig.pump(2.0, lambda: rig.out == rig.neutral):
            raise SystemExit(f"the motors run on: {rig.out}")
        found.append(time.monotonic() - at_s)
        child.join()
    return {"what": "kill -9 of the sender", **_times(found, runs)}


def _send_on(rig: Rig) -> None:
    while True:
        rig.put(rig.order(HELD))
        time.sleep(EVERY_S)


def stopped(
    rig: Rig, what: str, reason: ScriptReason, runs: int, rng: random.Random, stop: Any, undo: Any
) -> dict[str, Any]:
    """While orders go on: until the outputs are others; and whether they come back once the cause is gone."""
    found, again = [], 0
    for _ in range(runs):
        rig.begin()
        rig.stream(0.3 + EVERY_S * rng.random(), HELD)
        at_s = time.monotonic()
        stop()
        if not rig.stream(2.0, HELD, lambda: rig.out != HELD):
            raise SystemExit(f"{what}: the motors run on")
        found.append(time.monotonic() - at_s)
        rig.stream(0.6, HELD)
        assert rig.reason is reason, (what, rig.alive.state)
        undo()
        again += rig.stream(1.0, OTHER, lambda: rig.out == OTHER)
    return {"what": what, "again": again, **_times(found, runs)}


def dropped(rig: Rig, what: str, runs: int, make: Callable[[], bytes]) -> dict[str, Any]:
    """How many frames of a kind move the motors, between good orders."""
    moved = 0
    for _ in range(runs):
        rig.put(rig.order(HELD))
        rig.pump(0.012)
        rig.put(make())
        before = len(rig.outputs)
        rig.pump(0.035)
        moved += any(out != HELD for _, out in rig.outputs[before:])
    return {"what": what, "n": runs, "moved": moved}


def _times(found: list[float], runs: int) -> dict[str, Any]:
    ordered = sorted(found)
    return {
        "n": runs,
        "median_ms": round(1e3 * statistics.median(ordered)),
        "p95_ms": round(1e3 * ordered[int(0.95 * (len(ordered) - 1))]),
        "max_ms": round(1e3 * ordered[-1]),
    }


def measure(rig: Rig, runs: int, seed: int, travel: tuple[int, int]) -> list[dict[str, Any]]:
    """All of it; vehicle disarmed at the end."""
    rng = random.Random(seed)
    rig.pump(10.0, lambda: rig.peer is not None and rig.mode >= 0)
    for number, rate_hz in ((SERVO_OUTPUT_RAW, 40.0), (RC_CHANNELS, 10.0)):
        rig.command(INTERVAL, number, 1e6 / rate_hz)
    rig.arm()

    def sticks(first: int) -> None:
        rig.order_of_station(mav.MAVLink_manual_control_message(1, 32767, first, 0, 32767, 0))

    def flipped() -> bytes:
        frame = bytearray(rig.order(OTHER))
        bit = rng.choice([*range(8 * 4, 8 * 7), *range(8 * 10, 8 * len(frame))])
        frame[bit // 8] ^= 1 << bit % 8
        return bytes(frame)

    rows = [latency(rig, 20 * runs, rng, travel), killed(rig, 2 * runs, rng)]
    release = lambda: rig.put(rig.order(HELD, Order.RELEASE))  # noqa: E731
    rows.append(stopped(rig, "release", ScriptReason.RELEASED, runs, rng, release, lambda: None))
    stop = lambda: rig.station_command(AUX_FUNCTION, EMERGENCY_STOP, HIGH)  # noqa: E731
    lift = lambda: rig.station_command(AUX_FUNCTION, EMERGENCY_STOP, LOW)  # noqa: E731
    rows.append(stopped(rig, "emergency stop", ScriptReason.EMERGENCY_STOP, runs, rng, stop, lift))
    sticks(0)
    rig.pump(0.5)
    moved, back = lambda: sticks(300), lambda: sticks(0)
    rows.append(stopped(rig, "stick of a ground station", ScriptReason.STICK, runs, rng, moved, back))
    manual, hold = lambda: rig.station_command(SET_MODE, 1, MANUAL), lambda: rig.command(SET_MODE, 1, HOLD)
    rows.append(stopped(rig, "mode MANUAL", ScriptReason.MODE, runs, rng, manual, hold))
    disarm = lambda: rig.station_command(ARM, 0)  # noqa: E731
    rows.append(stopped(rig, "disarming", ScriptReason.DISARMED, runs, rng, disarm, rig.arm))
    rig.begin()
    replay = rig.order(OTHER)
    kinds: dict[str, Callable[[], bytes]] = {
        "one bit flipped": flipped,
        "check word wrong": lambda: rig.order(OTHER, xor=4),
        "of system 255": lambda: rig.order(OTHER, sender=(255, 191)),
        "of component 192": lambda: rig.order(OTHER, sender=(1, 192)),
        "for system 2": lambda: rig.order(OTHER, target=(2, 1)),
        "replayed": lambda: replay,
        "of an earlier start": lambda: rig.order(OTHER, start=rig.start - 1, count=10**6),
        "pulse of 500 us": lambda: rig.order((500, 1500)),
        "pulse of 2500 us": lambda: rig.order((1500, 2500)),
        "another version": lambda: rig.order(OTHER, version=2),
        "an unknown order": lambda: rig.order(OTHER, 7),
    }
    rows += [dropped(rig, what, (30 if what == "one bit flipped" else 5) * runs, make) for what, make in kinds.items()]
    rig.station_command(ARM, 0)
    rig.pump(1.0)
    state = rig.alive.state
    assert state is not None
    rig.start, rig.count = state.start, 0
    rig.stream(0.5, HELD)
    rig.arm()
    early = rig.stream(1.0, HELD, lambda: rig.out != rig.neutral)
    rows.append({"what": "a start of before arming, after it", "n": 1, "moved": int(early)})
    return [*rows, disarmed(rig)]


def disarmed(rig: Rig) -> dict[str, Any]:
    """The end of the measurements: the vehicle is disarmed. How fast its clock ran, against ours."""
    rig.station_command(ARM, 0)
    rig.pump(1.0)
    (first_s, first_boot_s), (last_s, last_boot_s) = rig.boot[0], rig.boot[-1]
    return {"what": "real-time factor", "value": round((last_boot_s - first_boot_s) / (last_s - first_s), 3)}


def report(rows: list[dict[str, Any]], output: Path | None) -> None:
    """Print the rows, and write them as JSON where asked to."""
    width = max(len(row["what"]) for row in rows)
    for row in rows:
        print("  ".join(f"{name} {value}" if name != "what" else f"{value:{width}}" for name, value in row.items()))
    if output is not None:
        output.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


def main() -> None:
    """Measure, print, and write JSON where asked to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=14550, help="UDP port that the autopilot sends to")
    parser.add_argument("--station", type=int, help="TCP port of the autopilot for the ground station")
    parser.add_argument("--motors", default="1,3", help="outputs of the port and the starboard motor")
    parser.add_argument("--neutral", type=int, default=1500, help="SERVOn_TRIM of both")
    parser.add_argument("--travel", default="1100,1900", help="SERVOn_MIN and _MAX of both")
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-o", "--output", type=Path, help="write the figures as JSON")
    given = parser.parse_args()
    port, starboard = (int(n) for n in given.motors.split(","))
    low, high = (int(n) for n in given.travel.split(","))
    rig = Rig(given.port, given.station, (port, starboard), given.neutral)
    report(measure(rig, given.runs, given.seed, (low, high)), given.output)


if __name__ == "__main__":
    end_in_words(main)
