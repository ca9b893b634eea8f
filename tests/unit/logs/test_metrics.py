"""Metrics of series whose values are known beforehand."""

import math
from pathlib import Path

import numpy as np
import pytest

from asvhil.logs.holds import PhaseSpans
from asvhil.logs.metrics import (
    MotionTrack,
    PoseErrors,
    circular_deg,
    docking_figures,
    docking_windows,
    energy_figures,
    motor_figures,
    score,
    wind_figures,
)
from asvhil.logs.run import read_run
from asvhil.logs.summary import summarise
from asvhil.types import Phase
from tests.support.independent_metrics import figures as independent
from tests.support.phase_logs import hold, record_phases


def track(seconds: float = 30.0, step_s: float = 0.1, **changes: float) -> MotionTrack:
    """A boat at rest 3 m north of its station, at its heading."""
    k = round(seconds / step_s) + 1
    rows = {"distance_m": 3.0, "heading_deg": 0.0, "speed_mps": 0.0, "rate_degps": 0.0} | changes
    pose = np.tile([rows["distance_m"], 0.0, math.radians(rows["heading_deg"])], (k, 1))
    return MotionTrack(
        t_s=step_s * np.arange(k),
        pose=pose,
        speed_mps=np.full(k, rows["speed_mps"]),
        yaw_rate_radps=np.full(k, math.radians(rows["rate_degps"])),
        station=np.zeros((k, 3)),
        moves=np.zeros(k, dtype=bool),
        hold=np.ones(k, dtype=int),
    )


@pytest.mark.parametrize(
    ("inside", "outside"),
    [
        ({"distance_m": 14.99}, {"distance_m": 15.01}),
        ({"heading_deg": 19.9}, {"heading_deg": 20.1}),
        ({"heading_deg": -19.9}, {"heading_deg": -20.1}),
        ({"speed_mps": 0.49}, {"speed_mps": 0.51}),
        ({"rate_degps": -4.9}, {"rate_degps": -5.1}),
    ],
)
def test_a_docking_window_ends_at_each_of_its_bounds(inside: dict[str, float], outside: dict[str, float]) -> None:
    (window,) = docking_windows(track(**inside))
    assert window["length_s"] == pytest.approx(30.0)
    assert docking_windows(track(**outside)) == []


def test_docking_windows_are_cut_where_the_boat_is_outside_and_short_ones_do_not_count() -> None:
    boat = track(60.0)
    boat.speed_mps[300] = 1.0  # at 30 s
    boat.pose[400:405, 0] = 16.0  # at 40 s: between the two 9.8 s
    found = docking_figures(boat)
    assert [(w["from_s"], w["to_s"]) for w in found["windows"]] == [
        (0.0, pytest.approx(29.9)),
        (pytest.approx(40.5), 60.0),
    ]
    assert found["longest_s"] == pytest.approx(29.9) and found["share"] == pytest.approx((29.9 + 19.5) / 60.0)
    assert found["windows"][0]["distance_m"] == {"mean": 3.0, "max": 3.0}


@pytest.mark.parametrize("what", ["station", "hold", "gap", "released"])
def test_a_docking_window_is_of_one_hold_and_one_station_without_gaps(what: str) -> None:
    boat = track(40.0)
    match what:
        case "station":
            boat.station[200:, 1] = 0.5
        case "hold":
            boat.hold[200:] = 2
        case "gap":
            boat.t_s[200:] += 1.0
        case "released":
            boat.hold[200:] = 0
    lengths = [round(window["length_s"], 3) for window in docking_windows(boat)]
    assert lengths == ([19.9] if what == "released" else [19.9, 20.0])


def test_a_boat_without_samples_has_no_windows() -> None:
    nothing = track().where(np.zeros(301, dtype=bool))
    assert docking_figures(nothing) == {"windows": [], "longest_s": 0.0, "share": None}


def test_directions_about_north_have_a_mean_there_and_their_spread() -> None:
    found = circular_deg(np.radians([350.0, 10.0, 355.0, 5.0]))
    assert found["mean"] == pytest.approx(0.0, abs=1e-9)
    wrapped = np.random.default_rng(1).normal(math.pi, math.radians(40.0), 200_000)
    found = circular_deg((wrapped + math.pi) % math.tau - math.pi)
    assert abs(found["mean"] or 0.0) == pytest.approx(180.0, abs=0.5)
    assert found["std"] == pytest.approx(40.0, abs=0.5), "of a wrapped normal distribution it is that of the normal one"


def test_directions_that_cancel_have_no_mean() -> None:
    assert circular_deg(np.array([0.0, math.pi])) == circular_deg(np.array([])) == {"mean": None, "std": None}
    assert circular_deg(np.array([1.0])) == {"mean": pytest.approx(math.degrees(1.0)), "std": 0.0}


