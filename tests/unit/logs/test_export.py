"""Exported logs, read by the tools they are for: pymavlink, the csv module, pyarrow; and what a log is said to hold."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from pymavlink import mavutil

from asvhil.config import load_config
from asvhil.errors import AsvhilError, LogError
from asvhil.logs import export
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.export import COLUMNS, Exported, export_log
from asvhil.logs.info import log_info
from asvhil.logs.reader import LogFile
from asvhil.logs.run import read_run
from asvhil.logs.tlog import read_tlog
from asvhil.sitl import run_lockstep
from asvhil.types import Phase, Station, changed
from tests.support.command_line import call
from tests.support.log_damage import chunk_spans
from tests.support.log_samples import make_recorder, record_ticks, sample_inputs
from tests.support.shifted_logs import shifted

SPAN_S = 12.0


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the simulated boat that holds its station."""
    path = tmp_path_factory.mktemp("export") / "run.mcap"
    run_lockstep(load_config("sitl"), path, SPAN_S)
    return path


def test_the_telemetry_log_has_every_frame_of_the_autopilots_link(log: Path, tmp_path: Path) -> None:
    target = tmp_path / "run.tlog"
    exported = export_log(log, target)
    count = exported.count
    assert exported.damage is None
    times = [t_us for t_us, _ in read_tlog(target)]
    assert len(times) == count and times == sorted(times)
    sent = {"in": 0, "out": 0}
    for direction in sent:
        sent[direction] = sum(1 for _ in LogFile(log).frames("autopilot", direction))
    link = mavutil.mavlink_connection(str(target), robust_parsing=False)
    kinds: dict[str, int] = {}
    while (message := link.recv_match()) is not None:
        kinds[message.get_type()] = kinds.get(message.get_type(), 0) + 1
    link.close()
    assert sum(kinds.values()) == count == sum(sent.values())
    assert "BAD_DATA" not in kinds
    assert kinds["ATTITUDE"] >= 18 * SPAN_S and kinds["RC_CHANNELS_OVERRIDE"] >= 18 * (SPAN_S - 5)


def table(path: Path) -> list[dict[str, Any]]:
    """Rows of an exported table, empty cells as None."""
    if path.suffix == ".parquet":
        rows: list[dict[str, Any]] = pq.read_table(path).to_pylist()
        return rows
    readers = {float: float, int: int, str: str, bool: {"true": True, "false": False}.__getitem__}
    with path.open(newline="") as file:
        return [
            {name: readers[COLUMNS[name]](cell) if cell else None for name, cell in row.items()}
            for row in csv.DictReader(file)
        ]


def test_tables_have_a_row_for_each_tick(log: Path, tmp_path: Path) -> None:
    outputs = [decode_outputs(data) for _, data in LogFile(log).ticks() if data is not None]
    for ending in (".csv", ".parquet"):
        target = tmp_path / f"run{ending}"
        assert export_log(log, target) == Exported(count=len(outputs), damage=None, warnings=())
        rows = table(target)
        assert [list(row) for row in rows[:1]] == [list(COLUMNS)]
        assert [row["unix_ns"] for row in rows] == [tick.t_ns for tick in outputs]
        for row, tick in zip(rows, outputs, strict=True):
            estimate, control = tick.estimate, tick.control
            assert row["phase"] == tick.phase and row["code"] == tick.health.code
            assert row["n_m"] == (estimate.n_m if estimate else None)
            assert (row["pwm_port_us"], row["pwm_starboard_us"]) == (tick.pwm_us or (None, None))
            assert row["command_port"] == (control.command[0] if control else None)
            assert row["solution_ok"] == (control.ok if control else None)
        held = [row for row in rows if row["phase"] == Phase.HOLD]
        assert held and all(row["step_ms"] > 0.0 and row["overrun"] is False for row in held)
        truth = read_run(log).truth
        assert truth is not None
        last = rows[-1]
        assert (last["truth_n_m"], last["truth_e_m"]) == pytest.approx(truth.pose[-1, :2])
    both = [table(tmp_path / f"run{ending}") for ending in (".csv", ".parquet")]
    assert [{k: v or None for k, v in row.items()} for row in both[0]] == [
        {k: v or None for k, v in row.items()} for row in both[1]
    ]  # an empty text and no text are the same in CSV


