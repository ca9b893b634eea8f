"""The figures of whole logs: each hold, fail-safe and release apart, and all as an independent script has them."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from asvhil.config import load_config
from asvhil.logs.run import RunLog, read_run
from asvhil.logs.summary import summarise
from tests.support.independent_metrics import figures as independent

# Sensors that the independent script does not read.
FOREIGN = {"bream": ("measured",)}


def assert_same(own: Any, other: Any, where: str, leave_out: tuple[str, ...] = ()) -> int:
    """All that the other one has is in the own one too, numbers to 1e-9: how many numbers there are."""
    if isinstance(other, dict):
        assert isinstance(own, dict), where
        return sum(
            assert_same(own[key], part, f"{where}.{key}", leave_out)
            for key, part in other.items()
            if key not in leave_out
        )
    if isinstance(other, list):
        assert len(own) == len(other), where
        pairs = zip(own, other, strict=True)
        return sum(assert_same(one, two, f"{where}[{i}]", leave_out) for i, (one, two) in enumerate(pairs))
    if isinstance(other, float):
        assert own == pytest.approx(other, rel=1e-9, abs=1e-9), where
        return 1
    assert own == other, where
    return 0


@pytest.mark.parametrize("name", ["two_holds", "bream", pytest.param("procedure", marks=pytest.mark.thorough)])
def test_an_independent_script_has_the_same_figures(name: str, run_logs: Callable[[str], Path]) -> None:
    log = run_logs(name)
    other = independent(log)
    compared = assert_same(summarise(read_run(log)), other, name, FOREIGN.get(name, ()))
    assert compared > 70, "too little has been compared"


@pytest.fixture(scope="module")
def two_holds(run_logs: Callable[[str], Path]) -> RunLog:
    return read_run(run_logs("two_holds"))


def test_holds_failsafe_and_release_are_reported_apart(two_holds: RunLog) -> None:
    figures = summarise(two_holds)
    first, second = figures["holds"]
    (failsafe,) = figures["failsafes"]
    after_failsafe, by_operator = figures["releases"]
    assert first["to_s"] < failsafe["from_s"] < failsafe["to_s"] < after_failsafe["at_s"] < second["from_s"]
    assert second["to_s"] < by_operator["at_s"]
    assert (first["number"], second["number"]) == (1, 2)
    assert first["energy_wh"] > 0.0 < second["energy_wh"]
    assert figures["energy_wh"] == pytest.approx(first["energy_wh"] + second["energy_wh"])
    assert "stale" in failsafe["reason"] and first["ended"] == f"failsafe: {failsafe['reason']}"
    assert after_failsafe["after"] == "failsafe" and by_operator["code"] == "released"
    assert (first["stations"], second["stations"]) == (1, 2), "the second station was moved"
    assert figures["phases"]["hold"] == pytest.approx(
        sum(hold["to_s"] - hold["from_s"] + 0.05 for hold in (first, second)), abs=0.01
    )


def test_errors_are_to_the_station_of_the_tick_and_only_while_it_is_held(two_holds: RunLog) -> None:
    """The station was moved by 3.6 m: to the last one all errors before were larger."""
    track = two_holds.estimated
    errors = track.errors

    held = track.hold > 0
    assert held.any() and not held.all()
    last = track.station[held][-1]
    before = held & (abs(track.station[:, 0] - last[0]) > 1.0)
    to_last_m = abs(errors.distance_m - [math.dist(pose[:2], last[:2]) for pose in track.pose])
    assert to_last_m[before][-1] > 2.0
    assert to_last_m[held & ~before].max() < 1e-12
    figures = summarise(two_holds)
    adrift = track.where((track.t_s > figures["failsafes"][0]["from_s"]) & (track.hold == 0))
    assert len(adrift.t_s) > 20, "the boat drifts meanwhile"
    assert figures["estimated"]["distance_m"]["max"] == track.of_hold().errors.distance_m.max()


def test_the_stages_of_a_hold_are_in_its_figures(run_logs: Callable[[str], Path]) -> None:
    (hold,) = summarise(read_run(run_logs("procedure")))["holds"]
    stages = [stage["stage"] for stage in hold["stages"]]
    assert stages == ["approach", "keep_heading"]
    assert hold["stages"][0]["to_s"] < hold["stages"][1]["from_s"] <= hold["to_s"]


def test_measured_estimated_and_true_differ_as_the_sensors_do(run_logs: Callable[[str], Path]) -> None:
    """BREAM's receiver is off by metres, slowly; its estimate follows the readings, and the truth is elsewhere."""
    run = read_run(run_logs("bream"))
    assert run.measured is not None and run.truth is not None
    noisy_m, smooth_m = (abs(track.of_hold().errors.distance_m[-100:]) for track in (run.measured, run.estimated))
    assert abs(noisy_m[1:] - noisy_m[:-1]).mean() > 3.0 * abs(smooth_m[1:] - smooth_m[:-1]).mean()
    config = load_config("sitl-bream")
    assert len(run.measured.t_s) == pytest.approx(config.plant.sensors.gnss.rate_hz * run.duration_s, rel=0.1)
