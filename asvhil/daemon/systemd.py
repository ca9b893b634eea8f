"""What the daemon tells systemd where that has started it (`Type=notify`): ready, alive, its phase, stopping."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Mapping, MutableMapping

MOST_OFTEN_S = 0.2
SHARE = 4  # of the watchdog's time, between two signs of life


class ServiceManager:
    """The datagrams of sd_notify(3); none where no service manager listens. Nothing here raises or waits."""

    def __init__(self, environment: MutableMapping[str, str]) -> None:
        """Take the variables out of the environment, so that no child answers for this process."""
        address = environment.pop("NOTIFY_SOCKET", "")
        self._every_s = _period_s(environment)
        for name in ("WATCHDOG_USEC", "WATCHDOG_PID"):
            environment.pop(name, None)
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket: socket.socket | None = None
        if address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self._socket.setblocking(False)
        self._ready = False
        self._alive_s = -1e9
        self._status = ""

    def tick(self, status: str) -> None:
        """A tick was made: ready after the first one; alive, for the watchdog; the status in words where it changes."""
        if self._socket is None:
            return
        lines = [] if self._ready else ["READY=1"]
        now_s = time.monotonic()
        if self._every_s is not None and now_s - self._alive_s >= self._every_s:
            self._alive_s = now_s
            lines.append("WATCHDOG=1")
        if status != self._status:
            lines.append("STATUS=" + " ".join(status.split()))
        if lines and self._send(lines):
            self._ready, self._status = True, status

    def stopping(self) -> None:
        """The run is over; the log is still to be finished, which the watchdog does not watch."""
        self._send(["STOPPING=1"])
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send(self, lines: list[str]) -> bool:
        if self._socket is None:
            return False
        try:
            self._socket.sendto("\n".join(lines).encode(), self._address)
        except OSError:
            return False  # said again in the next tick
        return True


def _period_s(environment: Mapping[str, str]) -> float | None:
    """Between two signs of life; None where no watchdog waits for them."""
    try:
        watchdog_s = int(environment["WATCHDOG_USEC"]) * 1e-6
    except (KeyError, ValueError):
        return None
    if environment.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return None
    return min(watchdog_s / SHARE, MOST_OFTEN_S) if watchdog_s > 0.0 else None
