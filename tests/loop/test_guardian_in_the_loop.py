"""Daemons that die in a hold, with the guardian beside them; and a guardian that dies."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.support.deaths import DEATHS, LINKS
from tests.support.loop import PLAIN_CONTROLLER
from tests.support.paths import ROOT
from tests.support.processes import Process, bench

pytestmark = pytest.mark.real_time

# Beside other tests. Without a guardian it is 3 s; on a quiet computer 0.05 s (docs/results/guardian.md).
NEUTRAL_WITHIN_S = 1.0


def guardian_of(daemon: Process) -> int:
    """The process id of a daemon's guardian; 0 where it has none."""
    pid = daemon.child.pid
    for children in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in children.read_text().split():
            if b"guardian_process" in Path(f"/proc/{child}/cmdline").read_bytes():
                return int(child)
    return 0


@pytest.mark.parametrize(
    "link", [pytest.param(link, marks=[pytest.mark.thorough] * (link in ("udpout", "tcp"))) for link in LINKS]
)
def test_the_motors_are_neutral_at_once_however_a_daemon_dies(link: str, tmp_path: Path) -> None:
    words = [sys.executable, "-m", "bench.guardian", "--link", link, "--deaths", str(len(DEATHS)), "--raw"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False, timeout=150.0)
    deaths = [json.loads(line) for line in done.stdout.splitlines()]
    assert [death["how"] for death in deaths] == list(DEATHS), done.stderr
    for death in deaths:
        assert death["neutral_s"] is not None and death["neutral_s"] < NEUTRAL_WITHIN_S, death


def test_a_guardian_that_dies_is_told_and_the_hold_goes_on(tmp_path: Path) -> None:
    with bench(tmp_path, PLAIN_CONTROLLER) as at, at.plant(), at.daemon() as daemon:
        daemon.wait_for(lambda s: s["phase"] == "hold", 20.0)
        first = guardian_of(daemon)
        assert first
        os.kill(first, signal.SIGKILL)
        killed_s = time.monotonic()
        status = daemon.wait_for(lambda s: "guardian" in s["notes"], 3.0)
        assert time.monotonic() - killed_s < 2.5, "at the next status"
        assert status["notes"]["guardian"] == "died (SIGKILL), and was started again" and status["phase"] == "hold"
        assert guardian_of(daemon) not in (0, first)
        assert daemon.wait_for(lambda s: True, 3.0)["phase"] == "hold"
        second = guardian_of(daemon)
        assert daemon.end(signal.SIGTERM) == (0, "")
        assert not Path(f"/proc/{second}").exists(), "it ends with the daemon"


def test_the_hold_ends_with_its_guardian_where_the_config_says_so(tmp_path: Path) -> None:
    with bench(tmp_path, PLAIN_CONTROLLER, "daemon.guardian_lost=release") as at, at.plant(), at.daemon() as daemon:
        daemon.wait_for(lambda s: s["phase"] == "hold", 20.0)
        os.kill(guardian_of(daemon), signal.SIGKILL)
        status = daemon.wait_for(lambda s: s["phase"] == "standby", 3.0)
        assert status["code"] == "released" and status["pwm_us"] is None
        daemon.end()


def test_without_a_guardian_there_is_none(tmp_path: Path) -> None:
    words = ("run", "sitl", "--no-guardian", "--status-json", "--log")
    with bench(tmp_path) as at, Process(*words, str(at.log), *at.sets) as daemon:
        status = daemon.wait_for(lambda s: True, 15.0)
        assert guardian_of(daemon) == 0 and "guardian" not in status["notes"]
        daemon.end()
