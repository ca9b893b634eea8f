"""The check at rest: the shipped models at the place where a station is kept, and what the check says of wrong ones."""

from __future__ import annotations

import numpy as np
import pytest

from asvhil.collect import with_manoeuvres
from asvhil.config import load_config
from asvhil.config.mean_wind import parse_wind
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.dynamics.weights import read_model
from asvhil.study.rows import ROWS, row_overrides
from asvhil.train.at_rest import SPEEDS_MPS, SQUARE, at_rest
from tests.support.paths import ROOT

MODELS = sorted((ROOT / "config" / "models").glob("*.npz"))
CONFIGS = {"wamv16": "sitl", "bream": "sitl-bream", "blueboat": "sitl-blueboat"}
VESSEL = load_config("sitl").vehicle.vessel
WIND_REACH = np.array([10.0, 10.0])


def test_there_are_shipped_models() -> None:
    assert len(MODELS) >= 11


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_a_shipped_model_is_right_where_a_station_is_kept(path) -> None:
    model = read_model(path)
    check = at_rest(model.dynamics(), model.scaling.half[5:], load_config(CONFIGS[model.vehicle]).vehicle.vessel)
    u_dot, v_dot, r_dot = np.abs(check.still)
    assert u_dot <= 0.01 and v_dot <= 0.01 and r_dot <= 0.003
    for load in check.loads:
        if load.side in SQUARE and load.speed_mps in SPEEDS_MPS:
            off = np.abs(np.array(load.rates) - load.reference)
            allowed = np.maximum(0.15 * np.abs(load.reference), [0.01, 0.01, 0.003])
            assert (off <= allowed).all(), (load.side, load.speed_mps, off / allowed)
    assert check.right and check.rising


class Changed(SimplifiedDynamics):
    """The true physics, with a rate of surge added and another wind."""

    def __init__(self, surge: float = 0.0, wind: float = 1.0) -> None:
        super().__init__(VESSEL)
        self._surge, self._wind_factor = surge, wind

    def derivative(self, x, a, wind):
        return super().derivative(x, a, self._wind_factor * wind) + np.array([self._surge, 0.0, 0.0, 0.0, 0.0])


def test_the_true_physics_are_right_at_rest() -> None:
    check = at_rest(Changed(), WIND_REACH, VESSEL)
    assert check.right and check.still == (0.0, 0.0, 0.0) and check.worst.error == 0.0
    assert check.thrust_dip_mps2 == 0.0 and check.fall_mps2 == 0.0
    assert "wrong" not in check.verdict()


def test_the_check_finds_a_boat_that_creeps_a_weak_wind_and_one_that_pulls() -> None:
    creeps = at_rest(Changed(surge=0.0575), WIND_REACH, VESSEL)
    assert not creeps.stays and not creeps.right and "still air 0.0575" in creeps.verdict()
    weak = at_rest(Changed(wind=0.7), WIND_REACH, VESSEL)
    assert weak.stays and weak.rising and not weak.right
    assert "of the bound (wrong); load rises" in weak.verdict() and weak.verdict().count("wrong") == 1
    assert weak.worst.speed_mps == 10.0 and weak.worst.error == pytest.approx(0.51 / 0.15, rel=1e-6)
    pulls = at_rest(Changed(wind=-0.5), WIND_REACH)
    assert pulls.worst is None and pulls.stays and not pulls.rising and not pulls.right


def test_training_and_the_six_tests_share_no_gusts() -> None:
    base = load_config("sitl")
    trained = {with_manoeuvres(base, 600.0, parse_wind("4@20"), run=run).plant.seed for run in range(50)}
    tested = {load_config("sitl", row_overrides(row, seed)).plant.seed for row in ROWS for seed in range(1, 51)}
    assert min(trained) >= 1000 and not trained & tested
