"""A log in segments: each whole by itself, together exactly the log in one file, and nothing lost between two."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from mcap.reader import make_reader

from asvhil.config import load_config
from asvhil.errors import LogError
from asvhil.logs.info import log_info
from asvhil.logs.reader import LogFile
from asvhil.logs.recorder import Recorder
from asvhil.logs.recover import recover
from asvhil.logs.run import read_run
from asvhil.logs.segments import first_in, segment_path
from asvhil.logs.summary import summarise
from asvhil.sitl import run_lockstep
from asvhil.types import Inputs
from bench.power_cuts import SHIM, synced_sizes
from tests.support.log_damage import chunk_spans
from tests.support.log_samples import METADATA, make_recorder, record_ticks, sample_inputs
from tests.support.paths import ROOT

TICKS = 160
SEGMENT_BYTES = 10_000


def record(path: Path, *, threaded: bool = False, segment_bytes: int = SEGMENT_BYTES) -> Path:
    recorder = make_recorder(path, threaded=threaded, segment_bytes=segment_bytes)
    record_ticks(recorder, range(TICKS))
    recorder.close()
    assert recorder.error is None and recorder.dropped == 0
    return path


def sample_of(tick: int) -> Inputs:
    """What `record_ticks` writes."""
    return sample_inputs(tick, frames=tick % 4)


def files_of(path: Path) -> list[Path]:
    return sorted(path.parent.glob("*.mcap"), key=lambda file: file.name.replace(".mcap", "-000.mcap").split("-")[1])


def ticks_of(path: Path) -> list[int]:
    """Ticks from 1, by the mcap package's own reader, CRCs checked."""
    with path.open("rb") as file:
        found = make_reader(file, validate_crcs=True).iter_messages("/asvhil/inputs", log_time_order=False)
        return [message.sequence for _, _, message in found]


@pytest.mark.parametrize("threaded", [False, True])
def test_the_segments_are_together_what_one_file_is(tmp_path: Path, threaded: bool) -> None:
    (tmp_path / "one").mkdir()
    (tmp_path / "many").mkdir()
    one = record(tmp_path / "one" / "log.mcap", segment_bytes=0)
    many = record(tmp_path / "many" / "log.mcap", threaded=threaded)
    files = files_of(many)
    assert len(files) > 3 and files == [segment_path(many, number) for number in range(len(files))]
    assert [tick for file in files for tick in ticks_of(file)] == list(range(1, TICKS + 1))
    log = LogFile(many)
    assert list(log.ticks()) == list(LogFile(one).ticks())
    assert list(log.frames("autopilot", "in")) == list(LogFile(one).frames("autopilot", "in"))
    assert list(log.timing()) == list(LogFile(one).timing())
    assert log.metadata == METADATA and log.damage is None and not log.truncated and log.segments == len(files)
    assert list(LogFile(tmp_path / "many").ticks()) == list(log.ticks())
    told, expected = log_info(many), log_info(one)
    assert told["segments"] == len(files) and told["bytes"] == sum(file.stat().st_size for file in files)
    same = ("whole", "ticks", "ticks_dropped", "holds", "phases", "channels", "duration_s", "overruns")
    assert {name: told[name] for name in same} == {name: expected[name] for name in same}


def test_each_segment_opens_by_itself(tmp_path: Path) -> None:
    path = record(tmp_path / "log.mcap")
    topics = []
    for file in files_of(path):
        with file.open("rb") as stream:
            reader = make_reader(stream)
            summary = reader.get_summary()
            assert summary is not None
            topics.append({number: channel.topic for number, channel in summary.channels.items()})
            metadata = {item.name: item.metadata for item in reader.iter_metadata()}
            assert {name: metadata[name] for name in METADATA} == METADATA
    assert all(found == topics[0] for found in topics)
    later = LogFile(segment_path(path, 2))
    assert later.first_tick > 1 and later.segments == 1
    assert next(inputs for inputs, _ in later.ticks()) == sample_of(later.first_tick - 1)
    assert log_info(segment_path(path, 2))["whole"]


