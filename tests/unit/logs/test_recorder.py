"""The recorder: layout, a disk that is full or stalls, a process that is killed."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import pytest
from mcap.reader import make_reader

from asvhil.errors import LogError
from asvhil.logs import recorder as recorder_module
from asvhil.logs.encoding import encode_outputs
from asvhil.logs.foxglove import SCHEMAS
from asvhil.logs.reader import LogFile, Timing
from asvhil.types import Frame, Inputs
from tests.support.log_samples import (
    METADATA,
    START_NS,
    TICK_NS,
    assert_fits,
    make_recorder,
    record_ticks,
    sample_inputs,
    sample_outputs,
)
from tests.support.paths import ROOT
from tests.support.waiting import wait_until

pytestmark = pytest.mark.real_time


def run_child(code: str, *args: str) -> subprocess.Popen[str]:
    """A Python process that can import this folder's helpers."""
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    command = [sys.executable, "-c", textwrap.dedent(code), *args]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=env)


@pytest.mark.parametrize("threaded", [False, True])
def test_what_goes_in_comes_out(tmp_path: Path, threaded: bool) -> None:
    path = tmp_path / "run.mcap"
    recorder = make_recorder(path, threaded)
    record_ticks(recorder, range(200))
    recorder.close()
    assert recorder.error is None and recorder.dropped == 0
    log = LogFile(path)
    assert log.metadata == METADATA
    assert not log.truncated and log.damage is None
    expected = [
        (sample_inputs(tick, tick % 4), encode_outputs(sample_outputs(tick, tick % 4 == 0))) for tick in range(200)
    ]
    assert list(log.ticks()) == expected
    assert list(log.ticks()) == expected  # a log can be read again
    received = [frame for inputs, _ in expected for frame in inputs.frames if frame.port == "autopilot"]
    assert list(log.frames("autopilot", "in")) == received
    assert list(log.frames("autopilot", "out")) == [f for t in range(200) for f in sample_outputs(t).frames]
    assert list(log.frames("nobody", "in")) == []
    assert list(log.timing()) == [
        Timing(t_ns=START_NS + tick * TICK_NS, step_ns=1000 + tick, overrun=tick == 3) for tick in range(200)
    ]


def test_odd_frames_keep_their_bytes_addresses_and_order(tmp_path: Path) -> None:
    """Equal and falling times, empty data, many ports and peers: the order of the file is what counts."""
    frames = (
        Frame(t_ns=START_NS + 5, port="autopilot", data=b"", peer="10.0.0.1:1"),
        Frame(t_ns=START_NS + 5, port="operator", data=b"\x00" * 70_000, peer="[fe80::1%eth0]:14550"),
        Frame(t_ns=START_NS + 4, port="a port", data=bytes(range(256)), peer="péer"),
        Frame(t_ns=START_NS + 5, port="autopilot", data=b"\xfd", peer="10.0.0.1:2"),
        Frame(t_ns=START_NS + 5, port="operator", data=b"1", peer="10.0.0.1:1", via="ground.qgc"),
        Frame(t_ns=START_NS + 5, port="operator", data=b"2", peer="10.0.0.1:1"),
        Frame(t_ns=START_NS + 5, port="operator", data=b"3", via="ground.radio"),
        *(Frame(t_ns=0, port=f"p{i % 7}", data=bytes([i]), peer=str(i)) for i in range(200)),
    )
    recorder = make_recorder(tmp_path / "run.mcap")
    inputs = [Inputs(t_ns=START_NS, frames=frames), Inputs(t_ns=START_NS, frames=()), sample_inputs(3)]
    for tick, one in enumerate(inputs):
        recorder.write_inputs(one)
        recorder.write_outputs(sample_outputs(tick))
    recorder.close()
    assert recorder.error is None
    assert [read for read, _ in LogFile(tmp_path / "run.mcap").ticks()] == inputs


def test_a_last_tick_without_outputs(tmp_path: Path) -> None:
    recorder = make_recorder(tmp_path / "run.mcap")
    record_ticks(recorder, range(3))
    recorder.write_inputs(sample_inputs(3))
    recorder.close()
    ticks = list(LogFile(tmp_path / "run.mcap").ticks())
    assert len(ticks) == 4
    assert ticks[3] == (sample_inputs(3), None)


