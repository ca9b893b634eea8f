"""Where training data come from: which boat, the simulated or the real one, and that no log counts twice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from asvhil.config import Config
from asvhil.dynamics.hull import differences, hull_of
from asvhil.errors import ConfigError
from asvhil.files import is_file
from asvhil.logs.learned_file import is_simulated
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import config_of
from asvhil.train.records import source_hash
from asvhil.types import record

TRUTH = "SIM_STATE"  # that message is asked for in configs of a simulated boat alone: no real autopilot sends it


@record
class DataOrigin:
    """Where training data come from: vehicle, config hash, and figures of the hull (empty where it is not known).

    `simulated`: logs of a simulated boat; False where that is not known, as of CSV files.
    """

    vehicle: str
    config_hash: str
    hull: Mapping[str, float]
    simulated: bool


def origin_of(paths: Sequence[Path]) -> DataOrigin:
    """The origin of MCAP logs.

    ConfigError where they come from two vehicles, by name or by hull, or some from a simulated boat and some from a
    real one: a rehearsal knows nothing of the boat that it rehearses.
    """
    logs = [LogFile(path) for path in paths]
    configs = [config_of(log, path, known_only=True) for log, path in zip(logs, paths, strict=True)]
    names = {config.vehicle.name for config in configs}
    if len(names) > 1:
        raise ConfigError(f"data: logs of different vehicles ({', '.join(sorted(names))})")
    first = configs[0]
    simulated = [_from_simulation(log, config) for log, config in zip(logs, configs, strict=True)]
    for path, config, one in zip(paths, configs, simulated, strict=True):
        apart = differences(hull_of(first.vehicle.vessel), config.vehicle.vessel)
        if apart:
            raise ConfigError(f"data: {path} is of another hull than {paths[0]} by vehicle.vessel ({apart})")
        if one != simulated[0]:
            raise ConfigError(f"data: {path} is of {boat(one)}, and {paths[0]} of {boat(simulated[0])}")
    vehicle = first.vehicle
    return DataOrigin(
        vehicle=vehicle.name,
        config_hash=first.content_hash(),
        hull=hull_of(vehicle.vessel),
        simulated=simulated[0],
    )


def of_simulation(config: Config) -> bool:
    """Whether a config is of a simulated boat: it engages by itself, or the truth is asked for."""
    return is_simulated(config) or TRUTH in config.links.autopilot.streams_hz


def boat(simulated: bool) -> str:
    """Which of the two boats, in words."""
    return "the simulated boat" if simulated else "the real boat"


def _from_simulation(log: LogFile, config: Config) -> bool:
    return of_simulation(config) or log.metadata.get("run", {}).get("mode") == "lockstep"


def once(paths: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """The files to read, and those that are left out: later segments of a log whose first is given, and read with it.

    ConfigError where two files are the same record, which would count twice. LogError where one cannot be read.
    """
    _refuse_same_content(paths)
    runs = {path: _run_of(path) for path in paths if path.suffix.lower() == ".mcap"}
    left_out = []
    for path, run in runs.items():
        for other, whole in runs.items():
            if other == path or not _shared(run, whole):
                continue
            if run.first_tick == whole.first_tick:
                raise ConfigError(f"data: {path} and {other} are the same record: give it once")
            if run.first_tick > whole.first_tick:
                left_out.append(path)
                break
    return [path for path in paths if path not in left_out], left_out


def refuse_shared(data: Sequence[Path], test: Sequence[Path]) -> None:
    """ConfigError where a log to test on is one to train on, or has segments of one."""
    _refuse_same_content([*data, *test])
    trained = {path: _run_of(path) for path in data}
    for path in test:
        run = _run_of(path)
        for other, whole in trained.items():
            if _shared(run, whole):
                raise ConfigError(f"data: {path} is of the same run as {other}, and to test on another drive is needed")


@record
class _RunOf:
    """What a log is of: the run by its word, the segments that are read, and how it begins (config, time in ns)."""

    word: str
    parts: frozenset[str]
    begin: tuple[str, int] | None
    first_tick: int


def _run_of(path: Path) -> _RunOf:
    """LogError where the log cannot be read."""
    log = LogFile(path)
    start_ns = next((inputs.t_ns for inputs, _ in log.ticks()), None)
    config_hash = config_of(log, path, known_only=True).content_hash()
    begin = None if start_ns is None else (config_hash, start_ns)
    return _RunOf(word=log.run, parts=log.parts, begin=begin, first_tick=log.first_tick)


def _shared(a: _RunOf, b: _RunOf) -> bool:
    """Whether both have something of one run. A log in one file has no word, nor what was recovered of several."""
    if a.begin is not None and a.begin == b.begin:
        return True
    return bool(a.word) and a.word == b.word and not a.parts.isdisjoint(b.parts)


def _refuse_same_content(paths: Sequence[Path]) -> None:
    seen: dict[str, Path] = {}
    sizes = [path.stat().st_size for path in paths if is_file(path)]
    for path in paths:
        if is_file(path) and sizes.count(path.stat().st_size) < 2:
            continue
        content = source_hash([path])
        if content in seen:
            raise ConfigError(f"data: {seen[content]} and {path} are the same record: give it once")
        seen[content] = path