def test_the_score_of_the_virtual_robotx_counts_the_heading_near_the_station() -> None:
    def vrx(distance_m: float, heading_deg: float) -> float:
        one = (np.array([value]) for value in (0.0, distance_m, heading_deg))
        return score(PoseErrors(**dict(zip(("t_s", "distance_m", "heading_deg"), one, strict=True))), 0.0)["vrx_score"]

    assert vrx(0.0, -90.0) == pytest.approx(math.pi / 2.0)
    assert vrx(2.0, 90.0) == pytest.approx(2.0 + 0.75**2 * math.pi / 2.0)
    assert vrx(50.0, 180.0) == pytest.approx(50.0, abs=1e-5)


def test_vrx_score_is_the_same_on_every_processor() -> None:
    def vrx(distance_m: float) -> float:
        one = PoseErrors(t_s=np.zeros(1), distance_m=np.array([distance_m]), heading_deg=np.full(1, 90.0))
        return float(score(one, 0.0)["vrx_score"])

    distances = np.random.default_rng(3).uniform(0.0, 20.0, 2000).tolist()
    assert [vrx(d) for d in distances] == [d + math.pow(0.75, d) * float(np.radians(90.0)) for d in distances]


def test_reversals_and_changes_of_the_motors() -> None:
    def rows(port: list[float], hold: list[int]) -> np.ndarray:
        k = len(port)
        return np.column_stack([0.2 * np.arange(k), port, np.zeros(k), hold])

    # Ahead, astern, within the dead zone, ahead: two reversals of one motor in 1 s.
    found = motor_figures(rows([0.5, -0.5, -0.04, 0.04, 0.5, 0.5], [1] * 6))
    assert found["reversals_per_min"] == pytest.approx(60.0)
    assert found["reversals_per_min_most"] == pytest.approx(120.0)
    assert found["saturated_share"] == 0.0
    assert motor_figures(rows([1.0, -1.0, 0.9, 0.0], [1] * 4))["saturated_share"] == 0.5
    assert found["change_per_s"] == pytest.approx(0.5 * (1.0 + 0.46 + 0.08 + 0.46))
    assert found["energy"] == pytest.approx((4 * 0.25 + 2 * 0.0016) / 12.0)
    # What happens between two holds is of neither.
    apart = motor_figures(rows([0.5, 0.5, -0.5, -0.5], [1, 1, 2, 2]))
    assert apart["reversals_per_min"] == apart["change_per_s"] == 0.0
    assert set(motor_figures(rows([], [])).values()) == {None}


@pytest.mark.parametrize(
    ("rows", "energy_wh", "energy_by"),
    [
        ([], None, None),
        ([(0.0, math.nan, math.nan, 1)], None, None),
        ([(0.0, 1.0, 0.0, 1), (1.0, 2.5, 0.0, 1)], 2.5, "curve"),
        ([(0.0, 1.0, 0.0, 1), (1.0, 2.5, 1.0, 1), (9.0, 0.0, 1.0, 2), (10.0, 4.0, 1.0, 2)], 6.5, "curve and measured"),
        ([(0.0, 1.0, 1.0, 1), (9.0, math.nan, math.nan, 2)], None, "measured"),  # of the second hold nothing is known
    ],
)
def test_the_energy_of_all_holds_is_the_sum_of_their_last(
    rows: list[tuple[float, ...]], energy_wh: float | None, energy_by: str | None
) -> None:
    found = energy_figures(np.array(rows, dtype=float).reshape(-1, 4))
    assert found == {"energy_wh": energy_wh, "energy_by": energy_by}


def test_the_wind_of_no_rows_is_none() -> None:
    assert wind_figures(np.empty((0, 4))) is None


def test_spans_know_the_phase_that_followed() -> None:
    spans = PhaseSpans()
    assert spans.all == ()
    for t_s, phase, reason in (
        (0.0, Phase.STANDBY, "not asked"),
        (1.0, Phase.HOLD, "holding"),
        (2.0, Phase.HOLD, "holding, another word"),
        (3.0, Phase.FAILSAFE, "no position"),
        (4.0, Phase.HOLD, "holding"),
    ):
        spans.add(t_s, phase, reason)
    assert [(span.phase, span.from_s, span.to_s) for span in spans.all] == [
        (Phase.STANDBY, 0.0, 0.0),
        (Phase.HOLD, 1.0, 2.0),
        (Phase.FAILSAFE, 3.0, 3.0),
        (Phase.HOLD, 4.0, 4.0),
    ]
    assert spans.holds == [
        {"from_s": 1.0, "ended": "failsafe: no position", "to_s": 2.0},
        {"from_s": 4.0, "ended": None, "to_s": 4.0},
    ]
    assert spans.hold == 2


def test_the_way_counts_in_the_maximum_of_a_hold_that_ended_before_its_scores_begin(tmp_path: Path) -> None:
    released = 300, Phase.STANDBY, "the sticks were moved", "pilot"
    log = record_phases(tmp_path / "a.mcap", hold(100), released)
    own, other = summarise(read_run(log)), independent(log)
    assert own["settled_from_s"] > 9.0 and own["estimated"]["penalty_score"] is None
    distance_m = own["estimated"]["distance_m"]
    assert distance_m["max"] == pytest.approx(other["estimated"]["distance_m"]["max"]) == pytest.approx(1.0 / 3.0)
    assert distance_m["mean"] is distance_m["max_settled"] is None
