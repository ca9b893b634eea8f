"""The lines of a run on a pipe."""

import dataclasses

import pytest

from asvhil.commands.views import LiveView
from asvhil.config import load_config
from asvhil.daemon.status import StatusTeller
from asvhil.types import Outputs, Station
from tests.support.log_samples import sample_outputs

TICKS = 25 * 20  # 25 s


def lines(capsys: pytest.CaptureFixture[str], *stations: Station) -> list[str]:
    """What a pipe gets of 20 ticks a second, each with a station."""
    config = load_config("sitl")
    first = sample_outputs(1)
    view, teller = LiveView(config, "title"), StatusTeller(config)
    with view:
        for number, station in enumerate(stations):
            outputs: Outputs = dataclasses.replace(first, t_ns=first.t_ns + 50_000_000 * number, station=station)
            teller.see(outputs)
            if number % 10 == 0:
                view.show_status(teller.status(outputs, {}, 0, None))
    return capsys.readouterr().out.splitlines()


@pytest.mark.parametrize("moves", [True, False], ids=["on a course", "with the weather"])
def test_a_station_that_goes_on_is_one_line_and_its_place_comes_with_the_time(
    moves: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    course = [Station(n_m=0.0, e_m=0.015 * k, psi_rad=0.5, ve_mps=0.3) for k in range(TICKS)]
    turning = [Station(n_m=0.0, e_m=0.0, psi_rad=0.5 + 0.0005 * k, of_weather=True) for k in range(TICKS)]
    shown = lines(capsys, *(course if moves else turning))
    assert len([line for line in shown if line.startswith("station: ")]) == 1
    timed = [line for line in shown if " s  " in line]
    assert len(timed) == 3 and "; station " not in timed[0]
    places = {line.partition("; station ")[2] for line in timed[1:]}
    assert len(places) == 2 and all(place.partition(", heading ")[2] for place in places)


def test_a_station_at_rest_is_told_when_it_is_given(capsys: pytest.CaptureFixture[str]) -> None:
    here, there = Station(n_m=0.0, e_m=0.0, psi_rad=0.5), Station(n_m=3.0, e_m=0.0, psi_rad=0.5)
    shown = lines(capsys, *([here] * (TICKS // 2) + [there] * (TICKS // 2)))
    assert len([line for line in shown if line.startswith("station: ")]) == 2
    assert not any("; station " in line for line in shown)
