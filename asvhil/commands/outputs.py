"""Files that commands write: checked before long work, whole or not at all, never in the place of an input."""

from __future__ import annotations

import errno
import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from asvhil.errors import AsvhilError, ConfigError
from asvhil.files import write_text

MCAP_MAGIC = b"\x89MCAP"


def write_json(path: Path | None, figures: dict[str, Any]) -> None:
    """Write the file of --json, if there is one. AsvhilError."""
    if path is not None:
        check_json(path)  # again: the run may have written a log of that name meanwhile
        with writing(path, "--json "):
            write_text(path, json.dumps(figures, indent=2) + "\n")


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
        if file.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if file.exists():  # not opened: it may be a pipe
            if not os.access(file, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
            if _head(file).startswith(MCAP_MAGIC):
                raise AsvhilError(f"{option}{file}: is a log, which is never overwritten; give another name")
        else:
            tempfile.TemporaryFile(dir=file.parent).close()


def check_json(file: Path | None, option: str = "--json ") -> None:
    """Check a file that is to hold JSON in the same way. AsvhilError too where there is a file that is not JSON.

    So what a command reads, or has just written, is not lost by a slip.
    """
    check_writable(file, option)
    if file is None:
        return
    with writing(file, option):
        begin = _head(file).lstrip()[:1]
    if begin not in (b"", b"{", b"["):
        raise AsvhilError(f"{option}{file}: is there already, and is not JSON; give another name, or delete it")


def check_apart(*files: tuple[str, Path | None]) -> None:
    """ConfigError where two of the files that are written, each with what names it, are one: the later would take the
    earlier's place.
    """
    seen: dict[Path, str] = {}
    for option, file in files:
        # A pipe, or a terminal, takes as many as come.
        if file is None or (file.exists() and not file.is_file()):
            continue
        other = seen.setdefault(file.resolve(), option)
        if other != option:
            raise ConfigError(f"{option} {file}: is the file of {other} too; give another name")


def _head(file: Path) -> bytes:
    """The first bytes of a regular file; nothing of anything else."""
    if not file.is_file():
        return b""
    with file.open("rb") as opened:
        return opened.read(64)
