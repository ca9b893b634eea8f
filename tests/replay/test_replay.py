"""Replay of a log is exact to the byte, and names the first tick and field that is not."""

import json
from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.errors import AsvhilError
from asvhil.logs.opening import log_metadata
from asvhil.logs.reader import LogFile
from asvhil.logs.recorder import Recorder
from asvhil.logs.replay import replay
from asvhil.sitl import run_lockstep
from asvhil.types import Frame, Inputs


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("replay") / "log.mcap"
    run_lockstep(load_config("sitl"), path, 20.0)
    return path


def rewrite(source: Path, target: Path, edit_tick: int, flip: tuple[str, int, int] | None) -> None:
    """Copy a log, flipping one bit of one recorded input frame: (port, byte, bit) in a tick."""
    original = LogFile(source)
    recorder = Recorder(target, metadata=original.metadata, chunk_kib=128, sync_period_s=1.0, threaded=False)
    from asvhil.logs.encoding import decode_outputs

    for tick, (inputs, recorded) in enumerate(original.ticks()):
        frames = list(inputs.frames)
        if flip is not None and tick == edit_tick:
            port, byte, bit = flip
            at = next(i for i, frame in enumerate(frames) if frame.port == port)
            data = bytearray(frames[at].data)
            data[byte] ^= 1 << bit
            frames[at] = Frame(t_ns=frames[at].t_ns, port=port, data=bytes(data), peer=frames[at].peer)
        recorder.write_inputs(Inputs(t_ns=inputs.t_ns, frames=tuple(frames)))
        assert recorded is not None
        recorder.write_outputs(decode_outputs(recorded))
    recorder.close()


def test_every_tick_is_exact(log: Path) -> None:
    result = replay(log)
    assert result.mismatch is None and result.compared == 403 and not result.truncated


def test_a_copy_without_a_flip_is_exact_too(log: Path, tmp_path: Path) -> None:
    rewrite(log, tmp_path / "copy.mcap", 0, None)
    assert replay(tmp_path / "copy.mcap").mismatch is None


@pytest.mark.parametrize("bit", [0, 5])
def test_one_flipped_bit_is_found_where_it_acts(log: Path, tmp_path: Path, bit: int) -> None:
    tick = next(
        number
        for number, (inputs, _) in enumerate(LogFile(log).ticks())
        if number > 200 and any(frame.port == "autopilot" for frame in inputs.frames)
    )
    rewrite(log, tmp_path / "flipped.mcap", tick, ("autopilot", 14, bit))
    mismatch = replay(tmp_path / "flipped.mcap").mismatch
    assert mismatch is not None and mismatch.tick == tick
    assert "recorded" in mismatch.field and "replayed" in mismatch.field


def test_a_changed_config_is_noticed(log: Path, tmp_path: Path) -> None:
    original = LogFile(log)
    other = load_config("sitl", ("estimator.ekf.position_std_m=0.2",))
    path = tmp_path / "other.mcap"
    recorder = Recorder(
        path, metadata=log_metadata(other, "lockstep"), chunk_kib=128, sync_period_s=1.0, threaded=False
    )
    from asvhil.logs.encoding import decode_outputs

    for inputs, recorded in original.ticks():
        recorder.write_inputs(inputs)
        assert recorded is not None
        recorder.write_outputs(decode_outputs(recorded))
    recorder.close()
    mismatch = replay(path).mismatch
    assert mismatch is not None and mismatch.field.startswith(("estimate.", "health."))


def test_a_cut_log_replays_up_to_its_cut(log: Path, tmp_path: Path) -> None:
    data = log.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) * 2 // 3])
    result = replay(tmp_path / "cut.mcap")
    assert result.truncated and result.mismatch is None and 100 < result.compared < 403


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", b"no log at all" * 100])
def test_what_is_no_log_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bad.mcap"
    path.write_bytes(content)
    with pytest.raises(AsvhilError) as caught:
        replay(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_the_log_holds_what_it_takes_to_replay_it(log: Path) -> None:
    metadata = LogFile(log).metadata
    assert json.loads(metadata["config"]["json"])["vehicle"]["name"] == "wamv16"
    assert metadata["run"] == {"mode": "lockstep", "seed": "1", "vehicle": "wamv16"}
    assert {"asvhil", "python", "numpy", "casadi", "daqp", "pymavlink", "mcap"} <= set(metadata["versions"])
