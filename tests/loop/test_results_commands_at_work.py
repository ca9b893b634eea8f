"""The commands that pages of results were made by still work: each begins, and Ctrl-C ends it in a line.

Whole they take minutes to hours; what they end in is shown in short by the tests of the studies and the benchmarks.
"""

from __future__ import annotations

import contextlib
import os
import pty
import re
import shlex
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.sitl import run_lockstep
from tests.support.paths import ROOT
from tests.unit.test_shown_commands import FENCE

pytestmark = [pytest.mark.thorough, pytest.mark.real_time, pytest.mark.alone, pytest.mark.timeout(120)]
RESULTS = ROOT / "docs/results"
BENCHMARK = re.compile(r"(?:`|written by )(python -m bench\.[^`]*?)(?:`| -->)")
BEGINS = ("asvhil ", "python -m bench.")
FOR_S = 5.0
SILENT_S = 15.0  # on a busy machine; told in two seconds on another
TO_END_S = 30.0
INTERRUPTED = 130
# Words that stand for the reader's own, with what is there in the folder of the test.
INSTEAD = {
    "CONTROLLER": "sd-mpc",
    "CONFIG": "sitl-bream",
    "MODEL": "models/bream-lagnet.npz",
    "OLD": "models/bream-sd.npz",
    "NEW": "models/bream-lagnet.npz",
    "RUNS": "runs",
    "FILE": "figures.json",
    "JSON": "figures.json",
    "WAY": "links.autopilot.output=manual_control",
    ".venv/bin/python": sys.executable,
}
# Those that work on what the project may not hold, or with what is not here: by their first words.
ELSEWHERE = {
    "asvhil train": "recordings of the BlueBoat; tests/unit/commands/test_learn_cli.py",
    "asvhil evaluate robust.npz": "recordings of the BlueBoat; tests/unit/commands/test_learn_cli.py",
    "asvhil script install": "an autopilot; tests/loop/test_script_command.py",
    "asvhil run my-sitl.yaml": "an autopilot; tests/loop/test_realtime.py",
    "asvhil plant my-sitl.yaml": "the reader's config; tests/hil/test_hil_server.py",
    "asvhil hold": "a daemon; tests/loop/test_realtime.py",
    "python -m bench.autopilot_script": "a real ArduRover",
    "python -m bench.overrides": "a real ArduRover",
    "python -m bench.mutants": "mutmut, which `make mutants` installs",
    "python -m bench.guardian": "ends daemons by signals itself; tests/loop/test_guardian_in_the_loop.py",
    "python -m bench.effort_front": "the table of a campaign of an hour; tests/unit/test_benchmark_ends.py",
}


def commands() -> dict[str, list[str]]:
    """Words of each command by its page and text, in the order in which they stand."""
    found: dict[str, list[str]] = {}
    for page in sorted(set(RESULTS.glob("*.md")) - {RESULTS / "README.md"}):
        text = page.read_text()
        lines = [line for fence in FENCE.findall(text) for line in fence.replace("\\\n", " ").splitlines()]
        lines += BENCHMARK.findall(text)
        for line in lines:
            words = shlex.split(line.replace("--data ...", "").replace(" ...", ""), comments=True)
            begin = " ".join(words)
            if begin.startswith(BEGINS) and not begin.startswith(tuple(ELSEWHERE)) and words not in found.values():
                found.setdefault(f"{page.name}: {re.sub(' +', ' ', line)[:90]}", words)
    return found


COMMANDS = commands()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a reader has who runs the commands of a page: the checkout's files, and logs of commands before."""
    folder = tmp_path_factory.mktemp("results")
    for name in ("tests", "bench", "config", "firmware", "asvhil", "Makefile", "pyproject.toml"):
        (folder / name).symlink_to(ROOT / name)
    (folder / "models").symlink_to(ROOT / "config" / "models")
    (folder / "docs" / "results").mkdir(parents=True)
    (folder / "collect").mkdir()
    for name, config in (("run.mcap", "sitl"), ("log.mcap", "sitl"), ("test-2mps-45deg.mcap", "sitl-bream")):
        run_lockstep(load_config(config, ("controller.name=loiter",)), folder / name, 75.0)
    return folder


def test_many_are_found() -> None:
    assert len(COMMANDS) > 30


@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_it_begins_and_ends_when_it_is_told_to(words: list[str], folder: Path) -> None:
    if "--log" in words:  # which may be the one that another command reads: it is in the order of a page
        (folder / words[words.index("--log") + 1]).unlink(missing_ok=True)
    begin = [sys.executable, "-m", "asvhil"] if words[0] == "asvhil" else [sys.executable]
    terminal, tty = pty.openpty()
    said: list[bytes] = []
    process = subprocess.Popen(
        [*begin, *map(filled_in, words[1:])],
        cwd=folder / "collect" if words[1] == "collect" else folder,  # what it writes another reads
        stdin=tty,
        stdout=tty,
        stderr=tty,
        start_new_session=True,
    )
    os.close(tty)
    reader = threading.Thread(target=read, args=(terminal, said), daemon=True)
    reader.start()
    try:
        begin_s = time.monotonic()
        while process.poll() is None and time.monotonic() < begin_s + (FOR_S if said else SILENT_S):
            time.sleep(0.05)
        ended_itself = process.poll() is not None
        if not ended_itself:
            os.killpg(process.pid, signal.SIGINT)  # as the terminal does: all of its processes hear of it
        status = process.wait(timeout=TO_END_S)
    finally:
        process.kill()
        process.wait()
    reader.join(timeout=TO_END_S)
    os.close(terminal)
    text = b"".join(said).decode()
    assert "Traceback" not in text, text
    assert status in ((0,) if ended_itself else (0, INTERRUPTED)), (status, text)
    assert text.strip(), "whatever takes more than 2 s shows how far it is"


def filled_in(word: str) -> str:
    """What stands for the reader's own, alone, behind `KEY=`, or at the begin of a command in quotes."""
    return re.sub(
        rf"^({'|'.join(map(re.escape, INSTEAD))})(?=$| )|(?<==)({'|'.join(INSTEAD)})$",
        lambda found: INSTEAD[found[0]],
        word,
    )


def read(terminal: int, said: list[bytes]) -> None:
    """All that is written to the terminal, until its last writer has ended."""
    with contextlib.suppress(OSError):
        while data := os.read(terminal, 65536):
            said.append(data)
