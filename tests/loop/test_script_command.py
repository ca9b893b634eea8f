"""`asvhil script` as it is run: a process against the simulated vehicle over UDP, in real time."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.autopilot_script import SCRIPT, parameters
from tests.support.ports import free_port
from tests.support.processes import Bench, bench

pytestmark = pytest.mark.real_time


def script(*words: str, where: Bench | None = None) -> subprocess.CompletedProcess[str]:
    command, *arguments = words
    sets = () if where is None else where.sets
    line = [sys.executable, "-m", "asvhil", "script", command, *(("sitl", *sets) if where else ()), *arguments]
    return subprocess.run(line, capture_output=True, text=True, check=False, timeout=60.0, stdin=subprocess.DEVNULL)


def test_installed_looked_at_and_removed(tmp_path: Path) -> None:
    with bench(tmp_path, parameters()) as where, where.plant():
        none = script("status", where=where)
        assert none.returncode == 1
        assert none.stdout.splitlines()[-1] == "it is not installed: `asvhil script install`"
        unasked = script("install", where=where)
        assert (unasked.returncode, unasked.stderr) == (
            2,
            "asvhil: script: a terminal is needed to confirm; use --yes\n",
        )
        done = script("install", "--yes", where=where)
        assert done.returncode == 0, done.stderr
        assert "writing the script" in done.stdout
        assert "file: version 1, as shipped (/APM/scripts)" in done.stdout
        assert "alive sign: version 1, the vehicle is, or was, disarmed; 0 orders used, 0 dropped" in done.stdout
        assert script("status", where=where).returncode == 0
        removed = script("remove", "--yes", where=where)
        assert removed.returncode == 0, removed.stderr
        assert removed.stdout.splitlines()[-1] == "/APM/scripts/asvhil.lua: removed"


def test_a_copy_for_the_memory_card(tmp_path: Path) -> None:
    file = tmp_path / "asvhil.lua"
    done = script("install", "--copy-to", str(file))
    assert done.returncode == 0, done.stderr
    assert file.read_text() == SCRIPT
    again = script("install", "--copy-to", str(file))
    assert (again.returncode, again.stderr) == (
        2,
        f"asvhil: --copy-to {file}: is there already; name a new file\n",
    )
    nowhere = script("install", "--copy-to", str(tmp_path / "no" / "x"))
    assert nowhere.returncode == 2
    assert len(nowhere.stderr.splitlines()) == 1


def test_nobody_there() -> None:
    endpoint = f"links.autopilot.endpoint=udpin:127.0.0.1:{free_port()}"
    done = script("status", "sitl", "--set", endpoint, "--timeout", "3")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "nothing was heard within 3 s: is the autopilot on and wired?" in line
