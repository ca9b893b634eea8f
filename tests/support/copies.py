"""What took long to bring about is brought about once: each test goes on with a copy of it, in a process of its own."""

from __future__ import annotations

import os
import pickle
import traceback
from collections.abc import Callable
from pathlib import Path

import pytest


def on_a_copy(body: Callable[[], None]) -> None:
    """Run what a test does in a fork of this process: what it changes is lost, where it fails the test fails."""
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        told = ""
        try:
            os.close(reading)
            body()
        except BaseException:
            told = traceback.format_exc()
        finally:
            with os.fdopen(writing, "wb") as pipe:
                pickle.dump(told, pipe)
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        data = pipe.read()
    _, status = os.waitpid(pid, 0)
    if status != 0 or not data:
        pytest.fail(f"the copy ended with status {status}", pytrace=False)
    if told := pickle.loads(data):
        pytest.fail(told, pytrace=False)


def with_a_file_of_its_own(path: Path, own: Path) -> None:
    """In a copy: what was written to an open file so far is written to another, and so is what comes."""
    own.write_bytes(path.read_bytes())
    to = os.open(own, os.O_WRONLY | os.O_APPEND)
    for entry in Path("/proc/self/fd").iterdir():
        if entry.is_symlink() and os.path.realpath(entry) == str(path.resolve()):
            os.dup2(to, int(entry.name))
    os.close(to)
