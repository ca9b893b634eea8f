"""A hold goes on whatever becomes of the terminal, the pipe or the file that the daemon prints to, and it says so."""

import contextlib
import fcntl
import itertools
import os
import pty
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from asvhil.logs.encoding import decode_outputs
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import replay
from asvhil.types import Inputs, Outputs, Phase
from tests.support.loop import PLAIN_CONTROLLER
from tests.support.processes import Bench, bench
from tests.support.waiting import wait_until

pytestmark = pytest.mark.real_time

HELD_S = 3.0  # after the display has broken


@dataclass
class Run:
    """A daemon with some standard output; `broken` is called once it holds."""

    child: subprocess.Popen[str]
    broken: Callable[[], None] = lambda: None
    ours: list[int] = field(default_factory=list)


def start(at: Bench, stdout: int | None, *options: str, **popen: object) -> subprocess.Popen[str]:
    words = [sys.executable, "-m", "asvhil", "run", "sitl", "--log", str(at.log), *options, *at.sets]
    kind = {"stdin": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True} | popen
    return subprocess.Popen(words, stdout=stdout, **kind)  # type: ignore[call-overload, no-any-return]


def full_disk(at: Bench) -> Run:
    fd = os.open("/dev/full", os.O_WRONLY)
    return Run(start(at, fd, "--status-json"), ours=[fd])


def closed(at: Bench) -> Run:
    return Run(start(at, None, preexec_fn=lambda: os.close(1)))


def pipe_whose_reader_leaves(at: Bench) -> Run:
    reader, writer = os.pipe()
    child = start(at, writer, "--status-json")
    os.close(writer)
    return Run(child, broken=lambda: os.close(reader))


def pipe_that_nobody_reads(at: Bench) -> Run:
    reader, writer = os.pipe()
    fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, 4096)
    return Run(start(at, writer, "--status-json"), ours=[reader, writer])


def terminal_that_nobody_reads(at: Bench) -> Run:
    master, slave = pty.openpty()
    return Run(start(at, slave), ours=[master, slave])


def terminal_that_hangs_up(at: Bench) -> Run:
    """The daemon leads a session on it, as a command by ssh does: it gets SIGHUP, and EIO from then on."""
    master, slave = pty.openpty()

    def take_terminal() -> None:
        os.setsid()
        fcntl.ioctl(slave, 0x540E, 0)  # TIOCSCTTY

    child = start(at, slave, stdin=slave, preexec_fn=take_terminal)
    os.close(slave)
    return Run(child, broken=lambda: os.close(master))


def suspended(at: Bench) -> Run:
    """Ctrl-Z, and the signals for a job in the background that reads or writes."""
    child = start(at, subprocess.DEVNULL)

    def suspend() -> None:
        for number in (signal.SIGTSTP, signal.SIGTTOU, signal.SIGTTIN):
            child.send_signal(number)

    return Run(child, broken=suspend)


@contextlib.contextmanager
def held(at: Bench, make: Callable[[Bench], Run]) -> Iterator[Run]:
    """The run, while it holds."""
    with at.plant():
        run = make(at)
        try:
            wait_until(lambda: at.log.exists() and holds(at.log), 20.0)
            yield run
        finally:
            if run.child.poll() is None:
                run.child.kill()
            run.child.wait()
            run.child.stderr.close()  # type: ignore[union-attr]
            for fd in run.ours:
                os.close(fd)


def holds(log: Path) -> bool:
    time.sleep(0.5)  # reading takes a while, and the daemon has to have some time too
    return any(decode_outputs(data).phase is Phase.HOLD for _, data in list(LogFile(log).ticks())[-5:] if data)


def ticks(log: Path) -> list[tuple[Inputs, Outputs]]:
    return [(inputs, decode_outputs(data)) for inputs, data in LogFile(log).ticks() if data is not None]


def end(run: Run) -> tuple[int, str]:
    run.child.send_signal(signal.SIGTERM)
    run.child.wait(15.0)
    assert run.child.stderr is not None
    return run.child.returncode, run.child.stderr.read()


@pytest.mark.parametrize(
    ("make", "code", "words", "note"),
    [
        (full_disk, 2, "asvhil: standard output: No space left on device\n", "display: No space left on device"),
        pytest.param(closed, 0, "", "", marks=pytest.mark.thorough),
        pytest.param(pipe_whose_reader_leaves, 0, "", "display: Broken pipe", marks=pytest.mark.thorough),
        (pipe_that_nobody_reads, 0, "", "display: takes nothing for more than 2 s"),
        pytest.param(
            terminal_that_nobody_reads, 0, "", "display: takes nothing for more than 2 s", marks=pytest.mark.thorough
        ),
        pytest.param(
            terminal_that_hangs_up,
            2,
            "asvhil: standard output: Input/output error\n",
            "terminal: hung up",
            marks=pytest.mark.thorough,
        ),
        pytest.param(suspended, 0, "", "", marks=pytest.mark.thorough),
    ],
)
def test_a_hold_outlives_its_display(
    make: Callable[[Bench], Run], code: int, words: str, note: str, tmp_path: Path
) -> None:
    with bench(tmp_path, PLAIN_CONTROLLER) as at, held(at, make) as run:
        run.broken()
        broken_ns = time.time_ns()
        time.sleep(HELD_S)
        assert run.child.poll() is None
        assert end(run) == (code, words)
        of_the_run = ticks(at.log)
        begun = next(i for i, (_, outputs) in enumerate(of_the_run) if outputs.phase is Phase.HOLD)
        held_ticks = [(i, o) for i, o in of_the_run[begun:] if o.phase is Phase.HOLD]
        times = [inputs.t_ns for inputs, _ in held_ticks]
        assert times[-1] - broken_ns > (HELD_S - 0.5) * 1e9, "the hold went on to the end"
        # By a display that takes nothing it would be for good; by a busy computer it may be for a while.
        assert max(b - a for a, b in itertools.pairwise(times)) < 1.5e9, "no tick was held up"
        said = {f"{n.subject}: {n.text}" for _, outputs in held_ticks for n in outputs.health.notes if not n.ok}
        found = [text for text in said if text.startswith(("display", "terminal"))]
        assert found == [] if not note else any(text.startswith(note) for text in found), found
        assert replay(at.log).mismatch is None  # the notes are inputs


def test_a_hang_up_ends_the_run_in_order_where_the_config_says_so(tmp_path: Path) -> None:
    with (
        bench(tmp_path, PLAIN_CONTROLLER, "daemon.terminal_lost=release") as at,
        held(at, terminal_that_hangs_up) as run,
    ):
        run.broken()
        end_s = time.monotonic() + 10.0
        while run.child.poll() is None and time.monotonic() < end_s:
            run.child.send_signal(signal.SIGHUP)  # some come twice
            time.sleep(0.005)
        assert run.child.returncode == 2, "in order, but for what could not be shown"
        last = [outputs for _, outputs in ticks(at.log)][-1]
        assert last.phase is Phase.STANDBY and last.health.code == "released"
        assert not LogFile(at.log).truncated
