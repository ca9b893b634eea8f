"""Figures of the bridge on this machine: sensor datagram in to PWM datagram out, and a flood of MAVLink. Not a test.

    python -m bench.bridge [--json FILE] [--quick] [--only latency|flood]

The daemon runs as a process of its own with a trivial controller; this process is the autopilot on UDP loopback.
Latency runs from the moment before the ATTITUDE datagram is sent to the moment the override that it caused has been
received; the pair is found by the daemon's log: which datagram was in the tick, which override the tick sent. It is
measured with ticks cut by the timer (20 Hz as shipped, and 100 Hz) and on arrival.
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import json
import math
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from asvhil.backseat.build import build_backseat
from asvhil.config import Config, load_config
from asvhil.daemon.daemon import Daemon
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect, message_id
from asvhil.links.clock import Clock
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.opening import open_recorder
from asvhil.logs.reader import LogFile
from asvhil.operator.encoding import encode_hold
from asvhil.types import Control, Estimate, Station, Wind
from bench.ending import end_in_words
from tests.support.ports import free_port

SENSOR_HZ = 50.0
FLOOD_HZ = 5000
LATENCY_ASKED_MS = 5.0
# From sent to stamped by the daemon; from there to the cut of the tick; the step; threads, sending and receiving.
PARTS = ("in", "wait", "step", "out")
CUTS = {"timer, 20 Hz": ("timer", 20.0), "timer, 100 Hz": ("timer", 100.0), "arrival": ("arrival", 100.0)}


class Trivial:
    """Answers at once, with another pulse each time, so that every override can be told from the one before."""

    def __init__(self) -> None:
        self._count = 0

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control:
        self._count += 1
        value = 0.01 + 0.19 * (self._count % 76) / 76.0  # within the dead band: the boat of this bench stands still
        return Control(command=(value, value), ok=True, iterations=0, cost=0.0)

    def new_station(self) -> None:
        """Nothing is remembered that matters."""

    def reset(self) -> None:
        """Nothing is remembered that matters."""


def settings(autopilot_port: int, operator_port: int, cut: tuple[str, float]) -> Config:
    return load_config(
        "sitl",
        (
            "links.anemometer=null",
            f"links.autopilot.endpoint=udpin:127.0.0.1:{autopilot_port}",
            f"links.operator.endpoint=udpin:127.0.0.1:{operator_port}",
            "supervisor.engage=command",
            "controller.name=loiter",
            f"daemon.control_hz={cut[1]}",
            f"daemon.cut_on={cut[0]}",
            f"daemon.tick_hz={cut[1]}",
            "vehicle.pwm.slew_us_per_s=1000000",
        ),
    )


def serve(arguments: argparse.Namespace) -> None:
    """The daemon's process."""
    config = settings(arguments.autopilot, arguments.operator, (arguments.cut, arguments.tick_hz))
    recorder = open_recorder(config, Path(arguments.log), "live")
    daemon = Daemon(config, recorder, Clock(), backseat=build_backseat(config, controller=Trivial()))
    try:
        asyncio.run(daemon.run())
    finally:
        recorder.close()
    losses = {port: link.losses for port, link in daemon.links.items() if link.losses}
    print(
        json.dumps({"ticks": daemon.ticks, "overruns": daemon.overruns, "losses": losses, "dropped": recorder.dropped})
    )


class Child:
    """A daemon, its ports, and its end."""

    def __init__(self, folder: Path, cut: tuple[str, float]) -> None:
        self.log = folder / "log.mcap"
        self.autopilot_port, self.operator_port = free_port(), free_port()
        words = ["--serve", "--log", str(self.log), "--cut", cut[0], "--tick-hz", str(cut[1])]
        words += ["--autopilot", str(self.autopilot_port), "--operator", str(self.operator_port)]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "bench.bridge", *words], stdout=subprocess.PIPE, text=True
        )

    def rss_mb(self) -> float:
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(next(line for line in status.splitlines() if line.startswith("VmRSS")).split()[1]) / 1024.0

    def cpu_s(self) -> float:
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def end(self) -> dict[str, Any]:
        self.process.send_signal(signal.SIGINT)
        words, _ = self.process.communicate(timeout=60.0)
        return dict(json.loads(words.splitlines()[-1]))


