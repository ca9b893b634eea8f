"""The guardian as a real process, with real sockets and a real pseudo terminal, killed and misled."""

import ast
import asyncio
import contextlib
import itertools
import os
import pty
import signal
import socket
import struct
import subprocess
import sys
import textwrap
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from asvhil.daemon import guardian as guardian_module
from asvhil.daemon.guardian import Guardian
from asvhil.links import guardian_process
from asvhil.links.clock import Clock
from asvhil.links.endpoint import open_endpoint
from asvhil.links.guardian_process import REST_BYTES, STEP_S
from asvhil.links.link import Handover
from tests.support.waiting import wait_until

pytestmark = pytest.mark.real_time

WORDS = [[b"neutral"], [b"neutral"], [b"release"]]
SO_TIMESTAMPNS = 35
SAID = [b"neutral", b"neutral", b"release"]


@contextlib.contextmanager
def guarded() -> Iterator[Guardian]:
    guardian = Guardian()
    guardian.start()
    try:
        yield guardian
    finally:
        guardian.close()


class Ear:
    """A UDP socket that hears, and a connected one to it."""

    def __init__(self) -> None:
        self.ear = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.ear.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self.ear.bind(("127.0.0.1", 0))
        self.mouth = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.mouth.connect(self.ear.getsockname())

    def link(self) -> Handover:
        return Handover(fd=self.mouth.fileno(), kind="datagrams", key=self)

    def heard(self, seconds: float) -> list[tuple[float, bytes]]:
        """(seconds since the call, as the kernel notes it; datagram) of what comes in a time."""
        start_s, began_s, found = time.monotonic(), time.time(), []
        while (left_s := start_s + seconds - time.monotonic()) > 0.0:
            self.ear.settimeout(left_s)
            with contextlib.suppress(TimeoutError):
                data, ((_, _, stamp),), _, _ = self.ear.recvmsg(4096, 64)
                seconds_, nanoseconds = struct.unpack("qq", stamp)
                found.append((seconds_ + nanoseconds * 1e-9 - began_s, data))
        return found

    def close(self) -> None:
        self.ear.close()
        self.mouth.close()


@pytest.fixture
def ear() -> Iterator[Ear]:
    made = Ear()
    yield made
    made.close()


def words_of(heard: list[tuple[float, bytes]]) -> list[bytes]:
    return [data for _, data in heard]


def keep_telling(guardian: Guardian, seconds: float, link: Handover | None) -> None:
    """As a daemon does that lives."""
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        guardian.tell(WORDS, link)
        time.sleep(0.02)


# --- what it sends, and when ---


def test_it_speaks_when_the_daemon_is_gone_and_not_before(ear: Ear) -> None:
    with guarded() as guardian:
        keep_telling(guardian, 0.5, ear.link())
        assert ear.heard(0.3) == [], "the daemon lives, even if it says nothing"
        guardian._control.close()  # type: ignore[union-attr]
        guardian._control = None
        heard = ear.heard(0.5)
        assert words_of(heard) == SAID
        times = [t_s for t_s, _ in heard]
        assert times[0] < 0.2
        assert all(b - a > 0.99 * STEP_S for a, b in itertools.pairwise(times)), "one step after the other"
        wait_until(lambda: guardian._process.poll() == 0, 2.0)  # type: ignore[union-attr]


def test_it_is_silent_where_the_motors_were_given_back(ear: Ear) -> None:
    for end in (lambda g: g.stand_down(), lambda g: g.tell([], ear.link())):
        with guarded() as guardian:
            keep_telling(guardian, 0.2, ear.link())
            end(guardian)
            guardian.close()
            assert ear.heard(0.4) == []


def test_every_peer_is_told_and_a_link_that_is_gone_harms_nothing() -> None:
    ears = [Ear(), Ear()]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bound, guarded() as guardian:
        bound.bind(("127.0.0.1", 0))
        peers = tuple(ear.ear.getsockname() for ear in ears)
        nobody = ("127.0.0.1", 9)
        guardian.tell(WORDS, Handover(fd=bound.fileno(), kind="datagrams", key=1, peers=(nobody, *peers)))
        guardian.close()
        assert [words_of(ear.heard(0.3)) for ear in ears] == [SAID, SAID]
    for ear in ears:
        ear.close()


def test_a_new_link_takes_the_place_of_the_old_one(ear: Ear) -> None:
    other = Ear()
    with guarded() as guardian:
        guardian.tell(WORDS, ear.link())
        guardian.tell(WORDS, None)
        guardian.tell(WORDS, other.link())
        guardian.close()
        assert words_of(other.heard(0.4)) == SAID and ear.heard(0.1) == []
    other.close()