def test_a_later_segment_alone_has_its_own_figures_and_says_where_it_begins(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    run_lockstep(load_config("sitl", ("recorder.segment_s=10",)), log, 25.0)
    (alone := tmp_path / "alone").mkdir()
    parts = [summarise(read_run(path.rename(alone / f"{number}.mcap"))) for number, path in enumerate(files_of(log))]
    for number in range(3):
        (alone / f"{number}.mcap").rename(segment_path(log, number))
    whole = summarise(read_run(log))
    assert len(parts) == 3 and whole["energy_wh"] > 1.0
    assert sum(part["energy_wh"] for part in parts) == pytest.approx(whole["energy_wh"], rel=0.02)
    growing = [name for name, count in whole["counters"].items() if count > 100]
    assert growing
    for name in growing:  # what came in the first tick of a segment is in neither
        apart = whole["counters"][name] - sum(part["counters"][name] for part in parts)
        assert 0 <= apart <= 0.02 * whole["counters"][name], name
    words = "begins with tick 201: a later segment of a run, read alone"
    assert words in parts[1]["warnings"] and not whole["warnings"] and not parts[0]["warnings"]
    told = log_info(segment_path(log, 1))
    assert told["whole"] and told["ticks_dropped"] == 0 and told["first_tick"] == 201 and words in told["warnings"]
    assert log_info(log)["first_tick"] == 1


@pytest.mark.parametrize("swapped", [(1, 2), (2, 3)])
def test_segments_out_of_order_are_told_and_end_the_log(tmp_path: Path, swapped: tuple[int, int]) -> None:
    path = record(tmp_path / "log.mcap")
    earlier, later = (segment_path(path, number) for number in swapped)
    earlier.rename(tmp_path / "aside")
    later.rename(earlier)
    (tmp_path / "aside").rename(later)
    begins = ticks_of(earlier)[0]
    before = [tick for number in range(swapped[0]) for tick in ticks_of(segment_path(path, number))]
    told = log_info(path)
    words = f"{earlier}: segments out of order: it begins with tick {begins}; left out behind it: {later.name}"
    assert not told["whole"] and told["damage"][0].startswith(words)
    assert (told["ticks"], told["ticks_dropped"], told["warnings"]) == (len(before), 0, [])
    log = LogFile(path)
    assert len(list(log.ticks())) == len(before) and str(log.damage).startswith(words)
    assert recover(path, tmp_path / "new.mcap").lost[0].startswith(words)


def test_time_ends_a_segment_too(tmp_path: Path) -> None:
    recorder = Recorder(
        tmp_path / "log.mcap", metadata=METADATA, chunk_kib=16, sync_period_s=0.1, threaded=False, segment_s=2.0
    )
    record_ticks(recorder, range(TICKS))
    recorder.close()
    assert [len(ticks_of(file)) for file in files_of(tmp_path / "log.mcap")] == [40, 40, 40, 40]


def test_off_there_is_one_file_as_before(tmp_path: Path) -> None:
    path = record(tmp_path / "log.mcap", segment_bytes=0)
    assert files_of(path) == [path]
    with path.open("rb") as stream:
        assert {item.name for item in make_reader(stream).iter_metadata()} == {*METADATA, "asvhil"}


@pytest.mark.parametrize("next_has", [0, 8, 200, "metadata"])
def test_a_power_cut_while_the_next_is_begun_loses_nothing(tmp_path: Path, next_has: int | str) -> None:
    """The old one has no end yet, and the next its first bytes alone."""
    path = record(tmp_path / "log.mcap")
    old, new = segment_path(path, 1), segment_path(path, 2)
    for file in files_of(path)[3:]:
        file.unlink()
    last = ticks_of(old)[-1]
    old.write_bytes(old.read_bytes()[: chunk_spans(old.read_bytes())[-1][1]])
    start = chunk_spans(new.read_bytes())[0][0]
    new.write_bytes(new.read_bytes()[: start if next_has == "metadata" else int(next_has)])
    log = LogFile(path)
    assert log.truncated and log.damage is not None
    assert [inputs for inputs, _ in log.ticks()] == [sample_of(tick) for tick in range(last)]
    assert all(outputs is not None for _, outputs in log.ticks())
    result = recover(path, tmp_path / "again.mcap")
    assert result.ticks == last


def test_a_segment_without_its_end_in_the_middle_has_lost_nothing(tmp_path: Path) -> None:
    """As of a power cut after the first ticks of the next, while the old one was ended."""
    path = record(tmp_path / "log.mcap")
    old = segment_path(path, 1)
    old.write_bytes(old.read_bytes()[: chunk_spans(old.read_bytes())[-1][1] + 5])
    log = LogFile(path)
    assert log.damage is None and not log.truncated and len(list(log.ticks())) == TICKS
    result = recover(path, tmp_path / "again.mcap")
    assert result.lost == () and result.ticks == TICKS
    assert list(LogFile(tmp_path / "again.mcap").ticks()) == list(log.ticks())
    assert LogFile(tmp_path / "again.mcap").segments == 1


def test_ticks_lost_in_the_middle_end_the_log_there(tmp_path: Path) -> None:
    path = record(tmp_path / "log.mcap")
    old = segment_path(path, 1)
    old.write_bytes(old.read_bytes()[: chunk_spans(old.read_bytes())[-3][1]])
    with pytest.raises(LogError, match=r"log-002.mcap: chunk at byte .*are missing"):
        list(LogFile(path).ticks())
    assert recover(path, tmp_path / "again.mcap").lost != ()


@pytest.mark.parametrize("missing", [1, -1])
def test_a_segment_that_was_left_behind_is_told(tmp_path: Path, missing: int) -> None:
    path = record(tmp_path / "log.mcap")
    files = files_of(path)
    gone = files[missing]
    first = ticks_of(gone)[0]
    gone.unlink()
    log = LogFile(path)
    behind = files[2:] if missing == 1 else []
    those = f"{behind[0].name} to {behind[-1].name} ({len(behind)} files)" if behind else ""
    left = f"; left out behind it: {those}, each readable by its own path" if behind else ""
    assert log.truncated and log.damage == f"{gone}: is not there, and the run goes on in it{left}"
    assert len(list(log.ticks())) == first - 1
    told = log_info(path)
    assert not told["whole"] and str(gone) in told["damage"][-1]


def test_a_log_of_another_run_is_not_taken_for_a_segment(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    path, other = record(tmp_path / "log.mcap"), record(tmp_path / "other" / "log.mcap")
    segment_path(path, 1).write_bytes(segment_path(other, 1).read_bytes())
    assert "another run" in str(LogFile(path).damage)
    alone = tmp_path / "other" / "new.mcap"
    record(alone, segment_bytes=0)
    segment_path(alone, 1).write_bytes(path.read_bytes())
    assert LogFile(alone).damage is None and LogFile(alone).segments == 1


def test_segments_of_another_run_are_never_written_over(tmp_path: Path) -> None:
    segment_path(tmp_path / "log.mcap", 1).write_bytes(b"theirs")
    with pytest.raises(LogError, match="a segment of another run"):
        make_recorder(tmp_path / "log.mcap", segment_bytes=SEGMENT_BYTES)


def test_a_next_one_that_cannot_be_made_leaves_the_log_in_one_file(tmp_path: Path) -> None:
    recorder = make_recorder(tmp_path / "log.mcap", segment_bytes=SEGMENT_BYTES)
    segment_path(tmp_path / "log.mcap", 1).mkdir()
    record_ticks(recorder, range(TICKS))
    assert "log-001.mcap cannot be made" in recorder.trouble
    recorder.close()
    assert recorder.error is None and ticks_of(tmp_path / "log.mcap") == list(range(1, TICKS + 1))


def test_a_folder_has_one_run(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no log"):
        LogFile(tmp_path)
    path = record(tmp_path / "log.mcap")
    recover(path, tmp_path / "log-recovered.mcap")
    assert first_in(tmp_path) == path
    record(tmp_path / "more.mcap", segment_bytes=0)
    with pytest.raises(LogError, match=r"several logs: log.mcap, more.mcap; name one"):
        LogFile(tmp_path)


KILLED = """
import sys, time
from pathlib import Path
from asvhil.logs.recorder import Recorder
from tests.support.log_samples import METADATA, sample_inputs, sample_outputs
recorder = Recorder(
    Path(sys.argv[1]), metadata=METADATA, chunk_kib=16, sync_period_s=0.25, segment_bytes=8_000
)
for tick in range(100_000):
    recorder.write_inputs(sample_inputs(tick))
    recorder.write_outputs(sample_outputs(tick))
    print(tick, flush=True)
    time.sleep(0.01)
"""


@pytest.mark.parametrize("after_s", [0.7, 0.93, 1.31])
def test_a_power_cut_at_any_moment_costs_half_a_second_at_most(tmp_path: Path, after_s: float) -> None:
    """A segment every few tenths of a second; of each file what an fsync has returned for is left."""
    (tmp_path / "shim").mkdir()
    (tmp_path / "shim" / "sitecustomize.py").write_text(SHIM)
    (tmp_path / "run").mkdir()
    first, synced = tmp_path / "run" / "log.mcap", tmp_path / "synced"
    env = os.environ | {"PYTHONPATH": f"{tmp_path / 'shim'}{os.pathsep}{ROOT}", "SYNCED": str(synced)}
    with subprocess.Popen([sys.executable, "-c", KILLED, str(first)], env=env, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(after_s)
        process.kill()
        told = 1 + int(process.stdout.read().split()[-1])
    for file in files_of(first):
        file.write_bytes(file.read_bytes()[: max(synced_sizes(file, synced), default=0)])
    log = LogFile(tmp_path / "run")
    kept = [inputs for inputs, _ in log.ticks()]
    assert log.segments > 2
    assert kept == [sample_inputs(tick) for tick in range(len(kept))]
    assert told - len(kept) <= 50  # ticks of 0.01 s
    assert recover(first, tmp_path / "again.mcap").ticks >= len(kept) - 1