def test_a_station_that_moves_has_its_velocity_in_the_row(log: Path) -> None:
    ticks = [decode_outputs(data) for _, data in LogFile(log).ticks() if data is not None]
    outputs = next(tick for tick in reversed(ticks) if tick.station is not None)
    moving = changed(outputs, station=Station(n_m=1.0, e_m=2.0, psi_rad=0.5, vn_mps=0.3, ve_mps=-0.1))
    for tick, velocity in (
        (moving, (0.3, -0.1)),
        (outputs, (0.0, 0.0)),
        (changed(outputs, station=None), (None, None)),
    ):
        row = dict(zip(COLUMNS, export._row(tick, 0.0, None, None), strict=True))
        assert (row["station_vn_mps"], row["station_ve_mps"]) == velocity


@pytest.mark.parametrize(("by_s", "words"), [(3e8, "time jumps by"), (-10.0, "time jumps by"), (3.0, "no tick for")])
def test_times_of_rows_are_those_of_the_report(log: Path, tmp_path: Path, by_s: float, words: str) -> None:
    path = shifted(log, tmp_path / "shifted.mcap", by_s, 100)
    for target in (tmp_path / "run.csv", tmp_path / "run.tlog"):
        said = call("log", "export", path.name, target.name, cwd=tmp_path)
        assert said.status == 0 and f"{path.name}: {words}" in said.out
    rows = table(tmp_path / "run.csv")
    assert rows[-1]["t_s"] == pytest.approx(read_run(path).duration_s, abs=1e-6)
    jump_s = 0.05 if words == "time jumps by" else 0.05 + by_s
    assert rows[99]["t_s"] - rows[98]["t_s"] == pytest.approx(jump_s, abs=1e-6)


def test_times_of_rows_begin_with_the_first_tick(tmp_path: Path) -> None:
    recorder = make_recorder(tmp_path / "late.mcap")
    recorder.write_inputs(sample_inputs(0))
    record_ticks(recorder, range(1, 40))
    recorder.close()
    export_log(tmp_path / "late.mcap", tmp_path / "late.csv")
    assert table(tmp_path / "late.csv")[0]["t_s"] == pytest.approx(0.05)


def test_a_log_without_its_end_is_exported_as_far_as_it_goes(log: Path, tmp_path: Path) -> None:
    data = log.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: len(data) // 2])
    exported = export_log(cut, tmp_path / "cut.csv")
    assert exported.damage is not None and "no end: cut off in the record at byte" in exported.damage
    assert exported.count == sum(data is not None for _, data in LogFile(cut).ticks()) > 0


def test_what_cannot_be_exported_leaves_no_file(log: Path, tmp_path: Path) -> None:
    with pytest.raises(AsvhilError, match=r"run\.xls: a file that ends in \.tlog, \.csv, \.parquet is expected"):
        export_log(log, tmp_path / "run.xls")
    taken = tmp_path / "taken.csv"
    taken.write_text("mine")
    with pytest.raises(AsvhilError, match=r"taken\.csv: exists already"):
        export_log(log, taken)
    assert taken.read_text() == "mine"
    with pytest.raises(AsvhilError, match=r"none/run\.csv: cannot be written \(No such file or directory\)"):
        export_log(log, tmp_path / "none" / "run.csv")
    data = bytearray(log.read_bytes())
    data[chunk_spans(bytes(data))[1][0] + 100] ^= 1
    bad = tmp_path / "bad.mcap"
    bad.write_bytes(data)
    for ending in (".tlog", ".csv", ".parquet"):
        with pytest.raises(
            LogError, match=r"bad\.mcap: chunk at byte \d+: damaged .*`asvhil log recover .*bad\.mcap -o NEW`"
        ):
            export_log(bad, tmp_path / f"bad{ending}")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.mcap", "taken.csv"]


def test_info_tells_the_run_its_holds_and_rates(log: Path) -> None:
    figures = log_info(log)
    assert figures["whole"] and figures["damage"] == []
    assert (figures["mode"], figures["vehicle"], figures["controller"]) == ("lockstep", "wamv16", "lagnet-mpc")
    assert figures["model"] == "wamv16-lagnet.npz" and figures["seed"] == "1"
    assert figures["ticks"] == sum(figures["phases"].values()) and figures["ticks_dropped"] == 0
    assert figures["duration_s"] == pytest.approx(SPAN_S, abs=0.2)
    (hold,) = figures["holds"]
    assert 1.0 < hold["from_s"] < 6.0 and hold["to_s"] > SPAN_S - 1.0 and "released" in hold["ended"]
    rates = {channel["topic"]: channel["rate_hz"] for channel in figures["channels"]}
    assert rates["/asvhil/inputs"] == pytest.approx(20.0, rel=0.01)
    assert rates["/frames/anemometer/in"] == pytest.approx(5.0, rel=0.05)
