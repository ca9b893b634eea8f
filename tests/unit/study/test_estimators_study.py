"""The estimator study: errors worked by hand, one recording for all, and what is made of faults and glitches."""

import math

import numpy as np
import pytest

from asvhil.config import load_config
from asvhil.geo import LocalFrame
from asvhil.study.estimators import names, verdicts, worst
from asvhil.study.trials import abrupt
from asvhil.study.trials.abrupt import run_abrupt, run_survival
from asvhil.study.trials.estimation import errors, estimate_rows, feed, record_run, run_estimation, truth_rows

COLUMNS = 10
AFTER_S = 12.0  # a boat that has recovered stays so for 10 s


def rows(**columns: list[float]) -> np.ndarray:
    at = {"n": 0, "e": 1, "vn": 2, "ve": 3, "psi": 4, "r": 5, "wn": 6, "we": 7, "u": 8, "v": 9}
    table = np.zeros((2, COLUMNS))
    for name, values in columns.items():
        table[:, at[name]] = values
    return table


def test_errors_of_two_rows_by_hand() -> None:
    truth = rows(wn=[3.0, 3.0], psi=[math.pi - 0.1] * 2)
    made = rows(
        n=[3.0, 3.0],
        e=[4.0, 2.0],
        vn=[0.3, 0.0],
        ve=[0.4, 0.0],
        psi=[-math.pi + 0.1, math.pi - 0.1],
        wn=[0.0, 3.0],
        we=[4.0, 0.0],
        u=[0.2, 0.2],
        r=[0.1, -0.1],
    )
    found = errors(made, truth)
    assert found["position_m"] == pytest.approx(math.sqrt((25.0 + 13.0) / 2.0))
    assert found["position_spread_m"] == pytest.approx(1.0)  # (3, 4) and (3, 2) about (3, 3)
    assert found["velocity_mps"] == pytest.approx(math.sqrt(0.125))
    assert found["heading_deg"] == pytest.approx(math.degrees(0.2) / math.sqrt(2.0))  # across the wrap
    assert found["heading_spread_deg"] == pytest.approx(math.degrees(0.1))
    assert (found["u_mps"], found["v_mps"], found["yaw_rate_radps"]) == pytest.approx((0.2, 0.0, 0.1))
    assert found["wind_vector_mps"] == pytest.approx(5.0 / math.sqrt(2.0))
    assert found["wind_speed_mps"] == pytest.approx(1.0 / math.sqrt(2.0))
    assert found["wind_direction_deg"] == pytest.approx(90.0 / math.sqrt(2.0))


def test_an_estimate_that_is_missing_gives_no_error() -> None:
    made = rows()
    made[1, 6] = math.nan
    assert set(errors(made, rows()).values()) == {None}


def test_one_recording_goes_through_every_estimator() -> None:
    """Raw readings without noise are the truth of their own times; the recorded run itself is the EKF's."""
    exact = ("plant.sensors.nmea.compass_hz=20", "plant.sensors.gnss={rate_hz: 20, slow_bias_m: 0, white_m: 0}")
    quiet = ("plant.sensors.heading={white_deg: 0}", "plant.sensors.gnss.velocity_white_mps=0")
    true = (
        "estimator.ekf.compass.deviation_deg=[0, 0, 0, 0, 0]",
    )  # a compass without deviation, and nothing taken out
    config = load_config("sitl-bream", (*exact, *quiet, *true))
    run = record_run(config, "manoeuvres", 20.0)
    truth = truth_rows(run.truth)
    moved = np.ptp(truth[200:, 8])
    raw = estimate_rows(feed(config, "raw", run.inputs), run.origin)
    found = errors(raw[200:], truth[200:])
    assert moved > 0.3 and found["position_m"] < 0.05 and found["velocity_mps"] < 0.05 and found["heading_deg"] < 0.1
    again = feed(config, "raw", run.inputs)
    assert np.array_equal(estimate_rows(again, run.origin), raw, equal_nan=True)
    # The inputs do not know the origin of the plant: rows are about it all the same.
    elsewhere = LocalFrame(lat_deg=run.origin.lat_deg + 1e-4, lon_deg=run.origin.lon_deg)
    shifted = estimate_rows(again, elsewhere)[-1, 0] - raw[-1, 0]
    assert shifted == pytest.approx(-11.1, abs=0.1)


def test_traces_are_points_of_the_same_run() -> None:
    result = run_estimation("sitl-bream", (), "station", (6.0, 9.0), True)
    traces = result["traces"]
    assert traces["t_s"] == [6.0 + 0.25 * k for k in range(12)]
    assert {len(traces[name]) for name in ("truth", "ekf", "fir", "raw")} == {12}
    assert set(result["errors"]) == {"ekf", "fir", "raw"} and result["invalid"]["raw"] == 0.0


def test_recovery_is_when_it_stays_good() -> None:
    hz = 10.0
    good = np.ones(300, dtype=bool)
    assert abrupt.recovery_s(good, hz) == 0.0
    good[10:15] = False
    assert abrupt.recovery_s(good, hz) == 1.5
    good[120] = False  # 10 s of calm from 1.5 s on end before 11.5 s: this is another story
    assert abrupt.recovery_s(good, hz) == 1.5
    good[100] = False
    assert abrupt.recovery_s(good, hz) == 12.1
    assert abrupt.recovery_s(np.zeros(300, dtype=bool), hz) is None


