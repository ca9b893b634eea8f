"""Plug-ins of a run in its log: what was recorded of them, and whether they are here when it is read.

One metadata record for each, `plugin.0`, `plugin.1`, ...: of a file its path, its SHA-256 and its text; of an installed
package its name and version. `gives` are the kinds that the run had of it, such as `controller my-pid`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path

from asvhil.config import Config
from asvhil.config.plugins import Plugin, PluginFile, all_loaded, load_files, load_source, loaded
from asvhil.config.registry import AUTOPILOTS, REGISTRIES, SENSORS
from asvhil.errors import ConfigError, LogError
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


def load_plugins(path: Path, files: Iterable[Path] = (), *, allow_recorded: bool = False) -> None:
    """Load plug-ins for reading a log: the files, then, where it is allowed, those that the log holds the text of.

    Either runs their code. ConfigError where a file cannot be loaded, LogError where a text is damaged.
    """
    load_files(PluginFile(file=str(file.absolute())) for file in files)
    for record in _records(LogFile(path)) if allow_recorded else ():
        if "package" in record or loaded(record.get("sha256")) is not None:
            continue
        data = record.get("source", "").encode()
        if hashlib.sha256(data).hexdigest() != record.get("sha256"):
            raise LogError(f"{path}: the record of the plug-in {record.get('file')} is damaged")
        try:
            load_source(record.get("file", ""), data)
        except ConfigError as error:
            raise LogError(f"{path}: {error}") from None


def _records(log: LogFile) -> Iterator[dict[str, str]]:
    return (values for name, values in sorted(log.metadata.items()) if name.startswith(PREFIX))


def _gives(plugin: Plugin) -> str:
    return ", ".join(f"{registry.what} {row.name}" for registry, row in plugin.rows)


def _check_package(record: dict[str, str], path: Path) -> None:
    whats = {registry.what: registry for registry in REGISTRIES}
    for given in record["gives"].split(", "):
        what, _, name = given.rpartition(" ")
        if what not in whats or whats[what].get(name) is None:
            package = f"the package {record['package']} {record.get('version', '')}"
            raise LogError(f"{path}: the run had the {given} of {package}, which is not installed here")


def _missing(record: dict[str, str]) -> str:
    """What to tell of a plug-in file that is not loaded."""
    file, sha256 = Path(record.get("file", "")), record.get("sha256", "")
    others = [one for one in all_loaded() if Path(one.file).name == file.name]
    what = f"the run had the {record.get('gives')} of the plug-in {file.name} (SHA-256 {sha256[:12]})"
    if others:
        return f"{what}, and {others[-1].file} is not the same (SHA-256 {others[-1].sha256[:12]})"
    ways = f"give that file with --plugin{_place(file, sha256)}, or run the copy in the log with"
    return f"{what}; {ways} --allow-recorded-plugins if you trust it"


def _place(file: Path, sha256: str) -> str:
    """Where the file still is, unchanged. It is looked at, and not run: a log does not choose what is."""
    try:
        same = file.is_file() and hashlib.sha256(file.read_bytes()).hexdigest() == sha256
    except OSError:
        same = False
    return f" {file}" if same else ""
