"""Reading logs: order, damage at every place, files cut off, and what is refused."""

from __future__ import annotations

import dataclasses
import random
import re
import struct
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC, CompressionType, IndexType, Writer

from asvhil.errors import LogError
from asvhil.logs.metadata import closing_record, digest
from asvhil.logs.reader import LogFile
from asvhil.types import Frame, Inputs
from tests.support.log_damage import chunk_spans, records_of, rewrite
from tests.support.log_samples import METADATA, make_recorder, record_ticks, sample_inputs

TICKS = 160


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A log of several chunks."""
    path = tmp_path_factory.mktemp("log") / "whole.mcap"
    recorder = make_recorder(path)
    record_ticks(recorder, range(TICKS))
    recorder.close()
    return path.read_bytes()


def metadata_end(data: bytes) -> int:
    *_, (_, start) = (item for item in records_of(data) if item[0] == 0x0C)
    return start + 9 + struct.unpack_from("<Q", data, start + 1)[0]


def read_all(log: LogFile) -> list[Inputs]:
    return [inputs for inputs, _ in log.ticks()]


def ticks_by_chunk(path: Path, spans: list[tuple[int, int]]) -> list[int]:
    """How many tick markers there are up to the end of each chunk, by the mcap package's own reader."""
    counts = [0] * len(spans)
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        assert [index.chunk_start_offset for index in summary.chunk_indexes] == [start for start, _ in spans]
        for _, _, message in reader.iter_messages("/asvhil/inputs", log_time_order=False):
            t_ns = message.log_time
            first = next(i for i, c in enumerate(summary.chunk_indexes) if c.message_end_time >= t_ns)
            for i in range(first, len(spans)):
                counts[i] += 1
    return counts


def test_cut_at_any_byte_gives_all_intact_ticks(whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole)
    spans = chunk_spans(whole)
    assert len(spans) >= 5
    marks = ticks_by_chunk(path, spans)
    assert marks[-1] == TICKS
    expected = [sample_inputs(tick, tick % 4) for tick in range(TICKS)]
    ready = metadata_end(whole)
    borders = {border + by for span in spans for border in span for by in (-1, 0, 1)}
    sizes = sorted(borders | {*range(0, ready + 2), *range(0, len(whole), 997), len(whole) - 1})
    for size in sizes:
        path.write_bytes(whole[:size])
        if size < ready:
            with pytest.raises(LogError, match=r"cut\.mcap: (not a log|is empty|cut off)") as caught:
                LogFile(path)
            assert "\n" not in str(caught.value)
            continue
        log = LogFile(path)
        assert log.truncated, size
        assert str(size) in str(log.damage)
        intact = sum(end <= size for _, end in spans)
        ticks = read_all(log)
        assert ticks == expected[: len(ticks)], size
        assert len(ticks) == (marks[intact - 1] if intact else 0), size
    path.write_bytes(whole)
    assert not LogFile(path).truncated
    assert read_all(LogFile(path)) == expected


@pytest.mark.parametrize("at", [0.0, 0.3, 0.999])
def test_damage_in_the_middle_is_told_with_its_offset(whole: bytes, tmp_path: Path, at: float) -> None:
    path = tmp_path / "bad.mcap"
    spans = chunk_spans(whole)
    start, end = spans[2]
    data = bytearray(whole)
    position = start + 9 + 44 + int(at * (end - start - 9 - 45))  # in the packed bytes, behind the chunk's header
    data[position] ^= 0x40
    path.write_bytes(data)
    log = LogFile(path)
    assert not log.truncated
    read = []
    with pytest.raises(LogError, match=rf"bad\.mcap: chunk at byte {start}: "):
        for inputs, _ in log.ticks():
            read.append(inputs)
    assert read == [sample_inputs(tick, tick % 4) for tick in range(len(read))]
    assert len(read) > 0
    recover = rf"; `asvhil log recover {re.escape(str(path))} -o NEW` keeps what is intact before it$"
    for iterator in (log.ticks(), log.frames("autopilot", "in"), log.timing(), log.messages()):
        with pytest.raises(LogError, match=rf"byte {start}.*{recover}"):
            list(iterator)