def test_a_connection_that_the_daemon_closes_is_closed() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server, guarded() as guardian:
        mine = socket.create_connection(server.getsockname())
        theirs, _ = server.accept()
        with theirs:
            guardian.tell(WORDS, Handover(fd=mine.fileno(), kind="stream", key=1))
            mine.close()
            guardian.tell(WORDS, None)
            theirs.settimeout(2.0)
            assert theirs.recv(100) == b"", "the guardian has let go of it too"


def test_a_connection_with_unread_bytes_brings_the_last_words_all_the_same() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server, guarded() as guardian:
        mine = socket.create_connection(server.getsockname())
        theirs, _ = server.accept()
        with theirs:
            theirs.sendall(bytes(10_000))
            guardian.tell(WORDS, Handover(fd=mine.fileno(), kind="stream", key=1))
            mine.close()
            guardian.close()
            theirs.settimeout(2.0)
            got = b""
            while data := theirs.recv(4096):
                got += data
            assert got == bytes(REST_BYTES) + b"".join(SAID)


def test_what_waits_on_a_serial_line_is_thrown_away_first() -> None:
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.set_blocking(slave, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(slave, b"old orders ")
    with guarded() as guardian:
        guardian.tell(WORDS, Handover(fd=slave, kind="serial", key=1))
        guardian.close()
    got = b""
    os.set_blocking(master, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            got += os.read(master, 4096)
    os.close(master)
    os.close(slave)
    assert got.endswith(bytes(REST_BYTES) + b"".join(SAID)) and len(got) < 5000


async def test_real_links_are_handed_over(tmp_path: Path) -> None:
    """Each kind of link of the daemon: what the guardian gets of it, and that it reaches the other end."""
    now_ns = Clock().now_ns
    for ours, theirs in (
        ("udpin:127.0.0.1:0", "udpout:127.0.0.1:{port}"),
        ("udpout:127.0.0.1:{port}", "udpin:127.0.0.1:0"),
        ("tcp:127.0.0.1:{port}", "tcpin:127.0.0.1:0"),
        ("tcpin:127.0.0.1:0", "tcp:127.0.0.1:{port}"),
        (f"serial:{tmp_path}/line:57600", f"pty:{tmp_path}/line"),
        (f"pty:{tmp_path}/line2", f"serial:{tmp_path}/line2:57600"),
    ):
        first, second = (theirs, ours) if "{port}" in ours or ours.startswith("serial") else (ours, theirs)
        one = await open_endpoint(first, "a", now_ns)
        other = await open_endpoint(second.format(port=one.address.rpartition(":")[2]), "b", now_ns)
        daemon, boat = (other, one) if first == theirs else (one, other)
        for _ in range(3):
            await daemon.send(b"hello")
            await boat.send(b"heartbeat")
            await asyncio.sleep(0.05)
        assert (await asyncio.wait_for(daemon.recv(), 2.0)).data.startswith(b"heartbeat"), ours
        guardian = Guardian()
        guardian.start()
        guardian.tell(WORDS, daemon.handover())  # type: ignore[attr-defined]
        await asyncio.to_thread(guardian.close)
        got = b""
        while not got.endswith(b"".join(SAID)):
            got += (await asyncio.wait_for(boat.recv(), 2.0)).data
        await daemon.close()
        assert daemon.handover() is None, "a closed link is none"  # type: ignore[attr-defined]
        await boat.close()


# --- what becomes of it ---


@pytest.mark.parametrize("number", guardian_process.IGNORED)
def test_signals_for_the_daemon_do_not_end_it(number: signal.Signals, ear: Ear) -> None:
    with guarded() as guardian:
        keep_telling(guardian, 0.3, ear.link())
        os.kill(guardian.pid or 0, number)
        keep_telling(guardian, 0.2, ear.link())
        assert guardian.trouble == "" and guardian.deaths == 0
        guardian.close()
        assert words_of(ear.heard(0.4)) == SAID


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSEGV])
def test_a_dead_one_is_told_and_replaced_at_once(number: signal.Signals, ear: Ear) -> None:
    with guarded() as guardian:
        keep_telling(guardian, 0.3, ear.link())
        first = guardian.pid
        os.kill(first or 0, number)
        end_s = time.monotonic() + 10.0  # a busy machine takes its time to end a process
        while not guardian.deaths and time.monotonic() < end_s:
            keep_telling(guardian, 0.02, ear.link())
        assert guardian.deaths == 1 and guardian.pid not in (None, first)
        keep_telling(guardian, 0.3, ear.link())
        assert guardian.deaths == 1
        assert guardian.trouble == f"died ({number.name}), and was started again"
        assert ear.heard(0.2) == [], "it died, and not the daemon"
        keep_telling(guardian, 0.1, ear.link())
        guardian.close()
        assert words_of(ear.heard(0.4)) == SAID, "the new one knows as much"