class Autopilot:
    """What the daemon needs to hold, as packed messages; the attitude's boot time numbers its datagrams."""

    def __init__(self, port: int) -> None:
        self._mav = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(("127.0.0.1", port))

    def pack(self, message: Any) -> bytes:
        data = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return data

    def send(self, message: Any) -> None:
        try:
            self.socket.send(self.pack(message))
        except ConnectionRefusedError:
            return  # the daemon is not up yet

    def housekeeping(self) -> None:
        self.send(dialect.MAVLink_heartbeat_message(11, 3, 0x81 | 0x40, 0, 4, 3))
        self.send(dialect.MAVLink_ekf_status_report_message(831, 0, 0, 0, 0, 0, 0))
        self.send(dialect.MAVLink_global_position_int_message(0, 404237000, -869212000, 0, 0, 0, 0, 0, 0))

    def hold(self, config: Config, operator_port: int) -> None:
        """Ask the daemon to hold until it does, feeding it meanwhile."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as operator:
            operator.connect(("127.0.0.1", operator_port))
            operator.setblocking(False)
            for turn in range(600):
                self.housekeeping()
                self.send(dialect.MAVLink_attitude_message(1, 0, 0, 0.3, 0, 0, 0))
                if turn % 10 == 0:
                    try:
                        operator.send(encode_hold(config.links.autopilot, None, None, None))
                        for data in FrameSplitter().receive(operator.recv(4096)):
                            message = decode(data)
                            if message is not None and message.get_type() == "COMMAND_ACK" and message.result == 0:
                                return
                    except (BlockingIOError, ConnectionRefusedError):
                        pass
                time.sleep(0.05)
        raise SystemExit("the daemon did not hold within 30 s")


def sleep_until(at_s: float) -> None:
    """Sleep to a time of the monotonic clock; not at all where it is past."""
    time.sleep(max(0.0, at_s - time.monotonic()))


def latency(folder: Path, cut: tuple[str, float], seconds: float) -> dict[str, Any]:
    """Percentiles of the latency in ms, and of its parts."""
    child = Child(folder, cut)
    autopilot = Autopilot(child.autopilot_port)
    received: list[tuple[int, int]] = []
    stop = threading.Event()

    def listen() -> None:
        splitter = FrameSplitter(datagrams=True)
        autopilot.socket.settimeout(0.2)
        while not stop.is_set():
            try:
                data = autopilot.socket.recv(4096)
            except (TimeoutError, ConnectionRefusedError):
                continue
            now_ns = time.monotonic_ns()
            for frame in splitter.receive(data):
                if message_id(frame) == dialect.MAVLINK_MSG_ID_RC_CHANNELS_OVERRIDE:
                    received.append((now_ns, decode(frame).chan1_raw))

    ear = threading.Thread(target=listen, daemon=True)
    ear.start()
    config = settings(child.autopilot_port, child.operator_port, cut)
    try:
        autopilot.hold(config, child.operator_port)
        received.clear()
        gc.disable()
        sent_ns: dict[int, int] = {}
        start_s = time.monotonic()
        for number in range(round(seconds * SENSOR_HZ)):
            sent_ns[1000 + number] = time.monotonic_ns()
            autopilot.send(dialect.MAVLink_attitude_message(1000 + number, 0, 0, 0.3, 0, 0, 0))
            # Off the grid of the ticks, so that every phase between the two is met.
            if number % 10 == 0:
                sleep_until(start_s + (number + 0.5) * 1.0137 / SENSOR_HZ)
                autopilot.housekeeping()  # has a tick of its own
            sleep_until(start_s + (number + 1) * 1.0137 / SENSOR_HZ)
        time.sleep(0.3)
    finally:
        gc.enable()
        summary = child.end()
        stop.set()
        ear.join()
    return _latencies(child.log, sent_ns, received) | {"daemon": summary}


def _latencies(log: Path, sent_ns: dict[int, int], received: list[tuple[int, int]]) -> dict[str, Any]:
    """Pair each datagram with the override of the tick that took it in, by order and pulse width."""
    steps = {timing.t_ns: timing.step_ns for timing in LogFile(log).timing()}
    offset_ns = time.time_ns() - time.monotonic_ns()  # of the daemon's clock, to a few microseconds
    total: list[float] = []
    parts: dict[str, list[float]] = {name: [] for name in PARTS}
    at = 0
    splitter = FrameSplitter(datagrams=True)
    for inputs, data in LogFile(log).ticks():
        if data is None:
            continue
        outputs = decode_outputs(data)
        pulses = outputs.pwm_us
        numbers = [
            (frame.t_ns, message.time_boot_ms)
            for frame in inputs.frames
            if frame.port == "autopilot"
            for message in map(decode, splitter.receive(frame.data))
            if message is not None and message.get_type() == "ATTITUDE" and message.time_boot_ms in sent_ns
        ]
        if pulses is None or not numbers:
            continue
        # The first override after the datagram was sent that carries this tick's pulse.
        for arrived_ns, number in numbers:
            while at < len(received) and received[at][0] < sent_ns[number]:
                at += 1
            found = next((t for t, pulse in received[at : at + 40] if pulse == pulses[0]), None)
            if found is None or outputs.control is None:
                continue
            step_ns = steps.get(inputs.t_ns, 0)
            total.append((found - sent_ns[number]) * 1e-6)
            parts["in"].append((arrived_ns - offset_ns - sent_ns[number]) * 1e-6)
            parts["wait"].append((inputs.t_ns - arrived_ns) * 1e-6)
            parts["step"].append(step_ns * 1e-6)
            parts["out"].append((found - (inputs.t_ns - offset_ns) - step_ns) * 1e-6)
    return {
        "pairs": len(total),
        "of": len(sent_ns),
        "latency_ms": _percentiles(total),
        "parts_ms": {name: _percentiles(values) for name, values in parts.items()},
    }


def _percentiles(values: list[float]) -> dict[str, float]:
    values = sorted(values)
    if not values:
        return {}
    at = {"p50": 0.5, "p90": 0.9, "p99": 0.99, "max": 1.0}
    return {name: values[min(len(values) - 1, math.ceil(share * len(values)) - 1)] for name, share in at.items()}


def flood(folder: Path, seconds: float) -> dict[str, Any]:
    """5000 messages a second of a vehicle's usual mix, in datagrams of one each; what arrived by log and counters."""
    cut = CUTS["timer, 20 Hz"]
    child = Child(folder, cut)
    autopilot = Autopilot(child.autopilot_port)
    config = settings(child.autopilot_port, child.operator_port, cut)
    mix = _mix()
    memory: list[float] = []
    try:
        autopilot.hold(config, child.operator_port)
        sent = 0
        cpu_s = child.cpu_s()
        start_s = time.monotonic()
        while True:
            elapsed_s = time.monotonic() - start_s
            if elapsed_s >= seconds:
                break
            due = round(elapsed_s * FLOOD_HZ)
            for number in range(sent, due):
                autopilot.socket.send(autopilot.pack(mix[number % len(mix)]))
            sent = max(sent, due)
            if len(memory) <= elapsed_s:
                memory.append(child.rss_mb())
            time.sleep(0.001)
        cpu_share = (child.cpu_s() - cpu_s) / seconds
        time.sleep(1.0)
    finally:
        summary = child.end()
    logged = 0
    splitter = FrameSplitter(datagrams=True)
    ids = {message.get_msgId() for message in mix}
    for frame in LogFile(child.log).frames("autopilot", "in"):
        logged += sum(message_id(data) in ids for data in splitter.receive(frame.data))
    settled = memory[min(10, len(memory) // 2)]
    return {
        "asked_hz": FLOOD_HZ,
        "seconds": seconds,
        "sent": sent,
        "logged": logged,
        "lost": sent - logged,
        "achieved_hz": sent / seconds,
        "rss_mb": {"start": memory[0], "settled": settled, "end": memory[-1], "growth": memory[-1] - settled},
        "cpu_share_of_a_core": cpu_share,
        "log_mb": child.log.stat().st_size / 1e6,
        "daemon": summary,
    }


def _mix() -> list[Any]:
    """One second's worth of kinds: mostly what is logged and left alone, some of what the estimator takes."""
    d = dialect
    quiet: list[Any] = [
        d.MAVLink_vfr_hud_message(1.0, 1.0, 90, 40, 0.0, 0.0),
        d.MAVLink_sys_status_message(1, 1, 1, 100, 12600, 100, 80, 0, 0, 0, 0, 0, 0),
        d.MAVLink_scaled_imu2_message(1, 1, 2, 3, 4, 5, 6, 7, 8, 9),
        d.MAVLink_param_value_message(b"RC1_DZ", 0.0, 9, 900, 3),
        d.MAVLink_nav_controller_output_message(1.0, 2.0, 3, 4, 5, 6.0, 7.0, 8.0),
        d.MAVLink_local_position_ned_message(1, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0),
        d.MAVLink_vibration_message(1, 0.1, 0.2, 0.3, 0, 0, 0),
        d.MAVLink_battery_status_message(0, 0, 0, 2500, [4200] * 10, 100, 1, 1, 80),
        d.MAVLink_power_status_message(5000, 5000, 0),
    ]
    heard: list[Any] = [
        d.MAVLink_servo_output_raw_message(1, 0, *[1500] * 8),
        d.MAVLink_gps_raw_int_message(1, 3, 404237000, -869212000, 0, 121, 200, 0, 0, 10),
        d.MAVLink_system_time_message(1, 2000),
    ]
    return [message for turn in range(8) for message in [*quiet, heard[turn % 3]]]


def show(figures: dict[str, Any], console: Console) -> None:
    if "latency" in figures:
        table = Table(title="sensor datagram in to PWM datagram out, ms")
        for column in ("ticks cut by", "p50", "p90", "p99", "max", *(f"{part} 50/99" for part in PARTS), "pairs"):
            table.add_column(column, justify="left" if column == "ticks cut by" else "right")
        for name, row in figures["latency"].items():
            times = [f"{row['latency_ms'].get(key, math.nan):.2f}" for key in ("p50", "p90", "p99", "max")]
            parts = [f"{p.get('p50', math.nan):.1f}/{p.get('p99', math.nan):.1f}" for p in row["parts_ms"].values()]
            table.add_row(name, *times, *parts, f"{row['pairs']} of {row['of']}")
        console.print(table)
        worst = figures["latency"]["arrival"]["latency_ms"].get("p99", math.nan)
        console.print(f"asked: p99 at most {LATENCY_ASKED_MS} ms; on arrival {worst:.2f} ms")
    if "flood" in figures:
        row = figures["flood"]
        memory = row["rss_mb"]
        console.print(
            f"flood: {row['sent']} messages in {row['seconds']:.0f} s ({row['achieved_hz']:.0f}/s), "
            f"{row['lost']} lost; RSS {memory['settled']:.1f} MB settled, {memory['end']:.1f} MB at the end; "
            f"{row['cpu_share_of_a_core']:.0%} of a core; daemon {row['daemon']}",
            soft_wrap=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--quick", action="store_true", help="a few seconds of each")
    parser.add_argument("--only", choices=["latency", "flood"])
    for name, kind in (("log", str), ("cut", str), ("tick-hz", float), ("autopilot", int), ("operator", int)):
        parser.add_argument(f"--{name}", type=kind, help=argparse.SUPPRESS)
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.serve:
        serve(arguments)
        return
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        if arguments.only != "flood":
            figures["latency"] = {}
            for number, (cut, how) in enumerate(CUTS.items()):
                folder = Path(name) / str(number)
                folder.mkdir()
                figures["latency"][cut] = latency(folder, how, 5.0 if arguments.quick else 30.0)
        if arguments.only != "latency":
            figures["flood"] = flood(Path(name), 5.0 if arguments.quick else 60.0)
    show(figures, Console(width=150))
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    end_in_words(main)
