"""`asvhil replay --what-if`: another controller or estimator over recorded inputs, in an open loop that says so."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from asvhil.commands.cli import app
from asvhil.errors import ConfigError
from asvhil.logs.what_if import replay_what_if, what_if_figures

Runs = Callable[[str], Path]


def test_the_same_config_asks_for_the_same_to_the_bit(run_logs: Runs) -> None:
    log = run_logs("bream")
    found = replay_what_if(log, ["controller.name=lagnet-mpc"])
    figures = what_if_figures(found)
    assert figures["commands_apart"]["max"] == 0.0 and figures["estimates_apart"]["position_m"]["max"] == 0.0
    assert figures["motors"]["recorded"] == figures["motors"]["what_if"]
    assert figures["judged_to_s"] is None and figures["holds"]["recorded"] == figures["holds"]["what_if"]
    assert len(found.recorded_command) > 500


def test_the_commands_of_two_holds_are_drawn_apart(run_logs: Runs) -> None:
    found = replay_what_if(run_logs("two_holds"), ["controller.backstepping.kp=[900, 900, 16]"])
    assert len(found.recorded.spans) > 2
    for rows in (found.recorded_command, found.other_command):
        (at,) = np.flatnonzero(np.diff(rows[:, 3]))
        assert rows[at + 1, 0] - rows[at, 0] > 5.0 and np.diff(rows[:at, 0]).max() < 1.0


def test_another_controller_asks_for_other_commands_of_the_same_boat(run_logs: Runs, tmp_path: Path) -> None:
    """LOITER shares the estimator's sensors; its commands differ, and the boat stays where the record has it."""
    picture, figures_file = tmp_path / "differences.png", tmp_path / "figures.json"
    arguments = ["--what-if", "controller.name=loiter", "--picture", str(picture), "--json", str(figures_file)]
    done = CliRunner().invoke(app, ["replay", str(run_logs("bream")), *arguments])
    assert done.exit_code == 0, done.output
    assert "open loop, the boat moves as recorded" in done.output
    figures = json.loads(figures_file.read_text())
    assert figures["open_loop"] is True and figures["commands_apart"]["mean"] > 0.05
    assert figures["estimates_apart"]["position_m"]["mean"] < 1.0
    assert figures["against_truth"]["what_if"]["position_m"] < 4.0
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.thorough
def test_another_filter_sees_another_way(run_logs: Runs) -> None:
    """A filter that takes the receiver at its word is moved about by it."""
    found = replay_what_if(
        run_logs("bream"), ["estimator.ekf.position_bias_std_m=0", "estimator.ekf.position_std_m=0.2"]
    )
    figures = what_if_figures(found)
    assert 0.1 < figures["estimates_apart"]["position_m"]["max"] < 10.0
    held = [run.estimated.of_hold().pose[-400:, :2] for run in (found.recorded, found.other)]
    moved = [np.hypot(*np.diff(pose, axis=0).T).sum() for pose in held]
    assert moved[1] > 1.05 * moved[0]


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("plant.seed=2", "--what-if plant.seed=2: the boat of a log is as recorded; controller.*"),
        ("controller.name=pid", "key controller.name"),
        ("controller.mpc.stagess=8", "did you mean stages?"),
        ("nonsense", "--what-if nonsense: KEY=VALUE is expected"),
    ],
)
def test_a_mistake_names_the_option_and_the_key(override: str, words: str, run_logs: Runs) -> None:
    with pytest.raises(ConfigError) as told:
        replay_what_if(run_logs("bream"), [override])
    assert words in str(told.value) and "\n" not in str(told.value) and "--what-if" in str(told.value)
