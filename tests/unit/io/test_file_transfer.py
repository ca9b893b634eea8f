"""MAVFTP: payloads by literal bytes; the client against the simulated autopilot's server, with losses."""

import random
import zlib

import pytest

from asvhil.errors import LinkError
from asvhil.io.mavlink.file_client import (
    FileClient,
    FileRefused,
    FilesUnanswered,
    Steps,
    list_folder,
    read_file,
    remove_file,
    rename_file,
    write_file,
)
from asvhil.io.mavlink.file_transfer import FilePacket, Op, decode_packet, refusal_text
from asvhil.simplant.ardurover.file_server import FileServer

FOLDER = "/APM/scripts"
PATH = f"{FOLDER}/asvhil.lua"
MS = 1_000_000


def test_a_request_by_literal_bytes() -> None:
    payload = FilePacket(number=0x1234, session=93, op=Op.WRITE, offset=0x01020304, data=b"lua").encode()
    assert payload[:16].hex(" ") == "34 12 5d 07 03 00 00 00 04 03 02 01 6c 75 61 00"
    assert len(payload) == 251
    assert decode_packet(payload) == FilePacket(
        number=0x1234, session=93, op=Op.WRITE, offset=0x01020304, data=b"lua", size=3
    )


def test_a_request_to_read_says_how_much() -> None:
    payload = FilePacket(number=65536, session=1, op=Op.READ, offset=239, size=239).encode()
    assert payload[:13].hex(" ") == "00 00 01 05 ef 00 00 00 ef 00 00 00 00"


@pytest.mark.parametrize("payload", [b"", b"\0" * 250, b"\0\0\0\x80\xf0".ljust(251, b"\0")])
def test_what_is_no_packet(payload: bytes) -> None:
    assert decode_packet(payload) is None


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"\x0a", "no such file"),
        (b"\x02\x1c", "no space left on device"),
        (b"\x04", "another program transfers a file"),
        (b"\x63", "reason 99"),
        (b"", "reason 0"),
    ],
)
def test_refusals_in_words(data: bytes, words: str) -> None:
    assert refusal_text(data) == words


class Pair:
    """A client and a server, with a link that loses a share of what goes either way."""

    def __init__(self, files: dict[str, bytes] | None = None, lost: float = 0.0, capacity: int = 1_000_000) -> None:
        self.files = {} if files is None else files
        self.server = FileServer(self.files, (FOLDER,), capacity)
        self.client = FileClient(1, 1)
        self.rng = random.Random(5)
        self.lost = lost
        self.t_ns = 0
        self.requests: list[FilePacket] = []

    def run(self, steps: Steps) -> object:
        self.client.begin("work", steps)
        for _ in range(100_000):
            if not self.client.busy:
                return self.client.result()
            self.t_ns += 10 * MS
            for message in self.client.data_to_send(self.t_ns):
                request = decode_packet(bytes(message.payload))
                assert request is not None
                self.requests.append(request)
                if self.rng.random() < self.lost:
                    continue
                for answer in self.server.receive(self.t_ns, (1, 191), request):
                    if self.rng.random() >= self.lost:
                        message.payload = list(answer.encode())
                        self.client.receive(message)
        raise AssertionError("no end")


@pytest.mark.parametrize("lost", [0.0, 0.3])
@pytest.mark.parametrize("size", [0, 1, 238, 239, 240, 478, 8000])
def test_a_file_goes_there_and_back(lost: float, size: int) -> None:
    data = random.Random(size).randbytes(size)
    pair = Pair({PATH: b"an old and longer text" * 1000}, lost)
    pair.run(write_file(PATH, data))
    assert pair.files[PATH] == data
    assert pair.run(read_file(PATH)) == data
    crc = pair.server.receive(pair.t_ns, (1, 191), FilePacket(number=9, session=1, op=Op.CRC32, data=PATH.encode()))[0]
    assert int.from_bytes(crc.data, "little") == zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


def test_nothing_is_written_twice_where_answers_are_lost() -> None:
    pair = Pair(lost=0.4)
    pair.run(write_file(PATH, b"x" * 1000))
    assert len(pair.requests) > 8
    assert pair.files[PATH] == b"x" * 1000


def test_lists_of_many_files() -> None:
    files = {f"{FOLDER}/a_script_with_a_long_name_{n}.lua": b"x" * n for n in range(40)}
    pair = Pair({**files, "/APM/LOGS/1.bin": b"", f"{FOLDER}/modules/m.lua": b""})
    assert pair.run(list_folder(FOLDER)) == {path.rpartition("/")[2]: len(data) for path, data in files.items()}
    assert Pair().run(list_folder(FOLDER)) == {}


def test_names_change_and_files_go() -> None:
    pair = Pair({PATH: b"lua"})
    pair.run(rename_file(PATH, f"{FOLDER}/other.lua"))
    assert pair.files == {f"{FOLDER}/other.lua": b"lua"}
    pair.run(remove_file(f"{FOLDER}/other.lua"))
    assert pair.files == {}


@pytest.mark.parametrize(
    "steps", [read_file(PATH), remove_file(PATH), rename_file(PATH, "x"), write_file("/no/x", b""), list_folder("/no")]
)
def test_what_is_not_there(steps: Steps) -> None:
    with pytest.raises(FileRefused, match=r"^work: no such file$"):
        Pair().run(steps)


def test_a_full_memory_card_ends_the_session() -> None:
    pair = Pair(capacity=500)
    with pytest.raises(FileRefused, match=r"^work: no space left on device$"):
        pair.run(write_file(PATH, b"x" * 1000))
    pair.run(write_file(f"{FOLDER}/small", b"x"))


def test_another_program_that_transfers() -> None:
    pair = Pair({PATH: b"lua"})
    other = FilePacket(number=1, session=0, op=Op.OPEN_READ, data=PATH.encode())
    assert pair.server.receive(0, (255, 190), other)[0].op == Op.ACK
    with pytest.raises(FileRefused, match="another program transfers a file"):
        pair.run(read_file(PATH))
    pair.t_ns += 3_000 * MS
    assert pair.run(read_file(PATH)) == b"lua"


def test_a_session_that_was_left_open() -> None:
    pair = Pair({PATH: b"lua"})
    left = FilePacket(number=1, session=93, op=Op.CREATE, data=f"{FOLDER}/left".encode())
    assert pair.server.receive(0, (1, 191), left)[0].op == Op.ACK
    assert pair.run(read_file(PATH)) == b"lua"


def test_an_autopilot_that_does_not_answer() -> None:
    pair = Pair()
    pair.server.enabled = False
    with pytest.raises(FilesUnanswered, match=r"^work: the autopilot does not answer$") as error:
        pair.run(list_folder(FOLDER))
    assert isinstance(error.value, LinkError)
    assert pair.t_ns == pytest.approx(6_000 * MS, abs=100 * MS)


def test_a_burst_of_the_server() -> None:
    server = FileServer({PATH: b"x" * 500}, (FOLDER,))
    server.receive(0, (1, 191), FilePacket(number=1, session=1, op=Op.OPEN_READ, data=PATH.encode()))
    burst = server.receive(0, (1, 191), FilePacket(number=3, session=1, op=Op.READ_BURST, size=239))
    assert [(one.op, one.offset, len(one.data), one.number) for one in burst] == [
        (Op.ACK, 0, 239, 4),
        (Op.ACK, 239, 239, 5),
        (Op.ACK, 478, 22, 6),
        (Op.NAK, 500, 1, 7),
    ]
    assert burst[-1].data == b"\x06"
