"""Progress on a pipe: a line now and then, and no empty ones."""

import io

import pytest
from rich.console import Console

from asvhil.commands import piped_progress
from asvhil.commands.views import progress, stage_bar


def lines_of(work: int, total: float | None, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    seconds = iter(range(1000))  # a step of work takes one
    monkeypatch.setattr(piped_progress.time, "monotonic", lambda: float(next(seconds)))
    out = io.StringIO()
    with progress(Console(file=out)) as bar:
        task = bar.add_task("drive [1/2]", total=total)
        for _ in range(work):
            bar.advance(task)
    return out.getvalue().splitlines()


def test_a_line_after_two_seconds_and_then_every_ten(monkeypatch: pytest.MonkeyPatch) -> None:
    assert lines_of(25, 50, monkeypatch) == ["drive [1/2]: 4 %", "drive [1/2]: 24 %", "drive [1/2]: 44 %"]
    assert lines_of(11, None, monkeypatch) == ["drive [1/2]: 2"]


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
