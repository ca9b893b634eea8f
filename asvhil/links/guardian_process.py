"""The guardian: a process that sends the daemon's last words when the daemon has died without saying them.

Run as `python -I -S guardian_process.py FD PID`, with a connected SOCK_SEQPACKET socket to the daemon and the daemon's
process id. It needs the standard library alone, and knows no MAVLink: the daemon hands it an open link and the bytes.

Each message is JSON; it is acknowledged by a byte:
- `link`: "keep" the one it has; "none": close it; "datagrams", "stream" or "serial": a new one, its descriptor with it
- `peers`: where datagrams go, as socket addresses; empty for a socket that is connected
- `steps`: the last words, a list of frames (hex) each, STEP_S apart; empty while the motors are not the daemon's

The daemon's death is the end of the socket, or the end of its main thread while other threads are stuck in the kernel.
Nothing is sent before, and nothing where `steps` is empty. Then this process ends too.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import socket
import sys
import termios
import time

STEP_S = 0.05
LOOK_S = 0.1  # the daemon tells something in each tick while it has the motors
REST_BYTES = 280  # of zeros: the rest of a frame that the daemon was in the middle of, if it was
# It ends with the daemon, and not by what ends that one; SIGABRT is systemd's watchdog.
IGNORED = (signal.SIGINT, signal.SIGHUP, signal.SIGTERM, signal.SIGQUIT, signal.SIGABRT, signal.SIGPIPE)


class Line:
    """An open link of the daemon: a duplicate of its descriptor."""

    def __init__(self, kind: str, fd: int) -> None:
        self._kind, self._fd = kind, fd
        self._waiting = b""  # of a stream, not taken yet
        self.peers: list[list[object]] = []

    def begin(self) -> None:
        """Make way: what the daemon had queued is old, and may have been cut off in the middle of a frame."""
        if self._kind == "serial":
            with contextlib.suppress(termios.error):
                termios.tcflush(self._fd, termios.TCOFLUSH)
        if self._kind != "datagrams":
            self._waiting = bytes(REST_BYTES)

    def send(self, data: bytes, until_s: float) -> None:
        """Send; what a stream does not take by that time waits for the next call."""
        if self._kind == "datagrams":
            self._send_to_all(data)
            return
        self._waiting += data
        while self._waiting:
            try:
                self._waiting = self._waiting[os.write(self._fd, self._waiting) :]
            except BlockingIOError:
                left_s = until_s - time.monotonic()
                if left_s <= 0.0:
                    return
                select.select([], [self._fd], [], left_s)
            except OSError:
                self._waiting = b""

    def _send_to_all(self, data: bytes) -> None:
        with socket.socket(fileno=os.dup(self._fd)) as link:
            link.setblocking(False)
            targets: list[list[object] | None] = [*self.peers] or [None]
            for peer in targets:
                for _ in range(2):  # the error of an earlier datagram is reported instead of sending this one
                    with contextlib.suppress(OSError):
                        link.send(data) if peer is None else link.sendto(data, tuple(peer))
                        break

    def drain(self) -> None:
        """Read what has come: a connection that is closed with unread bytes is reset, and loses the last words."""
        with contextlib.suppress(OSError):
            while self._kind == "stream" and os.read(self._fd, 65536):
                pass

    def close(self) -> None:
        """Give it up, so that the daemon can open it again."""
        os.close(self._fd)


def leader_has_died(pid: int) -> bool:
    """Whether the main thread of a process has ended, though others may not have."""
    try:
        with open(f"/proc/{pid}/stat", "rb") as file:
            return file.read().rpartition(b")")[2].split()[0] in (b"Z", b"X")
    except OSError:
        return False  # its socket tells


def watch(control: socket.socket, pid: int) -> tuple[Line | None, list[list[str]]]:
    """Take messages until the daemon has died: its link and its last words."""
    link: Line | None = None
    steps: list[list[str]] = []
    while True:
        if not select.select([control], [], [], LOOK_S if steps else None)[0]:
            if leader_has_died(pid):
                return link, steps
            continue
        try:
            data, fds, _, _ = socket.recv_fds(control, 1 << 18, 1)
        except ConnectionError:
            data = b""
        if not data:
            return link, steps
        message = json.loads(data)
        if message["link"] != "keep":
            if link is not None:
                link.close()
            link = Line(message["link"], fds[0]) if fds else None
        if link is not None:
            link.peers = message["peers"]
        steps = message["steps"]
        with contextlib.suppress(OSError):  # it does not read, or is gone: the next call tells
            control.send(b".", socket.MSG_DONTWAIT)


def main() -> None:
    """Watch, and say the last words if there are any."""
    for number in IGNORED:
        signal.signal(number, signal.SIG_IGN)
    link, steps = watch(socket.socket(fileno=int(sys.argv[1])), int(sys.argv[2]))
    if link is None or not steps:
        return
    link.begin()
    for frames in steps:
        until_s = time.monotonic() + STEP_S
        for frame in frames:
            link.send(bytes.fromhex(frame), until_s)
        time.sleep(STEP_S)  # from then on, however late it was: a release must not follow on the heels of a neutral
    link.drain()


if __name__ == "__main__":
    main()
