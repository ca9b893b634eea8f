"""Software in the loop: the daemon against the simulated boat, as two processes in real time, or in lockstep."""

from __future__ import annotations

import gc
import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from asvhil.config import Config
from asvhil.config.ports import ANEMOMETER, GNSS, INS
from asvhil.errors import AsvhilError, ConfigError
from asvhil.io.sensors.firmware import FIRMWARE
from asvhil.logs.opening import open_recorder
from asvhil.simplant.boat.arduino import SimulatedArduino
from asvhil.simplant.lockstep import Lockstep
from asvhil.simplant.plant import with_lines_read
from asvhil.types import Outputs

STOP_S = 10.0
WEATHER_HZ = 20.0  # how often the wind on a simulated Arduino changes


def check_buildable(config: Config) -> None:
    """AsvhilError before anything is left of a run whose boat or backseat cannot be built."""
    Lockstep(config)


def run_lockstep(
    config: Config, log: Path, duration_s: float, on_tick: Callable[[Outputs], None] | None = None
) -> float:
    """A run in virtual time; returns the seconds it took."""
    recorder = open_recorder(config, log, "lockstep", threaded=False)  # nothing to keep up with, so nothing to drop
    try:
        loop = Lockstep(config, recorder)
        gc.freeze()  # as in the daemon: a full collection would pass over all modules, and take as long as 50 ticks
        start_s = time.perf_counter()
        loop.run(duration_s, on_tick)
        wall_s = time.perf_counter() - start_s
    finally:
        gc.unfreeze()
        recorder.close()
    if recorder.error is not None:
        raise recorder.error
    return wall_s


def run_realtime(
    config: Config,
    folder: Path,
    log: Path,
    duration_s: float,
    on_status: Callable[[dict[str, Any]], None],
    arduino: SimulatedArduino | None = None,
) -> float:
    """A run of two processes over UDP and a pty; returns the seconds it took, start-up and end included.

    With a running `arduino`, the simulated wind is sent to it, and the daemon reads its serial port.
    Raises AsvhilError with the last line of the process that failed.
    """
    start_s = time.perf_counter()
    effective = folder / "config.json"
    settings = _with_own_ports(config, folder)
    if arduino is not None:
        settings = with_firmware(settings, arduino.pty, arduino.udp_port)
    effective.write_text(settings.canonical_json(), encoding="utf-8")
    base = [sys.executable, "-m", "asvhil"]
    words = {name: folder / f"{name}.log" for name in ("plant", "daemon")}
    with (
        words["plant"].open("w", encoding="utf-8") as plant_words,
        words["daemon"].open("w", encoding="utf-8") as daemon_words,
        subprocess.Popen(
            [*base, "plant", str(effective), "--quiet"],
            stdin=subprocess.DEVNULL,
            stdout=plant_words,
            stderr=subprocess.STDOUT,
        ) as plant,
        subprocess.Popen(
            [*base, "run", str(effective), "--log", str(log), "--duration", str(duration_s), "--status-json"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=daemon_words,
            text=True,
        ) as daemon,
    ):
        try:
            assert daemon.stdout is not None
            for line in daemon.stdout:
                on_status(json.loads(line))
                if plant.poll() is not None or (arduino is not None and arduino.failure is not None):
                    break
            board_died = arduino.failure if arduino is not None else None
            plant_died = plant.poll() is not None
        finally:
            for process in (daemon, plant):
                _end(process)
    if board_died is not None:
        raise AsvhilError(board_died)
    if plant_died:
        raise AsvhilError(f"the plant ended early: {_last_line(words['plant'])}")
    if daemon.returncode != 0:
        raise AsvhilError(f"the daemon ended with status {daemon.returncode}: {_last_line(words['daemon'])}")
    return time.perf_counter() - start_s


def _end(process: subprocess.Popen[Any]) -> None:
    """Interrupt a child process as a terminal would and wait; kill it only if it does not end."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    try:
        process.wait(STOP_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _with_own_ports(config: Config, folder: Path) -> Config:
    """The config with free ports and a pty of its own, so that several runs do not interfere.

    ConfigError where no link spec can have the folder's path.
    """
    if not str(folder.resolve()).isprintable():
        what = "its serial lines need a folder whose path is plain text in UTF-8"
        raise ConfigError(f"{folder.resolve()}: {what}; set recorder.directory, or run with --lockstep")
    tree = with_lines_read(config).model_dump(mode="json")
    autopilot = _free_udp_port()
    tree["links"]["autopilot"]["endpoint"] = f"udpin:127.0.0.1:{autopilot}"
    tree["plant"]["links"]["autopilot"] = f"udpout:127.0.0.1:{autopilot}"
    for port in (ANEMOMETER, INS, GNSS):
        if tree["links"][port] is not None:
            pty = folder.resolve() / port
            tree["plant"]["links"][port] = f"pty:{pty}"
            tree["links"][port]["endpoint"] = f"serial:{pty}:115200"
    for name, sensor in tree["links"].get("sensors", {}).items():
        pty = folder.resolve() / name
        tree["plant"]["links"].setdefault("sensors", {})[name] = f"pty:{pty}"
        sensor["endpoint"] = f"serial:{pty}:115200"
    if not _is_free(tree["links"]["operator"]["endpoint"]):
        tree["links"]["operator"]["endpoint"] = f"udpin:127.0.0.1:{_free_udp_port()}"
    return Config.model_validate(tree)


def with_firmware(config: Config, pty: str, udp_port: int) -> Config:
    """The config with the anemometer's firmware between plant and daemon. It must have links.anemometer.

    The plant's own sensor then gives the exact apparent wind, which the firmware quantises and averages.
    """
    tree = config.model_dump(mode="json")
    tree["links"]["anemometer"] |= {"endpoint": f"serial:{pty}:115200", "firmware": FIRMWARE}
    tree["plant"]["links"]["anemometer"] = f"udpout:127.0.0.1:{udp_port}"
    tree["plant"]["sensors"]["anemometer"] |= {"rate_hz": WEATHER_HZ, "speed_white_mps": 0.0, "directions": 360}
    return Config.model_validate(tree)


def _free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _is_free(endpoint: str) -> bool:
    scheme, _, rest = endpoint.partition(":")
    host, _, port = rest.rpartition(":")
    if scheme != "udpin":
        return True
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((host, int(port)))
        except (OSError, ValueError):
            return False
    return True


def _last_line(words: Path) -> str:
    """The last line of a child's output, for an error message."""
    lines = [line for line in words.read_text(encoding="utf-8").splitlines() if line.strip()]
    return lines[-1] if lines else "it said nothing"
