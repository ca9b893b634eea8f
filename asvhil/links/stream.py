"""Bytes in and out of a non-blocking file descriptor: what TCP, serial ports and pseudo terminals have in common.

Not asyncio's transports, because those buffer without bound, and not pyserial-asyncio-fast, because it loops inside
write() for ever when the kernel's buffer of a serial port is full (version 0.16 with pyserial 3.5).
"""

from __future__ import annotations

import asyncio
import os
from collections import deque
from collections.abc import Callable

from asvhil.links.link import why

CHUNK_BYTES = 4096
MAX_PENDING_BYTES = 256 * 1024


class ByteStream:
    """Reads and writes a file descriptor, which its owner opens and closes; stops itself before it calls `lost`."""

    def __init__(
        self,
        fd: int,
        received: Callable[[bytes], object],
        lost: Callable[[str], None],
        unsent: Callable[[int], None],
    ) -> None:
        self._fd = fd
        self._received = received
        self._lost = lost
        self._unsent = unsent
        self._head = memoryview(b"")  # the send that is partly out: it alone must never be dropped
        self._waiting: deque[bytes] = deque()
        self._pending_bytes = 0
        self._writing = False
        self._stopped = False
        self._loop = asyncio.get_running_loop()
        os.set_blocking(fd, False)
        self._loop.add_reader(fd, self._readable)

    @property
    def pending_bytes(self) -> int:
        """Bytes accepted by send() that the kernel has not taken yet."""
        return self._pending_bytes

    def send(self, data: bytes) -> None:
        """Write, or queue behind a slow reader; above 256 KiB the oldest whole sends are dropped and counted."""
        if self._stopped:
            self._unsent(1)
            return
        self._waiting.append(data)
        self._pending_bytes += len(data)
        if not self._writing:
            self._flush()
        while self._waiting and self._pending_bytes > MAX_PENDING_BYTES:
            self._pending_bytes -= len(self._waiting.popleft())
            self._unsent(1)

    def stop(self) -> None:
        """Stop using the descriptor, before its owner closes it; pending sends count as unsent. Idempotent."""
        if self._stopped:
            return
        self._stopped = True
        self._loop.remove_reader(self._fd)
        self._loop.remove_writer(self._fd)
        self._unsent(len(self._waiting) + bool(self._head))
        self._waiting.clear()
        self._head = memoryview(b"")
        self._pending_bytes = 0

    def _readable(self) -> None:
        try:
            data = os.read(self._fd, CHUNK_BYTES)
        except (BlockingIOError, InterruptedError):
            return
        except OSError as exc:
            self._end(why(exc))
            return
        if data:
            self._received(data)
        else:
            self._end("the other end closed")

    def _flush(self) -> None:
        while self._head or self._waiting:
            if not self._head:
                self._head = memoryview(self._waiting.popleft())
            try:
                n = os.write(self._fd, self._head)
            except (BlockingIOError, InterruptedError):
                n = 0
            except OSError as exc:
                self._write_failed(exc)
                return
            self._pending_bytes -= n
            self._head = self._head[n:]
            if self._head:
                if not self._writing:
                    self._writing = True
                    self._loop.add_writer(self._fd, self._flush)
                return
        if self._writing:
            self._writing = False
            self._loop.remove_writer(self._fd)

    def _write_failed(self, exc: OSError) -> None:
        """The peer has closed: read what it sent before, which the kernel still has."""
        for _ in range(1024):
            if self._stopped:
                return
            try:
                data = os.read(self._fd, CHUNK_BYTES)
            except OSError:
                break
            if not data:
                break
            self._received(data)
        self._end(why(exc))

    def _end(self, reason: str) -> None:
        if not self._stopped:
            self.stop()
            self._lost(reason)
