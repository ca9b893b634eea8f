"""`asvhil report` in the terminal: what ended the holds, and why there are no scores."""

from __future__ import annotations

from pathlib import Path

import pytest

from asvhil.types import Phase
from tests.support.command_line import call
from tests.support.phase_logs import Ticks, hold, record_phases

REVERSED = "the port motor is reversed"


def test_the_end_of_an_only_hold_is_told_with_its_reason(tmp_path: Path) -> None:
    record_phases(tmp_path / "a.mcap", hold(101), (300, Phase.STANDBY, REVERSED, "motor_fault"))
    said = call("report", "a.mcap", cwd=tmp_path).out
    assert f"0.0 s  hold 1 to 5.0 s, 0.33 m off (estimated), ended by standby: {REVERSED}\n" in said
    assert "no station was held from 10 s on: no scores" in said
    for html in ((), ("--html", "a.html")):
        compared = call("report", "a.mcap", "--compare", "a.mcap", *html, cwd=tmp_path).out
        assert "a.mcap: no station was held from 10 s on: no scores" in compared
    assert "no station was held from 10 s on: no scores" in (tmp_path / "a.html").read_text()


def test_each_of_several_holds_tells_its_end_and_by_what_its_distance_is_known(tmp_path: Path) -> None:
    neutral = 20, Phase.STANDBY, "the sticks were moved", "pilot"
    record_phases(tmp_path / "a.mcap", hold(101), neutral, hold(100))
    said = call("report", "a.mcap", cwd=tmp_path).out
    assert "hold 1 to 5.0 s, 0.33 m off (estimated), ended by standby: the sticks were moved" in said
    assert "hold 2 to 11.0 s, 0.33 m off (estimated)\n" in said and "released after hold" not in said


@pytest.mark.parametrize("spans", [(hold(100),), (hold(100), (3, Phase.STANDBY, "by the operator", "released"))])
def test_an_only_hold_that_the_run_ends_is_not_told(tmp_path: Path, spans: tuple[Ticks, ...]) -> None:
    record_phases(tmp_path / "a.mcap", *spans)
    said = call("report", "a.mcap", cwd=tmp_path).out
    assert "hold 1" not in said and "no scores" not in said and "penalty score, estimated" in said
