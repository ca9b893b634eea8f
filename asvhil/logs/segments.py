"""The files of one run: `log.mcap`, and where the recorder splits it `log-001.mcap`, `log-002.mcap`, ..."""

from __future__ import annotations

import glob
import re
from pathlib import Path

from asvhil.errors import LogError
from asvhil.files import is_folder

_FOLLOWS = re.compile(r"(.+)-([0-9]{3,}|recovered)")


def segment_path(first: Path, number: int) -> Path:
    """The path of a segment by that of the first, whose number is 0."""
    return first if number == 0 else first.with_name(f"{first.stem}-{number:03d}{first.suffix}")


def segments_behind(first: Path, number: int) -> list[Path]:
    """The files with a later number than this one, in their order."""
    found = {}
    for path in first.parent.glob(f"{glob.escape(first.stem)}-*{first.suffix}"):
        digits = path.stem.removeprefix(f"{first.stem}-")
        if digits.isdigit() and int(digits) > number and path == segment_path(first, int(digits)):
            found[int(digits)] = path
    return [found[one] for one in sorted(found)]


def first_in(path: Path) -> Path:
    """The log at a path: itself, or the one in a run's folder. LogError where a folder has none, or several."""
    if not is_folder(path):
        return path
    firsts = logs_in(path)
    if len(firsts) != 1:
        found = ", ".join(log.name for log in firsts[:5])
        found += f" and {len(firsts) - 5} more" if len(firsts) > 5 else ""
        what = f"several logs: {found}; name one" if firsts else "no log (.mcap)"
        raise LogError(f"{path}: a folder with {what}")
    return firsts[0]


def logs_in(folder: Path) -> list[Path]:
    """The logs of a folder by their names: without later segments, and without what was recovered of one."""
    names = {file.stem for file in folder.glob("*.mcap")}
    firsts = sorted(name for name in names if not ((of := _FOLLOWS.fullmatch(name)) and of[1] in names))
    return [folder / f"{name}.mcap" for name in firsts]
