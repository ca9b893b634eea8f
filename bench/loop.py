"""Figures of the loop on this machine: step time, lockstep and replay speed, start-up, memory. Not a test.

    python -m bench.loop [--json FILE]

Speeds are given per CPU second of one core beside the wall clock, because other work disturbs the latter.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from asvhil.config import load_config
from asvhil.io.mavlink.frames import FrameSplitter, message_id
from asvhil.logs.replay import replay
from asvhil.logs.run import read_run
from asvhil.logs.summary import summarise
from asvhil.machine_code.compiler import use_compiler
from asvhil.sitl import run_lockstep
from bench.ending import end_in_words
from tests.support.processes import bench

SPAN_S = 360.0
STARTS = 5


def lockstep_and_replay(folder: Path) -> dict[str, Any]:
    """A 360 s run in lockstep on one core, and its replay."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    log = folder / "log.mcap"
    use_compiler()  # as commands do
    config = load_config("sitl", ("plant.sensors.gnss.slow_bias_m=0",))
    cpu_s = time.process_time()
    wall_s = run_lockstep(config, log, SPAN_S)
    cpu_s = time.process_time() - cpu_s
    figures = summarise(read_run(log), wall_s)
    replay_cpu_s = time.process_time()
    result = replay(log)
    replay_cpu_s = time.process_time() - replay_cpu_s
    return {
        "step_ms": figures["step_ms"],
        "lockstep_times_real_time": {"wall": SPAN_S / wall_s, "cpu": SPAN_S / cpu_s},
        "replay_times_real_time": {"wall": result.span_s / result.wall_s, "cpu": result.span_s / replay_cpu_s},
        "replay_exact": result.mismatch is None,
    }


def start_to_heartbeat_s(folder: Path) -> float:
    """Seconds from the start of `asvhil run` to its first HEARTBEAT on the autopilot's port."""
    with bench(folder) as at:
        port = at.autopilot_port
        at.sets += ["--set", f"links.autopilot.endpoint=udpout:127.0.0.1:{port}"]

        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
            ear.bind(("127.0.0.1", port))
            ear.settimeout(20.0)
            with at.daemon() as daemon:
                splitter = FrameSplitter(datagrams=True)
                while not any(message_id(frame) == 0 for frame in splitter.receive(ear.recv(4096))):
                    pass
                elapsed_s = time.monotonic() - daemon.started_s
                daemon.end()
    return elapsed_s


def memory_mb(folder: Path) -> dict[str, Any]:
    """Resident memory of a daemon that has held for 20 s, and what it has imported."""
    with bench(folder) as at, at.plant(), at.daemon() as daemon:
        daemon.wait_for(lambda s: s["phase"] == "hold", 20.0)
        time.sleep(20.0)
        pid = daemon.child.pid
        status = Path(f"/proc/{pid}/status").read_text()
        maps = Path(f"/proc/{pid}/maps").read_text()
        daemon.end(signal.SIGINT)
    resident_kb = int(next(line for line in status.splitlines() if line.startswith("VmRSS")).split()[1])
    return {"rss_mb": resident_kb / 1024.0, "torch_mapped": "torch" in maps}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--only", choices=["lockstep"], help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if arguments.only == "lockstep":
            print(json.dumps(lockstep_and_replay(folder)))
            return
        one_core = subprocess.run(
            [sys.executable, "-m", "bench.loop", "--only", "lockstep"], capture_output=True, text=True, check=True
        )
        figures = json.loads(one_core.stdout)
        starts = []
        for number in range(STARTS):
            (folder / str(number)).mkdir()
            starts.append(start_to_heartbeat_s(folder / str(number)))
        figures["start_to_first_heartbeat_s"] = {"median": sorted(starts)[STARTS // 2], "max": max(starts)}
        (folder / "memory").mkdir()
        figures["daemon"] = memory_mb(folder / "memory")
    text = json.dumps(figures, indent=2)
    print(text)
    if arguments.json:
        arguments.json.write_text(text + "\n")


if __name__ == "__main__":
    end_in_words(main)
