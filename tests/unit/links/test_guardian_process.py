"""The guardian's own code, called in the test's process: its messages, its links and its last words."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import pty
import signal
import socket
import sys
import termios
import threading
import time
import tty
import warnings
from collections.abc import Iterator

import pytest

from asvhil.links import guardian_process
from asvhil.links.guardian_process import REST_BYTES, STEP_S, Line, leader_has_died, watch

LOCAL = ("127.0.0.1", 0)


def udp() -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind(LOCAL)
    made.settimeout(2.0)
    return made


class Talk:
    """The daemon's end of the socket, and the guardian's."""

    def __init__(self) -> None:
        self.daemon, self.guardian = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.daemon.settimeout(2.0)

    def tell(self, link: str, steps: list[list[str]], *fds: int, peers: object = ()) -> None:
        message = json.dumps({"link": link, "peers": peers, "steps": steps}).encode()
        socket.send_fds(self.daemon, [message], fds)

    def watched(self, pid: int = 0) -> tuple[Line | None, list[list[str]]]:
        """What `watch` returns once the daemon has closed its end."""
        self.daemon.shutdown(socket.SHUT_WR)
        return watch(self.guardian, pid or os.getpid())


@pytest.fixture
def talk() -> Iterator[Talk]:
    made = Talk()
    yield made
    made.daemon.close()
    made.guardian.close()


def ended_child() -> int:
    """A process that has ended, and whose end nobody has asked for yet."""
    pid = os.fork()
    if pid == 0:
        os._exit(0)
    os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
    return pid


# --- links ---------------------------------------------------------------------------------------------------


def test_datagrams_go_to_every_peer_as_they_are() -> None:
    with udp() as mouth, udp() as one, udp() as other:
        line = Line("datagrams", mouth.fileno())
        line.begin()
        line.peers = [list(one.getsockname()), list(other.getsockname())]
        line.send(b"neutral", 0.0)
        assert one.recv(99) == other.recv(99) == b"neutral"
        assert not os.get_blocking(mouth.fileno())


def test_datagrams_of_a_connected_socket_survive_the_error_of_an_earlier_one() -> None:
    with udp() as mouth:
        gone = udp()
        address = gone.getsockname()
        mouth.connect(address)
        gone.close()
        mouth.send(b"nobody hears this")  # its error comes back to the next call
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as again:
            again.bind(address)
            again.settimeout(2.0)
            Line("datagrams", mouth.fileno()).send(b"neutral", 0.0)
            assert again.recv(99) == b"neutral"
            again.settimeout(0.05)
            with pytest.raises(TimeoutError):
                again.recv(99)


def test_a_stream_gets_the_rest_of_a_frame_first_and_then_every_byte() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        line = Line("stream", ours.fileno())
        line.begin()
        line.send(b"neutral", time.monotonic() + 1.0)
        line.send(b"release", time.monotonic() + 1.0)
        assert theirs.recv(4096) == bytes(REST_BYTES) + b"neutralrelease"


def fill(ours: socket.socket) -> None:
    """Send until the other end's buffer is full."""
    ours.setblocking(False)
    with contextlib.suppress(BlockingIOError):
        while True:
            ours.send(bytes(4096))


def test_what_a_full_stream_does_not_take_in_time_waits_for_the_next_call() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        fill(ours)
        line = Line("stream", ours.fileno())
        began_s = time.monotonic()
        line.send(b"neutral", began_s + 0.1)
        assert 0.08 < time.monotonic() - began_s < 1.0
        began_s = time.monotonic()
        line.send(b"", began_s - 1.0)
        assert time.monotonic() - began_s < 0.05
        theirs.setblocking(False)
        heard = b""
        with pytest.raises(BlockingIOError):
            while True:
                heard += theirs.recv(1 << 20)
        line.send(b"release", time.monotonic() + 1.0)
        assert theirs.recv(99) == b"neutralrelease" and not heard.strip(b"\0")


def test_a_stream_that_has_room_again_in_time_gets_it_in_the_same_call() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        fill(ours)
        heard = bytearray()
        reading = threading.Timer(0.1, lambda: heard.extend(theirs.recv(1 << 22)))  # with or without what is sent then
        reading.start()
        began_s = time.monotonic()
        Line("stream", ours.fileno()).send(b"neutral", began_s + 5.0)
        assert 0.05 < time.monotonic() - began_s < 3.0
        reading.join()
        theirs.setblocking(False)
        with pytest.raises(BlockingIOError):
            while True:
                heard += theirs.recv(1 << 20)
        assert heard.endswith(b"neutral")


def test_what_a_broken_stream_cannot_take_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    line, answers, given = Line("stream", 99), [OSError(errno.EIO, "gone"), 7], []

    def write(fd: int, data: bytes) -> int:
        given.append((fd, data))
        answer = answers.pop(0)
        if isinstance(answer, OSError):
            raise answer
        return answer

    monkeypatch.setattr(os, "write", write)
    line.send(b"neutral", 0.0)
    line.send(b"release", 0.0)
    assert given == [(99, b"neutral"), (99, b"release")]


