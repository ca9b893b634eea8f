"""New files that have their name only once they are whole, and are on the disk then."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole_file(target: Path) -> Iterator[Path]:
    """A file beside the target to write to, which takes its name at the end. OSError; after one nothing is left.

    Unlike a rename, this never takes the place of another file.
    """
    part = target.with_name(f"{target.name}.part")
    try:
        yield part
        os.link(part, target)
        sync_folder(target.parent)
    finally:
        part.unlink(missing_ok=True)


def sync_folder(folder: Path) -> None:
    """Sync the folder, so that the name of a new file is on the disk too."""
    fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)