def test_one_that_does_not_answer_is_replaced(ear: Ear, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guardian_module, "ANSWER_S", 0.4)
    with guarded() as guardian:
        keep_telling(guardian, 0.6, ear.link())
        os.kill(guardian.pid or 0, signal.SIGSTOP)
        keep_telling(guardian, 1.0, ear.link())
        assert guardian.deaths == 1 and guardian.trouble == "did not answer, and was started again"
        assert ear.heard(0.1) == []


def held_up(guardian: Guardian, link: Handover) -> None:
    """The guardian is stopped, and told until nothing more goes into its socket."""
    os.kill(guardian.pid or 0, signal.SIGSTOP)
    for number in range(5000):
        guardian.tell([[b"%d" % number]], link)
        if guardian._told[1] is guardian_module.UNTOLD:
            return
    raise AssertionError("its socket never filled")


def test_a_link_that_it_could_not_be_told_is_told_again(ear: Ear) -> None:
    """One that was held up for less than two seconds went on with a connection that was gone."""
    old = Ear()
    with guarded() as guardian:
        keep_telling(guardian, 0.4, old.link())
        held_up(guardian, old.link())
        guardian.tell(WORDS, ear.link())
        os.kill(guardian.pid or 0, signal.SIGCONT)
        keep_telling(guardian, 0.6, ear.link())
        assert guardian.deaths == 0
    assert words_of(ear.heard(0.4)) == SAID and old.heard(0.1) == []
    old.close()


def test_one_that_could_not_be_told_that_the_motors_were_given_back_says_nothing(ear: Ear) -> None:
    with guarded() as guardian:
        keep_telling(guardian, 0.4, ear.link())
        held_up(guardian, ear.link())
        guardian.stand_down()
    assert ear.heard(0.4) == []


def test_one_that_cannot_be_started_is_told_and_tried_again(monkeypatch: pytest.MonkeyPatch, ear: Ear) -> None:
    monkeypatch.setattr(guardian_module, "START_AGAIN_S", 0.1)
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    guardian = Guardian()
    guardian.start()
    guardian.tell(WORDS, ear.link())
    assert guardian.trouble == "is not there (No such file or directory): nothing sends neutral if this program dies"
    monkeypatch.undo()
    time.sleep(0.2)
    monkeypatch.setattr(guardian_module, "START_AGAIN_S", 0.1)
    guardian.tell(WORDS, ear.link())
    assert guardian.watches and guardian.trouble == ""
    guardian.close()


def test_a_main_thread_that_ends_alone_is_a_death(ear: Ear) -> None:
    """As where another thread is stuck in the kernel on a dead disk: the process and its sockets stay."""
    code = """
        import ctypes, threading, time, socket, sys
        from asvhil.daemon.guardian import Guardian
        from asvhil.links.link import Handover
        mouth = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        mouth.connect(("127.0.0.1", int(sys.argv[1])))
        guardian = Guardian()
        guardian.start()
        threading.Thread(target=time.sleep, args=(3.0,)).start()
        guardian.tell([[b"neutral"], [b"neutral"], [b"release"]], Handover(fd=mouth.fileno(), kind="datagrams", key=1))
        time.sleep(0.3)
        print("dies", flush=True)
        ctypes.CDLL(None).syscall(60, 0)  # exit of this thread
    """
    words = [sys.executable, "-c", textwrap.dedent(code), str(ear.ear.getsockname()[1])]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None and child.stdout.readline() == "dies\n"
        assert words_of(ear.heard(1.0)) == SAID
        assert child.poll() is None
        child.kill()


# --- what it is made of ---


def test_it_is_small_and_needs_the_standard_library_alone() -> None:
    path = Path(guardian_process.__file__)
    text = path.read_text()
    assert text.count("\n") < 150
    roots = {
        name.split(".")[0]
        for node in ast.walk(ast.parse(text))
        for name in (
            [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else []
        )
    }
    assert roots <= sys.stdlib_module_names
    with guarded() as guardian:
        guardian.tell([], None)
        time.sleep(0.3)
        status = Path(f"/proc/{guardian.pid}/status").read_text()
        kib = next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS"))
        assert kib < 25_000