def test_a_serial_port_forgets_what_it_had_to_send(monkeypatch: pytest.MonkeyPatch) -> None:
    flushed: list[tuple[int, int]] = []
    monkeypatch.setattr(termios, "tcflush", lambda *what: flushed.append(what))
    theirs, ours = pty.openpty()
    tty.setraw(ours)
    line = Line("serial", ours)
    line.begin()
    assert flushed == [(ours, termios.TCOFLUSH)]
    line.send(b"neutral", time.monotonic() + 1.0)
    assert os.read(theirs, 4096) == bytes(REST_BYTES) + b"neutral"
    for kind in ("stream", "datagrams"):
        Line(kind, ours).begin()
    assert len(flushed) == 1
    os.close(theirs)
    line.close()
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(ours)


def test_a_serial_port_that_is_gone_ends_nothing() -> None:
    ours, theirs = socket.socketpair()  # no terminal: the flush fails
    with ours, theirs:
        line = Line("serial", ours.fileno())
        line.begin()
        line.send(b"neutral", time.monotonic() + 1.0)
        assert theirs.recv(4096) == bytes(REST_BYTES) + b"neutral"


def test_a_stream_is_read_dry_and_nothing_else_is() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.setblocking(False)
        theirs.send(bytes(100_000))
        for kind in ("serial", "datagrams"):
            Line(kind, ours.fileno()).drain()
        assert len(ours.recv(1 << 20, socket.MSG_PEEK)) == 100_000
        Line("stream", ours.fileno()).drain()
        with pytest.raises(BlockingIOError):
            ours.recv(1)
        theirs.close()
        Line("stream", ours.fileno()).drain()  # and ends with the other side


# --- the daemon's death ----------------------------------------------------------------------------------------


def test_a_process_has_died_once_its_main_thread_has_ended() -> None:
    assert not leader_has_died(os.getpid())
    assert not leader_has_died(2**22 + 1)  # no process has this number
    pid = ended_child()
    assert leader_has_died(pid)
    os.waitpid(pid, 0)


def test_the_name_of_a_process_does_not_count() -> None:
    there, ready = os.pipe()
    pid = os.fork()
    if pid == 0:
        with open("/proc/self/comm", "w") as file:
            file.write("a) Z 1 (b")
        os.write(ready, b".")
        time.sleep(20.0)
        os._exit(0)
    os.read(there, 1)
    try:
        assert not leader_has_died(pid)
    finally:
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        os.close(there)
        os.close(ready)


def test_nothing_was_told(talk: Talk) -> None:
    assert talk.watched() == (None, [])


def test_each_message_is_acknowledged_and_the_last_one_counts(talk: Talk) -> None:
    with udp() as mouth, udp() as ear:
        talk.tell("datagrams", [["00"]], mouth.fileno(), peers=[["127.0.0.1", 1]])
        talk.tell("keep", [["01"], ["02", "03"]], peers=[list(ear.getsockname())])
        link, steps = talk.watched()
        assert steps == [["01"], ["02", "03"]] and link is not None
        assert link.peers == [list(ear.getsockname())]
        link.send(b"neutral", 0.0)
        assert ear.recv(99) == b"neutral"
        assert [talk.daemon.recv(9), talk.daemon.recv(9)] == [b".", b"."]
        link.close()


def test_a_link_that_is_replaced_is_closed(talk: Talk) -> None:
    """Otherwise the daemon could not open its port again."""
    one, one_end = socket.socketpair()
    other, other_end = socket.socketpair()
    with one_end, other_end:
        talk.tell("stream", [], one.fileno())
        talk.tell("stream", [], other.fileno())
        one.close()
        other.close()
        link, _ = talk.watched()
        one_end.settimeout(2.0)
        assert one_end.recv(1) == b"", "the first is closed"
        assert link is not None
        link.send(b"neutral", time.monotonic() + 1.0)
        assert other_end.recv(99) == b"neutral"
        link.close()


def test_a_link_that_is_gone_is_closed_and_not_used(talk: Talk) -> None:
    one, one_end = socket.socketpair()
    with one_end:
        talk.tell("stream", [["00"]], one.fileno())
        talk.tell("none", [])
        one.close()
        assert talk.watched() == (None, [])
        one_end.settimeout(2.0)
        assert one_end.recv(1) == b""


def test_a_socket_that_breaks_is_the_daemons_end(talk: Talk) -> None:
    """The daemon died with an acknowledgement unread: the kernel resets the connection."""
    talk.tell("none", [["00"]])
    found: list[object] = []
    running = threading.Thread(target=lambda: found.append(watch(talk.guardian, os.getpid())), daemon=True)
    running.start()
    talk.daemon.recv(9, socket.MSG_PEEK)  # it has come, and stays unread
    talk.daemon.close()
    running.join(2.0)
    assert found == [(None, [["00"]])]


def test_a_message_may_be_long(talk: Talk) -> None:
    steps = [["00" * 280] * 90]
    talk.tell("none", steps)
    assert talk.watched() == (None, steps)


