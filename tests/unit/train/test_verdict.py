"""Which models are good enough to hold with."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from asvhil.config import load_config
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.train.at_rest import AtRest, at_rest
from asvhil.train.evaluate import HOLD
from asvhil.train.verdict import judge

SOUND = at_rest(SimplifiedDynamics(load_config("sitl").vehicle.vessel), np.array([6.0, 6.0]))


def row(u: float, v: float, r: float, windows: int = 40) -> dict[str, Any]:
    return {"moving": {"windows": windows, "mae_u": u, "mae_v": v, "mae_r": r}}


def faults(own: dict[str, Any], check: AtRest = SOUND) -> tuple[str, ...]:
    rows = {"nnsem": own, "sd": row(0.15, 0.05, 0.07), "physics": row(0.01, 0.01, 0.01), HOLD: row(0.5, 0.1, 0.3)}
    return judge("nnsem", rows, check).faults


def test_a_model_that_is_better_than_the_fitted_physics_is_good() -> None:
    assert faults(row(0.08, 0.04, 0.04)) == ()
    assert faults(row(0.16, 0.05, 0.07)) == ()  # as good as it


@pytest.mark.parametrize(
    ("own", "words"),
    [
        (row(0.17, 0.04, 0.04), "u is off by 0.170 m/s over 10 s; the fitted physics by 0.150"),
        (row(0.08, 0.06, 0.04), "v is off by 0.060 m/s over 10 s; the fitted physics by 0.050"),
        (row(0.08, 0.04, 0.09), "r is off by 0.090 rad/s over 10 s; the fitted physics by 0.070"),
        (row(0.08, 0.04, 0.04, windows=9), "the test has 9 stretches of 10 s in motion, and 10 or more are needed"),
        (row(float("nan"), 0.04, 0.04), "u is off by nan"),
    ],
)
def test_each_error_is_told(own: dict[str, Any], words: str) -> None:
    assert words in " | ".join(faults(own))


def test_a_model_that_knows_little_is_not_good_even_beside_bad_physics() -> None:
    rows = {"nnsem": row(0.3, 0.04, 0.2), "sd": row(0.9, 0.9, 0.9), HOLD: row(0.5, 0.1, 0.3)}
    found = judge("nnsem", rows, SOUND).faults
    assert [words.split(", ")[1] for words in found] == [
        "60 % of what a constant velocity would be",
        "67 % of what a constant velocity would be",
    ]


def test_the_check_at_rest_counts() -> None:
    good = row(0.08, 0.04, 0.04)
    assert "starts to move by itself" in faults(good, dataclasses.replace(SOUND, still=(0.05, 0.0, 0.0)))[0]
    assert "more wind is less load, by 0.100 m/s^2" in faults(good, dataclasses.replace(SOUND, fall_mps2=0.1))[0]
    assert "the thrust falls" in faults(good, dataclasses.replace(SOUND, thrust_dip_mps2=0.01))[0]
