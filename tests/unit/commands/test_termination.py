"""SIGTERM ends long work as Ctrl-C does: a word on how to go on, status 130, and nothing left behind."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import CodeType, FrameType

import casadi
import pytest

from asvhil.commands.termination import AGAIN_S, UNTOUCHED, _Interrupts, interrupted_by
from asvhil.logs.reader import LogFile
from tests.support.loop import PLAIN_CONTROLLER
from tests.support.waiting import wait_until

SPEC = """
config: sitl
design: {kind: grid}
parameters: {wind_speed: [3, 6]}
variants: {LOITER: {controller.name: loiter}}
window_s: [5, 15]
worst: 0
repeats: 500
"""


SHAPE = casadi.MX.shape.fget.__code__
ENDING = (signal.SIGINT, signal.SIGTERM)


def test_a_sigterm_is_an_interrupt_within_and_what_it_was_thereafter() -> None:
    with pytest.raises(KeyboardInterrupt), interrupted_by(*ENDING):
        os.kill(os.getpid(), signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    assert signal.getsignal(signal.SIGINT) == signal.default_int_handler
    try:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        with interrupted_by(*ENDING):
            os.kill(os.getpid(), signal.SIGTERM)
        assert signal.getsignal(signal.SIGTERM) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def interrupt_within(code: CodeType, number: signal.Signals, times: int, first: int = 1) -> list[signal.Signals]:
    """Send this process a signal as often, each time when a function begins, from the `first` of its calls on.

    The list that is returned grows by what was sent.
    """
    sent: list[signal.Signals] = []
    calls = 0

    def look(frame: FrameType, event: str, argument: object) -> None:
        nonlocal calls
        if event == "call" and frame.f_code is code and len(sent) < times:
            calls += 1
            if calls >= first:
                sent.append(number)
                os.kill(os.getpid(), number)

    sys.setprofile(look)
    return sent


@pytest.mark.real_time
@pytest.mark.parametrize("call", [1, 2], ids=["as it begins", "once it is over"])
@pytest.mark.parametrize("number", ENDING)
def test_an_interrupt_at_the_very_end_is_raised_and_leaves_no_handler(number: signal.Signals, call: int) -> None:
    try:
        with pytest.raises(KeyboardInterrupt), interrupted_by(*ENDING):
            interrupt_within(_Interrupts.end.__code__, number, 1, call)
        sys.setprofile(None)
        assert [signal.getsignal(one) for one in ENDING] == [UNTOUCHED[one] for one in ENDING]
        time.sleep(5.0 * AGAIN_S)  # nothing comes again
    finally:
        sys.setprofile(None)
        for one in ENDING:
            signal.signal(one, UNTOUCHED[one])


@pytest.mark.real_time
@pytest.mark.parametrize("times", [1, 3])
@pytest.mark.parametrize("number", ENDING)
def test_an_interrupt_that_casadi_drops_comes_again(number: signal.Signals, times: int) -> None:
    """Of each matrix that Python hands it, CasADi asks the shape, from C, and drops what is raised there."""
    symbol, handed = casadi.MX.sym("x"), 0
    try:
        with pytest.raises(KeyboardInterrupt), interrupted_by(*ENDING):
            sent = interrupt_within(SHAPE, number, times)
            end_s = time.monotonic() + 20.0
            while time.monotonic() < end_s:
                symbol * symbol
                handed += 1
    finally:
        sys.setprofile(None)
    assert sent and handed > 1, "the first was dropped"


@pytest.mark.real_time
def test_an_interrupt_of_which_a_library_made_an_error_lets_all_be_cleared_away() -> None:
    symbol, cleared = casadi.MX.sym("x"), False
    try:
        with pytest.raises(RuntimeError), interrupted_by(*ENDING):
            try:
                interrupt_within(SHAPE, signal.SIGINT, 1)
                symbol * symbol
                raise RuntimeError("KeyboardInterrupt, says the library")
            finally:
                time.sleep(0.2)
                cleared = True
    finally:
        sys.setprofile(None)
    assert cleared


@pytest.mark.real_time
@pytest.mark.parametrize("group", [False, True])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_campaign_that_is_ended_says_how_to_go_on(tmp_path: Path, number: int, group: bool) -> None:
    (tmp_path / "many.yaml").write_text(SPEC)
    with subprocess.Popen(
        [sys.executable, "-m", "asvhil", "campaign", "many.yaml", "-o", "out", "--workers", "2"],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as campaign:
        store = tmp_path / "out" / "many.jsonl"
        try:
            wait_until(lambda: store.exists() and store.read_bytes().count(b"\n") >= 2, 120.0)
            (os.killpg if group else os.kill)(campaign.pid, number)
            _, words = campaign.communicate(timeout=60.0)
        finally:
            campaign.kill()
    assert campaign.returncode == 130
    assert words == "asvhil: campaign: interrupted; the same command goes on where it was\n"
    assert b"error" not in store.read_bytes(), "a process that was ended has not failed"


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("words", "name", "go_on"),
    [
        (("sitl", "--lockstep", "--duration", "100000", "--no-picture", "--log", "run.mcap"), "run.mcap", ""),
        (("sitl", "--duration", "600", "--no-picture", "--log", "run.mcap"), "run.mcap", ""),
        (("collect", "--duration", "100000", "-o", "run.mcap"), "run.mcap", ""),
        (
            ("learn", "sitl", "--yes", "--wind", "3@90", "--duration", "100000", "-o", "out"),
            "out/drive.mcap",
            "; the same command with --resume goes on",
        ),
    ],
)
def test_a_run_that_is_ended_says_where_its_log_is(
    tmp_path: Path, words: tuple[str, ...], name: str, go_on: str
) -> None:
    if words[0] == "learn":
        pytest.importorskip("torch")
    log = tmp_path / name
    with subprocess.Popen(
        [sys.executable, "-m", "asvhil", *words, "--set", PLAIN_CONTROLLER],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as run:
        try:
            wait_until(lambda: log.exists() and log.stat().st_size > 0, 120.0)
            run.send_signal(signal.SIGINT)
            _, told = run.communicate(timeout=60.0)
        finally:
            run.kill()
    assert run.returncode == 130
    assert told == f"asvhil: interrupted; log {name} (read it with `asvhil report`){go_on}\n"
    LogFile(log)  # is whole


AGAIN = """
import atexit, os, signal, sys, threading
from asvhil.commands.cli import main
atexit.register(os.kill, os.getpid(), signal.SIGINT)
threading.Timer(1.5, os.kill, (os.getpid(), signal.SIGINT)).start()
sys.argv = ["asvhil", "status", "--watch"]
main()
"""


@pytest.mark.real_time
def test_each_interrupt_is_a_line_and_a_second_one_at_the_end_changes_nothing(tmp_path: Path) -> None:
    ended = subprocess.run([sys.executable, "-c", AGAIN], capture_output=True, text=True, cwd=tmp_path, timeout=60.0)
    assert (ended.returncode, ended.stderr) == (130, "asvhil: interrupted\n")
