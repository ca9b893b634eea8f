"""Progress on a pipe: a line now and then, and no empty ones."""

import io
from pathlib import Path

import pytest
from rich.console import Console

from asvhil.commands import piped_progress
from asvhil.commands.views import progress, stage_bar
from tests.support.command_line import call
from tests.support.phase_logs import hold, record_phases


def lines_of(work: int, total: float | None, monkeypatch: pytest.MonkeyPatch, *, spinner: bool = False) -> list[str]:
    seconds = iter(range(1000))  # a step of work takes one
    monkeypatch.setattr(piped_progress.time, "monotonic", lambda: float(next(seconds)))
    out = io.StringIO()
    with progress(Console(file=out), spinner=spinner) as bar:
        task = bar.add_task("drive [1/2]", total=total)
        for _ in range(work):
            bar.advance(task)
    return out.getvalue().splitlines()


def test_a_line_after_two_seconds_and_then_every_ten(monkeypatch: pytest.MonkeyPatch) -> None:
    assert lines_of(25, 50, monkeypatch) == ["drive [1/2]: 4 %", "drive [1/2]: 24 %", "drive [1/2]: 44 %"]
    assert lines_of(11, None, monkeypatch) == ["drive [1/2]: 2"]


def test_a_count_without_a_total_has_its_unit(monkeypatch: pytest.MonkeyPatch) -> None:
    assert lines_of(11, None, monkeypatch, spinner=True) == ["drive [1/2]: 2 ticks"]


def test_the_page_of_a_report_tells_how_far_the_log_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record_phases(tmp_path / "a.mcap", hold(200))
    monkeypatch.setattr(piped_progress, "FIRST_S", 0.0)
    monkeypatch.setattr(piped_progress, "EVERY_S", 0.0)
    said = call("report", "a.mcap", "--html", "a.html", cwd=tmp_path).out.splitlines()
    assert "report: reading a.mcap: 150 ticks" in said and "report: drawing motors" in said
    assert not any("%" in line for line in said if line.startswith("report: "))


def test_what_had_a_line_and_is_finished_has_a_last_one(monkeypatch: pytest.MonkeyPatch) -> None:
    assert lines_of(8, 8, monkeypatch) == ["drive [1/2]: 25 %", "drive [1/2]: 100 %"]


def test_what_is_quickly_done_says_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert lines_of(1, 1, monkeypatch) == []
    out = io.StringIO()
    with stage_bar(Console(file=out)) as bar:
        bar.update(bar.add_task("ports"), description="parameters")
    assert out.getvalue() == ""


def test_a_terminal_gets_a_bar() -> None:
    out = io.StringIO()
    with progress(Console(file=out, force_terminal=True)) as bar:
        bar.advance(bar.add_task("drive", total=2))
    assert "drive" in out.getvalue() and "1/2" in out.getvalue()
