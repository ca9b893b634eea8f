"""What a heading costs in the weather, against the physical bounds of boats that it was not fitted to."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from asvhil.backseat.build import build_heading_cost
from asvhil.config import load_config
from asvhil.study.bound import bound, plant_dynamics
from asvhil.supervisor.heading_cost import EVERY_NS, HeadingCost, HeadingCostWatch, heading_cost
from asvhil.types import Note, Station

VESSEL = load_config("sitl").vehicle.vessel
STATION = Station(n_m=0.0, e_m=0.0, psi_rad=0.0)


def cost_in(name: str, speed_mps: float, toward_deg: float) -> HeadingCost:
    """Of the simulated boat of a config, in a steady wind toward an angle from the station's heading."""
    config = load_config(name)
    toward = math.radians(toward_deg)
    wind = np.array([speed_mps * math.cos(toward), speed_mps * math.sin(toward)])
    push = plant_dynamics(config).derivative(np.zeros(5), np.zeros(2), wind)
    return heading_cost(config.plant_vessel, float(push[0]), float(push[1]))


@pytest.mark.parametrize(
    ("name", "speed_mps", "toward_deg"),
    [
        pytest.param("sitl", 4.0, 70.0, marks=pytest.mark.thorough),
        pytest.param("sitl-second", 3.0, 90.0, marks=pytest.mark.thorough),
        pytest.param("sitl-blueboat", 3.0, 90.0, marks=pytest.mark.thorough),
        ("sitl-blueboat", 6.0, 90.0),
    ],
)
def test_it_is_near_the_bound_of_boats_and_winds_that_it_was_not_fitted_to(
    name: str, speed_mps: float, toward_deg: float
) -> None:
    orbit = bound(plant_dynamics(load_config(name)), speed_mps, math.radians(toward_deg), 2)
    cost = cost_in(name, speed_mps, toward_deg)
    assert cost.distance_m == pytest.approx(orbit.distance_m[0], rel=0.15)
    assert math.degrees(cost.swing_rad) == pytest.approx(orbit.heading_deg[1], rel=0.35)


def test_with_the_weather_ahead_or_astern_it_lies_still_and_works_as_the_load_is() -> None:
    for toward_deg in (0.0, 180.0):
        cost = cost_in("sitl", 6.0, toward_deg)
        assert cost.can_be_held and cost.distance_m == pytest.approx(0.0, abs=1e-6)
    # 18 N of load: 481 N ahead can be given, 186 N astern.
    assert cost_in("sitl", 6.0, 180.0).thrust == pytest.approx(18.0 / 481.0)
    assert cost_in("sitl", 6.0, 0.0).thrust == pytest.approx(18.0 / 186.0)


@pytest.mark.parametrize(
    ("name", "speed_mps", "toward_deg", "watts"),
    [
        # The mean power of the bound's orbits by the power curves of both boats (`bound`, 2 starts).
        *(("sitl", 3.0, 90.0, 873.0), ("sitl", 6.0, 90.0, 900.0), ("sitl", 9.0, 90.0, 860.0)),
        *(
            ("sitl-blueboat", 3.0, 90.0, 599.0),
            ("sitl-blueboat", 6.0, 90.0, 567.0),
            ("sitl-blueboat", 9.0, 90.0, 527.0),
        ),
    ],
)
def test_the_power_is_near_that_of_the_bound(name: str, speed_mps: float, toward_deg: float, watts: float) -> None:
    config = load_config(name)
    toward = math.radians(toward_deg)
    wind = np.array([speed_mps * math.cos(toward), speed_mps * math.sin(toward)])
    push = plant_dynamics(config).derivative(np.zeros(5), np.zeros(2), wind)
    watch = build_heading_cost(config)
    assert watch is not None
    (note,) = watch.step(EVERY_NS, STATION, lambda psi_rad: (float(push[0]), float(push[1])))
    (told,) = re.findall(r"for some (\d+) W", note.text)
    assert float(told) == pytest.approx(watts, rel=0.2)


def test_power_is_told_of_the_stations_heading_and_of_the_weathers_better_side() -> None:
    """At 0.2 W/N and 1 W; bow and stern to the weather another force pushes than at the station's heading."""
    pushes = {0.0: (0.0, 0.05), 90.0: (0.03, 0.001), -90.0: (-0.02, 0.001)}
    mass_kg = VESSEL.mass_kg + VESSEL.added_mass_surge_kg

    def told(power_of: Callable[[float], float | None], push: tuple[float, float] = pushes[0.0]) -> str:
        watch = HeadingCostWatch(VESSEL, power_of)
        at = {**pushes, 0.0: push}
        (note,) = watch.step(EVERY_NS, STATION, lambda psi_rad: at[round(math.degrees(psi_rad))])
        return note.text

    swings_n = 2.0 * -VESSEL.thrust_curve[0][1]
    text = told(lambda thrust_n: 0.2 * abs(thrust_n) + 1.0)
    assert f"by turns, for some {0.2 * swings_n + 1.0:.0f} W at full thrust; turned to it" in text
    assert text.endswith(f"the boat would lie still, for {0.2 * 0.02 * mass_kg + 1.0:.0f} W at least")
    assert told(lambda thrust_n: max(thrust_n, 0.0)).endswith("for 0 W at least"), "astern, with the stern to it"
    assert told(lambda thrust_n: 1234.0).endswith("for 1230 W at least")
    assert "(5 W at least)" in told(lambda thrust_n: 5.0, (0.0, 0.25)), "what the heading takes that drives it off"
    for text in (told(lambda thrust_n: None), told(lambda thrust_n: None, (0.0, 0.25))):
        assert " W" not in text


