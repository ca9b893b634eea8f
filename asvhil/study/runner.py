"""Many independent runs on all cores, stored as JSON lines, so that an interrupted study can be resumed."""

from __future__ import annotations

import dataclasses
import fcntl
import functools
import hashlib
import json
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, TextIO

from asvhil.errors import AsvhilError
from asvhil.machine_code.compiler import use_compiler
from asvhil.types import record

WATCH_S = 0.3
PACKAGE = Path(__file__).resolve().parents[1]
# Packages that determine the result of a run. How studies count, draw and show their runs does not.
DECISIVE = (
    *("types.py", "geo.py", "config", "io", "dynamics", "estimator", "controller", "autopilot", "supervisor", "motion"),
    *("operator", "backseat", "simplant", "logs", "study/trials"),
)

Result = dict[str, Any]
Function = Callable[..., Result]


@record
class Job:
    """One run. `key` identifies everything that its result depends on; `group` names runs of about the same time."""

    key: str
    group: str
    arguments: tuple[Any, ...]  # of the function, picklable


@record
class StudyProgress:
    """Progress of a study. `remaining_s` is None until a run of every group is done.

    `note` is a remark on the store, given once at the start. `part` names the part of the study that is counted, if it
    is not the whole.
    """

    done: int
    total: int
    remaining_s: float | None = None
    total_s: float | None = None  # of the whole study on these processes, runs that were stored already included
    note: str = ""
    part: str = ""


@record
class Finished:
    """Results in the order of the jobs, time of each group (s), and the number of runs made by other code."""

    results: list[Result]
    group_s: dict[str, float]
    processes: int
    outdated: int


Tell = Callable[[StudyProgress], None]
Run = Callable[[Function, Sequence[Job]], Finished]  # what runs the jobs of a study, such as `run_into`


def run_into(store: Path, *, workers: int | None = None, tell: Tell = lambda progress: None) -> Run:
    """`run_jobs` with one store, as a function that studies call."""
    return functools.partial(run_jobs, store=store, workers=workers, tell=tell)


def run_jobs(
    function: Function,
    jobs: Sequence[Job],
    store: Path,
    *,
    workers: int | None = None,
    tell: Tell = lambda progress: None,
) -> Finished:
    """`function(*arguments)` for each job whose key the store does not hold yet; results must be JSON-able.

    Processes: `workers`, all cores where None, none but this one where 0. Results come back as JSON reads them, so
    that they do not depend on whether they were stored. Raises AsvhilError where the store is damaged, cannot be
    written or belongs to another study that is running, and what a job raises, after ending the other processes.
    """
    processes = 1 if workers == 0 else workers or os.cpu_count() or 1
    version = code_version()
    with _opened(store) as (stored, file, note):
        missing = list({job.key: job for job in jobs if job.key not in stored}.values())
        tell(dataclasses.replace(_progress(jobs, stored, processes), note=note))
        with closing(_run(function, missing, workers, processes)) as runs:
            for job, result, wall_s in runs:
                text = json.dumps({"key": job.key, "code": version, "wall_s": round(wall_s, 3), "result": result})
                file.write(text + "\n")
                file.flush()
                stored[job.key] = json.loads(text)
                tell(_progress(jobs, stored, processes))
    lines = {job.key: stored[job.key] for job in jobs}
    return Finished(
        results=[lines[job.key]["result"] for job in jobs],
        group_s=_group_s(jobs, stored),
        processes=processes,
        outdated=sum(line["code"] != version for line in lines.values()),
    )


@functools.cache
def code_version() -> str:
    """First 12 hex digits of the SHA-256 over the sources that determine the result of a run."""
    digest = hashlib.sha256()
    for name in DECISIVE:
        path = PACKAGE / name
        for source in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            digest.update(source.read_bytes())
    return digest.hexdigest()[:12]


# --- the store ---------------------------------------------------------------------------------------------


