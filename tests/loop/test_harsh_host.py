"""A computer that is not kind: its clock is stepped, its cores are taken, its disk is full. Real processes, signals."""

from __future__ import annotations

import itertools
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from asvhil.logs.reader import LogFile
from asvhil.logs.replay import replay
from tests.support.loop import PLAIN_CONTROLLER
from tests.support.processes import Process, bench

pytestmark = pytest.mark.real_time

# The time of day of a process, stepped by what a file says. The monotonic clock is left alone, as NTP leaves it.
STEPPED = """
import os, time
_time_ns, _file = time.time_ns, os.environ["CLOCK_STEP"]
def time_ns():
    with open(_file) as file:
        return _time_ns() + int(file.read() or 0) * 1_000_000_000
time.time_ns, time.time = time_ns, lambda: time_ns() * 1e-9
"""
AHEAD_AND_BACK = ("3600", "-3600", "0")


def phases_for(daemon: Process, seconds: float) -> set[str]:
    """The phases that a daemon tells in a span of time."""
    found = set()
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        found.add(daemon.wait_for(lambda _: True, 20.0)["phase"])
    return found


def test_a_clock_that_is_stepped_by_an_hour_either_way_changes_nothing(tmp_path: Path) -> None:
    steps = tmp_path / "steps"
    steps.write_text("0")
    (tmp_path / "sitecustomize.py").write_text(STEPPED)
    paths = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    env = {"PYTHONPATH": paths, "CLOCK_STEP": str(steps)}
    with bench(tmp_path, PLAIN_CONTROLLER) as at, at.plant(), at.daemon(env) as daemon:
        daemon.wait_for(lambda s: s["phase"] == "hold", 20.0)
        for step in AHEAD_AND_BACK:
            steps.write_text(step)
            assert phases_for(daemon, 2.5) == {"hold"}
        code, words = daemon.end()
    assert (code, words) == (0, "")
    times = [inputs.t_ns for inputs, _ in LogFile(at.log).ticks()]
    gaps_s = [(b - a) * 1e-9 for a, b in itertools.pairwise(times)]
    assert min(gaps_s) > 0.0 and max(gaps_s) < 2.0
    assert replay(at.log).mismatch is None


@contextmanager
def busy(processes: int) -> Iterator[None]:
    """So many processes that do nothing but take a core each."""
    children = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(processes)]
    try:
        yield
    finally:
        for child in children:
            child.kill()
            child.wait()


@pytest.mark.alone
def test_with_all_cores_taken_twice_over_the_hold_goes_on_or_ends_in_neutral(tmp_path: Path) -> None:
    with bench(tmp_path, PLAIN_CONTROLLER) as at, at.plant(), at.daemon() as daemon:
        daemon.wait_for(lambda s: s["phase"] == "hold", 20.0)
        with busy(2 * (os.cpu_count() or 1)):
            found = phases_for(daemon, 5.0)
        status = daemon.wait_for(lambda _: True, 20.0)
        assert found <= {"hold", "failsafe", "standby"} and "hold" in found
        if status["phase"] != "hold":
            assert status["pwm_us"] is None or set(status["pwm_us"]) == {1500}
        code, words = daemon.end()
    assert (code, words) == (0, "")
    result = replay(at.log)
    assert result.mismatch is None and result.compared > 150


def test_a_folder_that_cannot_be_written_is_refused_at_the_start(tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    folder.write_text("a file where the folder should be")
    with Process("run", "sitl", "--set", f"recorder.directory={folder}/logs") as daemon:
        daemon.child.wait(20.0)
        code, words = daemon.end()
    assert code == 2 and words.startswith("asvhil: ") and words.count("\n") == 1 and str(folder) in words


@pytest.mark.skipif(os.geteuid() != 0 or not shutil.which("mount"), reason="only root mounts a small file system")
def test_a_file_system_that_fills_up_ends_the_log_and_not_the_hold(tmp_path: Path) -> None:
    small = tmp_path / "small"
    small.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(small)], capture_output=True, check=False
    )
    if mounted.returncode != 0:
        pytest.skip("this machine lets nobody mount")
    try:
        with bench(small, PLAIN_CONTROLLER) as at, at.plant(), at.daemon() as daemon:
            daemon.wait_for(lambda s: s["phase"] == "hold", 20.0)
            status = daemon.wait_for(lambda s: "log" in s["notes"], 30.0)
            assert status["notes"]["log"] == "recording stopped: No space left on device"
            assert phases_for(daemon, 2.0) == {"hold"}
            code, words = daemon.end()
        assert code == 2 and words.endswith("recording stopped: No space left on device\n")
        assert sum(1 for _ in LogFile(at.log).ticks()) > 20  # what is on the disk can be read
    finally:
        subprocess.run(["umount", "-l", str(small)], check=True)
