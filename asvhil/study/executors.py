"""What runs the jobs of a study: this process, processes of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import gc
import logging
import multiprocessing
import os
import signal
import threading
import time
import traceback
import uuid
from collections import deque
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from asvhil.errors import AsvhilError
from asvhil.machine_code.compiler import use_compiler
from asvhil.study.code_version import PACKAGE, code_version
from asvhil.study.trials.interrupts import ENDING, interrupts_held_back, let_through
from asvhil.types import record

WATCH_S = 0.3
AHEAD = 4  # jobs that are handed out for each process: enough that none waits, few enough to hold in memory
CONNECT_S = 20.0
COLLECTED_AFTER = 50_000  # objects more than before, within one run; between two all that it has left is collected
MORE_OF_CLUSTER = "`dask worker ADDRESS --nthreads 1` starts one"

Function = Callable[..., dict[str, Any]]


@record
class Job:
    """One run. `key` identifies everything that its result depends on; `group` names runs of about the same time.

    `code` is the digest of what decides it, where that is less than all code that decides runs.
    """

    key: str
    group: str
    arguments: tuple[Any, ...]  # of the function, picklable
    code: str = ""


@record
class Done:
    """What came of a job: its result, or its error in one line; its time, and for how long its process had waited."""

    result: dict[str, Any]
    error: str
    wall_s: float
    idle_s: float | None
    code: str


Outcomes = Generator[tuple[Job, Done], None, None]


def run_here(function: Function, jobs: Iterable[Job], isolate: bool) -> Outcomes:
    """In this process, one after the other."""
    token = uuid.uuid4().hex
    for job in jobs:
        yield job, timed(function, job.arguments, isolate, token)


def run_on_processes(function: Function, jobs: Sequence[Job], processes: int, isolate: bool) -> Outcomes:
    """(job, what came of it) as they come, from processes of this machine.

    A process that dies takes with it what all of them were at. With `isolate` these jobs are run again, each with a
    process to itself, and one whose process dies then too has failed; else AsvhilError.
    """
    waiting = deque(jobs)
    suspects: list[Job] = []
    while waiting:
        suspects = yield from _run_pool(function, waiting, min(processes, len(waiting)), isolate)
        for job in suspects:
            alone = deque([job])
            if (yield from _run_pool(function, alone, 1, isolate)):
                error = "its process died (out of memory, or a crash in a library)"
                yield job, Done(result={}, error=error, wall_s=0.0, idle_s=None, code=code_version())


def _run_pool(
    function: Function, waiting: deque[Job], processes: int, isolate: bool
) -> Generator[tuple[Job, Done], None, list[Job]]:
    """Empties `waiting`, or returns the jobs that were handed out when a process died."""
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    token = uuid.uuid4().hex
    pool = ProcessPoolExecutor(processes, context, initializer=_obey)
    running: dict[Future[Done], Job] = {}
    try:
        while waiting or running:
            while waiting and len(running) < AHEAD * processes:
                job = waiting.popleft()
                running[job_future(pool, function, job, isolate, token)] = job
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                done = future.result()
                yield running.pop(future), done
    except BrokenProcessPool:
        if not isolate:
            words = "a process of the study died (out of memory?); start it again to go on where it was"
            raise AsvhilError(words) from None
        return list(running.values())
    except BaseException:
        # Runs that have begun are not waited for, nor asked: within a solver no Python runs for a minute on end.
        for worker in set(multiprocessing.active_children()) - others:
            worker.kill()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    return []


def job_future(pool: ProcessPoolExecutor, function: Function, job: Job, isolate: bool, token: str) -> Future[Done]:
    """Hand out a job; of a pool that has just broken, a future that says so."""
    try:
        with interrupts_held_back():  # the first jobs start the processes
            return pool.submit(_timed_in_process, function, job.arguments, isolate, token)
    except BrokenProcessPool as error:
        failed: Future[Done] = Future()
        failed.set_exception(error)
        return failed


def run_on_cluster(function: Function, jobs: Sequence[Job], client: Any, isolate: bool) -> Outcomes:
    """(job, what came of it) as they come, from the workers of a Dask cluster.

    A job whose worker is lost is run by another. AsvhilError where a worker has other code, or the scheduler is gone.
    """
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    token = uuid.uuid4().hex
    running: dict[Any, Job] = {}
    waiting = deque(jobs)

    def hand_out() -> Any:
        job = waiting.popleft()
        future = client.submit(
            _timed_on_worker, function, job.arguments, isolate, token, key=f"asvhil-{uuid.uuid4().hex}", pure=False
        )
        running[future] = job
        return future

    try:
        most = AHEAD * threads_of(client)
        come = as_completed([hand_out() for _ in range(min(most, len(waiting)))], loop=client.loop)
        for future in come:
            job = running.pop(future)
            try:
                done = future.result()
            except KilledWorker:
                if not isolate:
                    raise AsvhilError("a run ended the workers that it was given to; their logs may say why") from None
                error = "it ended each worker that it was given to (out of memory, or a crash in a library)"
                done = Done(result={}, error=error, wall_s=0.0, idle_s=None, code=code_version())
            if future.cancelled():
                raise AsvhilError("the scheduler is gone; the same command goes on where it was")
            if done.code != code_version():
                raise AsvhilError(
                    f"a worker has another version of asvhil's code ({done.code}, here {code_version()}); "
                    "install the same one there"
                )
            yield job, done
            future.release()
            if waiting:
                come.add(hand_out())
    finally:
        client.cancel(list(running))


@contextmanager
def connected(address: str) -> Generator[Any, None, None]:
    """A client of the scheduler at an address. AsvhilError where none answers, or it has no fitting worker."""
    try:
        from distributed import Client
    except ImportError:
        raise AsvhilError("--scheduler needs Dask: install asvhil[cluster]") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is told in one line
    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError):
        words = "no Dask scheduler answers; tcp://HOST:8786 is expected, as `dask scheduler` prints it"
        raise AsvhilError(f"--scheduler {address}: {words}") from None
    try:
        try:
            client.wait_for_workers(1, timeout=CONNECT_S)
        except TimeoutError:
            raise AsvhilError(f"--scheduler {address}: it has no workers; {MORE_OF_CLUSTER}") from None
        for worker, threads in client.nthreads().items():
            if threads != 1:  # a run is not made to share its process
                raise AsvhilError(f"--scheduler {address}: worker {worker} has {threads} threads; {MORE_OF_CLUSTER}")
        yield client
    finally:
        client.close()


def threads_of(client: Any) -> int:
    """Jobs that the cluster runs at a time, as it is now."""
    return max(1, sum(int(threads) for threads in client.nthreads().values()))


# --- in the process of a run -------------------------------------------------------------------------------

_last = ("", 0.0)  # of this process: the token of the study that it worked for, and when its last run ended


def timed(function: Function, arguments: tuple[Any, ...], isolate: bool, token: str) -> Done:
    """Run one job. With `isolate` an error is what came of it; else it is raised."""
    global _last
    begin_s = time.perf_counter()
    idle_s = begin_s - _last[1] if _last[0] == token else None
    result: dict[str, Any] = {}
    error = ""
    try:
        result = function(*arguments)
    except Exception as raised:
        if not isolate:
            raise
        error = told(raised)
    end_s = time.perf_counter()
    _last = (token, end_s)
    return Done(result=result, error=error, wall_s=end_s - begin_s, idle_s=idle_s, code=code_version())


def told(error: Exception) -> str:
    """An error in one line; with the line of this package that raised it, where it was not raised on purpose."""
    text = " ".join(str(error).split()) or "no words"
    if isinstance(error, AsvhilError):
        return text
    files = [(Path(frame.filename), frame.lineno) for frame in traceback.extract_tb(error.__traceback__)]
    files = [(file, line) for file, line in files if PACKAGE in file.parents and file != Path(__file__)]
    where = f" ({files[-1][0].relative_to(PACKAGE)}:{files[-1][1]})" if files else ""
    return f"{type(error).__name__}: {text}{where}"


def _timed_in_process(function: Function, arguments: tuple[Any, ...], isolate: bool, token: str) -> Done:
    """In a process that does nothing else. Garbage is collected once after each run, and the modules are left out.

    With Python's own thresholds it is looked for some twenty times in a run, and time and again among all modules.
    """
    if not _last[0]:
        gc.collect()
        gc.freeze()
        gc.set_threshold(COLLECTED_AFTER, *gc.get_threshold()[1:])
    return timed(_clean, (function, arguments), isolate, token)


def _clean(function: Function, arguments: tuple[Any, ...]) -> dict[str, Any]:
    result = function(*arguments)
    gc.collect()
    return result


def _timed_on_worker(function: Function, arguments: tuple[Any, ...], isolate: bool, token: str) -> Done:
    """On a worker of a cluster, which nobody has prepared."""
    if not _last[0]:
        use_compiler()
    return timed(function, arguments, isolate, token)


def _obey() -> None:
    """In a worker process, before its first job: end when the study's process has ended in any way."""
    parent = multiprocessing.parent_process()

    def watch() -> None:
        while parent is not None and parent.is_alive():
            time.sleep(WATCH_S)
        os._exit(1)

    # Was held back at the start; what a run starts may still be interrupted by it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    let_through(*ENDING)
    threading.Thread(target=watch, daemon=True).start()
    use_compiler()
