"""A boat that lies beside its station in a steady wind from astern or ahead, where no motor pushes sideways."""

import pytest

from asvhil.config import load_config
from asvhil.simplant.lockstep import Lockstep

BESIDE = (
    "plant.start_n_m=0",
    "plant.weather.wind.gust_along=0",
    "plant.weather.wind.gust_across=0",
    "plant.sensors.gnss={slow_bias_m: 0, white_m: 0, velocity_white_mps: 0}",
)


def east_m(*overrides: str) -> float:
    """The boat's distance east of its station (heading north), a minute after the start."""
    loop = Lockstep(load_config("sitl", (*BESIDE, *overrides)))
    for _ in range(round(60 * loop.config.daemon.tick_hz)):
        loop.tick()
    return loop.plant.truth.e_m


@pytest.mark.parametrize(("start_m", "toward_deg"), [(0.3, 0), pytest.param(-0.3, 180, marks=pytest.mark.thorough)])
def test_the_boat_comes_back_from_beside_its_station_within_a_minute(start_m, toward_deg):
    mpc = load_config("field").controller.mpc
    after_m = east_m(
        f"plant.start_e_m={start_m}",
        f"plant.weather.wind.toward_deg={toward_deg}",
        f"controller.mpc.lasting_offset_m={list(mpc.lasting_offset_m)}",
        f"controller.mpc.near.heading={mpc.near.heading}",
    )
    assert abs(after_m) < 0.1


@pytest.mark.thorough
def test_by_its_distance_alone_it_would_stay_there():
    """What the key is for; with the weights of the published scores, which are chosen by distance alone."""
    assert east_m("plant.start_e_m=0.3") > 0.28