def test_another_reader_finds_the_documented_layout(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    recorder = make_recorder(path)
    record_ticks(recorder, range(40))
    recorder.write_log(START_NS, "warning", "wind is stale")
    recorder.close()
    with path.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "asvhil"
        names = [metadata.name for metadata in reader.iter_metadata()]
        assert names == ["config", "versions", "run", "asvhil"]
        seen: dict[str, int] = {}
        times = []
        for schema, channel, message in reader.iter_messages():
            seen[channel.topic] = seen.get(channel.topic, 0) + 1
            times.append(message.log_time)
            if channel.message_encoding == "json":
                value = json.loads(message.data, parse_constant=lambda name: pytest.fail(name))
                assert isinstance(value, dict)
                if schema is not None:
                    assert schema.encoding == "jsonschema"
                    assert json.loads(schema.data) == SCHEMAS[schema.name]
                    assert_fits(value, json.loads(schema.data), channel.topic)
            else:
                assert (
                    channel.message_encoding == {"autopilot": "mavlink", "anemometer": "nmea"}[channel.metadata["port"]]
                )
    assert times == sorted(times)
    # 40 ticks at 20 Hz; every 4th has a control, and the ticks between are within the period of the views.
    assert seen == {
        "/frames/autopilot/in": 50,
        "/frames/anemometer/in": 10,
        "/frames/autopilot/out": 40,
        "/asvhil/inputs": 40,
        "/asvhil/outputs": 40,
        "/asvhil/timing": 40,
        "/asvhil/fix": 10,
        "/asvhil/pose": 10,
        "/tf": 10,
        "/asvhil/plan": 10,
        "/asvhil/log": 1,
    }


def test_views_come_at_5_hz_without_a_control(tmp_path: Path) -> None:
    recorder = make_recorder(tmp_path / "run.mcap")
    for tick in range(40):
        recorder.write_inputs(sample_inputs(tick))
        recorder.write_outputs(sample_outputs(tick, control=False))
    recorder.close()
    with (tmp_path / "run.mcap").open("rb") as file:
        times = [message.log_time for _, _, message in make_reader(file).iter_messages("/asvhil/pose")]
    assert times == [START_NS + tick * TICK_NS for tick in range(0, 40, 4)]


def test_start_up_errors_are_one_line(tmp_path: Path) -> None:
    (tmp_path / "old.mcap").write_bytes(b"precious")
    with pytest.raises(LogError, match=r"old\.mcap: the log cannot be made \(File exists\)"):
        make_recorder(tmp_path / "old.mcap")
    assert (tmp_path / "old.mcap").read_bytes() == b"precious"
    with pytest.raises(LogError, match="No such file or directory"):
        make_recorder(tmp_path / "no" / "run.mcap")


@pytest.mark.parametrize("threaded", [False, True])
def test_close_twice_and_write_after_close(tmp_path: Path, threaded: bool) -> None:
    recorder = make_recorder(tmp_path / "run.mcap", threaded)
    record_ticks(recorder, range(2))
    recorder.close()
    size = (tmp_path / "run.mcap").stat().st_size
    recorder.close()
    record_ticks(recorder, range(2, 4))
    assert (tmp_path / "run.mcap").stat().st_size == size
    assert recorder.dropped == 6
    assert recorder.error is None


def test_metadata_and_first_ticks_are_on_the_disk_while_the_run_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    recorder = make_recorder(path, threaded=True, chunk_kib=4096)
    assert LogFile(path).metadata == METADATA  # before any tick
    record_ticks(recorder, range(5))
    end_s = time.monotonic() + 5.0
    while len(ticks := list(LogFile(path).ticks())) < 5 and time.monotonic() < end_s:
        time.sleep(0.02)
    assert len(ticks) == 5
    assert LogFile(path).truncated
    recorder.close()
    assert not LogFile(path).truncated


# --- when the disk does not play along ---


def test_a_failing_write_stops_the_recording_but_not_the_caller(tmp_path: Path) -> None:
    """A real limit of the file's size, in a process of its own: the write fails with EFBIG."""
    path = tmp_path / "run.mcap"
    child = run_child(
        """
        import resource, sys, time
        from pathlib import Path
        from tests.support.log_samples import *
        from asvhil.logs.recorder import Recorder
        resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, resource.RLIM_INFINITY))
        path, threaded = Path(sys.argv[1]), sys.argv[2] == "threaded"
        recorder = Recorder(path, metadata=METADATA, chunk_kib=16, sync_period_s=0.05, threaded=threaded)
        tick = 0
        while recorder.error is None and tick < 100_000:
            record_ticks(recorder, range(tick, tick + 20))
            tick += 20
            time.sleep(0.002)
        record_ticks(recorder, range(tick, tick + 20))
        recorder.close()
        recorder.close()
        print(recorder.error)
        print(recorder.dropped)
        """,
        str(path),
        "threaded",
    )
    out, err = child.communicate(timeout=20)
    assert child.returncode == 0, err
    assert err == ""
    error, dropped = out.splitlines()
    assert error == f"{path}: recording stopped: File too large"
    assert int(dropped) >= 60
    log = LogFile(path)
    assert log.truncated
    ticks = list(log.ticks())
    assert len(ticks) > 50
    assert [inputs for inputs, _ in ticks] == [sample_inputs(tick, tick % 4) for tick in range(len(ticks))]


def test_a_disk_that_takes_little_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = os.write
    monkeypatch.setattr(os, "write", lambda fd, data: write(fd, data[:1000]))
    recorder = make_recorder(tmp_path / "run.mcap")
    record_ticks(recorder, range(100))
    recorder.close()
    monkeypatch.undo()
    log = LogFile(tmp_path / "run.mcap")
    assert not log.truncated
    assert [inputs for inputs, _ in log.ticks()] == [sample_inputs(tick, tick % 4) for tick in range(100)]


class FullDisk:
    """Stands in for the file descriptor: lets so many bytes through, then fails as a full disk does."""

    def __init__(self, sink: object, room: int) -> None:
        self._sink = sink
        self._room = room

    def write(self, data: bytes) -> int:
        self._room -= len(data)
        if self._room < 0:
            raise OSError(28, "No space left on device")
        return int(self._sink.write(data))  # type: ignore[attr-defined]

    def __getattr__(self, name: str) -> object:
        return getattr(self._sink, name)


@pytest.mark.parametrize("room", [0, 1000, 30_000])
def test_a_full_disk_is_an_error_of_the_recorder(tmp_path: Path, room: int) -> None:
    recorder = make_recorder(tmp_path / "run.mcap")
    writer = recorder._file._mcap
    writer._Writer__stream = FullDisk(recorder._file._sink, room)
    record_ticks(recorder, range(400))
    recorder.close()
    recorder.close()
    assert str(recorder.error) == f"{tmp_path}/run.mcap: recording stopped: No space left on device"
    assert recorder.trouble == "recording stopped: No space left on device"
    assert recorder.dropped > 0
    for inputs, _ in LogFile(tmp_path / "run.mcap").ticks():
        assert inputs.t_ns >= START_NS


def test_a_log_that_is_deleted_while_it_is_written_is_an_error(tmp_path: Path) -> None:
    """Its bytes went nowhere, and the run ended with status 0."""
    recorder = make_recorder(tmp_path / "log.mcap", threaded=True)
    record_ticks(recorder, range(3))
    (tmp_path / "log.mcap").unlink()
    record_ticks(recorder, range(3, 6))
    wait_until(lambda: bool(recorder.trouble), 5.0)
    assert recorder.trouble == "recording stopped: the file was deleted while it was written"
    recorder.close()
    assert recorder.error is not None and str(tmp_path / "log.mcap") in str(recorder.error)


def test_outputs_that_cannot_be_encoded_stop_the_recording_only(tmp_path: Path) -> None:
    recorder = make_recorder(tmp_path / "run.mcap")
    record_ticks(recorder, range(2))
    outputs = dataclasses.replace(sample_outputs(2), pwm_us=object())
    recorder.write_inputs(sample_inputs(2))
    recorder.write_outputs(outputs)
    recorder.close()
    assert "recording stopped: TypeError: a object cannot be recorded" in str(recorder.error)


def test_a_stalled_disk_drops_whole_ticks_and_the_reader_says_so(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    recorder = make_recorder(path, threaded=True, queue_bytes=60_000)
    stall = threading.Event()
    sync = recorder._file._sink.sync
    recorder._file._sink.sync = lambda: (stall.wait(), sync())[1]  # type: ignore[method-assign]
    record_ticks(recorder, range(1))
    time.sleep(0.2)  # longer than the sync period: the thread stands in the sync now
    started_s = time.monotonic()
    record_ticks(recorder, range(1, 50))
    assert time.monotonic() - started_s < 0.1  # the caller never waits
    assert 0 < recorder.dropped < 49 * 3
    kept = recorder.dropped
    assert recorder.trouble == "ticks are not recorded: the disk does not keep up"
    stall.set()
    while recorder._left_bytes < recorder._entered_bytes:
        time.sleep(0.005)
    record_ticks(recorder, range(50, 52))
    assert recorder.trouble == ""
    recorder.close()
    assert recorder.error is None and recorder.dropped == kept
    read = []
    with pytest.raises(LogError, match=r"run\.mcap: chunk at byte \d+: ticks \d+ to 50 are missing"):
        for inputs, outputs in LogFile(path).ticks():
            assert outputs is not None
            read.append(inputs)
    assert read == [sample_inputs(tick, tick % 4) for tick in range(len(read))]
    with path.open("rb") as file:
        texts = [
            json.loads(message.data)["message"] for _, _, message in make_reader(file).iter_messages("/asvhil/log")
        ]
    assert texts == [f"recorder: {50 - len(read)} ticks before this one were dropped"]


def test_a_disk_that_does_not_answer_is_told_before_anything_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "_SLOW_S", 0.2)
    recorder = make_recorder(tmp_path / "run.mcap", threaded=True)
    stall = threading.Event()
    sync = recorder._file._sink.sync
    recorder._file._sink.sync = lambda: (stall.wait(), sync())[1]  # type: ignore[method-assign]
    record_ticks(recorder, range(1))
    assert recorder.trouble == ""
    wait_until(lambda: recorder.trouble == "the disk has not answered for more than 0.2 s", 5.0)
    assert recorder.dropped == 0
    stall.set()
    wait_until(lambda: recorder.trouble == "", 5.0)
    recorder.close()
    assert not LogFile(tmp_path / "run.mcap").truncated


def test_kill_9_loses_no_more_than_half_a_second(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    child = run_child(
        """
        import sys, time
        from pathlib import Path
        from tests.support.log_samples import *
        from asvhil.logs.recorder import Recorder
        recorder = Recorder(Path(sys.argv[1]), metadata=METADATA, chunk_kib=128, sync_period_s=0.4)
        for tick in range(10_000):
            record_ticks(recorder, range(tick, tick + 1))
            print(tick, flush=True)
            time.sleep(0.01)
        """,
        str(path),
    )
    assert child.stdout is not None and child.stderr is not None
    told: list[tuple[float, int]] = []
    end_s = 0.0
    for line in child.stdout:
        told.append((time.monotonic(), int(line)))
        end_s = end_s or told[0][0] + 1.3
        if told[-1][0] > end_s:
            break
    killed_s = time.monotonic()
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    child.stdout.close()
    child.stderr.close()
    log = LogFile(path)
    assert log.truncated
    assert log.metadata == METADATA
    ticks = list(log.ticks())
    assert [inputs for inputs, _ in ticks] == [sample_inputs(tick, tick % 4) for tick in range(len(ticks))]
    assert all(outputs is not None for _, outputs in ticks[:-1])
    due = [tick for at_s, tick in told if at_s < killed_s - 0.5]
    assert len(due) > 20
    assert len(ticks) > due[-1]
