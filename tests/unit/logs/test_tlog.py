"""Telemetry logs: records of MAVLink 1 and 2, and damaged files."""

from __future__ import annotations

from pathlib import Path

import pytest

from asvhil.errors import LogError
from asvhil.logs.tlog import read_tlog

# 2026-09-21 13:33:20.123456 UTC in microseconds: 1790000000123456 = 0x00065bfeda27c240.
TIME = bytes.fromhex("00065bfeda27c240")
# Heartbeats: version 1 (9 bytes of payload), version 2, and version 2 with a signature of 13 bytes.
V1 = bytes.fromhex("fe 09 00 01 01 00 00000000 0b 03 51 04 03 1c7f".replace(" ", ""))
V2 = bytes.fromhex("fd 09 00 00 05 01 01 000000 00000000 0b 03 51 04 03 beef".replace(" ", ""))
SIGNED = bytes.fromhex("fd 01 01 00 06 01 01 000000 2a cafe 00112233445566778899aabbcc".replace(" ", ""))


def read(path: Path, data: bytes) -> list[tuple[int, bytes]]:
    path.write_bytes(data)
    return list(read_tlog(path))


def test_frames_of_both_versions(tmp_path: Path) -> None:
    t_us = 1_790_000_000_123_456
    records = read(tmp_path / "a.tlog", TIME + V1 + TIME + V2 + TIME + SIGNED)
    assert records == [(t_us, V1), (t_us, V2), (t_us, SIGNED)]


def test_empty_file_has_no_records(tmp_path: Path) -> None:
    assert read(tmp_path / "a.tlog", b"") == []


def test_wrong_start_byte_is_named_by_its_offset(tmp_path: Path) -> None:
    path = tmp_path / "a.tlog"
    path.write_bytes(TIME + V1 + TIME + b"\x00\x01\x02\x03")
    records = read_tlog(path)
    assert next(records)[1] == V1
    at = 8 + len(V1) + 8
    with pytest.raises(LogError, match=rf"a\.tlog: byte {at} is 0x00"):
        next(records)


def test_cut_at_every_byte(tmp_path: Path) -> None:
    path = tmp_path / "a.tlog"
    whole = TIME + V1 + TIME + SIGNED
    ends = {0: 0, 8 + len(V1): 1, len(whole): 2}
    for size in range(len(whole) + 1):
        path.write_bytes(whole[:size])
        if size in ends:
            assert len(list(read_tlog(path))) == ends[size]
            continue
        start = 0 if size < 8 + len(V1) else 8 + len(V1)
        with pytest.raises(LogError, match=rf"the record at byte {start} is cut off"):
            list(read_tlog(path))


@pytest.mark.parametrize("t_us", [7_258_118_400_000_000, 1_790_000_000_123_456 | 1 << 63])
def test_a_time_that_cannot_be_is_named_by_its_offset(tmp_path: Path, t_us: int) -> None:
    path = tmp_path / "a.tlog"
    path.write_bytes(TIME + V1 + t_us.to_bytes(8, "big") + V1)
    with pytest.raises(LogError, match=rf"a\.tlog: the record at byte {8 + len(V1)} has a time that cannot be, {t_us}"):
        list(read_tlog(path))


def test_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"none\.tlog: cannot be read"):
        list(read_tlog(tmp_path / "none.tlog"))
