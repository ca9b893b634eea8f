"""What `asvhil study` leaves: checked before anything runs, tables before pictures, and errors of one line."""

import json
import sys
from pathlib import Path

import pytest
from rich.console import Console

from asvhil.commands.cli import main
from asvhil.commands.study_views import check_output, finish
from asvhil.errors import AsvhilError
from asvhil.study.page import MARKER


def mistake(arguments: list[str], monkeypatch, capsys) -> str:
    """The one line that a command ends with."""
    monkeypatch.setattr(sys, "argv", ["asvhil", "study", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said


def nothing_runs(*arguments, **keys):
    raise AssertionError("it was to be refused before anything runs")


@pytest.fixture
def idle(monkeypatch):
    """No study, search or solver may begin: each of them does so under a progress bar."""
    monkeypatch.setattr("asvhil.commands.study_views.progress", nothing_runs)


@pytest.mark.usefixtures("idle")
@pytest.mark.parametrize(
    ("study", "stem"),
    [
        ("bound", "bound"),
        ("six-tests", "six-tests"),
        ("solvers", "solvers"),
        ("approach", "approach"),
        ("robustness", "robustness"),
        ("learned-loop", "learned-loop"),
        ("boat-models", "boat-models"),
        ("estimator", "estimator"),
        ("models", "models"),
    ],
)
def test_what_cannot_be_written_is_said_before_anything_runs(study, stem, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path(f"out/{stem}.png").mkdir(parents=True)
    said = mistake([study, "-o", "out"], monkeypatch, capsys)
    assert f"out/{stem}.png: cannot be written (Is a directory)" in said
    said = mistake([study, "-o", "other", "--json", "nowhere/figures.json"], monkeypatch, capsys)
    assert "--json nowhere/figures.json: cannot be written (No such file or directory)" in said


@pytest.mark.parametrize("ending", ["png", "md", "json"])
def test_each_file_that_a_study_leaves_is_checked(ending, tmp_path):
    (tmp_path / f"bound.{ending}").mkdir()
    with pytest.raises(AsvhilError, match=rf"bound\.{ending}: cannot be written \(Is a directory\)"):
        check_output(tmp_path, "bound", None)


def test_a_check_leaves_nothing_but_the_folder(tmp_path):
    check_output(tmp_path / "out", "six-tests", tmp_path / "figures.json")
    assert [path.name for path in tmp_path.iterdir()] == ["out"] and not list((tmp_path / "out").iterdir())


def test_a_picture_that_fails_takes_no_table_with_it(tmp_path):
    def draw(path: Path) -> None:
        raise OSError(28, "No space left on device")

    figures = {"ps": 1.0}
    with pytest.raises(AsvhilError, match=r"six-tests\.png: cannot be written \(No space left on device\)"):
        finish(Console(), tmp_path, "six-tests", figures, lambda _: "| ps |\n", tmp_path / "out.json", draw)
    assert json.loads((tmp_path / "six-tests.json").read_text()) == figures
    assert json.loads((tmp_path / "out.json").read_text()) == figures
    assert "| ps |" in (tmp_path / "six-tests.md").read_text(encoding="utf-8")


@pytest.mark.usefixtures("idle")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["solvers", "--peer", '"'], '--peer ": no command (No closing quotation)'),
        (["solvers", "--peer", "/nowhere/python peer.py"], "--peer /nowhere/python: no such program"),
        (["solvers", "--horizon", "inf"], "--horizon inf: a finite number is expected"),
        (["solvers", "--horizon", "nan"], "--horizon nan: a finite number is expected"),
        (["solvers", "--horizon", "1e9"], "--horizon 1e+09: 0.4 to 40 s are expected"),
        (["six-tests", "--seeds", "0"], "'--seeds': a number of 1 or more is expected, not 0; `asvhil study six-tests"),
        (
            ["six-tests", "--seeds", "100000000000"],
            "'--seeds': a number of 10000 or less is expected, not 100000000000",
        ),
        (["approach", "--runs", "100000000000"], "'--runs': a number of 100000 or less is expected, not 100000000000"),
        (["soak", "--hours", "long"], "'--hours': a number is expected, not long"),
        (["waves", "--workers", "1.5"], "'--workers': a whole number is expected, not 1.5"),
        (["robustness", "--models", "typo"], "--models typo: no such folder"),
        (["learned-loop", "--models", "typo"], "--models typo: no such folder"),
        (["changed-boats", "--boat-models", "typo"], "typo/wamv16-second-boat-lagnet.npz: no model of this boat"),
        (["bound", "--wind", "3@90", "--wind", "6@"], "--wind 6@: SPEED@DEG is expected"),
    ],
)
def test_a_mistake_is_one_line_before_anything_runs(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert words in mistake(arguments, monkeypatch, capsys)
    assert not list(tmp_path.iterdir())


def test_a_wind_without_a_bound_is_named(tmp_path, monkeypatch, capsys):
    def none(model, wind_mps, *arguments):
        raise RuntimeError(f"no periodic motion was found in a wind of {wind_mps:g} m/s")

    monkeypatch.setattr("asvhil.study.bound.bound", none)
    said = mistake(["bound", "--wind", "60@90", "-o", str(tmp_path)], monkeypatch, capsys)
    assert "--wind 60@90: no periodic motion was found in a wind of 60 m/s; give less wind" in said


def test_what_people_wrote_above_the_marker_stays_as_it_is(tmp_path):
    page = tmp_path / "six-tests.md"
    finish(Console(), tmp_path, "six-tests", {}, lambda _: "| first |\n", None)
    assert page.read_text(encoding="utf-8") == f"{MARKER}\n\n| first |\n"
    written = "# Die sechs Tests: 5 ± 1°\r\n\n".encode()
    page.write_bytes(written + page.read_bytes())
    finish(Console(), tmp_path, "six-tests", {}, lambda _: "| second ± |\n", None)
    assert page.read_bytes() == written + f"{MARKER}\n\n| second ± |\n".encode()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["six-tests.json", "six-tests.md"]


@pytest.mark.usefixtures("idle")
def test_a_file_in_the_place_of_the_folder_is_named(tmp_path, monkeypatch, capsys):
    (tmp_path / "file").write_text("mine")
    said = mistake(["robustness", "-o", str(tmp_path / "file")], monkeypatch, capsys)
    assert "file: is a file; the name of a folder is expected" in said
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.usefixtures("idle")
def test_a_page_without_the_marker_is_refused_and_left_alone(tmp_path, monkeypatch, capsys):
    page = tmp_path / "robustness.md"
    page.write_text("someone's words\n")
    said = mistake(["robustness", "-o", str(tmp_path)], monkeypatch, capsys)
    assert f"robustness.md: would be overwritten; add the line {MARKER}" in said
    assert page.read_text() == "someone's words\n"


def test_a_quick_run_stands_beside_the_full_tables(tmp_path, monkeypatch):
    monkeypatch.setattr("asvhil.study.robustness.study_robustness", lambda *arguments, **keys: {})
    monkeypatch.setattr("asvhil.study.robustness.markdown", lambda figures: "| quick |\n")
    (tmp_path / "robustness.md").write_text(f"{MARKER}\n\nfull\n")
    monkeypatch.setattr(sys, "argv", ["asvhil", "study", "robustness", "--quick", "-o", str(tmp_path)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    assert "full" in (tmp_path / "robustness.md").read_text()
    assert "| quick |" in (tmp_path / "robustness-quick.md").read_text()
