"""Files that have their name only once they are whole: new ones, and ones that take the place of another.

And a look at a path that a user gives, which never raises: whoever opens it then tells what is wrong. Those of
`pathlib` raise, in Python 3.11, where a folder may not be entered or a name is too long.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def is_there(path: Path) -> bool:
    """Whether there is a file, or anything else, at a path; not where that cannot be told."""
    return os.path.exists(path)


def is_file(path: Path) -> bool:
    """Whether there is a regular file at a path; not where that cannot be told."""
    return os.path.isfile(path)


def is_folder(path: Path) -> bool:
    """Whether there is a folder at a path; not where that cannot be told."""
    return os.path.isdir(path)


def identity(path: Path) -> object:
    """What is the same for two paths of one file, whatever they are called; by the name of what is not there."""
    try:
        there = path.stat()
    except (OSError, ValueError):
        return os.path.realpath(path)
    return there.st_dev, there.st_ino


def shown(text: str) -> str:
    r"""A text for people with what UTF-8 cannot hold escaped: a byte of a file's name that is none is `\xf6` in it.

    Names may hold any bytes, and Python has those that it cannot decode as surrogates. Where it took all names for
    ASCII, as the locale POSIX says, those that are UTF-8 are read as such.
    """
    try:
        raw = text.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:  # a surrogate that stands for no byte
        raw = text.encode("utf-8", "backslashreplace")
    return raw.decode("utf-8", "backslashreplace")


@contextmanager
def whole_file(target: Path) -> Iterator[Path]:
    """A file beside the target to write to, which takes its name at the end, and is on the disk then.

    OSError, FileExistsError where the target is there already: unlike `replacement`, this never takes the place of
    another file. After an error nothing is left.
    """
    part = target.with_name(f"{target.name}.part")
    try:
        yield part
        os.link(part, target)
        sync_folder(target.parent)
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def replacement(path: Path, *, sync: bool = False) -> Iterator[Path]:
    """A file to write to, which takes the place of the one at `path`, if there is one, when it is whole.

    Until then, and after any error, what was there stays as it was. A link stays a link to what is replaced. A pipe, a
    device such as /dev/stdout, and a file in a folder that takes no new ones are written to themselves. With `sync` the
    file is on the disk before it has its name, so that a power cut leaves the old or the new one. OSError.
    """
    target = path.resolve()
    if path.exists() and not (path.is_file() and os.access(target.parent, os.W_OK)):
        yield path
        return
    part = target.with_name(f".{target.stem}.{os.getpid()}.part{target.suffix}")
    try:
        yield part
        if target.exists():
            part.chmod(target.stat().st_mode & 0o7777)
        if sync:
            _sync(part, os.O_RDONLY)
        os.replace(part, target)
        if sync:
            sync_folder(target.parent)
    finally:
        part.unlink(missing_ok=True)


def write_text(path: Path, text: str, *, sync: bool = False) -> None:
    """Write a text as a `replacement`, in UTF-8. OSError."""
    with replacement(path, sync=sync) as part:
        part.write_text(text, encoding="utf-8")


def sync_folder(folder: Path) -> None:
    """Sync the folder, so that the name of a new file is on the disk too."""
    _sync(folder, os.O_RDONLY | os.O_DIRECTORY)


def _sync(path: Path, flags: int) -> None:
    fd = os.open(path, flags)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)
