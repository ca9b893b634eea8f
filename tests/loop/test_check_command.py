"""`asvhil check` as it is run: a process against the simulated vehicle over UDP and a serial line, in real time."""

import json
import os
import pty
import select
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.support.ports import free_port
from tests.support.processes import Bench, bench

pytestmark = pytest.mark.real_time


def check(where: Bench, *arguments: str) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-m", "asvhil", "check", "sitl", *where.sets, *arguments]
    return subprocess.run(words, capture_output=True, text=True, check=False, timeout=60.0, stdin=subprocess.DEVNULL)


def alone(*arguments: str) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-m", "asvhil", "check", "sitl", *arguments]
    return subprocess.run(words, capture_output=True, text=True, check=False, timeout=60.0, stdin=subprocess.DEVNULL)


def test_what_is_wrong_is_named_mended_and_passes_the_second_time(tmp_path: Path) -> None:
    wrong = "plant.frontseat.parameters={SYSID_MYGCS: 255, RC3_DZ: 30, PILOT_STEER_TYPE: 0}"
    file = tmp_path / "check.json"
    with bench(tmp_path, wrong) as where, where.plant():
        first = check(where, "--json", str(file))
        assert first.returncode == 1, first.stdout + first.stderr
        figures = json.loads(file.read_text())
        fails = {line["item"]: line["found"] for line in figures["checks"] if line["result"] == "fail"}
        assert figures["result"] == "fail" and figures["written"] == {}
        assert fails == {"SYSID_MYGCS": "255", "RC3_DZ": "30", "PILOT_STEER_TYPE": "0"}
        assert all(name in first.stdout for name in fails) and "3 fail" in first.stdout
        unasked = check(where, "--fix")
        assert unasked.returncode == 2 and "--fix needs a terminal to confirm; use --yes" in unasked.stderr
        mended = check(where, "--fix", "--yes", "--json", str(file))
        assert mended.returncode == 0, mended.stdout + mended.stderr
        assert json.loads(file.read_text())["written"] == {"SYSID_MYGCS": 1.0, "RC3_DZ": 0.0, "PILOT_STEER_TYPE": 1.0}
        assert "SYSID_MYGCS: 255 -> 1, written, reads back 1" in mended.stdout
        again = check(where)
        assert again.returncode == 0 and " 0 fail" in again.stdout


def at_a_terminal(where: Bench, typed: bytes) -> tuple[int, str]:
    """Status and words of `check --fix` at a terminal of its own, with these keys at its question."""
    words = [sys.executable, "-m", "asvhil", "check", "sitl", *where.sets, "--fix"]
    pid, terminal = pty.fork()
    if pid == 0:
        os.execv(sys.executable, words)
    said = b""
    end_s = time.monotonic() + 40.0
    while time.monotonic() < end_s:
        if not select.select([terminal], [], [], 0.2)[0]:
            continue
        try:
            said += os.read(terminal, 4096)
        except OSError:  # its end is closed: the process is at its end
            break
        if typed and b"[y/N]" in said:
            os.write(terminal, typed)
            typed, end_s = b"", time.monotonic() + 15.0
    else:
        os.kill(pid, signal.SIGKILL)
    status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    os.close(terminal)
    return status, said.decode()


def test_ctrl_c_at_the_question_ends_it_at_once_and_nothing_is_written(tmp_path: Path) -> None:
    with bench(tmp_path, "plant.frontseat.parameters={RC3_DZ: 30}") as where, where.plant():
        status, words = at_a_terminal(where, b"\x03")
    assert status == 130 and "RC3_DZ: 30 -> 0" in words and "reads back" not in words, words


def test_without_a_vehicle_it_ends_in_one_line() -> None:
    port = free_port()
    done = alone("--timeout", "1", "--set", f"links.autopilot.endpoint=udpin:127.0.0.1:{port}")
    assert done.returncode == 2
    assert done.stderr.strip().splitlines() == [
        f"asvhil: udpin:127.0.0.1:{port}: nothing was heard within 1 s: is the autopilot on and wired?"
    ]


def test_a_port_that_is_taken_is_named() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        spec = f"udpin:127.0.0.1:{taken.getsockname()[1]}"
        done = alone("--set", f"links.autopilot.endpoint={spec}")
    assert done.returncode == 2
    (line,) = done.stderr.strip().splitlines()
    assert spec in line and "in use" in line and "asvhil run" in line


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--yes",), "--yes goes with --fix"),
        (("--timeout", "0.1"), "--timeout"),
        (("--set", "links.autopilot.endpoint=nowhere"), "nowhere"),
    ],
)
def test_bad_arguments_end_in_a_line(arguments: tuple[str, ...], words: str) -> None:
    done = alone(*arguments)
    assert done.returncode == 2 and words in done.stderr and "Traceback" not in done.stderr