@contextmanager
def _opened(store: Path) -> Iterator[tuple[dict[str, dict[str, Any]], TextIO, str]]:
    """What the store holds by key, the file to add to, for this process alone, and a note where a run was dropped."""
    try:
        store.parent.mkdir(parents=True, exist_ok=True)
        file = store.open("a+", encoding="utf-8")
    except OSError as error:
        raise AsvhilError(f"{store}: cannot be written ({error.strerror})") from None
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise AsvhilError(f"{store}: another study is writing to it; wait for it, or give another -o") from None
        text, note = _text(store), ""
        whole = text[: text.rfind("\n") + 1]
        stored, last = _parsed(store, whole), text[len(whole) :]
        if last:
            try:
                stored |= _parsed(store, last)
                file.write("\n")  # the run is complete, but for the end of its line
            except AsvhilError:
                file.truncate(len(whole.encode()))
                note = f"{store}: the last line was cut off in writing; it is dropped, and its run done again"
        yield stored, file, note


def _text(store: Path) -> str:
    try:
        return store.read_bytes().decode()
    except OSError as error:
        raise AsvhilError(f"{store}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError as error:
        words = "is no text, so this is not a store of runs; give another -o, or delete the file"
        raise AsvhilError(f"{store}: byte {error.start} {words}") from None


def _parsed(store: Path, text: str) -> dict[str, dict[str, Any]]:
    stored = {}
    for number, line in enumerate(text.splitlines(), 1):
        try:
            row = json.loads(line)
            stored[row["key"]] = {"code": row["code"], "wall_s": float(row["wall_s"]), "result": row["result"]}
        except (ValueError, KeyError, TypeError):
            raise AsvhilError(f"{store}: line {number} is not a stored run; delete it, or the file") from None
    return stored


# --- time --------------------------------------------------------------------------------------------------


def _group_s(jobs: Sequence[Job], stored: dict[str, dict[str, Any]]) -> dict[str, float]:
    spent: dict[str, float] = {}
    for job in {job.key: job for job in jobs}.values():
        if job.key in stored:
            spent[job.group] = spent.get(job.group, 0.0) + stored[job.key]["wall_s"]
    return spent


def _progress(jobs: Sequence[Job], stored: dict[str, dict[str, Any]], processes: int) -> StudyProgress:
    unique = list({job.key: job for job in jobs}.values())
    done: dict[str, int] = {}
    all_: dict[str, int] = {}
    for job in unique:
        all_[job.group] = all_.get(job.group, 0) + 1
        done[job.group] = done.get(job.group, 0) + (job.key in stored)
    remaining_s = total_s = None
    if all(done.values()):
        spent = _group_s(unique, stored)
        total_s = sum(spent[group] / done[group] * all_[group] for group in all_) / processes
        remaining_s = sum(spent[group] / done[group] * (all_[group] - done[group]) for group in all_) / processes
    return StudyProgress(done=sum(done.values()), total=len(unique), remaining_s=remaining_s, total_s=total_s)


# --- processes ---------------------------------------------------------------------------------------------


def _run(
    function: Function, jobs: Sequence[Job], workers: int | None, processes: int
) -> Generator[tuple[Job, Result, float], None, None]:
    """(job, result, seconds) as they come."""
    if not jobs:
        return
    if workers == 0:
        for job in jobs:
            yield job, *_timed(function, job.arguments)
        return
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    pool = ProcessPoolExecutor(min(processes, len(jobs)), context, initializer=_obey, initargs=(stop,))
    try:
        running: dict[Future[tuple[Result, float]], Job] = {
            pool.submit(_timed, function, job.arguments): job for job in jobs
        }
        while running:
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                yield running.pop(future), *future.result()
    except BrokenProcessPool:
        words = "a process of the study died (out of memory?); start it again to go on where it was"
        raise AsvhilError(words) from None
    except BaseException:
        stop.set()  # runs that have begun are not waited for
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _timed(function: Function, arguments: tuple[Any, ...]) -> tuple[Result, float]:
    begin_s = time.perf_counter()
    return function(*arguments), time.perf_counter() - begin_s


def _obey(stop: Any) -> None:
    """In a worker process, before its first job: end when stopped, or when the study's process has ended in any way."""
    parent = multiprocessing.parent_process()

    def watch() -> None:
        while not stop.wait(WATCH_S) and parent is not None and parent.is_alive():
            pass
        os._exit(1)

    # Ctrl-C reaches every process of the terminal; only the study itself reports it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=watch, daemon=True).start()
    use_compiler()
