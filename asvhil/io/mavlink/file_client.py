"""The client of MAVFTP: lists, reads, writes, renames and removes files of an autopilot. Sans-IO.

Each operation is a generator of requests that gets the answers; `FileClient` sends them, again where no answer comes.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

from asvhil.errors import LinkError
from asvhil.io.mavlink.file_transfer import DATA_BYTES, FilePacket, FileRefusal, Op, decode_packet, refusal_text
from asvhil.io.mavlink.frames import dialect
from asvhil.types import record

SESSION = 93  # any; one that is not the default of ground stations
ANSWER_NS = 500_000_000
ATTEMPTS = 12  # of one request
MOST_ENTRIES = 1000


@record
class Request:
    """What is asked: opcode, offset, data, and how much is wanted by a request to read."""

    op: Op
    offset: int = 0
    data: bytes = b""
    size: int | None = None


class FileRefused(LinkError):
    """The autopilot refuses a request; `code` says why."""

    def __init__(self, what: str, data: bytes) -> None:
        super().__init__(f"{what}: {refusal_text(data)}")
        self.code = data[0] if data else 0


class FilesUnanswered(LinkError):
    """The autopilot does not answer requests about files."""


Steps = Generator[Request, FilePacket, Any]


def list_folder(path: str) -> Generator[Request, FilePacket, dict[str, int]]:
    """Names and sizes of the files in a folder."""
    found: dict[str, int] = {}
    at = 0
    while at < MOST_ENTRIES:
        try:
            reply = yield Request(op=Op.LIST, offset=at, data=path.encode())
        except FileRefused as error:
            if error.code == FileRefusal.END_OF_FILE:
                break
            raise
        entries = [entry for entry in reply.data.split(b"\0") if entry]
        if not entries:
            break
        at += len(entries)
        for entry in entries:
            name, _, size = entry[1:].decode("utf-8", "replace").partition("\t")
            if entry[:1] == b"F":
                found[name] = int(size) if size.isdecimal() else 0
    return found


def _open(op: Op, path: str) -> Generator[Request, FilePacket, None]:
    """Open a file, in the place of one that we have left open. ArduPilot ends a session of others at any TERMINATE."""
    try:
        yield Request(op=op, data=path.encode())
    except FileRefused as error:
        if error.code != FileRefusal.FAIL:
            raise
        yield Request(op=Op.TERMINATE)
        yield Request(op=op, data=path.encode())


def read_file(path: str) -> Generator[Request, FilePacket, bytes]:
    """The content of a file."""
    yield from _open(Op.OPEN_READ, path)
    data = b""
    while True:
        try:
            reply = yield Request(op=Op.READ, offset=len(data), size=DATA_BYTES)
        except FileRefused as error:
            yield Request(op=Op.TERMINATE)
            if error.code == FileRefusal.END_OF_FILE:
                return data
            raise
        if not reply.data:
            yield Request(op=Op.TERMINATE)
            return data
        data += reply.data


def write_file(path: str, data: bytes) -> Generator[Request, FilePacket, None]:
    """Put a file there, in the place of one of the same name."""
    yield from _open(Op.CREATE, path)
    for at in range(0, len(data), DATA_BYTES):
        try:
            yield Request(op=Op.WRITE, offset=at, data=data[at : at + DATA_BYTES])
        except FileRefused:
            yield Request(op=Op.TERMINATE)
            raise
    yield Request(op=Op.TERMINATE)


def remove_file(path: str) -> Generator[Request, FilePacket, None]:
    """Remove a file."""
    yield Request(op=Op.REMOVE, data=path.encode())


def rename_file(path: str, to: str) -> Generator[Request, FilePacket, None]:
    """Give a file another name, which none has."""
    yield Request(op=Op.RENAME, data=path.encode() + b"\0" + to.encode())


class FileClient:
    """One operation at a time: `begin` it, carry messages until `busy` is no more, then take the `result`."""

    def __init__(self, system_id: int, component_id: int) -> None:
        self._to = system_id, component_id
        self._steps: Steps | None = None
        self._pending: FilePacket | None = None
        self._number = 0
        self._attempts = 0
        self._due_ns = 0
        self._what = ""
        self._result: Any = None
        self._error: LinkError | None = None
        self.answers = 0

    @property
    def busy(self) -> bool:
        """Whether the operation has not come to its end."""
        return self._steps is not None

    def begin(self, what: str, steps: Steps) -> None:
        """Begin an operation; `what` names it in errors."""
        self._steps, self._what, self._result, self._error = steps, what, None, None
        self._go_on(lambda: next(steps))

    def result(self) -> Any:
        """What the operation gave. Raises LinkError in one line where it failed."""
        if self._error is not None:
            raise self._error
        return self._result

    def receive(self, message: Any) -> None:
        """A FILE_TRANSFER_PROTOCOL of the autopilot that is for us."""
        packet, pending, steps = decode_packet(bytes(message.payload)), self._pending, self._steps
        if packet is None or pending is None or steps is None:
            return
        if packet.number != (pending.number + 1) % 65536 or packet.request != pending.op:
            return  # an answer to what was asked before
        self.answers += 1
        if packet.op == Op.ACK:
            self._go_on(lambda: steps.send(packet))
        elif packet.op == Op.NAK:
            error = FileRefused(self._what, packet.data)
            self._go_on(lambda: steps.throw(error))

    def data_to_send(self, t_ns: int) -> list[Any]:
        """The request that is due, if one is."""
        if self._pending is None or t_ns < self._due_ns:
            return []
        if self._attempts >= ATTEMPTS:
            self._pending = self._steps = None
            self._error = FilesUnanswered(f"{self._what}: the autopilot does not answer")
            return []
        self._attempts += 1
        self._due_ns = t_ns + ANSWER_NS
        return [dialect.MAVLink_file_transfer_protocol_message(0, *self._to, self._pending.encode())]

    def _go_on(self, step: Any) -> None:
        self._pending = None
        try:
            request: Request = step()
        except StopIteration as end:
            self._steps, self._result = None, end.value
            return
        except LinkError as error:
            self._steps, self._error = None, error
            return
        self._number = (self._number + 2) % 65536  # the answer has the number after
        self._pending = FilePacket(
            number=self._number,
            session=SESSION,
            op=request.op,
            offset=request.offset,
            data=request.data,
            size=request.size,
        )
        self._attempts, self._due_ns = 0, 0
