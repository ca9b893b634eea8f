"""Standard output and error of a command: what cannot be written is lost, told once at the end, and never raised."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import select
import sys

from asvhil.files import shown

RETRY_S = 1.0


class StandardStream(io.TextIOBase):
    """Text to a file descriptor, at once and without a lock, so that a thread that is stuck in it holds up nobody else.

    The first error is kept in `failure`, in words, and all that comes later is dropped.
    """

    def __init__(self, fd: int, encoding: str = "utf-8") -> None:
        self._fd = fd
        self._encoding = encoding
        self._terminal = os.isatty(fd)
        self.failure = ""
        self.reader_left = False

    @property
    def encoding(self) -> str:  # type: ignore[override]
        return self._encoding

    @property
    def errors(self) -> str:  # type: ignore[override]
        return "replace"

    def writable(self) -> bool:
        return True

    def isatty(self) -> bool:
        return self._terminal

    def fileno(self) -> int:
        return self._fd

    def write(self, text: str) -> int:
        """Write the whole text; waits for a slow reader."""
        left = memoryview(shown(text).encode(self._encoding, "replace"))
        while left and not self.failure:
            try:
                left = left[os.write(self._fd, left) :]
            except BlockingIOError:  # whoever started us has set the pipe to non-blocking
                select.select([], [self._fd], [], RETRY_S)
            except OSError as error:
                self.reader_left = error.errno == errno.EPIPE
                self.failure = error.strerror or type(error).__name__
        return len(text)

    def flush(self) -> None:
        """Nothing is held back."""


def guard_standard_streams() -> tuple[StandardStream, StandardStream]:
    """Put `StandardStream`s in the place of sys.stdout and sys.stderr. A descriptor that is closed becomes /dev/null.

    Otherwise the next file that is opened would get its number, and a log our words. A stream that the caller has put
    in the place of the process's own, as a notebook or a test does, stays.
    """
    for fd in (0, 1, 2):
        try:
            os.fstat(fd)
        except OSError:
            with contextlib.suppress(OSError):
                os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free, which is this one
    streams = StandardStream(1, _encoding(sys.stdout)), StandardStream(2, _encoding(sys.stderr))
    if sys.stdout is sys.__stdout__:
        sys.stdout = streams[0]
    if sys.stderr is sys.__stderr__:
        sys.stderr = streams[1]
    return streams


def _encoding(stream: object) -> str:
    return getattr(stream, "encoding", None) or "utf-8"
