"""Stalls in a log: told, and time. Jumps of the clock: told, and in no figure."""

from __future__ import annotations

from pathlib import Path

import pytest

from asvhil.commands.views import title_of
from asvhil.config import load_config
from asvhil.logs.clock import Stall, TickClock, jump_words, stall_words
from asvhil.logs.info import log_info
from asvhil.logs.run import read_run
from asvhil.logs.summary import summarise
from asvhil.sitl import run_lockstep
from tests.support.loop import PLAIN_CONTROLLER
from tests.support.shifted_logs import shifted

FROM_TICK = 400


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "run.mcap"
    run_lockstep(load_config("sitl", (PLAIN_CONTROLLER,)), path, 40.0)
    return path


@pytest.mark.parametrize("by_s", [3e8, -10.0])
def test_a_jump_is_told_and_is_no_time(run: Path, tmp_path: Path, by_s: float) -> None:
    path = shifted(run, tmp_path / "jump.mcap", by_s, FROM_TICK)
    whole, jumped = summarise(read_run(run)), summarise(read_run(path))
    line = f"time jumps by {by_s:+.3f} s at tick {FROM_TICK}; no figure counts that as time"
    assert jumped["warnings"] == log_info(path)["warnings"] == [line]
    assert whole["warnings"] == whole["time_jumps"] == log_info(run)["warnings"] == []
    assert title_of(jumped) == f"{title_of(whole)}, log not whole" and jumped["stalls"] == []
    assert jumped["duration_s"] == pytest.approx(whole["duration_s"], abs=1e-6)
    assert log_info(path)["duration_s"] == pytest.approx(log_info(run)["duration_s"], abs=1e-6)
    assert log_info(path)["holds"] == log_info(run)["holds"]
    for key in ("change_per_s", "reversals_per_min", "energy", "settled_from_s"):
        assert jumped[key] == pytest.approx(whole[key], rel=1e-6), key
    for way in ("truth", "estimated", "measured"):
        for key in ("penalty_score", "vrx_score"):
            assert jumped[way][key] == pytest.approx(whole[way][key], rel=1e-6), way
        docking = jumped["docking"][way]
        at_s = jumped["time_jumps"][0]["at_s"]
        assert all(window["to_s"] < at_s or window["from_s"] >= at_s for window in docking["windows"])
        assert docking["share"] is None or docking["share"] <= 1.0


@pytest.mark.parametrize("for_s", [3.0, 100.0])
def test_a_stall_is_told_and_is_time(run: Path, tmp_path: Path, for_s: float) -> None:
    path = shifted(run, tmp_path / "stall.mcap", for_s - 0.05, FROM_TICK)
    whole, stalled = summarise(read_run(run)), summarise(read_run(path))
    info, lasts_s = log_info(path), whole["duration_s"] + for_s - 0.05
    line = f"no tick for {for_s:.1f} s at tick {FROM_TICK}"
    assert stalled["warnings"] == info["warnings"] == [line]
    assert stalled["stalls"] == info["stalls"] and stalled["stalls"][0]["tick"] == FROM_TICK
    assert stalled["stalls"][0]["for_s"] == pytest.approx(for_s)
    assert stalled["time_jumps"] == info["time_jumps"] == [] and whole["stalls"] == []
    assert title_of(stalled) == title_of(whole) and info["whole"]
    assert stalled["duration_s"] == pytest.approx(lasts_s) and info["duration_s"] == pytest.approx(lasts_s)
    assert info["holds"][0]["to_s"] == pytest.approx(log_info(run)["holds"][0]["to_s"] + for_s - 0.05)
    assert stalled["holds"][0]["to_s"] == pytest.approx(info["holds"][0]["to_s"], abs=1e-3)
    assert stalled["phases"]["hold"] == pytest.approx(whole["phases"]["hold"] + for_s - 0.05, abs=0.002)
    at_s = stalled["stalls"][0]["at_s"]
    for way in ("truth", "estimated", "measured"):
        windows = stalled["docking"][way]["windows"]
        assert all(window["to_s"] < at_s or window["from_s"] >= at_s for window in windows), way


def test_a_gap_beyond_a_day_is_a_jump_and_a_shorter_one_a_stall() -> None:
    clock = TickClock(0.05)
    for t_s in (0.0, 86_000.0, 86_000.0 + 86_500.0):
        clock.tick(round(t_s * 1e9))
    assert clock.stalls == [Stall(tick=2, at_s=86_000.0, for_s=86_000.0)]
    assert [jump.tick for jump in clock.jumps] == [3]
    assert clock.t_s(round(172_500e9)) == pytest.approx(86_000.05)


def test_ticks_that_are_missing_and_late_ones_are_no_jump() -> None:
    clock = TickClock(0.05)
    for number, t_ns in ((1, 0), (2, 50_000_000), (42, 2_050_000_000), (43, 2_900_000_000)):
        clock.tick(t_ns, number)
    assert not clock.jumps and not clock.stalls and clock.t_s(2_900_000_000) == pytest.approx(2.9)


def test_many_jumps_and_many_stalls_are_told_shortly() -> None:
    back, late = TickClock(0.05), TickClock(0.05)
    for number in range(1, 12):
        back.tick(-number * 100_000_000_000, number)
        late.tick(number * 100_000_000_000, number)
    assert len(back.jumps) == len(late.stalls) == 10 and not back.stalls and not late.jumps
    assert len(jump_words(back.jumps)) == len(stall_words(late.stalls)) == 6
    assert jump_words(back.jumps)[-1] == "time jumps 5 times more"
    assert stall_words(late.stalls)[-1] == "no tick for more than 1 s 5 times more"


def test_a_frame_of_before_a_jump_keeps_its_time() -> None:
    clock = TickClock(0.05)
    clock.tick(200_000_000_000)
    clock.tick(100_000_000_000)
    assert clock.t_s(100_000_000_000) == pytest.approx(0.05)
    assert clock.t_s(199_990_000_000) == pytest.approx(-0.01)
    assert clock.t_s(200_020_000_000) == pytest.approx(0.02)
