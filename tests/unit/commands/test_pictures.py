"""A picture that cannot be written is one line on stderr, whichever command draws it."""

import json
import sys
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from asvhil.commands.cli import main
from asvhil.errors import AsvhilError
from asvhil.logs.figure import save_figure
from tests.support.paths import ROOT

NNSEM = str(ROOT / "config" / "models" / "wamv16-nnsem.npz")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "log.mcap"
    assert run("sitl", "--lockstep", "--duration", "40", "--log", str(path), "--no-picture", cwd=path.parent) == 0
    return path


def run(*arguments: str, cwd: Path) -> int:
    """The exit status of the command."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(cwd)
        patch.setattr(sys, "argv", ["asvhil", *arguments])
        try:
            main()
        except SystemExit as end:
            return int(end.code or 0)
    return 0


BAD = [
    ("nowhere/run.png", "--picture nowhere/run.png: cannot be written (No such file or directory)"),
    ("taken.png", "--picture taken.png: cannot be written (Is a directory)"),
    ("run.bmp", "--picture run.bmp: a file that ends in .png, .svg, .pdf is expected"),
    ("run", "--picture run: a file that ends in .png, .svg, .pdf is expected"),
]


@pytest.mark.parametrize(("picture", "words"), BAD)
@pytest.mark.parametrize("command", ["report", "evaluate"])
def test_a_picture_that_cannot_be_is_refused_before_the_work(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str, picture: str, words: str
) -> None:
    (tmp_path / "taken.png").mkdir()
    capsys.readouterr()
    arguments = [command, str(log)] if command == "report" else [command, NNSEM, "--data", str(log), "--horizon", "5"]
    assert run(*arguments, "--picture", picture, cwd=tmp_path) == 2
    said = capsys.readouterr()
    assert said.err == f"asvhil: {words}\n" and said.out == ""


def test_a_good_picture_is_drawn_by_both(log: Path, tmp_path: Path) -> None:
    assert run("report", str(log), "--picture", "run.PNG", cwd=tmp_path) == 0
    evaluate = ("evaluate", NNSEM, "--data", str(log), "--horizon", "5", "--every", "2", "--picture", "rollout.svg")
    assert run(*evaluate, cwd=tmp_path) == 0
    assert (tmp_path / "run.PNG").read_bytes().startswith(b"\x89PNG")
    assert "<svg" in (tmp_path / "rollout.svg").read_text()


def test_sitl_says_before_the_run_that_there_is_no_place_for_its_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "run.png").mkdir()
    assert run("sitl", "--lockstep", "--duration", "5", "--log", "run.mcap", cwd=tmp_path) == 2
    assert capsys.readouterr().err == "asvhil: run.png: cannot be written (Is a directory)\n"
    assert run("sitl", "--lockstep", "--duration", "5", "--log", "other.png", cwd=tmp_path) == 2
    assert "--log other.png: the picture goes there; name the log .mcap" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["run.png"]  # no log, and no folder for one


@pytest.mark.thorough
def test_a_picture_of_a_training_that_fails_leaves_the_model(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("torch")
    assert run("collect", "--duration", "70", "--wind", "6@90", "-o", "data.mcap", cwd=tmp_path) == 0
    (tmp_path / "sd.curve.png").symlink_to("/dev/full")
    capsys.readouterr()
    assert run("train", "sd", "data.mcap", "-o", "sd.npz", "--force", cwd=tmp_path) == 2
    said = capsys.readouterr().err
    assert said == "asvhil: sd.curve.png: cannot be written (No space left on device)\n"
    assert (tmp_path / "sd.npz").stat().st_size > 1000


def test_a_disk_that_fills_up_under_a_picture_is_one_line(tmp_path: Path) -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("no /dev/full here")
    (tmp_path / "run.png").symlink_to(full)
    with pytest.raises(AsvhilError, match=r"run\.png: cannot be written \(No space left on device\)"):
        save_figure(Figure(), tmp_path / "run.png")
    with pytest.raises(AsvhilError, match=r"run\.gif: a picture ends in \.png, \.svg, \.pdf"):
        save_figure(Figure(), tmp_path / "run.gif")


def test_figures_that_cannot_be_written_are_told_before_the_work(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    for arguments in (["report", str(log)], ["sitl", "--lockstep"], ["collect"], ["check", "sitl"]):
        assert run(*arguments, "--json", "nowhere/figures.json", cwd=tmp_path) == 2
        said = capsys.readouterr()
        assert said.err == "asvhil: --json nowhere/figures.json: cannot be written (No such file or directory)\n"
        assert said.out == "" and not list(tmp_path.iterdir())
    assert run("report", str(log), "--json", "figures.json", cwd=tmp_path) == 0
    assert json.loads((tmp_path / "figures.json").read_text())["ticks"] > 0
