"""Files that commands write: checked before long work, whole or not at all, never in the place of an input."""

from __future__ import annotations

import errno
import json
import math
import os
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any, TextIO

from asvhil.errors import AsvhilError, ConfigError
from asvhil.files import identity, is_file, is_there, write_text

MCAP_MAGIC = b"\x89MCAP"
# Of any value, with the words that only Python knows; or a byte order mark.
JSON_BEGINS = (
    *(bytes([one]) for one in b'{["-0123456789'),
    *(b"true", b"false", b"null", b"NaN", b"Infinity"),
    *(b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff"),
)
NOT_JSON = "is there already, and is not JSON; give another name, or delete it"


STDOUT = Path("-")  # in the place of the file of --json
_streams: list[TextIO] = []  # where standard output went before words were sent elsewhere


@contextmanager
def words_to_stderr() -> Iterator[None]:
    """What a command says goes to standard error within it, so that standard output has the figures alone."""
    _streams.append(sys.stdout)
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        _streams.pop()


def write_json(path: Path | None, figures: dict[str, Any]) -> None:
    """Write the file of --json, if there is one; a number that is not finite is null there. AsvhilError.

    `STDOUT` is standard output.
    """
    if path is None:
        return
    text = json.dumps(_finite(figures), indent=2, allow_nan=False) + "\n"
    if path == STDOUT:
        (_streams[-1] if _streams else sys.stdout).write(text)
        return
    check_json(path)  # again: the run may have written a log of that name meanwhile
    with writing(path, "--json "):
        write_text(path, text)


def _finite(value: Any) -> Any:
    """The same with None for each number that JSON does not have: NaN and the infinities."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    return [_finite(part) for part in value] if isinstance(value, list | tuple) else value


@contextmanager
def writing(file: Path, option: str = "") -> Iterator[None]:
    """Turn an OSError of writing a file into an AsvhilError that names the option and the file."""
    try:
        yield
    except OSError as error:
        raise AsvhilError(f"{option}{file}: cannot be written ({error.strerror or error})") from None


def check_picture(file: Path | None) -> None:
    """Check the file of --picture before long work. AsvhilError where it cannot be written, or has no known format."""
    if file is None:
        return
    from asvhil.logs.figure import FORMATS

    if file.suffix.lower() not in FORMATS:
        raise ConfigError(f"--picture {file}: a file that ends in {', '.join(FORMATS)} is expected")
    check_writable(file, "--picture ")


def check_writable(file: Path | None, option: str = "") -> None:
    """Check before long work that a file can be written. AsvhilError; no file is left behind."""
    if file is None:
        return
    with writing(file, option):
        try:
            mode = file.stat().st_mode  # which tells too of a name that no file can have
        except FileNotFoundError:
            tempfile.TemporaryFile(dir=file.parent).close()
            return
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if not os.access(file, os.W_OK):  # not opened: it may be a pipe
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        if _head(file).startswith(MCAP_MAGIC):
            raise AsvhilError(f"{option}{file}: is a log, which is never overwritten; give another name")


def check_json(file: Path | None, option: str = "--json ") -> None:
    """Check a file that is to hold JSON in the same way. AsvhilError too where there is a file that holds no figures.

    So what a command reads, keeps, or has just written, is not lost by a slip.
    """
    if file == STDOUT and option == "--json ":
        return
    check_writable(file, option)
    if file is None or not is_file(file):
        return
    with writing(file, option):
        fault = _no_figures_by_head(_head(file)) or _no_figures(file.read_bytes())
    if fault:
        raise AsvhilError(f"{option}{file}: {fault}")


def _no_figures_by_head(head: bytes) -> str:
    """The same as far as the first bytes tell: a log of gigabytes is not read to refuse it."""
    from asvhil.study.store import BEGIN

    if head.startswith(BEGIN):
        return "is a store of runs; give another name"
    begin = head.lstrip()
    return NOT_JSON if begin and not begin.startswith(JSON_BEGINS) else ""


def _no_figures(content: bytes) -> str:
    """What a file holds that is not figures of an earlier run, and what to do; empty of such figures, and of nothing.

    Hours of work are in what a study keeps as JSON too: the record of a search.
    """
    from asvhil.study.tuning_record import is_record

    if not content.strip():
        return ""
    try:
        tree = json.loads(content)
    except RecursionError:
        return ""
    except json.JSONDecodeError as error:
        if error.msg == "Extra data" and content.lstrip().startswith((b"{", b"[")):
            return "is there already, and holds more than one piece of JSON; give another name, or delete it"
        return NOT_JSON
    except UnicodeDecodeError:
        return NOT_JSON
    return "is the record of a search; give another name" if is_record(tree) else ""


def check_apart(*files: tuple[str, Path | None]) -> None:
    """ConfigError where two of the files that are read, kept or written are one: the later would take the earlier's
    place.

    Each with what names it: an option, or words such as "the config". Files of one name may be the same.
    """
    seen: dict[object, str] = {}
    for option, file in files:
        # A pipe, or a terminal, takes as many as come.
        if file is None or (file == STDOUT and option == "--json") or (is_there(file) and not is_file(file)):
            continue
        other = seen.setdefault(identity(file), option)  # by what it is, not by its name: it may have two
        if other != option:
            what = f"the file of {other} too" if other.startswith("--") else other
            raise ConfigError(f"{option} {file}: is {what}; give another name")


def check_figures(json_: Path | None, *others: tuple[str, Path | None]) -> None:
    """Check the file of --json before the work, beside what else the command reads, keeps or writes. AsvhilError."""
    check_apart(*others, ("--json", json_))
    check_json(json_)


def config_and_bases(config: str) -> list[tuple[str, Path | None]]:
    """The files of a config, for `check_figures`. ConfigError where there is no such config."""
    from asvhil.config.loading import config_files

    return [("the config", file) for file in config_files(config)]


def columns_file(columns: str | None) -> list[tuple[str, Path | None]]:
    """The file of --columns, for `check_figures`."""
    return [("the column map", Path(columns))] if columns else []


def _head(file: Path) -> bytes:
    """The first bytes of a regular file; nothing of anything else."""
    if not is_file(file):
        return b""
    with file.open("rb") as opened:
        return opened.read(64)
