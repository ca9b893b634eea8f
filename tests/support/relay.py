"""A relay on UDP between the plant's autopilot and the daemon: it can cut, change and add what passes."""

from __future__ import annotations

import contextlib
import selectors
import socket
import threading
import time
from collections.abc import Callable
from typing import Any

from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect


class Relay:
    """Passes datagrams both ways by a thread of its own. `passes` says whether one does: (data, from the autopilot).

    `outputs` are (time.monotonic(), port us, starboard us) of each SERVO_OUTPUT_RAW, cut off or not.
    """

    def __init__(self, daemon_port: int) -> None:
        self._autopilot = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._autopilot.bind(("127.0.0.1", 0))
        self._daemon = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._daemon.bind(("127.0.0.1", 0))
        self._daemon_at = ("127.0.0.1", daemon_port)
        self._autopilot_at: Any = None
        self.port = int(self._autopilot.getsockname()[1])
        self.passes: Callable[[bytes, bool], bool] = lambda data, inward: True
        self.outputs: list[tuple[float, int, int]] = []
        self._splitter = FrameSplitter(datagrams=True)
        self._station = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
        self._others: dict[tuple[int, int], Any] = {}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def tell_autopilot(self, message: Any) -> None:
        """A message of a ground station, which the daemon does not hear."""
        self._autopilot.sendto(message.pack(self._station), self._autopilot_at)

    def tell_daemon(self, message: Any, system: int, component: int) -> None:
        """A message of somebody else on the autopilot's link."""
        sender = self._others.setdefault((system, component), dialect.MAVLink(None, system, component))
        self._daemon.sendto(message.pack(sender), self._daemon_at)
        sender.seq = (sender.seq + 1) % 256

    def wait_for_neutral(self, since_s: float, timeout_s: float) -> float:
        """Seconds from a time to the first report of neutral outputs after which all are neutral."""
        time.sleep(max(0.0, since_s + timeout_s - time.monotonic()))
        after = [row for row in self.outputs if row[0] > since_s]
        moving = [at_s for at_s, *us in after if set(us) - {0, 1500}]
        rest = [at_s for at_s, *_ in after if not moving or at_s > moving[-1]]
        assert rest, f"never neutral: {after[-3:]}"
        return rest[0] - since_s

    def _run(self) -> None:
        with selectors.DefaultSelector() as ready:
            ready.register(self._autopilot, selectors.EVENT_READ)
            ready.register(self._daemon, selectors.EVENT_READ)
            while not self._stop.is_set():
                for key, _ in ready.select(0.1):
                    with contextlib.suppress(OSError):
                        self._pass(key.fileobj is self._autopilot)

    def _pass(self, inward: bool) -> None:
        if inward:
            data, self._autopilot_at = self._autopilot.recvfrom(65536)
            for message in map(decode, self._splitter.receive(data)):
                if message is not None and message.get_type() == "SERVO_OUTPUT_RAW":
                    self.outputs.append((time.monotonic(), message.servo1_raw, message.servo3_raw))
            if self.passes(data, True):
                self._daemon.sendto(data, self._daemon_at)
        else:
            data, _ = self._daemon.recvfrom(65536)
            if self._autopilot_at is not None and self.passes(data, False):
                self._autopilot.sendto(data, self._autopilot_at)

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._autopilot.close()
        self._daemon.close()
