"""What a heading costs is told of one that somebody has asked for, not of one that follows the weather."""

from __future__ import annotations

import pytest

from asvhil.config import load_config
from asvhil.simplant.lockstep import Lockstep
from asvhil.supervisor.heading_cost import SUBJECT


@pytest.mark.parametrize(
    ("current_mps", "words"),
    [
        (0.5, {"this weather drives the boat off"}),
        pytest.param(0.2, {"the weather is on the side: at best 1."}, marks=pytest.mark.thorough),
    ],
)
def test_in_a_current_nothing_is_told_before_its_push_is_known(current_mps: float, words: set[str]) -> None:
    """BREAM across a current: 0.5 m/s drive it off, and 0.2 m/s had it 3.3 m off, where 0.3 m at best was told."""
    current = (f"plant.weather.current.speed_mps={current_mps}", "plant.weather.current.toward_deg=90")
    loop = Lockstep(load_config("sitl-bream", ("plant.weather.wind.speed_mps=0", *current)))
    texts = set()
    for _ in range(45 * 20):
        _, outputs = loop.tick()
        texts |= {note.text for note in outputs.health.notes if note.subject == SUBJECT}
    assert texts and all(text.startswith(tuple(words)) for text in texts)


@pytest.mark.parametrize(("policy", "told"), [("fixed", True), ("bow", False)])
def test_a_heading_that_follows_the_weather_costs_nothing_that_could_be_saved(policy: str, told: bool) -> None:
    heading = f"supervisor.heading={{policy: {policy}, time_constant_s: 5, turn_deg_per_min: 10}}"
    loop = Lockstep(load_config("sitl", (heading, "controller.name=backstepping", "plant.weather.wind.speed_mps=6")))
    subjects = set()
    for tick in range(60 * 20):
        if tick == 20 * 20:  # the weather veers, and the station's heading goes after it slowly
            loop.plant.weather.set_wind(6.0, 80.0)
        _, outputs = loop.tick()
        subjects |= {note.subject for note in outputs.health.notes}
    assert (SUBJECT in subjects) is told
