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
from asvhil.files import is_file, is_there
from asvhil.types import record

Result = dict[str, Any]
BEGIN = b'{"key": "'  # of each line
SUM = b', "crc": '
KEYS = {"key", "code", "wall_s", "idle_s", "same", "error", "result", "crc"}
NAMED_MOST = 5  # lines of a store in one error
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
        if is_there(path) and not is_file(path):
            raise AsvhilError(f"{path}: is no regular file, and so no store of runs; give another -o")
        file = path.open("a+", encoding="utf-8")
    except OSError as error:
        raise AsvhilError(f"{path}: cannot be written ({error.strerror})") from None
    with _closing(file):
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise AsvhilError(f"{path}: another study is writing to it; wait for it, or give another -o") from None
        content = _content(path)
        whole = content[: content.rfind(b"\n") + 1]
        runs, last = _parsed(path, whole), content[len(whole) :]
        notes = []
        if last:
            try:
                runs |= _parsed(path, last)
                whole = content
                file.write("\n")  # the run is complete, but for the end of its line
            except AsvhilError:
                _check_own(path, runs, last)
                file.truncate(len(whole))
                notes.append(f"{path}: the last line was cut off in writing; it is dropped, and its run done again")
        note = "; ".join(filter(None, [*notes, _without_sum(path, whole)]))
        yield Store(path, runs, file, note)


@contextmanager
def _closing(file: TextIO) -> Iterator[None]:
    """Close it in the end; what is left to be written, after a write that failed, is lost without a further error."""
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            file.close()


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise AsvhilError(f"{path}: cannot be read ({error.strerror})") from None


def _check_own(path: Path, runs: dict[str, StoredRun], last: bytes) -> None:
    """AsvhilError where nothing in a file is of a store: what its last line lacks is not to be dropped then."""
    if not runs and not last.startswith(BEGIN[: len(last)]):
        raise AsvhilError(f"{path}: line 1 is not a stored run, so this is no store of runs; give another -o")


def _parsed(path: Path, content: bytes) -> dict[str, StoredRun]:
    """The runs of whole lines. The bytes of each are judged apart, so that damage is that of one line."""
    runs = {}
    for number, line in enumerate(content.splitlines(), 1):
        try:
            row = json.loads(line.decode())
            body, mark, crc = line.rpartition(SUM)
            if mark and int(crc.removesuffix(b"}")) != zlib.crc32(body + b"}"):
                raise ValueError("its sum does not fit")
            if bool(mark) != ("crc" in row) or not set(row) <= KEYS:
                raise ValueError("not as a store writes it: a damaged key, or an edit")
            runs[row["key"]] = _run_of(row)
        except (ValueError, KeyError, TypeError, AttributeError):
            raise AsvhilError(f"{path}: line {number} is not a stored run; delete it, or the file") from None
    return runs


def _without_sum(path: Path, content: bytes) -> str:
    """What to say of lines without a sum: none of those that were written before there were sums.

    AsvhilError for those whose code has written others with a sum: they have lost their own, as in an edit.
    """
    lines = content.splitlines()
    bare = {number: json.loads(line)["code"] for number, line in enumerate(lines, 1) if SUM not in line}
    summed = {json.loads(line)["code"] for line in lines if SUM in line} if bare else set()
    lost = [number for number, code in bare.items() if code in summed]
    if lost:
        one = len(lost) == 1
        named = ", ".join(map(str, lost[:NAMED_MOST]))
        rest = f" and {len(lost) - NAMED_MOST} more" if len(lost) > NAMED_MOST else ""
        which = f"line {named} has lost its" if one else f"lines {named}{rest} have lost their"
        what = "delete it, and its run is" if one else "delete them, and their runs are"
        raise AsvhilError(f"{path}: {which} checksum, which other runs of the same code have; {what} done again")
    count = f"{len(bare)} lines have" if len(bare) != 1 else f"line {next(iter(bare))} has"
    return f"{path}: {count} no checksum, as of an older version; taken as they are, edited or not" if bare else ""


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
