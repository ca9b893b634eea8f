"""Many independent runs on all cores or a cluster, stored as they come, so that an interrupted study can be resumed."""

from __future__ import annotations

import dataclasses
import functools
import json
import os
import random
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

from asvhil.study.code_version import code_version
from asvhil.study.executors import (
    Function,
    Job,
    Outcomes,
    connected,
    run_here,
    run_on_cluster,
    run_on_processes,
    threads_of,
)
from asvhil.study.store import Result, StoredRun, opened
from asvhil.types import record

__all__ = ["Finished", "Function", "Job", "Result", "Run", "StudyProgress", "Tell", "run_into", "run_jobs"]


@record
class StudyProgress:
    """Progress of a study. `remaining_s` is None until a run of every group is done.

    `note` is a remark on the store, given once at the start. `part` names the part of the study that is counted, if it
    is not the whole. `outdated`: how many stored runs, made by other code, are taken as they are; given once too.
    `again` of these were run again, and came out the same but for `changed`; given once, at the end.
    """

    done: int
    total: int
    remaining_s: float | None = None
    total_s: float | None = None  # of the whole study on these processes, runs that were stored already included
    note: str = ""
    part: str = ""
    outdated: int = 0
    again: int = 0
    changed: int = 0


@record
class Finished:
    """Results in the order of the jobs, time of each group (s), and the number of runs made by other code.

    `outdated` of them are taken as they are, `again` were run again by this code, and `changed` of those differ then.
    `errors` has by its key the error of each job that failed, whose result is empty; only isolated jobs fail so.
    `idle_s` is the mean time for which a process waited for its next run, None where that is not known; `elapsed_s` and
    `runs_now` are of this call alone.
    """

    results: list[Result]
    group_s: dict[str, float]
    processes: int
    outdated: int
    again: int = 0
    changed: int = 0
    errors: dict[str, str]
    idle_s: float | None = None
    elapsed_s: float = 0.0
    runs_now: int = 0


Tell = Callable[[StudyProgress], None]
Run = Callable[[Function, Sequence[Job]], Finished]  # what runs the jobs of a study, such as `run_into`


def run_into(
    store: Path,
    *,
    workers: int | None = None,
    tell: Tell = lambda progress: None,
    scheduler: str | None = None,
    isolate: bool = False,
    retry: bool = False,
    confirm: int = 0,
) -> Run:
    """`run_jobs` with one store, as a function that studies call."""
    return functools.partial(
        run_jobs,
        store=store,
        workers=workers,
        tell=tell,
        scheduler=scheduler,
        isolate=isolate,
        retry=retry,
        confirm=confirm,
    )


def run_jobs(
    function: Function,
    jobs: Sequence[Job],
    store: Path,
    *,
    workers: int | None = None,
    tell: Tell = lambda progress: None,
    scheduler: str | None = None,
    isolate: bool = False,
    retry: bool = False,
    confirm: int = 0,
) -> Finished:
    """`function(*arguments)` for each job whose key the store does not hold yet; results must be JSON-able.

    Processes: `workers`, all cores where None, none but this one where 0; or the workers of the Dask cluster whose
    scheduler has the address `scheduler`. Results come back as JSON reads them, so that they do not depend on whether
    they were stored. With `isolate` an error is stored as what came of a job, and `retry` runs those again that had
    one; else it is raised after ending the other processes. Of the stored runs that other code made, so many are drawn
    at random and run again that `confirm` are known; what comes of them replaces what was stored. Raises AsvhilError
    where the store is damaged, cannot be written or belongs to another study that is running, and where the cluster
    cannot be used.
    """
    with ExitStack() as stack:
        kept = stack.enter_context(opened(store))
        missing = [job for job in _unique(jobs) if _is_missing(kept.runs.get(job.key), isolate, retry)]
        older, told = _taken(jobs, kept.runs, {job.key for job in missing})
        share = min(len(older), max(0, confirm - len(told)))
        drawn = random.Random(code_version()).sample(older, share)
        before = {job.key: kept.runs[job.key] for job in drawn}
        outdated = len(older) - len(drawn)
        missing += drawn
        client = stack.enter_context(connected(scheduler)) if scheduler is not None and missing else None
        processes = threads_of(client) if client else 1 if workers == 0 else workers or os.cpu_count() or 1
        tally = _Tally(jobs, kept.runs, {job.key for job in missing}, processes)
        tell(dataclasses.replace(tally.progress(), note=kept.note, outdated=outdated))
        begin_s = time.monotonic()
        outcomes: Outcomes
        if client is not None:
            outcomes = run_on_cluster(function, missing, client, isolate)
        elif workers == 0:
            outcomes = run_here(function, missing, isolate)
        else:
            outcomes = run_on_processes(function, missing, processes, isolate)
        with closing(outcomes) as runs:
            for job, done in runs:
                run = StoredRun(
                    code=job.code or done.code,
                    wall_s=done.wall_s,
                    result=done.result,
                    error=done.error,
                    idle_s=done.idle_s,
                )
                if job.key in before:
                    same = _alike(before[job.key], run)
                    told.append(same)
                    run = dataclasses.replace(run, same=same)
                tally.add(job, kept.add(job.key, run))
                tell(tally.progress())
        again, changed = len(told), told.count(False)
        if again:
            tell(dataclasses.replace(tally.progress(), again=again, changed=changed))
        elapsed_s = time.monotonic() - begin_s
    lines = {job.key: kept.runs[job.key] for job in jobs}
    waited = [line.idle_s for line in lines.values() if line.idle_s is not None]
    return Finished(
        results=[lines[job.key].result for job in jobs],
        group_s=dict(tally.spent),
        processes=processes,
        outdated=outdated,
        again=again,
        changed=changed,
        errors={key: line.error for key, line in lines.items() if line.error},
        idle_s=sum(waited) / len(waited) if waited else None,
        elapsed_s=elapsed_s,
        runs_now=len(missing),
    )


