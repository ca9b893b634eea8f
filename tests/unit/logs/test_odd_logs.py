"""Logs that are no regular file, of another version, or with a model that is none: one line that names the log."""

from __future__ import annotations

import hashlib
import json
import os
from base64 import b64encode
from pathlib import Path

import pytest

from asvhil.commands.outputs import write_json
from asvhil.config import load_config
from asvhil.errors import AsvhilError, ConfigError, LogError
from asvhil.logs.opening import log_metadata
from asvhil.logs.reader import LogFile
from asvhil.logs.recorder import Recorder
from asvhil.logs.replay import config_of, replay
from asvhil.logs.run import read_run
from asvhil.logs.summary import summarise
from asvhil.types import changed
from tests.support.log_samples import record_ticks, sample_inputs, sample_outputs


def made(path: Path, metadata: dict[str, dict[str, str]]) -> Path:
    recorder = Recorder(path, metadata=metadata, chunk_kib=16, sync_period_s=1.0, threaded=False)
    record_ticks(recorder, range(4))
    recorder.close()
    return path


def test_a_pipe_or_a_device_is_refused_at_once(tmp_path: Path) -> None:
    pipe = tmp_path / "fifo.mcap"
    os.mkfifo(pipe)
    for path in (pipe, Path("/dev/zero")):
        with pytest.raises(LogError, match=rf"{path.name}: not a regular file; a log is expected$"):
            LogFile(path)


def test_a_folder_in_the_place_of_a_segment_is_told(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    metadata = {"config": {"json": "{}"}}
    recorder = Recorder(path, metadata=metadata, chunk_kib=4, sync_period_s=1.0, threaded=False, segment_s=0.1)
    record_ticks(recorder, range(8))
    recorder.close()
    (tmp_path / "log-001.mcap").unlink()
    (tmp_path / "log-001.mcap").mkdir()
    assert "log-001.mcap: not a regular file; a log is expected" in str(LogFile(path).damage)


def test_a_config_of_another_version_is_called_so(tmp_path: Path) -> None:
    metadata = log_metadata(load_config("sitl"), "lockstep")
    tree = json.loads(metadata["config"]["json"])
    tree["condroller"] = tree.pop("controller")
    metadata["config"]["json"] = json.dumps(tree)
    metadata["versions"]["asvhil"] = "9.8.7"
    path = made(tmp_path / "a.mcap", metadata)
    with pytest.raises(ConfigError) as caught:
        config_of(LogFile(path), path)
    text = str(caught.value)
    assert f"{path} (config record): key condroller: unknown key; the log is of another version" in text
    assert "asvhil 9.8.7" in text and "did you mean" not in text


def test_a_model_that_is_none_is_named_by_its_log(tmp_path: Path) -> None:
    metadata = log_metadata(load_config("sitl"), "lockstep")
    data = b"no archive"
    record = {"file": "m.npz", "base64": b64encode(data).decode(), "sha256": hashlib.sha256(data).hexdigest()}
    tree = json.loads(metadata["config"]["json"])
    tree["controller"]["name"] = "nnsem-mpc"
    metadata["config"]["json"] = json.dumps(tree)
    path = made(tmp_path / "a.mcap", metadata | {"model": record})
    with pytest.raises(AsvhilError) as caught:
        replay(path)
    assert f"{path} (model record)" in str(caught.value) and "/tmp/tmp" not in str(caught.value)


def test_a_hold_without_a_station_gives_valid_json(tmp_path: Path) -> None:
    path, file = tmp_path / "a.mcap", tmp_path / "a.json"
    metadata = log_metadata(load_config("sitl"), "lockstep")
    recorder = Recorder(path, metadata=metadata, chunk_kib=16, sync_period_s=1.0, threaded=False)
    for tick in range(40):
        recorder.write_inputs(sample_inputs(tick))
        recorder.write_outputs(changed(sample_outputs(tick), station=None))
    recorder.close()
    figures = summarise(read_run(path))
    assert [hold["stations"] for hold in figures["holds"]] == [1]
    write_json(file, figures)

    def refuse(word: str) -> None:
        raise AssertionError(word)

    tree = json.loads(file.read_text(), parse_constant=refuse)
    assert tree["estimated"]["distance_m"]["mean"] is None


def test_numbers_that_json_has_not_are_null(tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    write_json(file, {"a": [1.5, float("nan"), {"b": float("-inf")}], "c": (float("inf"), None, True)})
    assert json.loads(file.read_text()) == {"a": [1.5, None, {"b": None}], "c": [None, None, True]}
