"""Replay: the recorded inputs through a fresh backseat, its outputs compared byte by byte with the recorded ones."""

from __future__ import annotations

import hashlib
import tempfile
import time
from base64 import b64decode
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from asvhil.backseat.backseat import Backseat
from asvhil.backseat.build import build_backseat
from asvhil.config import Config, config_from_json
from asvhil.errors import LogError
from asvhil.logs.encoding import encode_outputs, first_difference
from asvhil.logs.plugins import changed_packages, check_plugins
from asvhil.logs.reader import LogFile
from asvhil.types import record


@record
class Mismatch:
    """The first tick whose outputs differ: its number from 0, its time, and the first field that differs."""

    tick: int
    t_ns: int
    field: str


@record
class ReplayResult:
    """The result of a replay. `span_s` is recorded time, `wall_s` what the replay took.

    `changed_packages` are plug-ins of the run that are installed in another version now.
    """

    ticks: int
    compared: int
    mismatch: Mismatch | None
    truncated: bool
    span_s: float
    wall_s: float
    changed_packages: tuple[str, ...]


def config_of(log: LogFile, path: Path, *, known_only: bool = False) -> Config:
    """The config that a log was recorded with; `known_only` as `config_from_json`.

    LogError where it has none, or where a plug-in that the run needs is not available.
    """
    stored = log.metadata.get("config", {}).get("json")
    if stored is None:
        raise LogError(f"{path}: holds no config record; replay needs a log written by asvhil")
    if not known_only:
        check_plugins(log, path)
    return config_from_json(stored, f"{path} (config record)", known_only=known_only)


def check_begin(log: LogFile) -> None:
    """LogError for a later segment alone: a backseat starts with the first tick of a run."""
    if log.first_tick != 1:
        raise LogError(
            f"{log.path}: begins with tick {log.first_tick}; replay the run by its first segment or its folder"
        )


@contextmanager
def recorded_model(log: LogFile, path: Path) -> Iterator[Path | None]:
    """The file of the learned model that a log holds, for as long as it is open; None of a log without one.

    LogError where it is damaged.
    """
    stored = log.metadata.get("model")
    if stored is None:
        yield None
        return
    try:
        data = b64decode(stored["base64"], validate=True)
        intact = hashlib.sha256(data).hexdigest() == stored["sha256"]
    except (KeyError, ValueError):
        intact = False
    if not intact:
        raise LogError(f"{path}: the model record is damaged; the model that the run was made with is needed")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "model.npz"
        file.write_bytes(data)
        yield file


def build_recorded(log: LogFile, path: Path) -> Backseat:
    """A fresh backseat like the one that wrote a log, by the log's config and learned model."""
    check_begin(log)
    config = config_of(log, path)
    with recorded_model(log, path) as file:
        return build_backseat(config, file)


def replay(path: Path, on_tick: Callable[[int], None] | None = None) -> ReplayResult:
    """Step a fresh backseat through a log up to its end or the first tick that differs.

    The plug-ins of the run must have been loaded (`plugins.load_plugins`).
    """
    log = LogFile(path)
    backseat = build_recorded(log, path)
    ticks = compared = 0
    first_ns = last_ns = None
    mismatch = None
    start_s = time.perf_counter()
    for inputs, recorded in log.ticks():
        first_ns = inputs.t_ns if first_ns is None else first_ns
        last_ns = inputs.t_ns
        replayed = encode_outputs(backseat.step(inputs))
        if recorded is not None:
            compared += 1
            if replayed != recorded:
                field = first_difference(recorded, replayed) or "the encoding alone"
                mismatch = Mismatch(tick=ticks, t_ns=inputs.t_ns, field=field)
                break
        ticks += 1
        if on_tick is not None:
            on_tick(ticks)
    if compared == 0:
        raise LogError(f"{path}: holds no tick with outputs to compare")
    span_s = 0.0 if first_ns is None or last_ns is None else (last_ns - first_ns) * 1e-9
    return ReplayResult(
        ticks=ticks,
        compared=compared,
        mismatch=mismatch,
        truncated=log.truncated,
        span_s=span_s,
        wall_s=time.perf_counter() - start_s,
        changed_packages=tuple(changed_packages(log)),
    )
