"""Software in the loop: the daemon against the simulated boat, as two processes in real time, or in lockstep."""

from __future__ import annotations

import hashlib
import json
import platform
import signal
import socket
import subprocess
import sys
import time
from base64 import b64encode
from collections.abc import Callable
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from asvhil import __version__
from asvhil.build import build_model, model_file
from asvhil.config import Config
from asvhil.errors import AsvhilError
from asvhil.io.firmware import FIRMWARE
from asvhil.io.recorder import Recorder
from asvhil.simplant.arduino import SimulatedArduino
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Outputs

PACKAGES = ("numpy", "casadi", "daqp", "pymavlink", "mcap", "msgspec")
STOP_S = 10.0
WEATHER_HZ = 20.0  # how often the wind on a simulated Arduino changes


def make_run_folder(config: Config, name: str) -> Path:
    """A new folder for one run's log and picture, named by UTC time and what it is."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    base = Path(config.recorder.directory)
    for attempt in range(100):
        folder = base / (f"{stamp}-{name}" if attempt == 0 else f"{stamp}-{name}-{attempt}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise AsvhilError(f"{folder}: the run folder cannot be made ({error.strerror})") from None
        return folder
    raise AsvhilError(f"{base}: no free name for a run folder")


def log_metadata(config: Config, mode: str) -> dict[str, dict[str, str]]:
    """The metadata records that make a log replayable: the whole config, versions, seed and mode."""
    model = model_file(config)
    if model is not None:
        build_model(config, model)  # one that will not do is told before there is a log
    data = model.read_bytes() if model is not None else b""
    # The model itself goes into the log: a replay must not depend on a file that training may write again.
    stored = (
        {"model": {"file": model.name, "sha256": hashlib.sha256(data).hexdigest(), "base64": b64encode(data).decode()}}
        if model is not None
        else {}
    )
    versions = {name: version(name) for name in PACKAGES}
    return {
        "config": {"json": config.canonical_json(), "hash": config.content_hash()},
        "versions": {
            "asvhil": __version__,
            "python": platform.python_version(),
            "machine": platform.machine(),
            **versions,
        },
        "run": {"mode": mode, "seed": str(config.plant.seed), "vehicle": config.vehicle.name},
        **stored,
    }


def open_recorder(config: Config, path: Path, mode: str, *, threaded: bool = True) -> Recorder:
    """A recorder for one run."""
    return Recorder(
        path,
        metadata=log_metadata(config, mode),
        chunk_kib=config.recorder.chunk_kib,
        sync_period_s=config.recorder.sync_period_s,
        threaded=threaded,
    )


def run_lockstep(
    config: Config, log: Path, duration_s: float, on_tick: Callable[[Outputs], None] | None = None
) -> float:
    """A run in virtual time; returns the seconds it took."""
    recorder = open_recorder(config, log, "lockstep", threaded=False)  # nothing to keep up with, so nothing to drop
    try:
        loop = Lockstep(config, recorder)
        start_s = time.perf_counter()
        loop.run(duration_s, on_tick)
        wall_s = time.perf_counter() - start_s
    finally:
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

    With an `arduino`, running, the weather blows on it, and the daemon reads its serial port.
    Raises AsvhilError with the words of the process that failed.
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
    """Interrupt a child as a terminal would and wait; kill it only if it does not listen."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    try:
        process.wait(STOP_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _with_own_ports(config: Config, folder: Path) -> Config:
    """The config with links of this run's own: two runs side by side never meet."""
    tree = config.model_dump(mode="json")
    autopilot = _free_udp_port()
    tree["links"]["autopilot"]["endpoint"] = f"udpin:127.0.0.1:{autopilot}"
    tree["plant"]["links"]["autopilot"] = f"udpout:127.0.0.1:{autopilot}"
    for port in ("anemometer", "ins", "gnss"):
        if tree["links"][port] is not None:
            pty = folder.resolve() / port
            tree["plant"]["links"][port] = f"pty:{pty}"
            tree["links"][port]["endpoint"] = f"serial:{pty}:115200"
    if not _is_free(tree["links"]["operator"]["endpoint"]):
        tree["links"]["operator"]["endpoint"] = f"udpin:127.0.0.1:{_free_udp_port()}"
    return Config.model_validate(tree)


def with_firmware(config: Config, pty: str, udp_port: int) -> Config:
    """The config with the anemometer's firmware between plant and daemon. It must have links.anemometer.

    The plant's own sensor becomes the bare apparent wind: what quantises and averages it is the firmware.
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
    """The last thing a child said, for an error message of one line."""
    lines = [line for line in words.read_text(encoding="utf-8").splitlines() if line.strip()]
    return lines[-1] if lines else "it said nothing"
