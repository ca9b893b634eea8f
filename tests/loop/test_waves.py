"""Station keeping in waves: what the wave filter is for, and that it stays away from calm water."""

from __future__ import annotations

import math

import pytest

from asvhil.config import load_config
from asvhil.simplant.lockstep import Lockstep
from asvhil.study.rows import row_overrides
from asvhil.study.trials.trial import run_trial
from asvhil.types import Outputs, Phase

SEA = (
    "plant.weather.waves.orbital_std_mps=0.15",
    "plant.weather.waves.yaw_std_radps=0.04",
    "plant.weather.waves.spreading=1",
)


@pytest.mark.thorough
def test_the_wave_filter_more_than_halves_the_penalty_score() -> None:
    """Of a sea in which the motors work against every wave without it; a seed that is in no table."""
    scores = {}
    for mode in ("off", "auto"):
        keys = (*row_overrides("1", 31), *SEA, f"estimator.waves.mode={mode}")
        scores[mode] = run_trial(load_config("sitl", keys), 40.0, 85.0)["truth"]["penalty_score"]
    assert scores["auto"] < 2.5
    assert scores["auto"] < 0.55 * scores["off"]


@pytest.mark.parametrize("row", ["1", pytest.param("2", marks=pytest.mark.thorough)])
def test_a_sound_boat_in_a_sea_is_not_let_go(row: str) -> None:
    """The sense check took the waves of this seed for a dead motor 12 s after the hold had begun."""
    made = outputs(*row_overrides(row, 1), *SEA, seconds=30.0)
    assert all(output.phase is Phase.HOLD for output in made[100:600])


def test_motors_that_are_reversed_end_the_hold_in_a_sea_too() -> None:
    faults = "[{kind: port-motor-reversed}, {kind: starboard-motor-reversed}]"
    made = outputs(*row_overrides("1", 1), *SEA, f"plant.faults={faults}", seconds=30.0)
    held = [output for output in made if output.phase is Phase.HOLD]
    assert made[-1].phase is not Phase.HOLD
    assert made[-1].pwm_us in (None, (1500, 1500))
    distances = [
        math.hypot(output.estimate.n_m - output.station.n_m, output.estimate.e_m - output.station.e_m)
        for output in held
        if output.estimate is not None and output.station is not None
    ]
    assert distances[-1] < distances[0] + 10.0


def outputs(*overrides: str, seconds: float) -> list[Outputs]:
    made: list[Outputs] = []
    Lockstep(load_config("sitl", overrides)).run(seconds, made.append)
    return made


@pytest.mark.parametrize(
    "keys",
    [
        (),
        pytest.param(("plant.weather.wind.toward_deg=90", "controller.name=sd-mpc"), marks=pytest.mark.thorough),
    ],
    ids=["along", "across"],
)
@pytest.mark.thorough
def test_in_calm_water_nothing_changes(keys: tuple[str, ...]) -> None:
    assert outputs(*keys, seconds=30.0) == outputs(*keys, "estimator.waves.mode=off", seconds=30.0)


def test_the_waves_are_reported_and_the_estimate_is_without_them() -> None:
    made = outputs(*SEA, "plant.weather.waves.peak_hz=0.45", seconds=75.0)
    waves = made[-1].waves
    assert waves is not None
    assert abs(math.log(waves.peak_hz / 0.45)) < 0.2
    assert 0.1 < waves.velocity_std_mps < 0.25
    estimates = [output.estimate for output in made[-400:]]
    sway = [abs(estimate.v_mps) for estimate in estimates if estimate is not None]
    assert sum(sway) / len(sway) < 0.05  # with the waves in it 0.12


def test_estimators_without_a_model_do_without() -> None:
    made = outputs(*SEA, "estimator.kind=fir", seconds=20.0)
    assert made[-1].estimate is not None and made[-1].waves is None
