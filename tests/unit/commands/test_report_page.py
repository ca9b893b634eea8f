"""`asvhil report --html`: one page that needs nothing else, in a real browser; and two logs side by side."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from asvhil.commands.cli import main
from asvhil.config import load_config
from asvhil.logs.opening import open_recorder
from asvhil.sitl import run_lockstep
from asvhil.types import Note, changed
from tests.support import page_bench
from tests.support.arduino_driver import must_run
from tests.support.browser import chromium, shown
from tests.support.log_samples import record_ticks, sample_inputs, sample_outputs

MOST_BYTES = 5_000_000
FIGURES = {"track", "errors", "wind", "docking", "motors", "model", "timing"}
Runs = Callable[[str], Path]


def report(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr("sys.argv", ["asvhil", "report", *map(str, arguments)])
    try:
        main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def record_live(log: Path) -> None:
    """Some ticks as on a boat, where no simulator tells the truth."""
    recorder = open_recorder(load_config("field"), log, "live", threaded=False)
    record_ticks(recorder, range(1, 200))
    recorder.close()


@pytest.fixture(scope="module")
def page(run_logs: Runs, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of the log with two holds."""
    html = tmp_path_factory.mktemp("page") / "run.html"
    with pytest.MonkeyPatch.context() as patch:
        assert report(patch, run_logs("two_holds"), "--html", html) == 0
    return html


def test_the_page_is_whole_and_needs_nothing_else(page: Path) -> None:
    text = page.read_text()
    assert len(text) < MOST_BYTES
    addresses = re.findall(r"""(?:src|href|srcset|action)\s*=\s*["']([^"']*)""", text) + re.findall(
        r"url\(([^)]*)", text
    )
    assert len(addresses) == len(FIGURES) and all(one.startswith("data:image/png;base64,") for one in addresses)
    assert "<script" not in text and "@import" not in text
    assert {file.stem.removeprefix("run-") for file in page.parent.glob("run-*.png")} == FIGURES
    for file in page.parent.glob("run-*.png"):
        assert file.read_bytes().startswith(b"\x89PNG")


def test_the_page_has_holds_failsafe_releases_and_their_reasons(page: Path) -> None:
    text = page.read_text()
    row = re.compile(r"<tr[^>]*>(.*?)</tr>", re.S)
    rows = [re.sub(r"<[^>]+>", "|", part) for part in row.findall(text)]
    for words in (
        ("hold 1", "failsafe: position or heading is stale"),
        ("fail-safe", "position or heading is stale"),
        ("released", "autopilot heartbeat lost"),
        ("hold 2", "standby: released by the operator"),
        ("energy from the battery, curve (Wh)",),
    ):
        assert any(all(word in one for word in words) for one in rows), words
    assert any("gnss position" in one and "silent" in one for one in rows), "events with their reasons"
    assert "seed 1" in text and "UTC" not in text.partition("<h2>")[0]


@pytest.fixture
def browser() -> None:
    if chromium() is None:
        words = "chromium is not installed (tests/page/install-tools.sh)"
        if must_run():
            pytest.fail(words)
        pytest.skip(words)


