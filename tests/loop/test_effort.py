"""The operator's effort across the wind, and motors that may not do all that they could."""

from __future__ import annotations

from itertools import pairwise

import pytest

from asvhil.config import load_config
from asvhil.simplant.lockstep import Lockstep
from asvhil.study.trials.trial import NO_SLOW_ERROR, run_trial
from asvhil.types import Phase

NEUTRAL_US = 1500


def across(speed_mps: float, *keys: str) -> tuple[str, ...]:
    wind = f"plant.weather.wind.speed_mps={speed_mps}", "plant.weather.wind.toward_deg=90"
    return *wind, "plant.start_n_m=-2", "plant.start_e_m=0", "plant.seed=81", *NO_SLOW_ERROR, *keys


@pytest.mark.thorough
def test_less_effort_has_fewer_reversals_and_less_full_thrust() -> None:
    found = {}
    for effort in ("precise", "normal", "gentle"):
        run = run_trial(load_config("sitl", across(3.0, f"controller.mpc.effort={effort}")), 30.0, 75.0)
        assert run["held"] == 1.0
        found[effort] = run["motors"]["saturated_share"], run["truth"]["penalty_score"], run["motors"]
    assert found["precise"][0] > 1.3 * found["normal"][0] > 1.3 * found["gentle"][0]
    assert found["normal"][2]["reversals_per_min_most"] < 0.8 * found["precise"][2]["reversals_per_min_most"]
    assert found["normal"][1] < 1.3 * found["precise"][1] and found["gentle"][1] < 2.0 * found["precise"][1]


def test_along_the_wind_the_motors_do_not_follow_noise_to_either_side() -> None:
    keys = across(3.0, "plant.weather.wind.toward_deg=0")
    run = run_trial(load_config("sitl", keys), 20.0, 45.0)
    assert run["motors"]["reversals_per_min_most"] < 30.0 and run["truth"]["penalty_score"] < 1.0


def test_a_cap_and_a_pause_hold_on_the_wire_and_the_station_is_kept() -> None:
    loop = Lockstep(load_config("sitl", across(3.0, "vehicle.pwm.command_max=0.7", "vehicle.pwm.reversal_pause_s=0.4")))
    sides: list[list[int]] = [[], []]
    for _ in range(40 * 20):
        _, outputs = loop.tick()
        for told, pulse_us in zip(sides, outputs.pwm_us or (NEUTRAL_US, NEUTRAL_US), strict=True):
            assert abs(pulse_us - NEUTRAL_US) <= 280
            told.append((pulse_us > NEUTRAL_US) - (pulse_us < NEUTRAL_US))
    assert outputs.phase is Phase.HOLD
    for told in sides:
        turns = [tick for tick, side in enumerate(told) if side]
        reversals = [(a, b) for a, b in pairwise(turns) if told[a] != told[b]]
        assert len(reversals) > 4
        assert min(b - a for a, b in reversals) >= 9  # the first at neutral to the first beyond it: 8 ticks of 50 ms
    truth = loop.plant.truth
    assert abs(truth.n_m) < 4.0 and abs(truth.e_m) < 4.0
