"""Opening the log of a run: its folder, its recorder, and the records that make it replayable."""

from __future__ import annotations

import hashlib
import platform
from base64 import b64encode
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from asvhil import __version__
from asvhil.backseat.build import build_model, model_file
from asvhil.config import Config
from asvhil.config.registry import CONTROLLERS, SENSORS
from asvhil.controller.solvers.choice import choose_solver
from asvhil.errors import AsvhilError
from asvhil.logs.machine import machine
from asvhil.logs.plugins import plugin_records
from asvhil.logs.recorder import ENCODINGS, Recorder

PACKAGES = ("numpy", "casadi", "daqp", "pymavlink", "mcap", "msgspec")


def make_run_folder(config: Config, name: str) -> Path:
    """A new folder for one run's log and picture, named by UTC time and what it is.

    Raises AsvhilError, and leaves nothing behind, where the run would be refused: its model, plug-ins or solver.
    """
    check_run(config)
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


def check_run(config: Config) -> None:
    """AsvhilError where a run would be refused once its log is opened."""
    log_metadata(config, "")
    if CONTROLLERS.find(config.controller.name).solves:
        choose_solver(config.controller)


def log_metadata(config: Config, mode: str) -> dict[str, dict[str, str]]:
    """The metadata records that make a log replayable: the whole config, versions, plug-ins, seed and mode."""
    model = model_file(config)
    if model is not None:
        build_model(config, model)  # raises for an unsuitable model before a log is made
    data = model.read_bytes() if model is not None else b""
    # The model itself goes into the log: a replay must not depend on a file that training may write again.
    stored = (
        {"model": {"file": model.name, "sha256": hashlib.sha256(data).hexdigest(), "base64": b64encode(data).decode()}}
        if model is not None
        else {}
    )
    versions = {name: version(name) for name in PACKAGES}
    plugins = plugin_records(config)
    versions |= {record["package"]: record["version"] for record in plugins.values() if "package" in record}
    return {
        "config": {"json": config.canonical_json(), "hash": config.content_hash()},
        "versions": {
            "asvhil": __version__,
            "python": platform.python_version(),
            **machine(),
            **versions,
        },
        "run": {"mode": mode, "seed": str(config.plant.seed), "vehicle": config.vehicle.name},
        **stored,
        **plugins,
    }


def open_recorder(config: Config, path: Path, mode: str, *, threaded: bool = True) -> Recorder:
    """A recorder for one run."""
    sensors = {port: SENSORS.find(link.kind).encoding for port, link in config.links.sensors.items()}
    return Recorder(
        path,
        metadata=log_metadata(config, mode),
        encodings={**ENCODINGS, **sensors},
        chunk_kib=config.recorder.chunk_kib,
        sync_period_s=config.recorder.sync_period_s,
        segment_bytes=round(config.recorder.segment_mb * 1e6),
        segment_s=config.recorder.segment_s,
        threaded=threaded,
    )
