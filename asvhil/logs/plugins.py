"""Plug-ins of a run in its log: their records, and the check that they are available when the log is read.

One metadata record for each, `plugin.0`, `plugin.1`, ...: of a file its path, its SHA-256 and its text; of an installed
package its name and version. `gives` are the kinds that the run had of it, such as `controller my-pid`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from asvhil.config import Config
from asvhil.config.plugins import Plugin, PluginFile, all_loaded, load_files, load_source, loaded
from asvhil.config.registry import AUTOPILOTS, REGISTRIES, SENSORS, Registry
from asvhil.errors import ConfigError, LogError
from asvhil.files import is_file
from asvhil.logs.reader import LogFile

PREFIX = "plugin."


def plugin_records(config: Config) -> dict[str, dict[str, str]]:
    """The metadata records of all plug-ins of a run."""
    found: list[dict[str, str]] = []
    for one in config.plugins:
        plugin = loaded(one.sha256)
        if plugin is not None:
            found.append({"file": one.file, "sha256": plugin.sha256, "gives": _gives(plugin), "source": plugin.source})
    packages: dict[tuple[str, str], list[str]] = {}
    for registry, name in config.chosen():
        origin = registry.origin(name)
        if origin.package:
            packages.setdefault((origin.package, origin.version), []).append(f"{registry.what} {name}")
    found += (
        {"package": package, "version": version, "gives": ", ".join(names)}
        for (package, version), names in packages.items()
    )
    return {f"{PREFIX}{number}": record for number, record in enumerate(found)}


def check_plugins(log: LogFile, path: Path) -> None:
    """LogError, one line, where a plug-in that the run was made with is not loaded, or not installed."""
    for record in _records(log):
        if "package" in record:
            _check_package(record, path)
        elif loaded(record.get("sha256")) is None:
            raise LogError(f"{path}: {_missing(record)}")


def check_decoding(log: LogFile, path: Path, config: Config) -> None:
    """As `check_plugins`, where a kind that decodes frames is not known: the autopilot's or a sensor's."""
    links = config.links
    kinds = [AUTOPILOTS.get(links.autopilot.profile), *(SENSORS.get(link.kind) for link in links.sensors.values())]
    if None in kinds:
        check_plugins(log, path)


def load_plugins(logs: Iterable[Path], files: Iterable[Path] = (), *, allow_recorded: bool = False) -> None:
    """Load plug-ins for reading logs: the files, then, where it is allowed, those that the logs hold the text of.

    Either runs their code. ConfigError where a file cannot be loaded, LogError where a text is damaged.
    """
    load_files(PluginFile(file=str(file.absolute())) for file in files)
    for path in logs if allow_recorded else ():
        for record in _records(LogFile(path)):
            if "package" not in record and loaded(record.get("sha256")) is None:
                _load_recorded(record, path)


def changed_packages(log: LogFile) -> list[str]:
    """Packages with plug-ins of a run that are installed in another version now: `parts 0.3 then, parts 0.4 now`."""
    found = []
    for record in _records(log):
        then = f"{record.get('package')} {record.get('version')}"
        for registry, name in _given(record):
            if registry.get(name) is not None:
                origin = registry.origin(name)
                now = f"{origin.package} {origin.version}"
                found += [f"{then} then, {now} now"] if now != then else []
    return list(dict.fromkeys(found))


def _records(log: LogFile) -> Iterator[dict[str, str]]:
    return (values for name, values in sorted(log.metadata.items()) if name.startswith(PREFIX))


def _gives(plugin: Plugin) -> str:
    return ", ".join(f"{registry.what} {row.name}" for registry, row in plugin.rows)


def _given(record: dict[str, str]) -> list[tuple[Registry[Any], str]]:
    """The kinds that a run used of a package."""
    registries = {registry.what: registry for registry in REGISTRIES}
    pairs = (given.rpartition(" ") for given in record.get("gives", "").split(", ") if "package" in record)
    return [(registries[what], name) for what, _, name in pairs if what in registries]


def _check_package(record: dict[str, str], path: Path) -> None:
    for registry, name in _given(record):
        if registry.get(name) is None:
            package = f"the package {record['package']} {record.get('version', '')}"
            raise LogError(f"{path}: the run had the {registry.what} {name} of {package}, which is not installed here")


def _load_recorded(record: dict[str, str], path: Path) -> None:
    data = record.get("source", "").encode()
    if hashlib.sha256(data).hexdigest() != record.get("sha256"):
        raise LogError(f"{path}: the record of the plug-in {record.get('file')} is damaged")
    try:
        load_source(record.get("file", ""), data)
    except ConfigError as error:
        raise LogError(f"{path}: {error}") from None


def _missing(record: dict[str, str]) -> str:
    """The message for a plug-in file that is not loaded."""
    file, sha256 = Path(record.get("file", "")), record.get("sha256", "")
    others = [one for one in all_loaded() if Path(one.file).name == file.name]
    what = f"the run had the {record.get('gives')} of the plug-in {file.name} (SHA-256 {sha256[:12]})"
    if others:
        return f"{what}, and {others[-1].file} is not the same (SHA-256 {others[-1].sha256[:12]})"
    ways = f"give that file with --plugin{_place(file, sha256)}, or run the copy in the log with"
    return f"{what}; {ways} --allow-recorded-plugins if you trust it"


def _place(file: Path, sha256: str) -> str:
    """The path of the file if it is still there, unchanged. It is read, not run: a log never chooses what is run."""
    try:
        same = is_file(file) and hashlib.sha256(file.read_bytes()).hexdigest() == sha256
    except OSError:
        same = False
    return f" {file}" if same else ""
