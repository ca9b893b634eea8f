"""Jobs for the tests of the study runner: importable, so that other processes find them."""

import ctypes
import gc
import os
import sys
import time
import weakref
from pathlib import Path
from typing import ClassVar

from asvhil.study.runner import Job, run_jobs


def square(number: int, folder: str) -> dict[str, float]:
    """Leaves a line for each time that it runs."""
    with (Path(folder) / "ran.txt").open("a") as file:
        file.write(f"{number}\n")
    return {"square": float(number**2), "pid": os.getpid()}


def fail_at_three(number: int, folder: str) -> dict[str, float]:
    if number == 3:
        raise ValueError("three")
    return square(number, folder)


def die_at_three(number: int, folder: str) -> dict[str, float]:
    if number == 3:
        os._exit(9)
    return square(number, folder)


class Circle:
    """What only the garbage collector frees."""

    alive: ClassVar[weakref.WeakSet["Circle"]] = weakref.WeakSet()

    def __init__(self) -> None:
        self.itself = self
        self.alive.add(self)


def leave_circles(number: int, folder: str) -> dict[str, float]:
    """As a run leaves a boat, whose parts hold each other: `left` is how many circles there were before it."""
    left = len(Circle.alive)
    for _ in range(1000):
        Circle()
    return {**square(number, folder), "left": float(left), "threshold": float(gc.get_threshold()[0])}


def linger(number: int, folder: str) -> dict[str, float]:
    """The first two are quick, the others last far longer than any test."""
    result = square(number, folder)
    if number > 2:
        time.sleep(600.0)
    return result


def holds_on(number: int, folder: str) -> dict[str, float]:
    """As a solver in C that does not let Python run."""
    result = square(number, folder)
    ctypes.PyDLL(None).sleep(600)
    return result


def jobs(folder: Path, count: int, group: str = "squares") -> list[Job]:
    return [Job(key=f"square {n}", group=group, arguments=(n, str(folder))) for n in range(1, count + 1)]


if __name__ == "__main__":  # a study that never ends by itself, for the test that kills it
    place = Path(sys.argv[1])
    from tests.support import study_jobs

    run_jobs(getattr(study_jobs, sys.argv[2]), jobs(place, 6), place / "store.jsonl", workers=2)
