"""The store of a study's runs: JSON lines, one for each run that is done, open to one process at a time."""

from __future__ import annotations

import contextlib
import fcntl
import json
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

from asvhil.errors import AsvhilError
from asvhil.types import record

Result = dict[str, Any]
RESUMES = "what is done is kept: make room, and give the same command again"


@record
class StoredRun:
    """A run that is done: its result, or the error that it ended with, in one line.

    `wall_s` is the time of the run itself, `idle_s` that for which its process had waited for it since the run before;
    None where it was the first of its process. `same`: whether it came out as the run of other code that was stored
    before; None where there was none.
    """

    code: str
    wall_s: float
    result: Result
    error: str = ""
    idle_s: float | None = None
    same: bool | None = None


class Store:
    """The runs of an open store by key. `note` is a remark where the last line had been cut off."""

    def __init__(self, path: Path, runs: dict[str, StoredRun], file: TextIO, note: str) -> None:
        self.runs = runs
        self.note = note
        self._path, self._file = path, file

    def add(self, key: str, run: StoredRun) -> StoredRun:
        """Write a run at once; returns it as JSON reads it back, so that results do not depend on being stored.

        AsvhilError where it cannot be written.
        """
        row: dict[str, Any] = {"key": key, "code": run.code, "wall_s": round(run.wall_s, 3)}
        if run.idle_s is not None:
            row["idle_s"] = round(run.idle_s, 5)
        if run.same is not None:
            row["same"] = run.same
        row |= {"error": run.error} if run.error else {"result": run.result}
        text = json.dumps(row)
        # So that a figure that was damaged, or edited, is not one of a run.
        try:
            self._file.write(f'{text[:-1]}, "crc": {zlib.crc32(text.encode())}}}\n')
            self._file.flush()
        except OSError as error:
            raise AsvhilError(f"{self._path}: cannot be written ({error.strerror}); {RESUMES}") from None
        self.runs[key] = _run_of(json.loads(text))
        return self.runs[key]


@contextmanager
def opened(path: Path) -> Iterator[Store]:
    """The store at a path, for this process alone; a line that was cut off in writing is dropped.

    AsvhilError where it is damaged, cannot be written, or is in use.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists() and not path.is_file():
            raise AsvhilError(f"{path}: is no regular file, and so no store of runs; give another -o")
        file = path.open("a+", encoding="utf-8")
    except OSError as error:
        raise AsvhilError(f"{path}: cannot be written ({error.strerror})") from None
    with _closing(file):
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise AsvhilError(f"{path}: another study is writing to it; wait for it, or give another -o") from None
        text, note = _text(path), ""
        whole = text[: text.rfind("\n") + 1]
        runs, last = _parsed(path, whole), text[len(whole) :]
        if last:
            try:
                runs |= _parsed(path, last)
                file.write("\n")  # the run is complete, but for the end of its line
            except AsvhilError:
                file.truncate(len(whole.encode()))
                note = f"{path}: the last line was cut off in writing; it is dropped, and its run done again"
        yield Store(path, runs, file, note)


@contextmanager
def _closing(file: TextIO) -> Iterator[None]:
    """Close it in the end; what is left to be written, after a write that failed, is lost without a further error."""
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            file.close()


def _text(path: Path) -> str:
    try:
        return path.read_bytes().decode()
    except OSError as error:
        raise AsvhilError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError as error:
        words = "is no text, so this is not a store of runs; give another -o, or delete the file"
        raise AsvhilError(f"{path}: byte {error.start} {words}") from None


def _parsed(path: Path, text: str) -> dict[str, StoredRun]:
    runs = {}
    for number, line in enumerate(text.splitlines(), 1):
        try:
            row = json.loads(line)
            body, mark, crc = line.rpartition(', "crc": ')
            if mark and int(crc.removesuffix("}")) != zlib.crc32(f"{body}}}".encode()):
                raise ValueError("its sum does not fit")
            runs[row["key"]] = _run_of(row)
        except (ValueError, KeyError, TypeError, AttributeError):
            raise AsvhilError(f"{path}: line {number} is not a stored run; delete it, or the file") from None
    return runs


def _run_of(row: dict[str, Any]) -> StoredRun:
    error = str(row.get("error", ""))
    result = {} if error else row["result"]
    if not isinstance(result, dict):
        raise TypeError("a result is an object")
    return StoredRun(
        code=row["code"],
        wall_s=float(row["wall_s"]),
        result=result,
        error=error,
        idle_s=row.get("idle_s"),
        same=row.get("same"),
    )