def test_a_daemon_that_does_not_read_is_none_the_worse(talk: Talk) -> None:
    talk.daemon.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
    talk.guardian.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1)
    for number in range(20):
        talk.tell("none", [[f"{number:02x}"]])
    talk.daemon.shutdown(socket.SHUT_WR)
    found: list[object] = []
    running = threading.Thread(target=lambda: found.append(watch(talk.guardian, os.getpid())), daemon=True)
    running.start()
    running.join(3.0)
    assert found == [(None, [["13"]])]


@pytest.mark.parametrize(("steps", "noticed"), [([["00"]], True), ([], False)], ids=["with words", "without"])
def test_a_main_thread_that_has_ended_counts_while_there_are_last_words(
    talk: Talk, steps: list[list[str]], noticed: bool
) -> None:
    """Other threads of the daemon, stuck in the kernel, keep its socket open."""
    pid = ended_child()
    talk.tell("none", steps)
    found: list[object] = []
    running = threading.Thread(target=lambda: found.append(watch(talk.guardian, pid)), daemon=True)
    running.start()
    running.join(0.4)
    assert found == ([(None, steps)] if noticed else [])
    os.waitpid(pid, 0)
    talk.daemon.shutdown(socket.SHUT_WR)
    running.join(2.0)
    assert found == [(None, steps)]


def test_a_daemon_that_lives_and_is_silent_is_waited_for(talk: Talk) -> None:
    talk.tell("none", [["00"]])
    found: list[object] = []
    running = threading.Thread(target=lambda: found.append(watch(talk.guardian, os.getpid())), daemon=True)
    running.start()
    running.join(0.35)
    assert found == []
    talk.tell("none", [["01"]])
    talk.daemon.shutdown(socket.SHUT_WR)
    running.join(2.0)
    assert found == [(None, [["01"]])]


# --- the last words ----------------------------------------------------------------------------------------------


class Main:
    """`main` in this process, with a daemon that has said so much and died."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, talk: Talk) -> None:
        self.ignored: dict[int, object] = {}
        monkeypatch.setattr(signal, "signal", self.ignored.__setitem__)
        monkeypatch.setattr(sys, "argv", ["guardian", str(os.dup(talk.guardian.fileno())), str(os.getpid())])
        self.slept: list[float] = []
        monkeypatch.setattr(guardian_process.time, "sleep", self.slept.append)
        talk.daemon.shutdown(socket.SHUT_WR)

    def run(self) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)  # the process ends with its socket open
            guardian_process.main()


def test_the_last_words_are_said_step_by_step(monkeypatch: pytest.MonkeyPatch, talk: Talk) -> None:
    with udp() as mouth, udp() as ear:
        talk.tell("datagrams", [["00ff", "01"], ["02"]], mouth.fileno(), peers=[list(ear.getsockname())])
        main = Main(monkeypatch, talk)
        main.run()
        assert [ear.recv(99) for _ in range(3)] == [b"\x00\xff", b"\x01", b"\x02"]
        assert main.slept == [STEP_S, STEP_S]
    ended = (signal.SIGINT, signal.SIGHUP, signal.SIGTERM, signal.SIGQUIT, signal.SIGABRT, signal.SIGPIPE)
    assert main.ignored == dict.fromkeys(ended, signal.SIG_IGN)


def test_a_stream_is_resynchronised_before_them_and_read_after_them(
    monkeypatch: pytest.MonkeyPatch, talk: Talk
) -> None:
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    with ours, theirs:
        theirs.send(b"telemetry")
        talk.tell("stream", [["aa"], ["bb"]], ours.fileno())
        Main(monkeypatch, talk).run()
        assert theirs.recv(4096) == bytes(REST_BYTES) + b"\xaa\xbb"
        with pytest.raises(BlockingIOError):
            ours.recv(1)


def test_each_step_has_its_time(monkeypatch: pytest.MonkeyPatch, talk: Talk) -> None:
    with udp() as mouth:
        talk.tell("datagrams", [["00"], ["01"]], mouth.fileno())
        main = Main(monkeypatch, talk)
        given: list[float] = []
        monkeypatch.setattr(Line, "send", lambda self, data, until_s: given.append(until_s - time.monotonic()))
        main.run()
        assert [round(left_s, 2) for left_s in given] == [STEP_S, STEP_S]


@pytest.mark.parametrize("link", ["none", "datagrams"])
def test_without_a_link_or_words_nothing_is_sent(link: str, monkeypatch: pytest.MonkeyPatch, talk: Talk) -> None:
    with udp() as mouth, udp() as ear:
        fds = (mouth.fileno(),) if link == "datagrams" else ()
        talk.tell(link, [["00"]] if link == "none" else [], *fds, peers=[list(ear.getsockname())])
        main = Main(monkeypatch, talk)
        main.run()
        assert main.slept == []
        ear.settimeout(0.02)
        with pytest.raises(TimeoutError):
            ear.recv(9)