@pytest.mark.thorough
def test_a_jump_moves_the_raw_estimate_by_its_size_and_it_comes_back() -> None:
    keys = (
        "estimator.kind=raw",
        "plant.sensors.gnss={slow_bias_m: 0, white_m: 0.02}",
        "plant.sensors.heading.white_deg=0.1",
    )
    fault = "plant.faults=[{kind: gnss-jump, from_s: 12, until_s: 14, toward_deg: 0}]"
    found = run_abrupt("sitl-bream", (*keys, fault), 12.0, 2.0, AFTER_S)
    assert found["moved_m"] == pytest.approx(20.0, abs=0.5) and found["moved_deg"] < 3.0
    assert found["recovery_s"] is not None and found["recovery_s"] < 0.5 and found["flags"] == {}
    none = run_abrupt("sitl-bream", keys, 12.0, 2.0, AFTER_S)
    assert none["moved_m"] < 0.5 and none["recovery_s"] == 0.0


@pytest.mark.thorough
def test_a_source_that_falls_silent_and_one_that_is_replaced_are_flags() -> None:
    silent = run_abrupt(
        "sitl-bream", ("plant.faults=[{kind: anemometer, from_s: 12, until_s: 15}]",), 12.0, 3.0, AFTER_S
    )
    assert silent["flags"]["source of wind"] == pytest.approx(1.0, abs=0.3)
    other = run_abrupt("sitl-vn300", ("plant.faults=[{kind: ins, from_s: 12, until_s: 15}]",), 12.0, 3.0, AFTER_S)
    assert other["flags"]["source of position"] == pytest.approx(0.3, abs=0.1) and other["held"]


@pytest.mark.thorough
def test_a_boat_that_drifts_away_is_lost() -> None:
    kept = run_survival("sitl-bream", (), (8.0, 12.0), 20.0)
    assert not kept["lost"] and kept["held"] == 1.0 and 0.0 < kept["max_distance_m"] < 20.0
    assert run_survival("sitl-bream", (), (8.0, 12.0), 0.1)["lost"]
    dead = run_survival(
        "sitl-bream", ("plant.faults=[{kind: nmea, from_s: 8}]", "estimator.kind=raw"), (9.0, 16.0), 99.0
    )
    assert dead["lost"] and dead["held"] < 1.0


FIGURES = {"moved_m": 0.4, "moved_deg": 1.0, "moved_after_m": 0.2, "moved_after_deg": 1.0, "wind_moved_mps": 0.3}


def outcome(**changes: object) -> dict:
    return {**FIGURES, "invalid": 0.0, "recovery_s": 0.0, "flags": {}, "false_flags": [], "held": True, **changes}


def test_the_worst_of_all_seeds_counts() -> None:
    first = outcome(moved_m=0.6, flags={"gnss position": 0.2, "compass": 0.1}, recovery_s=2.0)
    found = worst("x", "gnss-jump", [first, outcome(flags={"gnss position": 1.5})])
    assert (found["moved_m"], found["recovery_s"], found["flag_delay_s"]) == (0.6, 2.0, 1.5)
    assert (found["still"], found["named"], found["recovered"]) == (False, True, True)
    assert not worst("x", "heading-jump", [first, outcome()])["named"]
    assert worst("x", "gnss-jump", [outcome(recovery_s=None)])["recovered"] is False
    assert worst("x", "", [outcome()])["named"] and not worst("x", "", [outcome(flags={"gyro": 1.0})])["named"]


@pytest.mark.parametrize(
    ("kind", "flag", "named"),
    [
        ("gnss-frozen", "gnss velocity", True),
        ("gnss-frozen", "compass", False),
        ("heading-silent", "compass", True),
        ("gnss-silent", "source of position", True),
        ("gnss-silent", "source of heading", False),
        ("anemometer", "source of wind", True),
        ("imu-silent", "gyro", True),
        ("anemometer-stuck", "wind", True),
        ("nmea", "compass", True),
        ("ins", "wind", False),
    ],
)
def test_which_flag_names_which_sensor(kind: str, flag: str, named: bool) -> None:
    assert names(kind, flag) is named


def test_a_figure_is_met_by_the_mean_and_better_by_the_ratios() -> None:
    def cell(ekf: float, fir: float, raw: float) -> dict:
        parts = {"ekf": ekf, "fir": fir, "raw": raw}
        both = ("velocity_mps", "heading_deg")
        return {"errors": {kind: {m: {"mean": value, "ci95": None} for m in both} for kind, value in parts.items()}}

    lines = verdicts("BREAM", {"station": {"calm": cell(0.09, 0.1, 0.18), "gusty": cell(0.11, 0.10, 0.5)}})
    velocity = {line["condition"]: line for line in lines if line["metric"] == "velocity_mps"}
    assert (velocity["calm"]["met"], velocity["calm"]["better"]) == (True, True)
    assert (velocity["gusty"]["met"], velocity["gusty"]["better"]) == (False, False)
    assert velocity["calm"]["ratio_raw"] == pytest.approx(2.0)