@pytest.mark.usefixtures("browser")
def test_a_page_that_asks_elsewhere_is_noticed(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text('<img src="http://192.0.2.1/a.png">')
    assert shown(page, tmp_path)[1] == ["http://192.0.2.1/a.png"]


@pytest.mark.usefixtures("browser")
def test_a_browser_shows_it_and_asks_nobody(page: Path, tmp_path: Path) -> None:
    picture, asked = shown(page, tmp_path)
    assert asked == []
    ink = (picture.min(axis=2) < 0.9).mean(axis=1)  # of each row of pixels
    assert (ink > 0.01).mean() > 0.4, "text and figures from top to bottom"
    red = (picture[:, :, 0] > 0.6) & (picture[:, :, 1:].max(axis=2) < 0.3)
    assert np.count_nonzero(red) > 300, "the fail-safe stands in red, and the figures are there"


@pytest.mark.usefixtures("browser")
def test_it_is_read_on_a_phone_and_at_night(page: Path) -> None:
    """No wider than the screen, with every table to be scrolled to its end; and light on dark where that is wanted."""
    with page_bench.browser() as program:
        night = program.new_page(viewport={"width": 390, "height": 844}, color_scheme="dark")
        night.goto(page.resolve().as_uri())
        assert night.evaluate("document.documentElement.scrollWidth") == 390
        outside = "[...document.querySelectorAll('table')].filter(t => t.parentElement.scrollWidth < t.offsetWidth)"
        assert night.evaluate(f"{outside}.length") == 0
        levels = [night.evaluate(f"getComputedStyle(document.body).{name}") for name in ("color", "backgroundColor")]
        ink, paper = (sum(map(int, re.findall(r"\d+", level)[:3])) for level in levels)
        assert ink > 600 and paper < 100
        night.close()


def test_only_a_trouble_is_told_to_be_as_it_should_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log, html = tmp_path / "log.mcap", tmp_path / "run.html"
    recorder = open_recorder(load_config("field"), log, "live", threaded=False)
    notes = Note(subject="moving station", text="to the north", ok=True), Note(subject="winds", text="lost", ok=False)
    for tick in range(40):
        outputs = sample_outputs(tick)
        health = changed(outputs.health, notes=notes if tick < 20 else ())
        recorder.write_inputs(sample_inputs(tick))
        recorder.write_outputs(changed(outputs, health=health))
    recorder.close()
    assert report(monkeypatch, log, "--html", html) == 0
    text = html.read_text()
    assert "<td>moving station</td><td>over</td>" in text and "<td>winds</td><td>as it should be again</td>" in text


@pytest.mark.thorough
def test_two_logs_side_by_side(
    run_logs: Runs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    html, figures = tmp_path / "both.html", tmp_path / "both.json"
    logs = run_logs("two_holds"), run_logs("bream")
    assert report(monkeypatch, logs[0], "--compare", logs[1], "--html", html, "--json", figures) == 0
    text = html.read_text()
    assert len(text) < MOST_BYTES and text.count("<section>") == 2
    assert text.index("two_holds.mcap and bream.mcap") < text.index("<section>")
    tree = json.loads(figures.read_text())
    a, b = (part["truth"]["distance_m"]["mean"] for part in (tree, tree["compared"]))
    assert f'<td class="n">{b - a:+.3f}</td>' in text and "│ distance, truth, mean (m)" in capsys.readouterr().out
    assert {file.stem for file in tmp_path.glob("*.png")} >= {"both-compare", "both-track-1", "both-track-2"}


def test_a_real_run_has_its_date_and_no_seed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = tmp_path / "log.mcap"
    record_live(log)
    assert report(monkeypatch, log, "--html", tmp_path / "run.html", "--json", tmp_path / "run.json") == 0
    head = (tmp_path / "run.html").read_text().partition("<h2>")[0]
    assert "2026-09-21 14:13:20 UTC" in head and "seed" not in head
    figures = json.loads((tmp_path / "run.json").read_text())
    assert figures["seed"] is None and figures["wind"]["configured"] is None and figures["simulated"] is False


def test_what_a_log_says_is_text_in_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A name with the signs of HTML, as a strange log may have it."""
    log = tmp_path / "<b>log.mcap"
    record_live(log)
    assert report(monkeypatch, log, "--html", tmp_path / "run.html") == 0
    text = (tmp_path / "run.html").read_text()
    assert "<b>log" not in text and "&lt;b&gt;log" in text


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--html", "run.txt"), "--html run.txt: a file that ends in .html is expected"),
        (("--html", "nowhere/run.html"), "--html nowhere/run.html: cannot be written (No such file or directory)"),
        (("--compare", "nowhere.mcap"), "nowhere.mcap: cannot be read (No such file or directory)"),
    ],
)
def test_a_mistake_is_one_line(
    arguments: tuple[str, str],
    words: str,
    run_logs: Runs,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert report(monkeypatch, run_logs("bream"), *arguments) == 2
    assert capsys.readouterr().err == f"asvhil: {words}\n"


def of_field(log: Path, ticks: int, config: str = "field") -> Path:
    """A log of this many ticks of a boat's own."""
    recorder = open_recorder(load_config(config), log, "live", threaded=False)
    record_ticks(recorder, range(1, ticks + 1))
    recorder.close()
    return log


def test_a_comparison_tells_of_damage_of_boats_and_of_windows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, cut = of_field(tmp_path / "whole.mcap", 200), of_field(tmp_path / "cut.mcap", 100, "blueboat")
    cut.write_bytes(cut.read_bytes()[:-40])
    html = tmp_path / "both.html"
    for extra in ((), ("--html", html)):
        assert report(monkeypatch, whole, "--compare", cut, *extra) == 0
        text = " ".join(capsys.readouterr().out.split())
        notes = [
            f"{cut}: no end: cut off in the record at byte",
            "the boats differ, wamv16 and blueboat",
            "the windows differ: scored from 5.0 s and from 2.5 s on",
        ]
        assert all(note in text for note in notes)
        for row in ("vehicle", "controller", "duration (s)", "scored from (s)"):
            assert f"│ {row} │" in text
    page = html.read_text()
    assert all(note in page for note in notes) and "<td>vehicle</td>" in page


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("placed", [True, False])
def test_a_log_of_one_tick_is_drawn_without_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, placed: bool
) -> None:
    log = tmp_path / "one.mcap"
    if placed:
        of_field(log, 1)
    else:  # nothing has been measured yet
        run_lockstep(load_config("sitl"), log, 0.01)
    assert report(monkeypatch, log, "--html", tmp_path / "one.html", "--picture", tmp_path / "one.png") == 0