def test_more_weather_costs_more_until_the_station_cannot_be_held() -> None:
    costs = [cost_in("sitl", speed_mps, 90.0) for speed_mps in (1.0, 2.0, 4.0, 6.0, 8.0, 11.0)]
    assert all(a.distance_m < b.distance_m and a.swing_rad < b.swing_rad for a, b in pairwise(costs))
    assert all(cost.can_be_held for cost in costs)
    assert not cost_in("sitl", 12.0, 90.0).can_be_held, "as the simulated boat was not"
    ahead = heading_cost(VESSEL, -2.0, 0.0)
    assert not ahead.can_be_held and ahead.thrust == 1.0


def test_it_tells_while_a_station_is_held_across_the_weather_and_seldom_anew() -> None:
    watch, t_ns = HeadingCostWatch(VESSEL), 0
    notes: list[Note] = []

    def told(station: Station | None, push: tuple[float, float] | None, after_ns: int = EVERY_NS) -> list[str]:
        nonlocal t_ns
        t_ns += after_ns
        notes[:] = watch.step(t_ns, station, lambda psi_rad: push)
        return [note.text for note in notes]

    assert told(None, (0.0, 0.05)) == [] and told(STATION, None) == []
    (across,) = told(STATION, (0.0, 0.05))
    assert across.startswith("the weather is on the side: at best 1.5 m off, 9 deg to either side")
    assert notes[0].ok and notes[0].subject == "heading cost"
    assert told(STATION, (0.0, 0.2), 1) == [across], "not at once"
    assert told(STATION, (0.0, 0.055)) == [across], "nor for little"
    (more,) = told(STATION, (0.0, 0.08))
    assert more != across
    (lost,) = told(STATION, (0.0, -0.25))
    assert lost.startswith("this weather drives the boat off") and not notes[0].ok
    assert told(STATION, (0.05, 0.0)) == [], "the weather is astern now"
    turned = Station(n_m=0.0, e_m=0.0, psi_rad=1.5)
    assert told(STATION, (0.0, 0.05), 1) == [] and told(turned, (0.0, 0.05), 1) != [], "a station that is turned"
    told(STATION, (0.0, 0.05))
    assert told(None, (0.0, 0.05)) == []


@pytest.mark.parametrize(
    ("moving", "at_rest", "cause"),
    [
        (0.25, 0.0, "cannot follow so at the station's heading"),
        (0.25, 0.05, "cannot follow so at the station's heading"),
        (0.25, 0.25, "this weather drives the boat off"),
        (0.05, 0.0, "the course is across the boat: at best"),
        (0.05, 0.04, "the weather is on the side"),
    ],
)
def test_a_course_across_the_boat_is_not_told_as_weather(moving: float, at_rest: float, cause: str) -> None:
    watch = HeadingCostWatch(VESSEL)
    station = Station(n_m=0.0, e_m=0.0, psi_rad=0.0, ve_mps=0.5)
    (note,) = watch.step(EVERY_NS, station, lambda psi_rad: (0.0, -moving), lambda psi_rad: (0.0, -at_rest))
    assert cause in note.text
    of_course = "course" in cause or "follow" in cause
    assert ("turn the heading along the course (90 deg)" in note.text) == of_course
    assert ("end the hold" in note.text) == (at_rest == 0.25)


def test_a_course_across_is_told_on_while_the_station_waits_for_the_boat() -> None:
    watch = HeadingCostWatch(VESSEL)
    rests = Station(n_m=0.0, e_m=0.0, psi_rad=0.0)
    moves = Station(n_m=0.0, e_m=0.0, psi_rad=0.0, ve_mps=0.5)
    push = (0.0, 0.0)

    def told(station: Station, t_s: float) -> int:
        return len(watch.step(round(t_s * 1e9), station, lambda psi_rad: push, lambda psi_rad: (0.0, 0.0)))

    assert told(rests, 0.0) == 0
    push = (0.0, -0.05)
    assert told(moves, 9.0) == 0
    push = (0.0, 0.0)
    assert told(rests, 12.0) == 0
    push = (0.0, -0.05)
    assert told(moves, 15.0) == 1, "looked at once it goes on"
    assert told(moves, 24.0) == 1
    push = (0.0, 0.0)
    assert told(rests, 26.0) == told(rests, 33.0) == 1 and told(rests, 35.0) == 0, "it rests for good"