def test_a_log_that_cannot_be_read_at_all_is_not_sent_to_be_recovered(whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "gone.mcap"
    path.write_bytes(whole)
    log = LogFile(path)
    path.unlink()
    with pytest.raises(LogError, match=r"gone\.mcap: cannot be read \(No such file or directory\)$"):
        list(log.messages())


def test_a_damaged_tail_is_left_out(whole: bytes, tmp_path: Path) -> None:
    """As after a power cut: the length of the last chunks is there, their content is not."""
    path = tmp_path / "tail.mcap"
    spans = chunk_spans(whole)
    start, end = spans[-2]
    path.write_bytes(whole[: start + 100] + bytes(end - start - 100) + bytes(5000))
    log = LogFile(path)
    assert log.truncated
    assert f"byte {start}" in str(log.damage)
    ticks = read_all(log)
    path.write_bytes(whole[:start])
    assert ticks == read_all(LogFile(path))


def test_a_hole_in_a_file_that_has_its_end(whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "hole.mcap"
    spans = chunk_spans(whole)
    start = spans[3][0]
    path.write_bytes(whole[:start] + bytes(50) + whole[start + 50 :])
    log = LogFile(path)
    assert not log.truncated
    read = []
    with pytest.raises(LogError, match=rf"hole\.mcap: damaged at byte {start}.*; `asvhil log recover .* -o NEW`"):
        for inputs, _ in log.ticks():
            read.append(inputs)
    assert len(read) > 0


def test_a_log_behind_the_end_of_another_is_told(whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "two.mcap"
    for behind in (whole, whole[:-2000], b"a torn line" + whole[metadata_end(whole) :]):
        path.write_bytes(whole + behind)
        log = LogFile(path)
        assert not log.truncated
        read = []
        follows = rf"two\.mcap: the log ends at byte {len(whole)} of {len(whole + behind)}, and another log follows"
        with pytest.raises(LogError, match=rf"{follows}; `asvhil log recover .* -o NEW`"):
            for inputs, _ in log.ticks():
                read.append(inputs)
        assert read == [sample_inputs(tick, tick % 4) for tick in range(TICKS)]


def test_bytes_behind_the_end_that_are_no_log_are_told(whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "longer.mcap"
    for behind in (b"\n", bytes(70_000), random.Random(3).randbytes(70_000)):
        path.write_bytes(whole + behind)
        log = LogFile(path)
        assert len(read_all(log)) == TICKS and not log.truncated and log.damage is None
        line = f"{len(behind)} bytes behind the end of the log (byte {len(whole)}) are not of it, and left out"
        assert list(log.damaged.values()) == [line]


def test_chunks_behind_damage_are_told_of_a_log_without_its_end(whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "worn.mcap"
    start = chunk_spans(whole)[3][0]
    path.write_bytes(whole[:start] + bytes(50) + whole[start + 50 : -2000])
    log = LogFile(path)
    assert not log.truncated
    with pytest.raises(LogError, match=rf"worn\.mcap: damaged at byte {start}.*; `asvhil log recover .* -o NEW`"):
        read_all(log)


def test_any_flipped_byte_raises_nothing_but_log_error(whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "flip.mcap"
    for position in range(0, len(whole), 211):
        data = bytearray(whole)
        data[position] ^= 0xFF
        path.write_bytes(data)
        try:
            log = LogFile(path)
            count = sum(1 for _ in log.ticks())
        except LogError as error:
            assert str(path) in str(error) and "\n" not in str(error)
        else:
            assert count == TICKS or log.truncated


def test_a_chunk_that_has_lost_its_name_is_missed(whole: bytes, tmp_path: Path) -> None:
    """A flipped bit in the opcode makes another kind of record of a chunk, even of the last."""
    path = tmp_path / "opcode.mcap"
    for start, _ in chunk_spans(whole):
        for bit in range(8):
            data = bytearray(whole)
            data[start] ^= 1 << bit
            path.write_bytes(data)
            with pytest.raises(LogError, match=r"opcode\.mcap: "):
                list(LogFile(path).ticks())


def test_a_metadata_record_that_has_lost_its_name_is_missed(whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "meta.mcap"
    start = whole.index(b"\x0c", 30)
    assert whole[start + 9 + 4 :].startswith(b"config")
    path.write_bytes(whole[:start] + b"\x0d" + whole[start + 1 :])
    log = LogFile(path)
    assert log.damaged == {
        "head of config": f"damaged: head of the config record (byte {start}); its content is intact"
    }
    assert log.metadata == METADATA and log.damage is None
    assert sum(1 for _ in log.ticks()) == TICKS


@pytest.mark.parametrize("told_bytes", [2**62, 1000])
def test_a_length_of_exabytes_asks_for_no_memory(whole: bytes, tmp_path: Path, told_bytes: int) -> None:
    """A zstd frame that says it holds 2^62 bytes, in a chunk that says the same, or less."""
    path = tmp_path / "long.mcap"
    start, end = chunk_spans(whole)[1]
    packed = bytes.fromhex("28b52ffd e0") + struct.pack("<Q", 2**62) + bytes.fromhex("010000")
    content = struct.pack("<QQQII", 0, 0, told_bytes, 1, 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed
    path.write_bytes(whole[:start] + struct.pack("<BQ", 0x06, len(content)) + content + whole[end:])
    with pytest.raises(LogError, match=rf"byte {start}: damaged"):
        list(LogFile(path).ticks())


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty; a log is expected$"),
        (b"\x89MCA", "cut off at byte 4, in the first bytes of an MCAP file$"),
        (b"\x89MCAP0\r\n", "not a log.*byte 8"),
        (b"hello, world", "not a log.*byte 0"),
        (b"\x00" * 1000, "not a log.*byte 0"),
    ],
)
def test_what_is_no_log(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "other.bin"
    path.write_bytes(content)
    with pytest.raises(LogError, match=rf"other\.bin: {words}"):
        LogFile(path)


def test_a_log_of_another_program(tmp_path: Path) -> None:
    path = tmp_path / "ros.mcap"
    writer = Writer(str(path))
    writer.start(profile="ros2")
    writer.finish()
    with pytest.raises(LogError, match="profile 'ros2', not 'asvhil'"):
        LogFile(path)


def test_a_log_of_another_layout(whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "new.mcap"
    entry = struct.pack("<I", 6) + b"layout" + struct.pack("<I", 1)
    assert entry + b"1" in whole
    closing = closing_record(METADATA)
    later = {key: value for key, value in closing.items() if key != "sha256"} | {"layout": "9"}
    data = whole.replace(entry + b"1", entry + b"9")
    path.write_bytes(data.replace(closing["sha256"].encode(), digest(later).encode()))
    with pytest.raises(LogError, match="layout is '9', and this asvhil reads '1'"):
        LogFile(path)


def test_missing_files_and_folders(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="No such file"):
        LogFile(tmp_path / "none.mcap")
    with pytest.raises(LogError, match="a folder with no log"):
        LogFile(tmp_path)


@pytest.mark.parametrize(
    "options",
    [
        {"compression": CompressionType.NONE},
        {"compression": CompressionType.LZ4},
        {"enable_crcs": False},
        {"use_chunking": False},
        {"use_statistics": False},
    ],
)
def test_a_log_that_another_tool_has_written_anew(whole: bytes, tmp_path: Path, options: dict[str, Any]) -> None:
    """Other compression, no CRC, no chunks, no statistics; with the channels where that tool puts them."""
    source, target = tmp_path / "a.mcap", tmp_path / "b.mcap"
    source.write_bytes(whole)
    rewrite(source, target, **options)
    log = LogFile(target)
    assert log.metadata == METADATA
    assert not log.truncated and log.damage is None
    assert list(log.ticks()) == list(LogFile(source).ticks())


VARIANTS: dict[str, dict[str, Any]] = {
    "zstd": {},
    "lz4": {"compression": CompressionType.LZ4},
    "plain": {"compression": CompressionType.NONE},
    "no CRC": {"enable_crcs": False},
    "no chunks": {"use_chunking": False},
    "no index": {"index_types": IndexType.NONE, "use_summary_offsets": False, "use_statistics": False},
    "no summary": {
        **{"index_types": IndexType.NONE, "use_summary_offsets": False, "use_statistics": False},
        **{"repeat_channels": False, "repeat_schemas": False},
    },
}


@pytest.mark.parametrize("options", VARIANTS.values(), ids=list(VARIANTS))
def test_a_rewritten_log_that_is_damaged_at_any_place(whole: bytes, tmp_path: Path, options: dict[str, Any]) -> None:
    """Cut, or with bytes changed: the ticks before the damage, or one line that names the file; nothing else."""
    source, target, odd = tmp_path / "a.mcap", tmp_path / "b.mcap", tmp_path / "odd.mcap"
    source.write_bytes(whole)
    rewrite(source, target, **options)
    data, ticks = target.read_bytes(), list(LogFile(source).ticks())
    assert list(LogFile(target).ticks()) == ticks
    noise = random.Random(len(data))
    told = 0
    for number in range(60):
        at = noise.randrange(len(data))
        changed = data[:at] if number % 2 else data[:at] + noise.randbytes(4) + data[at + 4 :]
        odd.write_bytes(changed)
        found: list[Any] = []
        try:
            log = LogFile(odd)
            told += log.damage is not None
            for tick in log.ticks():
                found.append(tick)
        except LogError as error:
            told += 1
            assert str(error).startswith(f"{odd}: ") and "\n" not in str(error)
        if number % 2 or options.get("use_chunking", options.get("enable_crcs", True)):
            whole_ones = found[:-1] if found and found[-1][1] is None else found
            assert whole_ones == ticks[: len(whole_ones)]
    assert told >= 30  # every cut


def test_a_compression_that_is_not_known_is_told(whole: bytes, tmp_path: Path) -> None:
    source, target = tmp_path / "a.mcap", tmp_path / "b.mcap"
    source.write_bytes(whole)
    rewrite(source, target, compression=CompressionType.LZ4)
    target.write_bytes(target.read_bytes().replace(b"\x03\x00\x00\x00lz4", b"\x03\x00\x00\x00br9"))
    with pytest.raises(LogError, match=r"b.mcap: its compression 'br9' is not supported \(zstd, lz4, none are\)$"):
        LogFile(target)


def repacked(whole: bytes, compressor: zstandard.ZstdCompressor) -> bytes:
    """The log with its chunks compressed anew."""
    out = RecordBuilder()
    out.write(MCAP0_MAGIC)
    for item in StreamReader(BytesIO(whole), emit_chunks=True).records:
        if isinstance(item, Chunk):
            item = dataclasses.replace(item, data=compressor.compress(zstandard.decompress(item.data)))
        item.write(out)
    out.write(MCAP0_MAGIC)
    return out.end()


def test_a_zstd_frame_that_does_not_say_its_size(whole: bytes, tmp_path: Path) -> None:
    """As a tool writes it that compresses a stream. More than the chunk's own size is not unpacked."""
    source, target = tmp_path / "a.mcap", tmp_path / "b.mcap"
    source.write_bytes(whole)
    data = repacked(whole, zstandard.ZstdCompressor(write_content_size=False))
    target.write_bytes(data)
    assert list(LogFile(target).ticks()) == list(LogFile(source).ticks())
    start, _ = chunk_spans(data)[1]
    size_at = start + 9 + 16
    target.write_bytes(data[:size_at] + struct.pack("<Q", 100) + data[size_at + 8 :])
    with pytest.raises(LogError, match=rf"byte {start}: damaged"):
        list(LogFile(target).ticks())


def test_a_damaged_summary_leaves_the_data_readable(whole: bytes, tmp_path: Path) -> None:
    """A length in the statistics that leads beyond their end."""
    path = tmp_path / "summary.mcap"
    start = next(offset for opcode, offset in records_of(whole) if opcode == 0x0B)
    length_at = start + 9 + 42  # of the counts by channel, the last field
    path.write_bytes(whole[:length_at] + struct.pack("<I", 2**31) + whole[length_at + 4 :])
    assert len(read_all(LogFile(path))) == TICKS


def test_logs_of_before_via_have_it_in_the_peer(tmp_path: Path) -> None:
    source, target = tmp_path / "a.mcap", tmp_path / "b.mcap"
    frames = (
        Frame(t_ns=1, port="operator", data=b"1", peer="10.0.0.1:5", via="ground.qgc"),
        Frame(t_ns=2, port="operator", data=b"2", via="ground.radio"),
        Frame(t_ns=3, port="operator", data=b"3", peer="10.0.0.1:5"),
        Frame(t_ns=4, port="autopilot", data=b"4", peer="10.0.0.1:6"),
    )
    recorder = make_recorder(source)
    recorder.write_inputs(Inputs(t_ns=5, frames=frames))
    recorder.close()

    def as_before(values: dict[str, str]) -> dict[str, str]:
        via = values.pop("via", "")
        return values | {"peer": f"{via}|{values['peer']}"} if via else values

    rewrite(source, target, as_before)
    assert [inputs.frames for inputs, _ in LogFile(target).ticks()] == [frames]
