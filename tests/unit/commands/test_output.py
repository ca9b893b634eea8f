"""Standard output that cannot be written: one line at the end, the right status, the work done all the same."""

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from asvhil.commands.display import STUCK_S, Display
from asvhil.commands.output import StandardStream
from tests.support.command_line import call

FULL = Path("/dev/full")


def asvhil(command: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """A command by the shell, `asvhil` in its words; the return code is that of the first of a pipeline."""
    shell = command.replace("asvhil", f"{sys.executable} -m asvhil") + "; exit ${PIPESTATUS[0]}"
    return subprocess.run(["bash", "-c", shell], capture_output=True, text=True, check=False, timeout=60, cwd=cwd)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("runs")
    done = asvhil("asvhil sitl --lockstep --duration 3 --no-picture --log run.mcap", made)
    assert done.returncode == 0, done.stderr
    return made


@pytest.mark.skipif(not FULL.exists(), reason="no /dev/full here")
@pytest.mark.parametrize(
    "command",
    [
        "asvhil --help",
        pytest.param("asvhil --version", marks=pytest.mark.thorough),
        "asvhil report run.mcap",
        pytest.param("asvhil replay run.mcap --json exact.json", marks=pytest.mark.thorough),
        "asvhil sitl --lockstep --duration 2 --no-picture --log full.mcap",
        pytest.param(
            "asvhil check sitl --timeout 1 --set links.autopilot.endpoint=udpin:127.0.0.1:0", marks=pytest.mark.thorough
        ),
        "asvhil run sitl --duration 1 --log none.mcap --set links.autopilot.endpoint=udpin:127.0.0.1:0"
        " --set links.anemometer=null --set links.operator.endpoint=udpin:127.0.0.1:0",
    ],
)
def test_a_full_disk_is_one_line(command: str, folder: Path) -> None:
    done = asvhil(f"{command} > /dev/full", folder)
    failed = "asvhil: standard output: No space left on device\n"
    if " check " in command:  # nobody answers: that is its result, and it stands
        assert done.returncode in (1, 2) and "Traceback" not in done.stderr and done.stderr.count("\n") == 1
    else:
        assert (done.returncode, done.stderr) == (2, failed)
    for log in ("full.mcap", "none.mcap"):
        if log in command:
            assert (folder / log).stat().st_size > 1000


@pytest.mark.parametrize(
    ("command", "reader"),
    [
        ("asvhil --help", "true"),
        ("asvhil report run.mcap", "head -1"),
        ("asvhil replay run.mcap", "head -1"),
        pytest.param("asvhil --help", "head -1", marks=pytest.mark.thorough),
        pytest.param("asvhil report run.mcap", "true", marks=pytest.mark.thorough),
        pytest.param("asvhil replay run.mcap", "true", marks=pytest.mark.thorough),
    ],
)
def test_a_reader_that_leaves_had_enough(command: str, reader: str, folder: Path) -> None:
    done = asvhil(f"{command} | {reader}", folder)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_result_stands_where_the_reader_left(folder: Path) -> None:
    done = asvhil("asvhil report nowhere.mcap | true", folder)
    assert done.returncode == 2 and done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    "closed",
    [
        "<&- >&- 2>&-",
        "2>/dev/full >/dev/full",
        *(pytest.param(closed, marks=pytest.mark.thorough) for closed in (">&-", ">&- 2>&-")),
    ],
)
def test_a_closed_output_is_no_output_and_no_log_gets_its_number(closed: str, folder: Path, tmp_path: Path) -> None:
    log = tmp_path / "closed.mcap"
    done = asvhil(f"asvhil sitl --lockstep --duration 2 --no-picture --log {log} {closed}", folder)
    assert done.returncode == (2 if "full" in closed else 0) and done.stderr == ""
    assert call("replay", str(log), cwd=folder).status == 0


# --- the parts ---


def test_a_pipe_that_does_not_block_gets_everything() -> None:
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    text = "x" * 500_000
    got: list[bytes] = []

    def read() -> None:
        while data := os.read(reader, 4096):
            got.append(data)

    thread = threading.Thread(target=read)
    thread.start()
    stream = StandardStream(writer)
    assert stream.write(text) == len(text) and stream.failure == ""
    os.close(writer)
    thread.join()
    os.close(reader)
    assert b"".join(got).decode() == text


def test_a_display_that_is_stuck_says_so_keeps_the_newest_and_holds_nobody_up() -> None:
    release, shown = threading.Event(), []
    display = Display(keep=3)
    display.put(lambda: (release.wait(30.0), shown.append("first"))[1])
    time.sleep(0.05)
    assert display.trouble == ""
    start_s = time.monotonic()
    for number in range(1000):
        display.put(lambda number=number: shown.append(number))  # type: ignore[misc]
    assert time.monotonic() - start_s < 0.5
    time.sleep(STUCK_S)
    assert display.trouble == "takes nothing for more than 2 s"
    release.set()
    display.close()
    assert shown == ["first", 997, 998, 999] and display.trouble == ""


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (BrokenPipeError(32, "Broken pipe"), "Broken pipe"),
        (SystemExit(1), "SystemExit"),
        (ValueError("I/O operation on closed file"), "ValueError"),
        (KeyboardInterrupt(), "KeyboardInterrupt"),
    ],
)
def test_what_a_display_raises_is_told_and_ends_only_the_display(error: BaseException, words: str) -> None:
    def fails() -> None:
        raise error

    shown: list[int] = []
    display = Display(keep=3)
    display.put(fails)
    while not display.trouble:
        time.sleep(0.005)
    display.put(lambda: shown.append(1))
    display.close()
    assert display.trouble == words and not shown
