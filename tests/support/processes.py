"""The daemon and the plant as real processes on loopback, for the few tests that need real time."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from asvhil.io.mavlink.frames import FrameSplitter, decode
from tests.support.ports import free_port


class Process:
    """One `asvhil` command. Its JSON status lines are collected as they come; it is ended by its pid."""

    def __init__(self, *arguments: str, env: dict[str, str] | None = None) -> None:
        self.started_s = time.monotonic()
        self.child = subprocess.Popen(
            [sys.executable, "-m", "asvhil", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | (env or {}),
        )
        self.lines: queue.Queue[str] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.child.stdout is not None
        for line in self.child.stdout:
            self.lines.put(line)

    def wait_for(self, condition: Callable[[dict[str, Any]], bool], timeout_s: float) -> dict[str, Any]:
        """The first JSON status that meets a condition."""
        end_s = time.monotonic() + timeout_s
        last = "nothing"
        while time.monotonic() < end_s:
            with contextlib.suppress(queue.Empty):
                last = self.lines.get(timeout=0.2)
                status: dict[str, Any] = json.loads(last)
                if condition(status):
                    return status
        raise AssertionError(f"not within {timeout_s} s; the last status was: {last}")

    def end(self, number: signal.Signals = signal.SIGINT, timeout_s: float = 10.0) -> tuple[int, str]:
        """Signal the process and wait: (return code, what it said on stderr)."""
        if self.child.poll() is None:
            self.child.send_signal(number)
        try:
            self.child.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.child.kill()
            self.child.wait()
            raise
        self._reader.join(5.0)
        assert self.child.stderr is not None and self.child.stdout is not None
        words = self.child.stderr.read()
        self.child.stderr.close()
        self.child.stdout.close()
        return self.child.returncode, words

    def __enter__(self) -> Process:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.child.poll() is None:
            self.child.kill()
            self.child.wait()
        for stream in (self.child.stdout, self.child.stderr):
            if stream is not None and not stream.closed:
                stream.close()


class PeerProcess:
    """A ground station of others as a process: a line in is a command, and `on_text` gets all that it prints.

    It is ended at the end of a `with`.
    """

    def __init__(self, words: list[str], on_text: Callable[[str], None], by_line: bool = True, **popen: Any) -> None:
        self.child = subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, **{"stderr": subprocess.DEVNULL, **popen}
        )
        self._on_text, self._by_line = on_text, by_line
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.child.stdout is not None
        while text := self.child.stdout.readline() if self._by_line else self.child.stdout.read(1):
            self._on_text(text)

    def say(self, line: str) -> None:
        assert self.child.stdin is not None
        self.child.stdin.write(line + "\n")
        self.child.stdin.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self) -> None:
        """Close its input, and wait for it and for what it still prints. A second call does nothing."""
        assert self.child.stdin is not None and self.child.stdout is not None
        self.child.stdin.close()
        try:
            self.child.wait(10.0)
        except subprocess.TimeoutExpired:
            self.child.kill()
            self.child.wait()
        self._reader.join(5.0)
        self.child.stdout.close()


def sets(*pairs: str) -> list[str]:
    """Options that override keys of the config."""
    return [part for pair in pairs for part in ("--set", pair)]


class NoisyLine:
    """A real pty between the plant's anemometer (UDP) and the daemon's serial port, with room for noise."""

    def __init__(self) -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._master)
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.device = os.ttyname(self._slave)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.2)
        self.udp_port = int(self._socket.getsockname()[1])
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._relay, daemon=True)
        self._thread.start()

    def write(self, data: bytes) -> None:
        """Put bytes on the line; what does not fit within a second is lost, as on a wire."""
        end_s = time.monotonic() + 1.0
        while data and time.monotonic() < end_s:
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:
                time.sleep(0.002)

    def _relay(self) -> None:
        while not self._stop.is_set():
            with contextlib.suppress(TimeoutError):
                self.write(self._socket.recv(4096))

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._socket.close()
        os.close(self._master)
        os.close(self._slave)


class Bench:
    """Ports and overrides for one plant and one daemon that know each other and nobody else."""

    def __init__(self, folder: Path, *overrides: str) -> None:
        self.autopilot_port, self.operator_port = free_port(), free_port()
        self.line = NoisyLine()
        self.log = folder / "log.mcap"
        settings = [
            f"links.autopilot.endpoint=udpin:127.0.0.1:{self.autopilot_port}",
            f"links.operator.endpoint=udpin:127.0.0.1:{self.operator_port}",
            f"links.anemometer.endpoint=serial:{self.line.device}:115200",
            f"plant.links.autopilot=udpout:127.0.0.1:{self.autopilot_port}",
            f"plant.links.anemometer=udpout:127.0.0.1:{self.line.udp_port}",
            *overrides,
        ]
        self.sets = [word for setting in settings for word in ("--set", setting)]

    def plant(self, *overrides: str) -> Process:
        return Process("plant", "sitl", "--quiet", *self.sets, *sets(*overrides))

    def daemon(self, env: dict[str, str] | None = None) -> Process:
        return Process("run", "sitl", "--status-json", "--log", str(self.log), *self.sets, env=env)

    def command(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """One `asvhil hold` or `release`, to its end."""
        words = [sys.executable, "-m", "asvhil", *arguments, "--config", "sitl", *self.sets]
        return subprocess.run(words, capture_output=True, text=True, check=False, timeout=20.0)


@contextlib.contextmanager
def bench(folder: Path, *overrides: str) -> Iterator[Bench]:
    made = Bench(folder, *overrides)
    try:
        yield made
    finally:
        made.line.close()


def listen(port: int, seconds: float) -> list[tuple[float, Any]]:
    """(seconds since the call, message) of what a vehicle sends to a UDP port on loopback."""
    found: list[tuple[float, Any]] = []
    splitter = FrameSplitter(datagrams=True)
    start_s = time.monotonic()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", port))
        ear.settimeout(0.2)
        while time.monotonic() - start_s < seconds:
            with contextlib.suppress(TimeoutError):
                for data in splitter.receive(ear.recv(4096)):
                    found.append((time.monotonic() - start_s, decode(data)))
    return found
