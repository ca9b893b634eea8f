"""Recovering logs: all that is intact before damage, told what was lost, verified, and never over another file."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType

from asvhil.errors import LogError
from asvhil.logs.info import log_info
from asvhil.logs.reader import LogFile
from asvhil.logs.recover import recover
from asvhil.types import changed
from tests.support.log_damage import chunk_spans, rewrite
from tests.support.log_samples import make_recorder, record_ticks, sample_inputs

TICKS = 160


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A log of several chunks."""
    path = tmp_path_factory.mktemp("log") / "whole.mcap"
    recorder = make_recorder(path)
    record_ticks(recorder, range(TICKS))
    recorder.close()
    return path.read_bytes()


def ticks_of(path: Path) -> list[int]:
    """Which ticks there are, by the mcap package's own reader, CRCs checked."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = reader.iter_messages("/asvhil/inputs", log_time_order=False)
        return [message.sequence - 1 for _, _, message in found]


def test_a_whole_log_loses_nothing(whole: bytes, tmp_path: Path) -> None:
    source, target = tmp_path / "whole.mcap", tmp_path / "again.mcap"
    source.write_bytes(whole)
    result = recover(source, target)
    assert result.lost == () and result.left_out == 0 and result.ticks == TICKS
    assert list(LogFile(target).ticks()) == list(LogFile(source).ticks())
    assert LogFile(target).metadata["recovered"] == {"from": "whole.mcap", "damage": ""}
    assert {name: LogFile(target).metadata[name] for name in LogFile(source).metadata} == LogFile(source).metadata
    again = recover(target, tmp_path / "third.mcap")
    assert again.messages == result.messages


def test_a_log_cut_at_any_place_keeps_its_intact_ticks(whole: bytes, tmp_path: Path) -> None:
    spans = chunk_spans(whole)
    rng = random.Random(1)
    sizes = sorted({rng.randrange(spans[0][1], spans[-1][1]) for _ in range(25)} | {end for _, end in spans})
    for size in sizes:
        source, target = tmp_path / f"{size}.mcap", tmp_path / f"{size}-again.mcap"
        source.write_bytes(whole[:size])
        expected = [inputs for inputs, _ in LogFile(source).ticks()]
        result = recover(source, target)
        assert result.lost and str(size) in result.lost[-1]
        assert [inputs for inputs, _ in LogFile(target).ticks()] == expected
        assert LogFile(target).damage is None
        assert ticks_of(target) == list(range(len(expected)))
        assert log_info(target)["whole"] and not log_info(source)["whole"]


def test_a_torn_tail_of_zeros_or_noise_is_left_out(whole: bytes, tmp_path: Path) -> None:
    """As a file system leaves it after a power cut: the size is there, the content is not."""
    start, _ = chunk_spans(whole)[-2]
    for number, tail in enumerate((bytes(70_000), random.Random(2).randbytes(70_000))):
        source = tmp_path / f"torn{number}.mcap"
        source.write_bytes(whole[: start + 40] + tail)
        result = recover(source, tmp_path / f"again{number}.mcap")
        assert result.lost and result.left_out == 0
        expected = [sample_inputs(tick, tick % 4) for tick in range(result.ticks)]
        assert [inputs for inputs, _ in LogFile(result.path).ticks()] == expected


def test_damage_in_the_middle_ends_it_or_leaves_a_gap(whole: bytes, tmp_path: Path) -> None:
    spans = chunk_spans(whole)
    start, end = spans[2]
    flipped = bytearray(whole)
    flipped[start + 200] ^= 0x10
    hole = whole[:start] + bytes(end - start + 7) + whole[end + 7 :]  # the first message index behind it too
    for name, data in (("flipped", bytes(flipped)), ("hole", hole)):
        source = tmp_path / f"{name}.mcap"
        source.write_bytes(data)
        before = recover(source, tmp_path / f"{name}-before.mcap")
        assert any(str(start) in line for line in before.lost)
        assert before.left_out == len(spans) - 3
        kept = ticks_of(before.path)
        assert kept == list(range(len(kept))) and 0 < len(kept) < TICKS
        all_of_it = recover(source, tmp_path / f"{name}-all.mcap", behind_damage=True)
        ticks = ticks_of(all_of_it.path)
        assert ticks[: len(kept)] == kept and ticks[-1] == TICKS - 1 and len(ticks) > len(kept)
        assert all_of_it.left_out == 0
        with pytest.raises(LogError, match="are missing"):
            list(LogFile(all_of_it.path).ticks())
        log = LogFile(all_of_it.path)
        up_to = [inputs.t_ns for inputs, _ in log.ticks(up_to_gap=True)]
        assert len(up_to) == len(kept) and log.truncated and "are missing" in str(log.damage)


@pytest.mark.parametrize("compression", [CompressionType.LZ4, CompressionType.NONE])
def test_logs_that_other_tools_have_rewritten_are_recovered(
    whole: bytes, tmp_path: Path, compression: CompressionType
) -> None:
    original, source = tmp_path / "whole.mcap", tmp_path / "other.mcap"
    original.write_bytes(whole)
    rewrite(original, source, compression=compression, chunk_size=20_000)
    assert recover(source, tmp_path / "again.mcap").ticks == TICKS
    data = source.read_bytes()
    source.write_bytes(data[: len(data) // 2])
    result = recover(source, tmp_path / "cut.mcap")
    assert result.lost and 0 < result.ticks < TICKS


def test_nothing_is_overwritten_and_nothing_left_behind(whole: bytes, tmp_path: Path) -> None:
    source, target = tmp_path / "a.mcap", tmp_path / "b.mcap"
    source.write_bytes(whole)
    target.write_bytes(b"another log")
    with pytest.raises(LogError, match=r"b\.mcap: exists already"):
        recover(source, target)
    assert target.read_bytes() == b"another log"
    with pytest.raises(LogError, match=r"a\.mcap: exists already"):
        recover(source, source)
    assert source.read_bytes() == whole
    source.write_bytes(whole[: chunk_spans(whole)[0][0]])
    with pytest.raises(LogError, match="no tick is intact"):
        recover(source, tmp_path / "c.mcap")
    with pytest.raises(LogError, match=r"none/d\.mcap: the recovered log cannot be written \(No such file"):
        source.write_bytes(whole)
        recover(source, tmp_path / "none" / "d.mcap")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap", "b.mcap"]


def test_a_copy_that_is_not_what_was_written_is_refused(
    whole: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that loses a bit on the way."""
    import asvhil.logs.recover as module

    source, target = tmp_path / "a.mcap", tmp_path / "b.mcap"
    source.write_bytes(whole)
    write = module._write

    def worn(log: LogFile, copy: object, path: Path) -> object:
        result = write(log, copy, path)  # type: ignore[arg-type]
        data = bytearray(path.read_bytes())
        data[chunk_spans(bytes(data))[0][0] + 300] ^= 1
        path.write_bytes(data)
        return result

    monkeypatch.setattr(module, "_write", worn)
    with pytest.raises(LogError, match=r"damaged|is the disk sound"):
        recover(source, target)
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


def test_a_log_with_itself_behind_it_is_not_called_one_with_missing_ticks(whole: bytes, tmp_path: Path) -> None:
    source = tmp_path / "twice.mcap"
    source.write_bytes(whole + whole)
    twice = recover(source, tmp_path / "again.mcap", behind_damage=True)
    with pytest.raises(LogError, match=rf"tick 1 comes after tick {TICKS}: another log, or a part of this one again"):
        list(LogFile(twice.path).ticks())


def test_a_log_of_another_boat_behind_the_end_is_left_out(whole: bytes, tmp_path: Path) -> None:
    source, other = tmp_path / "two.mcap", tmp_path / "other.mcap"
    recorder = make_recorder(other)
    inputs = sample_inputs(0)
    recorder.write_inputs(changed(inputs, frames=inputs.frames[::-1]))  # so another channel comes first
    recorder.close()
    source.write_bytes(whole + other.read_bytes())
    for behind_damage in (False, True):
        result = recover(source, tmp_path / f"{behind_damage}.mcap", behind_damage=behind_damage)
        assert f"the log ends at byte {len(whole)}" in result.lost[0]
        assert "of a log that numbers its channels otherwise, left out" in result.lost[1]
        assert ticks_of(result.path) == list(range(TICKS))
