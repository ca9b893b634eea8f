"""Damaged, foreign and empty files at the command line: done, or one line and status 2, never a traceback."""

import contextlib
import json
import random
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from asvhil.commands import cli
from asvhil.commands.outputs import write_json
from asvhil.config import load_config
from asvhil.dynamics.weights import save_model
from asvhil.errors import AsvhilError
from asvhil.sitl import run_lockstep
from tests.support.csv_columns import COLUMNS
from tests.support.damage import odd
from tests.support.model_samples import sample
from tests.support.paths import DATA

COMMANDS = {
    "run.csv": ("evaluate", "net.npz", "--data", "run.csv", "--columns", "map.yaml", "--horizon", "2"),
    "net.npz": ("evaluate", "net.npz", "--data", "run.csv", "--columns", "map.yaml", "--horizon", "2"),
    "map.yaml": ("evaluate", "net.npz", "--data", "run.csv", "--columns", "map.yaml", "--horizon", "2"),
    "drive.tlog": ("replay", "--tlog", "drive.tlog"),
    "log.mcap": ("replay", "log.mcap"),
    "boat.yaml": ("replay", "--tlog", "short.tlog", "--config", "boat.yaml"),
    "signing.key": ("hold", "--config", "boat.yaml", "--set", "links.operator.signing.key_file=signing.key"),
}

# The log is too short to be held against the autopilot, and nothing is there to replay, or to answer.
WHOLE = {"drive.tlog": 1, "boat.yaml": 2, "signing.key": 2}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of each kind as it should be."""
    place = tmp_path_factory.mktemp("whole")
    (place / "map.yaml").write_text(COLUMNS)
    (place / "boat.yaml").write_text("base: field\nlinks: {operator: {endpoint: 'tcp:127.0.0.1:9'}}\n")
    (place / "signing.key").write_text("ab" * 32)
    t = np.arange(0.0, 40.0, 0.2)
    lines = [f"{at:.3f},{np.sin(at):.4f},0.1,{np.cos(at):.4f},0.2,0.3" for at in t]
    (place / "run.csv").write_text("\n".join(["t,u,v,r,left,right", *lines]))
    save_model(place / "net.npz", sample("nnsem"))
    tlog = (DATA / "ardurover-4.6.3-json-boat-drive.tlog").read_bytes()
    (place / "drive.tlog").write_bytes(tlog[:3971])
    (place / "short.tlog").write_bytes(b"")
    run_lockstep(load_config("sitl", ("controller.name=loiter",)), place / "log.mcap", 3.0)
    return place


def call(
    arguments: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> tuple[int, str]:
    """The exit status, and what was written to stderr."""
    monkeypatch.setattr(sys, "argv", ["asvhil", *arguments])
    capfd.readouterr()
    code = 0
    try:
        cli.main()
    except SystemExit as end:
        code = int(end.code or 0)
    return code, capfd.readouterr().err


@pytest.mark.parametrize("name", COMMANDS)
def test_odd_files_are_one_line(
    name: str, whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(whole, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    assert call(COMMANDS[name], monkeypatch, capfd)[0] == WHOLE.get(name, 0)
    noise, data, refused = random.Random(len(name)), (whole / name).read_bytes(), 0
    for number in range(10):
        Path(name).write_bytes(odd(data, noise, number))
        code, err = call(COMMANDS[name], monkeypatch, capfd)
        assert code in (0, WHOLE.get(name, 0), 2) and "Traceback" not in err, (number, err)
        if code == 2:
            refused += 1
            assert err.startswith("asvhil: ") and err.count("\n") == 1, (number, err)
    assert refused >= 4


@pytest.mark.parametrize("name", COMMANDS)
def test_a_folder_or_another_file_in_its_place_is_one_line(
    name: str, whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(whole, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    for other in [None, *(other for other in COMMANDS if other != name)]:
        Path(name).unlink()
        if other is None:
            Path(name).mkdir()
        else:
            shutil.copy(whole / other, name)
        code, err = call(COMMANDS[name], monkeypatch, capfd)
        assert code == 2 and err.startswith("asvhil: ") and err.count("\n") == 1, (other, err)
        if other is None:
            Path(name).rmdir()
            Path(name).touch()


@pytest.mark.parametrize(
    ("arguments", "kept"),
    [
        (("report", "log.mcap", "--json", "log.mcap"), "log.mcap"),
        (("log", "info", "log.mcap", "--json", "log.mcap"), "log.mcap"),
        (("replay", "log.mcap", "--json", "log.mcap"), "log.mcap"),
        (("log", "recover", "log.mcap", "-o", "new.mcap", "--json", "log.mcap"), "log.mcap"),
        (("report", "log.mcap", "--compare", "other.mcap", "--json", "other.mcap"), "other.mcap"),
        (("report", "log.html", "--html", "log.html"), "log.html"),
        (("report", "log.mcap", "--json", "map.yaml"), "map.yaml"),
        (("calibrate", "log.mcap", "-o", "log.mcap"), "log.mcap"),
        (("config", "schema", "-o", "log.mcap"), "log.mcap"),
        (("config", "schema", "-o", "boat.yaml"), "boat.yaml"),
    ],
)
def test_what_is_read_is_not_written_over(
    arguments: tuple[str, ...],
    kept: str,
    whole: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    shutil.copytree(whole, tmp_path, dirs_exist_ok=True)
    for copy in ("other.mcap", "log.html"):
        shutil.copy(tmp_path / "log.mcap", tmp_path / copy)
    monkeypatch.chdir(tmp_path)
    before = Path(kept).read_bytes()
    code, said = call(arguments, monkeypatch, capfd)
    assert Path(kept).read_bytes() == before
    assert code == 2 and len(said.splitlines()) == 1 and kept in said, said


def test_a_log_that_is_to_be_written_is_no_place_for_the_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    run = ("sitl", "--lockstep", "--duration", "1", "--no-picture", "--log", "new.mcap", "--json", "new.mcap")
    code, said = call(run, monkeypatch, capfd)
    assert code == 2 and "--json new.mcap: is the file of --log too" in said and not list(tmp_path.iterdir())


def test_a_log_that_has_just_been_written_is_not_written_over(tmp_path: Path) -> None:
    path = tmp_path / "new.mcap"
    path.write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(AsvhilError, match=r"--json .*new\.mcap: is a log, which is never overwritten"):
        write_json(path, {})


def test_a_station_that_is_to_be_too_fast_is_refused_before_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    code, said = call(("sitl", "--lockstep", "--drift", "2@0", "--no-picture"), monkeypatch, capfd)
    assert code == 2 and "supervisor.station.speed_mps: 2 m/s" in said and not list(tmp_path.iterdir())


def test_a_log_that_is_not_whole_is_reported_exported_and_replayed_up_to_there_and_said_so(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    data = (whole / "log.mcap").read_bytes()
    Path("cut.mcap").write_bytes(data[: len(data) * 2 // 3])
    for command in (
        ("report", "cut.mcap", "--json", "r.json"),
        ("log", "export", "cut.mcap", "cut.csv"),
        ("replay", "cut.mcap"),
    ):
        monkeypatch.setattr(sys, "argv", ["asvhil", *command])
        with contextlib.suppress(SystemExit):
            cli.main()
        said = capfd.readouterr().out
        assert "cut.mcap: no end: cut off in the record at byte" in said, (command, said)
    assert json.loads(Path("r.json").read_text())["damage"].startswith("cut.mcap: no end")
