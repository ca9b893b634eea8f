"""The daemon's side of the guardian: starts it, tells it the link and the last words in each tick, and minds it."""

from __future__ import annotations

import json
import os
import resource
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Sequence

from asvhil.links import guardian_process
from asvhil.links.link import Handover

TELL_S = 0.5  # at least so often, so that it can be seen to answer
ANSWER_S = 2.0
START_AGAIN_S = 1.0
TOLD_S = 10.0  # how long a death is told
CLOSE_S = 2.0
UNTOLD = object()  # in the place of a link: it does not know which one

Steps = Sequence[Sequence[bytes]]


class Guardian:
    """One guardian process, started again when it dies. Nothing here raises or waits, but for `close`."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._control: socket.socket | None = None
        self._told: tuple[dict[str, object], object] = ({}, None)  # the last message, and the link that it has
        self._told_s = self._answered_s = self._died_s = self._tried_s = -1e9
        self._death = ""
        self.deaths = 0
        self._reason = ""
        self._no_link = ""

    @property
    def watches(self) -> bool:
        """Whether there is one."""
        return self._process is not None

    @property
    def pid(self) -> int | None:
        """Its process id, None where there is none."""
        return None if self._process is None else self._process.pid

    @property
    def trouble(self) -> str:
        """What is wrong with it, for operators; empty where nothing is."""
        if self._process is None:
            why = f" ({self._reason})" if self._reason else ""
            return f"is not there{why}: nothing sends neutral if this program dies"
        if time.monotonic() - self._died_s < TOLD_S:
            return f"{self._death}, and was started again"
        return self._no_link

    def start(self) -> None:
        """Start it, unless it runs; a failure is told by `trouble`."""
        if self._process is not None:
            return
        self._tried_s = time.monotonic()
        try:
            control, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        except OSError as error:
            self._reason = error.strerror or str(error)
            return
        words = [sys.executable, "-I", "-S", guardian_process.__file__, str(other.fileno()), str(os.getpid())]
        null = subprocess.DEVNULL
        try:
            # A session of its own: neither Ctrl-C nor a hang-up of the terminal reaches it.
            self._process = subprocess.Popen(
                words, pass_fds=(other.fileno(),), start_new_session=True, stdin=null, stdout=null, stderr=null, cwd="/"
            )
        except (OSError, ValueError) as error:
            self._reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
            control.close()
            return
        finally:
            other.close()
        control.setblocking(False)
        self._control = control
        self._told = ({}, None)
        self._told_s = -1e9
        self._answered_s = time.monotonic() + ANSWER_S  # it has its own start to make
        _no_core()

    def tell(self, steps: Steps, link: Handover | None) -> None:
        """What to send, and on which link, if the daemon dies from now on; starts it again if it has died."""
        now_s = time.monotonic()
        self._look(now_s)
        if self._process is None:
            if now_s - self._tried_s >= START_AGAIN_S or self._died_s == now_s:
                self.start()
            if self._process is None:
                return
        key = None if link is None else link.key
        same = key == self._told[1]
        content: dict[str, object] = {
            "peers": [] if link is None else link.peers,
            "steps": [[frame.hex() for frame in frames] for frames in steps],
        }
        if same and content == self._told[0] and now_s - self._told_s < TELL_S:
            return
        kind = "keep" if same else "none" if link is None else link.kind
        sent = self._send(json.dumps({"link": kind, **content}).encode(), [] if same or link is None else [link.fd])
        # What did not go out is told again, with its link: else that would be thought to be known.
        self._told, self._told_s = (content, key) if sent else ({}, UNTOLD), now_s

    def note_no_link(self, text: str) -> None:
        """Why the link to the autopilot is none that it could use; empty where it is."""
        self._no_link = text

    def stand_down(self) -> None:
        """The motors were given back: nothing is to be sent when this program ends."""
        if self._process is not None:
            self.tell([], None)
            if self._told[1] is UNTOLD:  # it would say the words of before
                self._end("did not answer", time.monotonic())

    def close(self) -> None:
        """End it: by the end of its socket, upon which it says what it was told last."""
        if self._control is not None:
            self._control.close()
            self._control = None
        if self._process is not None:
            try:
                self._process.wait(CLOSE_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            self._process = None

    # --- parts ---------------------------------------------------------------------------------------------

    def _send(self, data: bytes, fds: list[int]) -> bool:
        """Whether it went out; where it does not read, `_look` finds that out by its silence."""
        assert self._control is not None
        try:
            socket.send_fds(self._control, [data], fds)
        except BlockingIOError:
            return False
        except OSError:
            self._end("died", time.monotonic())
            return False
        return True

    def _look(self, now_s: float) -> None:
        """Whether it lives and answers."""
        if self._process is None or self._control is None:
            return
        try:
            while self._control.recv(64):
                self._answered_s = max(self._answered_s, now_s)
        except BlockingIOError:
            if self._told_s - self._answered_s > ANSWER_S:
                self._end("did not answer", now_s)
            return
        except OSError:
            pass
        self._end("died", now_s)

    def _end(self, death: str, now_s: float) -> None:
        process, self._process = self._process, None
        if self._control is not None:
            # Not before it is dead: the end of its socket would tell it that the daemon has died.
            if process is not None:
                process.kill()
                process.wait()
            self._control.close()
            self._control = None
        code = process.returncode if process is not None else None
        by = f" ({signal.Signals(-code).name})" if code is not None and code < 0 and death == "died" else ""
        self._death, self._died_s = f"{death}{by}", now_s
        self._reason = self._death
        self.deaths += 1


def _no_core() -> None:
    """No dump of the memory when this process crashes: until it is written, its death cannot be noticed.

    1 byte instead of none: the kernel does without a dump then also where it pipes dumps to a program.
    """
    _, most = resource.getrlimit(resource.RLIMIT_CORE)
    least = 1 if most == resource.RLIM_INFINITY else min(1, most)
    resource.setrlimit(resource.RLIMIT_CORE, (least, most))
