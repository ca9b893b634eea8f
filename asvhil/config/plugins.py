"""Plug-in files: kinds of one's own, loaded by path at start-up.

A plug-in is one Python file. Every record of a kind (`ControllerKind`, ...) that stands at its top level is a row of
the registries from then on. A file is run when a config that is loaded names it, or when somebody names the file
(`--plugin`). What a log holds or names is never run for that reason alone.
"""

from __future__ import annotations

import hashlib
import sys
import types
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from asvhil.config.base import Section
from asvhil.config.registry import REGISTRIES, Kind, Origin, Registry
from asvhil.errors import ConfigError
from asvhil.types import record

Row = tuple[Registry[Any], Kind]


class PluginFile(Section):
    """A plug-in: a Python file. In YAML also as one word, its path."""

    file: str = Field(min_length=1, description="Path of the file, from the folder of the config that names it.")
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")] | None = Field(
        default=None, description="SHA-256 that the file must have; null: that of the file as it is."
    )

    @model_validator(mode="before")
    @classmethod
    def _from_word(cls, value: Any) -> Any:
        return {"file": value} if isinstance(value, str) else value


@record
class Plugin:
    """A plug-in that was loaded: the text that was run, and the rows that it has given."""

    file: str
    sha256: str
    source: str
    rows: tuple[Row, ...]


_loaded: dict[str, Plugin] = {}  # by the SHA-256 of what was run


def loaded(sha256: str | None) -> Plugin | None:
    """The plug-in of a SHA-256, if it was loaded."""
    return _loaded.get(sha256 or "")


def all_loaded() -> tuple[Plugin, ...]:
    """Every plug-in that was loaded."""
    return tuple(_loaded.values())


def unload_all() -> None:
    """Take out the rows of all plug-ins and installed packages, as in a new process. Configs that use them are void."""
    for registry in REGISTRIES:
        registry.forget_added()
    _loaded.clear()


def load_files(files: Iterable[PluginFile]) -> list[Plugin]:
    """Load the plug-ins of one config. ConfigError, one line, where one cannot be loaded, or two define one name."""
    found: list[Plugin] = []
    owners: dict[tuple[str, str], str] = {}
    for one in files:
        plugin = load_source(one.file, _read(one))
        for registry, row in plugin.rows:
            other = owners.setdefault((registry.what, row.name), plugin.file)
            if other != plugin.file:
                raise ConfigError(f"plug-in {plugin.file}: {registry.what} {row.name} is defined in {other} too")
        found.append(plugin)
    return found


def load_source(file: str, data: bytes) -> Plugin:
    """Run the content of a plug-in, once for each SHA-256, and add its rows. ConfigError, one line, where it fails."""
    sha256 = hashlib.sha256(data).hexdigest()
    plugin = _loaded.get(sha256)
    if plugin is None:
        try:
            source = data.decode()
        except UnicodeDecodeError:
            raise ConfigError(f"plug-in {file}: not UTF-8 text") from None
        plugin = Plugin(file=file, sha256=sha256, source=source, rows=_rows_of(_run(file, sha256, source)))
        if not plugin.rows:
            kinds = ", ".join(registry.kind.__name__ for registry in REGISTRIES)
            raise ConfigError(f"plug-in {file}: has none of these at its top level: {kinds}")
    for registry, row in plugin.rows:
        registry.add(row, Origin(file=file, sha256=sha256))
    _loaded[sha256] = plugin
    return plugin


def _read(one: PluginFile) -> bytes:
    try:
        data = Path(one.file).read_bytes()
    except OSError as error:
        raise ConfigError(f"plug-in {one.file}: cannot be read ({error.strerror})") from None
    sha256 = hashlib.sha256(data).hexdigest()
    if one.sha256 is not None and sha256 != one.sha256:
        raise ConfigError(f"plug-in {one.file}: has changed: SHA-256 {sha256[:12]}, not {one.sha256[:12]}")
    return data


def _run(file: str, sha256: str, source: str) -> types.ModuleType:
    """The module of a source. It is known to Python, as classes want it, by a name that no other module has."""
    name = f"asvhil_plugin_{sha256[:16]}"
    module = types.ModuleType(name)
    module.__file__ = file
    sys.modules[name] = module
    try:
        exec(compile(source, file, "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        words = "it ends the program" if isinstance(error, SystemExit) else _words(error)
        raise ConfigError(f"plug-in {file}{_line(error, file)}: {words}") from None
    return module


def _line(error: BaseException, file: str) -> str:
    """Where in the plug-in something failed."""
    line = error.lineno if isinstance(error, SyntaxError) else None
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == file:
            line = trace.tb_lineno
        trace = trace.tb_next
    return "" if line is None else f", line {line}"


def _words(error: Exception) -> str:
    text = error.msg if isinstance(error, SyntaxError) else str(error)
    return f"{type(error).__name__}: {' '.join(text.split())}"


def _rows_of(module: types.ModuleType) -> tuple[Row, ...]:
    """The records of kinds at the top level of a module, in its order, each once."""
    rows: list[Row] = []
    values: Sequence[Any] = list(vars(module).values())
    for value in values:
        for registry in REGISTRIES:
            if isinstance(value, registry.kind) and not any(value is row for _, row in rows):
                rows.append((registry, value))
    return tuple(rows)
