"""Learning on station in the loop: a fouled motor is found and told, and the log replays to the byte."""

from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.errors import ConfigError
from asvhil.estimator.learned_words import HELD_BACK, learned_text
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.learned_file import LearnedKeeper
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import replay
from asvhil.simplant.lockstep import Lockstep
from asvhil.sitl import run_lockstep

FOULED = ("plant.motors={port_thrust: 0.7}", "plant.start_n_m=-4", "learning.enabled=true")


def test_a_fouled_motor_is_found_told_and_replayed(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    wind = ("plant.weather.wind.speed_mps=6", "plant.weather.wind.toward_deg=90")
    run_lockstep(load_config("sitl", (*FOULED, *wind)), log, 34.0)
    outputs = [decode_outputs(made) for _, made in LogFile(log).ticks() if made is not None]
    last = outputs[-30]  # before it is let go
    assert last.learned is not None and last.estimate is not None
    port, starboard, *_ = last.learned.factors
    assert port == pytest.approx(0.7, abs=0.1) and starboard == pytest.approx(1.0, abs=0.1)
    assert [1.0 + part for part in last.estimate.motor[2:]] == [port, starboard, 1.0, 1.0, 1.0]
    notes = {note.subject: note for note in last.health.notes}
    assert not notes["motor thrust"].ok and notes["motor thrust"].text.startswith("port motor gives ")
    assert outputs[10].learned is not None and outputs[10].learned.frozen == "no station is held"
    result = replay(log)
    assert result.mismatch is None and result.compared == len(outputs)


def test_in_a_current_nothing_is_told_and_nothing_kept(tmp_path: Path) -> None:
    weather = (
        *("plant.weather.wind.speed_mps=3", "plant.weather.wind.toward_deg=60", "plant.seed=2"),
        *("plant.weather.current.speed_mps=0.3", "plant.weather.current.toward_deg=120"),
    )
    config = load_config("sitl", ("learning.enabled=true", f"recorder.directory={tmp_path}", *weather))
    loop, keeper, texts = Lockstep(config), LearnedKeeper(config), []
    for _ in range(20 * 110):
        outputs = loop.tick()[1]
        keeper.see(outputs)
        texts += [note.text for note in outputs.health.notes if note.subject == "learning"]
    assert outputs.learned is not None and outputs.learned.learned_s > 60.0
    assert texts[-1] == HELD_BACK and learned_text(outputs.learned) == HELD_BACK
    assert keeper.save() is None and not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("key", "error"),
    [
        ("controller.name=loiter", "loiter predicts with no vessel model, so there is nothing to correct"),
        ("estimator.kind=fir", "the estimator fir has no vessel model; it needs ekf"),
        ("learning.least=0.1", "a number of 0.2 or more"),
    ],
)
def test_what_cannot_learn_is_refused(key: str, error: str) -> None:
    with pytest.raises(ConfigError, match=error):
        load_config("sitl", ("learning.enabled=true", key))
