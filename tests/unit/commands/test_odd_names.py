"""File names that are not UTF-8, as on old USB sticks, and a working directory that is gone: no traceback."""

import os
import shutil
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from asvhil.commands.cli import main
from asvhil.config import load_config
from asvhil.errors import ConfigError
from asvhil.files import shown
from asvhil.logs.figure import save_figure
from asvhil.sitl import run_lockstep, run_realtime
from asvhil.study.campaigns.design import plan
from asvhil.study.campaigns.spec import read_spec
from asvhil.study.campaigns.table import row_of, write_parquet
from asvhil.study.page import write_page
from tests.support.command_line import call

ODD = "l\udcf6g"  # as Python has the bytes of l, f6 and g
READ = r"l\xf6g"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("odd") / f"{ODD}.mcap"
    run_lockstep(load_config("sitl", ("controller.name=nnsem-mpc",)), path, 8.0)
    shutil.copy(path, path.with_name("other.mcap"))
    return path


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        ("log", "log"),
        ("lög", "lög"),
        (ODD, READ),
        ("l\udcc3\udcb6g", "lög"),  # of the locale POSIX
        ("l\ud800g", r"l\ud800g"),
    ],
)
def test_how_a_name_is_shown(text: str, seen: str) -> None:
    assert shown(text) == seen


@pytest.mark.parametrize("more", [(), ("--compare", "other.mcap")])
def test_a_page_of_a_log_with_such_a_name(log: Path, more: tuple[str, ...]) -> None:
    said = call("report", log.name, *more, "--html", "page.html", "--json", f"{ODD}.json", cwd=log.parent)
    assert said.status == 0, said
    assert f"{READ}.mcap" in (log.parent / "page.html").read_text(encoding="utf-8")
    assert (log.parent / f"{ODD}.json").exists()


def test_pictures_pages_and_tables_with_such_names(tmp_path: Path) -> None:
    figure = Figure()
    axes = figure.subplots()
    axes.set_title(ODD)
    axes.plot([1.0, 2.0], label=ODD)
    axes.legend()
    save_figure(figure, tmp_path / f"{ODD}.png")
    assert axes.get_title() == READ
    write_page(tmp_path / f"{ODD}.md", f"of {ODD}\n")
    assert f"of {READ}\n" in (tmp_path / f"{ODD}.md").read_text(encoding="utf-8")
    pq = pytest.importorskip("pyarrow.parquet")
    file = tmp_path / f"{ODD}.yaml"
    file.write_text("config: sitl\ndesign: {kind: grid}\nparameters: {wind_speed: [3, 6]}\nwindow_s: [5, 10]\n")
    spec, _, _ = read_spec(file)
    run, *_ = plan(spec)
    write_parquet(spec, [row_of(run, {}, ODD)], table := tmp_path / f"{ODD}.parquet")
    with table.open("rb") as opened:
        assert pq.read_table(opened)["error"].to_pylist() == [READ]


def test_a_run_in_real_time_in_such_a_folder_is_refused_in_one_line(tmp_path: Path) -> None:
    (folder := tmp_path / ODD).mkdir()
    with pytest.raises(ConfigError, match="its serial lines need a folder whose path is plain text in UTF-8"):
        run_realtime(load_config("sitl"), folder, folder / "log.mcap", 2.0, lambda status: None)


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (("config", "check", "sitl"), 0),  # which needs nothing of it
        (("sitl", "--lockstep", "--duration", "2"), 2),
        (("report", "log.mcap"), 2),
    ],
)
def test_a_working_directory_that_is_gone(
    arguments: tuple[str, ...],
    status: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (gone := tmp_path / "gone").mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    monkeypatch.setattr("sys.argv", ["asvhil", *arguments])
    with pytest.raises(SystemExit) as end:
        main()
    monkeypatch.undo()
    words = "asvhil: the folder that it was started in is not there any more; go to another\n"
    assert (end.value.code, capsys.readouterr().err) == (status, words if status else "")
    assert os.getcwd()
