"""The commands that README and the guides show do what they are shown for: each page's in their order, in one folder.

Those of a page that has a test of its own, and of results (studies of hours), are run by the tests that `ELSEWHERE`
and `tests/loop/test_study_commands.py` name.
"""

import glob
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from asvhil.collect import collect
from asvhil.config import load_config
from asvhil.config.mean_wind import parse_wind
from tests.support.command_line import call
from tests.support.paths import ROOT
from tests.unit.test_shown_commands import shown_commands

pytestmark = [pytest.mark.thorough, pytest.mark.real_time, pytest.mark.alone, pytest.mark.timeout(900)]
OWN_TESTS = {"cli.md", "configuration.md", "extending.md"}
GUIDES = [
    page
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs/boats").glob("*.md")))
    if page.name not in OWN_TESTS and shown_commands(page)
]
# Commands that need somebody at the other end, with the test that brings him.
ELSEWHERE = {
    "hold": "tests/loop/test_realtime.py",
    "check": "tests/loop/test_check_command.py",
    "script": "tests/loop/test_script_command.py",
    "collect": "tests/loop/test_collect.py",
    "calibrate": "tests/loop/test_calibration.py",
    "learn": "tests/unit/commands/test_learn.py",
    "campaign": "tests/loop/test_campaign_commands.py",
    "tune": "tests/loop/test_campaign_commands.py",
}
# What a command does for long is done for a moment; what is heard by the whole network, by this computer alone.
SHORTER = {
    "train": ("--iterations", "30"),
    "study six-tests": ("--quick", "--workers", "1"),
    "study field-tests": ("--workers", "1"),
}
REAL_TIME_S = "6"
UP = {"run": "links: "}  # with which words it is up: Ctrl-C before is an interruption, and not its end
INSTEAD = {"0.0.0.0": "127.0.0.1"}


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory, run_logs: Callable[[str], Path]) -> Path:
    """A folder with the files that the guides take for given."""
    folder = tmp_path_factory.mktemp("guide")
    for name in ("my-boat", "my-sitl"):
        (folder / f"{name}.yaml").write_text("base: sitl\n")
    for name in ("LOG", "LOG2", "run.mcap"):
        shutil.copy(run_logs("procedure"), folder / name)
    for name in ("data", "other", "test", "wamv16-1"):
        shutil.copy(run_logs("programme"), folder / f"{name}.mcap")
    collect(load_config("sitl-blueboat"), "lockstep", 70.0, [parse_wind("3@90")], folder / "mine.mcap")
    shutil.copy(ROOT / "config" / "models" / "wamv16-sd.npz", folder)
    (folder / "page-token").write_text("0123456789abcdef\n")
    return folder


@pytest.mark.parametrize("page", GUIDES, ids=lambda page: page.name)
def test_the_commands_of_a_guide_work(page: Path, prepared: Path, tmp_path: Path) -> None:
    folder = tmp_path / "guide"
    shutil.copytree(prepared, folder)
    for line in shown_commands(page):
        words = [word for part in shlex.split(line, comments=True)[1:] for word in expanded(part, folder)]
        if words[0] in ELSEWHERE:
            assert (ROOT / ELSEWHERE[words[0]]).is_file()
        elif lasts(words):
            until_it_is_ended(words, folder)
        else:
            said = call(*shortened(words, folder), cwd=folder)
            assert (said.status, said.err) == (0, ""), (line, said)


def expanded(word: str, folder: Path) -> list[str]:
    """As a shell would: `*` and the home folder, which is the guide's here."""
    word = INSTEAD.get(word, word.replace("~", str(folder)))
    return sorted(Path(found).name for found in glob.glob(word, root_dir=folder)) or [word]


def lasts(words: list[str]) -> bool:
    """Whether it goes on until Ctrl-C."""
    return words[0] in ("run", "plant", "dashboard") and "--duration" not in words


def shortened(words: list[str], folder: Path) -> list[str]:
    words = list(words)
    if words[0] == "sitl" and "--lockstep" not in words:
        at = words.index("--duration") + 1 if "--duration" in words else len(words)
        words[at:] = [*(() if "--duration" in words else ("--duration",)), REAL_TIME_S, *words[at + 1 :]]
    for begin, more in SHORTER.items():
        if words[: begin.count(" ") + 1] == begin.split():
            words += [word for word in more if word not in words]
    if words[0] == "train":  # the guide's own result may stand there
        (folder / words[words.index("-o") + 1]).unlink(missing_ok=True)
    return words


def until_it_is_ended(words: list[str], folder: Path) -> None:
    """It comes up, says something, is still there after a moment, and Ctrl-C ends it without an error."""
    told = folder / "told.txt"
    with told.open("w") as output:
        process = subprocess.Popen(
            [sys.executable, "-m", "asvhil", *words],
            cwd=folder,
            env=os.environ | {"HOME": str(folder), "PYTHONUNBUFFERED": "1"},
            stdout=output,
            stderr=subprocess.STDOUT,
        )
        try:
            end_s = time.monotonic() + 60.0
            while UP.get(words[0], ":") not in told.read_text() and process.poll() is None and time.monotonic() < end_s:
                time.sleep(0.1)
            time.sleep(2.0)
            assert process.poll() is None, (words, told.read_text())
            process.send_signal(signal.SIGINT)
            assert process.wait(timeout=20.0) == 0, (words, told.read_text())
        finally:
            process.kill()
            process.wait()
    assert "Traceback" not in told.read_text() and told.read_text()
