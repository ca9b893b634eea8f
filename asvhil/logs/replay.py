"""Replay: the recorded inputs through a fresh backseat, its outputs compared byte by byte with the recorded ones."""

from __future__ import annotations

import re
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from asvhil import __version__
from asvhil.backseat.backseat import Backseat
from asvhil.backseat.build import build_backseat
from asvhil.config import Config, config_from_json
from asvhil.errors import AsvhilError, ConfigError, LogError
from asvhil.logs.encoding import encode_outputs, first_difference
from asvhil.logs.following import Followed, follow
from asvhil.logs.machine import differences
from asvhil.logs.metadata import DAMAGED_PREFIX, model_bytes
from asvhil.logs.plugins import changed_packages, check_plugins
from asvhil.logs.reader import LogFile
from asvhil.types import record

_HINT = re.compile(r", did you mean [^?]*\?")
_LOST_BEFORE = "it was damaged in the log that this one was recovered from"


@record
class Mismatch:
    """The first tick whose outputs differ: its number from 0, its time, and the first field that differs."""

    tick: int
    t_ns: int
    field: str


@record
class ReplayResult:
    """The result of a replay. `span_s` is recorded time, `wall_s` what the replay took.

    `changed_packages` are plug-ins of the run that are installed in another version now. Where a tick differs,
    `followed` compares all ticks with a tolerance, and `other_machine` has what differs between the machines.
    """

    ticks: int
    compared: int
    mismatch: Mismatch | None
    truncated: bool
    damage: str | None  # what the log lacks, in words
    damaged_records: tuple[str, ...]  # of those that the replay does not need
    span_s: float
    wall_s: float
    changed_packages: tuple[str, ...]
    followed: Followed | None
    other_machine: tuple[str, ...]

    @property
    def same_within_tolerance(self) -> bool:
        """Whether the record is confirmed, though not to the byte, on a machine whose arithmetic is another."""
        return self.other_arithmetic and self.followed is not None and self.followed.beyond is None

    @property
    def other_arithmetic(self) -> bool:
        """Whether the log is of a machine whose results may differ in their last bits."""
        return any(line.startswith("arithmetic:") for line in self.other_machine)


def config_of(log: LogFile, path: Path, *, known_only: bool = False) -> Config:
    """The config that a log was recorded with; `known_only` as `config_from_json`.

    LogError where it has none, where that is damaged, or where a plug-in that the run needs is not available.
    """
    if "config" in log.damaged:
        lost = "what the log means depends on the config; `asvhil log recover` keeps the ticks"
        raise LogError(f"{path}: {log.damaged['config']}; {lost}")
    stored = log.metadata.get("config", {}).get("json")
    if stored is None:
        if f"{DAMAGED_PREFIX}config" in log.metadata:
            raise LogError(
                f"{path}: holds no config record: it was damaged in the log that this one was recovered from"
            )
        raise LogError(f"{path}: holds no config record; replay needs a log written by asvhil")
    if not known_only:
        check_plugins(log, path)
    try:
        return config_from_json(stored, f"{path} (config record)", known_only=known_only)
    except ConfigError as error:  # nobody has typed this: a hint at what was meant would mislead
        raise ConfigError(f"{_HINT.sub('', str(error))}; {_other_version(log)}") from None


def _other_version(log: LogFile) -> str:
    by = log.metadata.get("versions", {}).get("asvhil", "(not recorded)")
    here = f"another state of asvhil {by}" if by == __version__ else f"asvhil {by}, and this is asvhil {__version__}"
    return f"the log is of another version: it was written by {here}"


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
    needed = "the model that the run was made with is needed"
    if "model" in log.damaged:
        raise LogError(f"{path}: {log.damaged['model']}; {needed}")
    if f"{DAMAGED_PREFIX}model" in log.metadata:
        raise LogError(f"{path}: holds no model record: {_LOST_BEFORE}")
    stored = log.metadata.get("model")
    if stored is None:
        yield None
        return
    data = model_bytes(stored)
    if data is None:
        raise LogError(f"{path}: the model record is damaged; {needed}")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "model.npz"
        file.write_bytes(data)
        try:
            yield file
        except AsvhilError as error:  # of a file that is gone when it is read about
            raise type(error)(str(error).replace(str(file), f"{path} (model record)")) from None


def build_recorded(log: LogFile, path: Path) -> Backseat:
    """A fresh backseat like the one that wrote a log, by the log's config and learned model."""
    check_begin(log)
    config = config_of(log, path)
    with recorded_model(log, path) as file:
        return build_backseat(config, file)


def replay(path: Path, on_tick: Callable[[int], None] | None = None) -> ReplayResult:
    """Step a fresh backseat through a log, and compare. From a tick that differs on, the record is followed.

    The plug-ins of the run must have been loaded (`plugins.load_plugins`).
    """
    log = LogFile(path)
    backseat = build_recorded(log, path)
    ticks = compared = 0
    first_ns = last_ns = None
    mismatch = None
    start_s = time.perf_counter()
    for tick, (inputs, recorded) in enumerate(log.ticks(up_to_gap=True)):
        first_ns = inputs.t_ns if first_ns is None else first_ns
        last_ns = inputs.t_ns
        replayed = encode_outputs(backseat.step(inputs))
        if recorded is not None:
            compared += 1
            if replayed != recorded:
                field = first_difference(recorded, replayed) or "the encoding alone"
                mismatch = Mismatch(tick=tick, t_ns=inputs.t_ns, field=field)
                break
        ticks = tick + 1
        if on_tick is not None:
            on_tick(ticks)
    if compared == 0:
        raise LogError(f"{path}: holds no tick with outputs to compare")
    followed = None
    if mismatch is not None:
        with recorded_model(log, path) as file:
            followed = follow(log, config_of(log, path), file, on_tick or (lambda ticks: None))
        ticks, compared, last_ns = followed.ticks, followed.compared, followed.last_ns
    span_s = 0.0 if first_ns is None or last_ns is None else (last_ns - first_ns) * 1e-9
    return ReplayResult(
        ticks=ticks,
        compared=compared,
        mismatch=mismatch,
        truncated=log.truncated,
        damage=log.damage,
        damaged_records=tuple(log.damaged.values()),
        span_s=span_s,
        wall_s=time.perf_counter() - start_s,
        changed_packages=tuple(changed_packages(log)),
        followed=followed,
        other_machine=tuple(differences(log.metadata.get("versions", {}))),
    )
