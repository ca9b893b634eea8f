"""Damage before the data of a log, in header and metadata: it is told, and what is intact is read."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from mcap.writer import Writer

from asvhil.config import load_config
from asvhil.errors import LogError
from asvhil.logs.info import log_info
from asvhil.logs.metadata import digest
from asvhil.logs.opening import log_metadata
from asvhil.logs.reader import LogFile
from asvhil.logs.recorder import Recorder
from asvhil.logs.recover import recover
from asvhil.logs.replay import replay
from asvhil.logs.run import read_run
from asvhil.sitl import run_lockstep
from tests.support.log_damage import chunk_spans
from tests.support.log_samples import METADATA, make_recorder, record_ticks
from tests.support.loop import PLAIN_CONTROLLER

TICKS = 24


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A short log of several chunks."""
    path = tmp_path_factory.mktemp("log") / "whole.mcap"
    recorder = make_recorder(path, chunk_kib=4)
    record_ticks(recorder, range(TICKS))
    recorder.close()
    return path.read_bytes()


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The log of a run, with the config that its figures depend on."""
    path = tmp_path_factory.mktemp("run") / "run.mcap"
    run_lockstep(load_config("sitl", (PLAIN_CONTROLLER,)), path, 3.0)
    return path.read_bytes()


def flipped(data: bytes, at: int, bits: int) -> bytes:
    return data[:at] + bytes([data[at] ^ bits]) + data[at + 1 :]


@pytest.mark.parametrize("bits", [0x01, 0x80])
def test_a_flipped_bit_anywhere_is_told_and_loses_one_record_at_most(whole: bytes, tmp_path: Path, bits: int) -> None:
    path = tmp_path / "flip.mcap"
    library = range(whole.index(b"asvhil 0"), whole.index(b"\x0c", 31))  # the writer's name, which nothing depends on
    for at in (at for at in range(chunk_spans(whole)[0][0]) if at not in library):
        path.write_bytes(flipped(whole, at, bits))
        log = LogFile(path)
        assert log.damaged, at
        assert len(log.damaged) <= 2, at
        assert sum(1 for _ in log.ticks()) == TICKS, at
        kept = {name: values for name, values in log.metadata.items() if name not in log.damaged}
        assert kept == {name: METADATA[name] for name in kept}, at
        assert len(kept) >= len(METADATA) - 1, at


@pytest.mark.parametrize("at", [9, 12, 45, 51])
def test_damaged_lengths_of_the_first_records_hide_nothing(whole: bytes, tmp_path: Path, at: int) -> None:
    path, target = tmp_path / "a.mcap", tmp_path / "b.mcap"
    path.write_bytes(flipped(whole, at, 0x20))
    name = "header" if at < 40 else "config"
    result = recover(path, target)
    assert len(result.lost) == 1 and f"head of the {name} record" in result.lost[0]
    assert result.ticks == TICKS and result.left_out == 0
    assert not LogFile(target).damaged and LogFile(target).metadata["config"] == METADATA["config"]
    assert log_info(path)["damage"] == list(result.lost)


def test_a_damaged_config_is_told_and_no_figure_is_made_of_it(run: bytes, tmp_path: Path) -> None:
    path, target = tmp_path / "a.mcap", tmp_path / "b.mcap"
    at = run.index(b'"tick_hz": 20.0') + len('"tick_hz": ')
    path.write_bytes(flipped(run, at, 0x01))
    line = f"damaged: config record (byte {run.index(bytes([0x0C]), 30)})"
    assert log_info(path)["damage"] == [line]
    for reading in (read_run, replay):
        with pytest.raises(LogError, match=r"a\.mcap: damaged: config record"):
            reading(path)
    assert recover(path, target).lost == (line,)
    assert log_info(target)["whole"]
    with pytest.raises(LogError, match="it was damaged in the log that this one was recovered from"):
        read_run(target)
    assert '"tick_hz": 30.0' in LogFile(target).metadata["damaged.config"]["json"]


def test_other_damage_is_told_beside_the_figures(run: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    at = run.index(b"versions")
    path.write_bytes(flipped(run, run.index(b"python", at) + 12, 0x01))
    (line,) = read_run(path).damaged_records
    assert line.startswith("damaged: versions record")
    assert replay(path).damaged_records == (line,)


def older(path: Path, metadata: dict[str, dict[str, str]]) -> LogFile:
    """A log whose closing record has no digests."""
    writer = Writer(str(path))
    writer.start(profile="asvhil")
    for name, values in metadata.items():
        writer.add_metadata(name, values)
    writer.add_metadata("asvhil", {"layout": "1", "records": str(len(metadata))})
    writer.finish()
    return LogFile(path)


def test_logs_without_digests_are_checked_by_the_hashes_of_config_and_model(tmp_path: Path) -> None:
    config = log_metadata(load_config("sitl"), "lockstep")["config"]
    model = {"model": {"file": "a.npz", "base64": "QUJD", "sha256": "0" * 64}}
    assert older(tmp_path / "a.mcap", {"config": config}).damaged == {}
    # Of a key that this version does not have the text counts, not what is made of it.
    text = json.dumps({"was": 1, "plugins": []}, sort_keys=True)
    old = {"config": {"json": text, "hash": hashlib.sha256(text.encode()).hexdigest()[:16]}}
    assert older(tmp_path / "b.mcap", old).damaged == {}
    wrong = {"config": {"json": text.replace("1", "3"), "hash": old["config"]["hash"]}}
    assert list(older(tmp_path / "c.mcap", wrong).damaged) == ["config"]
    assert list(older(tmp_path / "d.mcap", old | model).damaged) == ["model"]


def test_a_config_with_plug_ins_is_hashed_without_their_folders(tmp_path: Path) -> None:
    text = json.dumps({"plugins": [{"file": "/home/me/pusher.py", "sha256": "ab"}]}, sort_keys=True)
    hashed = text.replace("/home/me/", "")
    config = {"json": text, "hash": hashlib.sha256(hashed.encode()).hexdigest()[:16]}
    assert older(tmp_path / "a.mcap", {"config": config}).damaged == {}


def test_a_digest_is_of_keys_and_values_alike() -> None:
    assert len({digest({"a": "b"}), digest({"b": "a"}), digest({"a": "b", "c": ""}), digest({})}) == 4


def test_the_metadata_of_a_segment_are_checked_too(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    recorder = Recorder(path, metadata=METADATA, chunk_kib=4, sync_period_s=0.1, threaded=False, segment_s=0.5)
    record_ticks(recorder, range(TICKS))
    recorder.close()
    second = path.with_name("log-001.mcap")
    data = second.read_bytes()
    second.write_bytes(flipped(data, data.index(b"wamv16"), 0x01))
    log = LogFile(path)
    assert list(log.damaged.values()) == [f"log-001.mcap: damaged: config record (byte {data.index(b'config') - 13})"]
    assert sum(1 for _ in log.ticks()) == TICKS
    assert log.metadata == METADATA


def test_what_is_damaged_in_the_first_segment_is_taken_from_another(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    recorder = Recorder(path, metadata=METADATA, chunk_kib=4, sync_period_s=0.1, threaded=False, segment_s=0.5)
    record_ticks(recorder, range(TICKS))
    recorder.close()
    data = path.read_bytes()
    path.write_bytes(flipped(data, data.index(b"wamv16"), 0x01))
    log = LogFile(path)
    assert list(log.damaged) == ["log.mcap config"] and log.metadata == METADATA