def _unique(jobs: Iterable[Job]) -> list[Job]:
    return list({job.key: job for job in jobs}.values())


def _is_missing(run: StoredRun | None, isolate: bool, retry: bool) -> bool:
    return run is None or bool(run.error and (retry or not isolate))


def _taken(jobs: Sequence[Job], runs: dict[str, StoredRun], missing: set[str]) -> tuple[list[Job], list[bool]]:
    """Jobs whose stored run is of other code; and, of those of this code, what is known of runs that were of other."""
    older, told = [], []
    for job in _unique(jobs):
        run = None if job.key in missing else runs[job.key]
        if run is None:
            continue
        if run.code != (job.code or code_version()):
            older.append(job)
        elif run.same is not None:
            told.append(run.same)
    return older, told


def _alike(stored: StoredRun, run: StoredRun) -> bool:
    """Whether a run came out as what is stored, to the last digit, but for times that it took and for new figures."""
    result = json.loads(json.dumps(run.result))  # as it will be stored: tuples are lists, and keys texts
    return stored.error == run.error and _holds(result, stored.result)


def _holds(tree: Any, older: Any) -> bool:
    """Whether all of `older` is in `tree` as it was, but for times (`..._ms`)."""
    if isinstance(older, dict) and isinstance(tree, dict):
        return all(name.endswith("_ms") or _holds(tree.get(name), part) for name, part in older.items())
    return bool(tree == older)


class _Tally:
    """Counts runs and their time by group, each run once: a study may have a million."""

    def __init__(self, jobs: Sequence[Job], runs: dict[str, StoredRun], missing: set[str], processes: int) -> None:
        self.spent: dict[str, float] = {}  # s
        self._all: dict[str, int] = {}
        self._done: dict[str, int] = {}
        self._processes = processes
        for job in _unique(jobs):
            self._all[job.group] = self._all.get(job.group, 0) + 1
            self._done.setdefault(job.group, 0)
            if job.key not in missing:
                self.add(job, runs[job.key])

    def add(self, job: Job, run: StoredRun) -> None:
        self._done[job.group] += 1
        self.spent[job.group] = self.spent.get(job.group, 0.0) + run.wall_s

    def progress(self) -> StudyProgress:
        all_, done = self._all, self._done
        remaining_s = total_s = None
        if all(done.values()):
            mean_s = {group: self.spent[group] / done[group] for group in all_}
            total_s = sum(mean_s[group] * all_[group] for group in all_) / self._processes
            remaining_s = sum(mean_s[group] * (all_[group] - done[group]) for group in all_) / self._processes
        return StudyProgress(
            done=sum(done.values()), total=sum(all_.values()), remaining_s=remaining_s, total_s=total_s
        )
