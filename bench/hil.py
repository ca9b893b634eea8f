"""How fast the plant is as an autopilot's physics, over real sockets, with a client that does nothing else. Not a test.

    python -m bench.hil [--seconds S] [--json FILE]

Asked: at least 5 times real time. The wall clock is that of client and server together, on whatever else the machine
does; the server's CPU time is given beside it.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from bench.ending import end_in_words
from tests.support.hil_clients import JsonAutopilot, Px4

CASES = (
    ("ArduPilot JSON, 400 Hz", 400, 16),
    ("ArduPilot JSON, 1200 Hz", 1200, 16),
    ("ArduPilot JSON, 1200 Hz, 32 channels", 1200, 32),
)
PX4_HZ = 250
WARM_UP = 200


@contextmanager
def plant(kind: str, scheme: str, socket_kind: int) -> Iterator[tuple[str, int]]:
    """A server in a process of its own: its address and process id."""
    with socket.socket(socket.AF_INET, socket_kind) as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{probe.getsockname()[1]}"
    sets = ["plant.links.anemometer=null", "plant.hil.px4.speed=0", "plant.hil.neutral_first_s=0"]
    command = [sys.executable, "-m", "asvhil", "plant", "sitl", kind, "--endpoint", f"{scheme}:{address}"]
    child = subprocess.Popen(
        [*command, *(part for text in sets for part in ("--set", text))], stdout=subprocess.PIPE, text=True
    )
    try:
        assert child.stdout is not None and child.stdout.readline()  # its title comes before it listens
        time.sleep(1.0)
        yield address, child.pid
    finally:
        child.send_signal(signal.SIGINT)
        child.wait(10.0)


def cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def measure(pid: int, run: Callable[[int], object], frames: int, rate_hz: int) -> dict[str, Any]:
    run(WARM_UP)
    start_s, start_cpu_s = time.perf_counter(), cpu_s(pid)
    run(frames)
    wall_s, server_s = time.perf_counter() - start_s, cpu_s(pid) - start_cpu_s
    return {
        "frames": frames,
        "times_real_time": frames / rate_hz / wall_s,
        "round_trip_us": 1e6 * wall_s / frames,
        "server_cpu_us": 1e6 * server_s / frames,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="of the autopilot's time, for each case")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    figures = {}
    for name, rate_hz, channels in CASES:
        with (
            plant("--ardupilot-json", "udpin", socket.SOCK_DGRAM) as (address, pid),
            JsonAutopilot(address, rate_hz=rate_hz, channels=channels) as autopilot,
        ):
            figures[name] = measure(pid, autopilot.run, round(arguments.seconds * rate_hz), rate_hz)
    with plant("--px4-hil", "tcpin", socket.SOCK_STREAM) as (address, pid), Px4.connect(address) as px4:
        px4.boot()
        figures[f"PX4, {PX4_HZ} Hz"] = measure(pid, px4.run, round(arguments.seconds * PX4_HZ), PX4_HZ)
    print(f"{'':40}{'x real time':>12}{'round trip':>12}{'server CPU':>12}")
    for name, row in figures.items():
        trip, server = f"{row['round_trip_us']:.0f} us", f"{row['server_cpu_us']:.0f} us"
        print(f"{name:40}{row['times_real_time']:>12.1f}{trip:>12}{server:>12}")
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    end_in_words(main)
