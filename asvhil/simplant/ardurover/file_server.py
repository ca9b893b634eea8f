"""MAVFTP on the simulated ArduRover: one session, one open file, the last answer said again. Sans-IO.

As the real one: a session that is idle for 3 s gives way to another, and CRC-32 begins with 0 and is not inverted.
"""

from __future__ import annotations

import errno
import zlib

from asvhil.io.mavlink.file_transfer import DATA_BYTES, FilePacket, FileRefusal, Op
from asvhil.types import record

SESSION_NS = 3_000_000_000
BURST = 500  # answers to one request
PATHS = (Op.LIST, Op.OPEN_READ, Op.CREATE, Op.OPEN_WRITE, Op.REMOVE, Op.REMOVE_FOLDER, Op.MAKE_FOLDER, Op.CRC32)


class _Refused(Exception):
    def __init__(self, refusal: FileRefusal, number: int | None = None) -> None:
        self.data = bytes([refusal] if number is None else [refusal, number])


@record
class _Open:
    path: str
    writing: bool
    session: int


class FileServer:
    """Files by their path. `capacity` bounds the sum of their sizes (bytes)."""

    def __init__(self, files: dict[str, bytes], folders: tuple[str, ...], capacity: int = 1_000_000) -> None:
        self.files, self.folders, self.capacity = files, list(folders), capacity
        self.enabled = True
        self._open: _Open | None = None
        self._said_ns = 0
        self._last: tuple[tuple[int, int], FilePacket] | None = None

    def receive(self, t_ns: int, sender: tuple[int, int], request: FilePacket) -> list[FilePacket]:
        """The answers to a request of a (system id, component id)."""
        if not self.enabled or request.op in (Op.ACK, Op.NAK):
            return []
        if self._last is not None:
            last_to, last = self._last
            if (last_to, last.session, last.number) == (sender, request.session, (request.number + 1) % 65536):
                return [last]
        try:
            answers = self._handle(t_ns, request)
        except _Refused as refused:
            answers = [(Op.NAK, request.offset, refused.data, True)]
        packets = [
            FilePacket(
                number=request.number + 1 + n,
                session=request.session,
                op=op,
                offset=offset,
                data=data,
                request=request.op,
                burst_complete=last_one and request.op == Op.READ_BURST,
            )
            for n, (op, offset, data, last_one) in enumerate(answers)
        ]
        self._said_ns = -SESSION_NS if request.op == Op.TERMINATE else t_ns  # whosever session it is, as the real one
        self._last = sender, packets[-1]
        return packets

    def _handle(self, t_ns: int, request: FilePacket) -> list[tuple[Op, int, bytes, bool]]:
        is_open = self._open
        foreign = is_open is not None and is_open.session != request.session
        if request.op in (Op.TERMINATE, Op.RESET):
            self._open = is_open if foreign else None
            return [_ack()]
        if foreign:
            if t_ns - self._said_ns < SESSION_NS:
                raise _Refused(FileRefusal.INVALID_SESSION)
            self._open = None
        if request.op == Op.READ_BURST:
            return self._burst(request)
        path = ""
        if request.op in PATHS:
            path = request.data.decode("utf-8", "replace")
            if not path or "\0" in path:
                raise _Refused(FileRefusal.INVALID_DATA_SIZE)
        return [self._one(Op(request.op), path, request)]

    def _one(self, op: Op, path: str, request: FilePacket) -> tuple[Op, int, bytes, bool]:
        match op:
            case Op.NONE:
                return _ack()
            case Op.LIST:
                return _ack(request.offset, self._list(path.rstrip("/") or "/", request.offset))
            case Op.OPEN_READ:
                self._may_open()
                size = len(self._content(path))
                self._open = _Open(path=path, writing=False, session=request.session)
                return _ack(0, size.to_bytes(4, "little"))
            case Op.CREATE | Op.OPEN_WRITE:
                self._may_open()
                if path.rpartition("/")[0] not in self.folders:
                    raise _Refused(FileRefusal.FILE_NOT_FOUND)
                if op == Op.CREATE:
                    self.files[path] = b""
                self._content(path)
                self._open = _Open(path=path, writing=True, session=request.session)
                return _ack()
            case Op.READ:
                return _ack(request.offset, self._read(request.offset, request.size or 0))
            case Op.WRITE:
                self._write(request.offset, request.data)
                return _ack(request.offset)
            case Op.REMOVE:
                self._content(path)
                del self.files[path]
                return _ack()
            case Op.RENAME:
                source, _, to = (part.decode("utf-8", "replace") for part in request.data.partition(b"\0"))
                self._content(source)
                self.files[to] = self.files.pop(source)
                return _ack()
            case Op.CRC32:
                crc = zlib.crc32(self._content(path), 0xFFFFFFFF) ^ 0xFFFFFFFF
                return _ack(0, crc.to_bytes(4, "little"))
            case Op.MAKE_FOLDER:
                if path in self.folders:
                    raise _Refused(FileRefusal.FILE_EXISTS)
                self.folders.append(path)
                return _ack()
        raise _Refused(FileRefusal.FAIL)

    def _may_open(self) -> None:
        if self._open is not None:
            raise _Refused(FileRefusal.FAIL)

    def _content(self, path: str) -> bytes:
        if path not in self.files:
            raise _Refused(FileRefusal.FILE_NOT_FOUND)
        return self.files[path]

    def _list(self, folder: str, offset: int) -> bytes:
        if folder not in self.folders:
            raise _Refused(FileRefusal.FILE_NOT_FOUND)
        inside = {path.removeprefix(f"{folder}/"): content for path, content in sorted(self.files.items())}
        entries = [f"F{name}\t{len(content)}\0".encode() for name, content in inside.items() if "/" not in name]
        found = b""
        for entry in entries[offset:]:
            if len(found) + len(entry) >= DATA_BYTES:
                break
            found += entry
        if not found:
            raise _Refused(FileRefusal.END_OF_FILE)
        return found

    def _read(self, offset: int, size: int) -> bytes:
        if self._open is None:
            raise _Refused(FileRefusal.FILE_NOT_FOUND)
        if self._open.writing:
            raise _Refused(FileRefusal.FAIL)
        data = self._content(self._open.path)[offset : offset + min(size, DATA_BYTES)]
        if not data:
            raise _Refused(FileRefusal.END_OF_FILE)
        return data

    def _write(self, offset: int, data: bytes) -> None:
        if self._open is None:
            raise _Refused(FileRefusal.FILE_NOT_FOUND)
        if not self._open.writing:
            raise _Refused(FileRefusal.FAIL)
        others = sum(len(content) for path, content in self.files.items() if path != self._open.path)
        if others + offset + len(data) > self.capacity:
            raise _Refused(FileRefusal.FAIL_ERRNO, errno.ENOSPC)
        old = self.files[self._open.path].ljust(offset, b"\0")
        self.files[self._open.path] = old[:offset] + data + old[offset + len(data) :]

    def _burst(self, request: FilePacket) -> list[tuple[Op, int, bytes, bool]]:
        answers: list[tuple[Op, int, bytes, bool]] = []
        size, offset = request.size or DATA_BYTES, request.offset
        while len(answers) < BURST:
            try:
                data = self._read(offset, size)
            except _Refused as refused:
                return [*answers, (Op.NAK, offset, refused.data, True)]
            answers.append((Op.ACK, offset, data, len(answers) == BURST - 1))
            offset += len(data)
        return answers


def _ack(offset: int = 0, data: bytes = b"") -> tuple[Op, int, bytes, bool]:
    return Op.ACK, offset, data, True
