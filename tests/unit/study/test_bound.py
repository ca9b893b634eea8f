"""The physical bound: that the orbit is a motion of the boat, that it is what the study ships, and its file."""

import json
import math

import numpy as np
import pytest

from asvhil.config import load_config
from asvhil.dynamics.integrate import advance
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.errors import AsvhilError
from asvhil.study.bound import (
    INTERVALS,
    PERIODS_S,
    boat_hash,
    bound,
    bounds_tree,
    figures,
    guesses,
    markdown,
    read_bounds,
)
from asvhil.study.rows import ROWS, along_the_wind, wind_of
from tests.support.paths import ROOT

CONFIG = load_config("sitl")
MODEL = SimplifiedDynamics(CONFIG.vehicle.vessel)
SHIPPED = ROOT / "docs" / "results" / "bound.json"


@pytest.fixture(scope="module")
def orbit():
    return bound(MODEL, 3.0, math.radians(90.0), starts=3)


def test_the_orbit_is_a_motion_of_the_boat_and_closes(orbit):
    """Its inputs, driven through the model in steps of a tenth of the study's, bring the boat back."""
    step_s, wind = orbit.period_s / INTERVALS, np.array([0.0, 3.0])
    state, distances_m, headings_deg = orbit.states[0], [], []
    for a in orbit.inputs:
        distances_m.append(math.hypot(state[0], state[1]))
        headings_deg.append(math.degrees(state[2]))
        state = np.asarray(advance(MODEL, state, a, wind, np.zeros(3), step_s, 20))
    assert state == pytest.approx(orbit.states[0], abs=0.02)
    distance, heading = np.array(distances_m), np.array(headings_deg)
    score = distance.mean() + distance.std() + abs(heading.mean()) + heading.std()
    assert score == pytest.approx(orbit.penalty_score, rel=0.02)
    assert (orbit.inputs >= MODEL.input_lower - 1e-6).all() and (orbit.inputs <= MODEL.input_upper + 1e-6).all()


def test_all_starts_end_at_the_same_orbit(orbit):
    assert (orbit.starts, orbit.converged, orbit.alike) == (3, 3, 3)
    assert 3.3 < orbit.penalty_score < 3.5 and 5.0 < orbit.period_s < 7.0


def test_starts_are_the_same_for_the_same_count_and_within_the_bounds():
    assert guesses(20) == guesses(20) and guesses(20)[:5] == guesses(5)
    assert all(PERIODS_S[0] <= guess.period_s <= PERIODS_S[1] for guess in guesses(60))


def test_the_file_comes_back_and_belongs_to_a_boat(orbit, tmp_path):
    file = tmp_path / "bound.json"
    tree = bounds_tree(CONFIG, {"3@90": figures(orbit)})
    file.write_text(json.dumps(tree))
    assert read_bounds(file, CONFIG) == {"3@90": orbit.penalty_score}
    with pytest.raises(AsvhilError, match="holds the bounds of wamv16, not of bream"):
        read_bounds(file, load_config("sitl-bream"))
    line = markdown(tree).splitlines()[-1]
    assert line.startswith(f"| 3@90 | {orbit.penalty_score:.3f} | {orbit.period_s:.2f} |") and line.endswith("3 | 3 |")


def test_the_bound_is_of_the_boat_and_not_of_what_the_controller_believes():
    vessel = CONFIG.vehicle.vessel
    heavy, light = (vessel.model_copy(update={"mass_kg": m_kg}) for m_kg in (500.0, 100.0))
    vessels = {"plant.vessel": heavy, "controller.vessel": light}
    keys = [f"{key}={json.dumps(part.model_dump(mode='json'))}" for key, part in vessels.items()]
    config = load_config("sitl", ("controller.name=sd-mpc", *keys))
    assert CONFIG.plant_vessel == vessel and config.plant_vessel == heavy
    assert bounds_tree(config, {})["vessel_hash"] == heavy.content_hash() != vessel.content_hash()


def test_bounds_of_other_values_of_a_vessel_are_one_line(tmp_path):
    file = tmp_path / "bound.json"
    tree = bounds_tree(CONFIG, {"3@90": {"penalty_score": 3.4}})
    file.write_text(json.dumps(tree))
    assert read_bounds(file, CONFIG) == {"3@90": 3.4}
    for other in (("vehicle.vessel.wind_sway_n_per_mps2=9",), ("plant.motors={port_thrust: 0.9}",)):
        config = load_config("sitl", other)
        with pytest.raises(
            AsvhilError, match=rf"bound\.json: vessel_hash \w{{16}}, but .* has {boat_hash(config)}; .*DIR"
        ):
            read_bounds(file, config)
    del tree["vessel_hash"]
    file.write_text(json.dumps(tree))
    with pytest.raises(AsvhilError, match=r"bound\.json: no vessel_hash, but"):
        read_bounds(file, CONFIG)


@pytest.mark.parametrize("text", ["", "[]", '{"vehicle": "wamv16"}', '{"vehicle": "wamv16", "winds": {"3@90": {}}}'])
def test_another_file_is_one_line(tmp_path, text):
    file = tmp_path / "bound.json"
    file.write_text(text)
    with pytest.raises(AsvhilError, match="not what `asvhil study bound -o` writes"):
        read_bounds(file, CONFIG)
    with pytest.raises(AsvhilError, match="cannot be read"):
        read_bounds(tmp_path / "nowhere.json", CONFIG)


def test_the_shipped_bounds_are_those_of_every_row_across_the_wind(orbit):
    shipped = read_bounds(SHIPPED, CONFIG)
    assert {wind_of(row) for row in ROWS if not along_the_wind(row)} == set(shipped)
    # Found from many starts; a few give the same.
    assert shipped["3@90"] == pytest.approx(orbit.penalty_score, rel=2e-3)
