"""The checks above find firmware that is wrong: one level of the ladder, no debouncing, a plain sum for the mean."""

import itertools
from pathlib import Path

import pytest

from tests.support.arduino_driver import Board, mutated, wrong_directions, wrong_speeds


def test_one_wrong_level_is_caught(tmp_path: Path) -> None:
    elf = mutated(tmp_path, "config.h", ("    8200,    // 45", "    10500,   // 45"))
    (wrong,) = wrong_directions(elf)
    assert wrong.startswith("45.0:")


@pytest.mark.thorough
def test_two_swapped_levels_are_caught(tmp_path: Path) -> None:
    elf = mutated(
        tmp_path,
        "config.h",
        ("    891,     // 67.5\n    1000,    // 90", "    1000,    // 67.5\n    891,     // 90"),
    )
    assert [wrong.partition(":")[0] for wrong in wrong_directions(elf)] == ["67.5", "90.0"]


@pytest.mark.thorough
def test_no_debouncing_is_caught(tmp_path: Path) -> None:
    elf = mutated(tmp_path, "config.h", ("debounce_open_us = 2000;", "debounce_open_us = 0;"))
    assert wrong_speeds(elf, (6.0,)) == []  # a clean contact hides it
    assert len(wrong_speeds(elf, (6.0,), "4 150")) == 2


@pytest.mark.thorough
def test_a_dead_time_instead_of_a_rest_is_caught(tmp_path: Path) -> None:
    """It takes the bounces of an opening for closures."""
    old = "if (open_ && now_us - opened_us_ >= config::debounce_open_us) rested_ = true;"
    new = "if (now_us - pulses_.last_us >= config::debounce_open_us) rested_ = true;"
    elf = mutated(tmp_path, "cup.cpp", (old, new))
    assert wrong_speeds(elf, (6.0,)) == []
    assert wrong_speeds(elf, (6.0,), "4 150") != []


@pytest.mark.thorough
def test_a_mean_that_forgets_the_quarter_turn_is_caught(tmp_path: Path) -> None:
    elf = mutated(tmp_path, "vane.cpp", ("sum.y += COS[quarter_back(position)];", "sum.y += COS[position];"))
    assert len(wrong_directions(elf)) >= 12


@pytest.mark.thorough
def test_a_slow_report_is_caught(tmp_path: Path) -> None:
    elf = mutated(tmp_path, "config.h", ("report_us = 200000;", "report_us = 206000;"))
    with Board(elf) as board:
        board.run(3.0)
        times_s = [t_s for t_s, text in board.lines if text.startswith("$WIMWV")]
    assert any(abs(b - a - 0.2) > 0.005 for a, b in itertools.pairwise(times_s))
