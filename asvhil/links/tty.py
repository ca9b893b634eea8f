"""Serial ports, and the pseudo terminal that simulates one on the plant's side."""

from __future__ import annotations

import array
import asyncio
import contextlib
import fcntl
import os
import termios
import tty
from collections.abc import Callable

import serial

from asvhil.config.link_spec import LinkSpec
from asvhil.errors import LinkError
from asvhil.links.in_thread import open_in_thread
from asvhil.links.link import Handover, Link, why
from asvhil.links.stream import CHUNK_BYTES, ByteStream

LINGER_S = 0.5
LOOK_PERIOD_S = 0.02
CONGESTED_S = 0.05  # of the line's time: an override that waits longer behind others comes late
CONGESTED_BYTES = 512  # at least, or a slow line would be congested by a single frame


class SerialLink(Link):
    """A serial port, opened exclusively; unplugging it loses the link."""

    def __init__(self, spec: LinkSpec, port: str, now_ns: Callable[[], int], device: serial.Serial) -> None:
        super().__init__(spec.text, spec.path, port, now_ns)
        self._device = device
        self._congested_bytes = max(CONGESTED_BYTES, round(CONGESTED_S * spec.baud / 10.0))  # 10 bits to a byte
        self._stream = ByteStream(device.fileno(), self._received, self._unplugged, self._count_unsent)

    def _handover(self) -> Handover | None:
        return Handover(fd=self._device.fileno(), kind="serial", key=self)

    def _unplugged(self, reason: str) -> None:
        self._lose(f"unplugged, or the other end closed ({reason})")

    def _transmit(self, data: bytes, peer: str) -> None:
        self._stream.send(data)

    @property
    def congested(self) -> bool:
        """Whether more bytes are queued, here and in the driver, than the line sends in 50 ms."""
        if self._gone:
            return False
        return self._stream.pending_bytes + _queued_bytes(self._device.fileno()) > self._congested_bytes

    async def _linger(self) -> None:
        """Wait for the last sends (release of the motors); the kernel's own wait in close() would block up to 30 s."""
        loop = asyncio.get_running_loop()
        deadline_s = loop.time() + LINGER_S
        while self._device.is_open and (self._stream.pending_bytes or _queued_bytes(self._device.fileno())):
            if loop.time() >= deadline_s:
                with contextlib.suppress(termios.error):
                    termios.tcflush(self._device.fileno(), termios.TCOFLUSH)
                return
            await asyncio.sleep(0.005)

    def _release(self) -> None:
        self._stream.stop()
        self._device.close()


def _queued_bytes(fd: int) -> int:
    """Bytes in the driver's output queue; 0 when the device is gone."""
    count = array.array("i", [0])
    try:
        fcntl.ioctl(fd, termios.TIOCOUTQ, count)
    except OSError:
        return 0
    return count[0]


def _open_device(spec: LinkSpec) -> serial.Serial:
    device = serial.Serial(spec.path, spec.baud, timeout=0, write_timeout=0, exclusive=True)
    try:
        # pyserial leaves VMIN at 0, where "nothing yet" and "unplugged" both read as no bytes; with 1 they differ.
        attributes = termios.tcgetattr(device.fileno())
        attributes[6][termios.VMIN] = 1
        termios.tcsetattr(device.fileno(), termios.TCSANOW, attributes)
    except BaseException:
        device.close()
        raise
    return device


async def open_serial(spec: LinkSpec, port: str, now_ns: Callable[[], int]) -> SerialLink:
    """Open a serial port 8N1 without flow control; LinkError when it is missing, busy, or no serial port."""
    try:
        device = await open_in_thread(_open_device, spec)  # some drivers take a second to open
    except OSError as exc:  # pyserial's SerialException is one
        raise LinkError(f"{spec.text}: {why(exc)}") from None
    except (termios.error, ValueError) as exc:
        raise LinkError(f"{spec.text}: the port refuses {spec.baud} baud, 8N1 ({exc})") from None
    return SerialLink(spec, port, now_ns, device)


class PtyLink(Link):
    """The master end of a pseudo terminal; `address` is the slave's path, a symlink at the spec's path leads there.

    While no process has the slave open, sends are dropped: the kernel would keep them for the next reader, which would
    get stale bytes. An opened slave is noticed at the next send, or within 20 ms.
    """

    def __init__(self, spec: LinkSpec, slave_path: str, port: str, now_ns: Callable[[], int], master_fd: int) -> None:
        super().__init__(spec.text, slave_path, port, now_ns)
        self._path = spec.path
        self._master_fd = master_fd
        self._stream: ByteStream | None = None
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        os.set_blocking(master_fd, False)
        self._look()

    def _handover(self) -> Handover | None:
        if self._stream is None:
            return None
        return Handover(fd=self._master_fd, kind="stream", key=self)

    def _look(self) -> None:
        """Check whether a process has opened the slave: then read and write it until it is closed, else check again."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        try:
            data = os.read(self._master_fd, CHUNK_BYTES)
        except (BlockingIOError, InterruptedError):
            data = b""
        except OSError:  # EIO: the slave is closed. A closed slave polls as readable, so its opening cannot be awaited.
            self._timer = self._loop.call_later(LOOK_PERIOD_S, self._look)
            return
        self._stream = ByteStream(self._master_fd, self._received, self._slave_closed, self._count_unsent)
        if data:
            self._received(data)

    def _slave_closed(self, _reason: str) -> None:
        self._stream = None
        try:  # discard what the last reader has not read
            slave_fd = os.open(self.address, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError:
            pass
        else:
            with contextlib.suppress(termios.error):
                termios.tcflush(slave_fd, termios.TCIFLUSH)
            os.close(slave_fd)
        self._look()

    def _transmit(self, data: bytes, peer: str) -> None:
        if self._stream is None:
            self._look()
        if self._stream is None:
            self._count_unsent(1)
        else:
            self._stream.send(data)

    def _release(self) -> None:
        if self._master_fd < 0:
            return
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._stream is not None:
            self._stream.stop()
            self._stream = None
        with contextlib.suppress(OSError):  # already gone, or replaced by another plant's
            if os.readlink(self._path) == self.address:
                os.unlink(self._path)
        os.close(self._master_fd)
        self._master_fd = -1


async def open_pty(spec: LinkSpec, port: str, now_ns: Callable[[], int]) -> PtyLink:
    """Open a raw pseudo terminal and make the symlink to its slave; LinkError when the symlink cannot be made."""
    if os.path.lexists(spec.path) and not os.path.islink(spec.path):
        raise LinkError(f"{spec.text}: something that is not a symlink is already there")
    try:
        master_fd, slave_fd = os.openpty()
    except OSError as exc:
        raise LinkError(f"{spec.text}: no pseudo terminal to be had: {why(exc)}") from None
    try:
        tty.setraw(slave_fd)
        slave_path = os.ttyname(slave_fd)
        # Renamed into place: a symlink left by a killed plant is replaced, and a reader never sees none.
        fresh = f"{spec.path}.{os.getpid()}.{master_fd}"
        os.symlink(slave_path, fresh)
        try:
            os.replace(fresh, spec.path)
        except OSError:
            os.unlink(fresh)
            raise
    except OSError as exc:
        os.close(master_fd)
        raise LinkError(f"{spec.text}: cannot make the symlink: {os.strerror(exc.errno or 0).lower()}") from None
    finally:
        os.close(slave_fd)
    return PtyLink(spec, slave_path, port, now_ns, master_fd)
