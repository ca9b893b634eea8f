"""The geofence: which points lie in it, and what becomes of stations and holds outside."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from asvhil.config import StationConfig, SupervisorConfig
from asvhil.geo import LocalFrame
from asvhil.supervisor.geofence import distance_to_border, is_inside
from asvhil.supervisor.reasons import Reason
from asvhil.types import Phase
from tests.support.supervisor_bench import ESTIMATE, FRAME, SupervisorBench

SQUARE = [(0.0, 0.0), (0.0, 10.0), (10.0, 10.0), (10.0, 0.0)]
BAY = [(0.0, 0.0), (0.0, 10.0), (10.0, 10.0), (10.0, 6.0), (4.0, 6.0), (4.0, 4.0), (10.0, 4.0), (10.0, 0.0)]
DIAMOND = [(0.0, 5.0), (5.0, 10.0), (10.0, 5.0), (5.0, 0.0)]


@pytest.mark.parametrize(
    ("corners", "at", "inside"),
    [
        (DIAMOND, (5.0, 5.0), True),  # as far north as two of the corners
        (DIAMOND, (5.0, -1.0), False),
        (DIAMOND, (5.0, 11.0), False),
        (SQUARE, (5.0, 10.0), False),  # on the border
        (SQUARE, (5.0, 5.0), True),
        (SQUARE, (-0.1, 5.0), False),
        (SQUARE, (5.0, 10.1), False),
        (SQUARE, (5.0, -3.0), False),
        (SQUARE[::-1], (9.9, 0.1), True),
        (BAY, (7.0, 5.0), False),  # in the bight
        (BAY, (7.0, 2.0), True),
        (BAY, (7.0, 8.0), True),
        (SQUARE, (math.nan, 5.0), False),
    ],
)
def test_which_points_lie_inside(corners: list[tuple[float, float]], at: tuple[float, float], inside: bool) -> None:
    assert is_inside(corners, at) is inside


def test_convex_fences_agree_with_their_half_planes() -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, rng.integers(3, 9)))
        corners = [(40.0 * math.cos(a), 40.0 * math.sin(a)) for a in angles]
        for n, e in rng.uniform(-45.0, 45.0, (20, 2)):
            sides = zip(corners, corners[1:] + corners[:1], strict=True)
            left = all((n1 - n0) * (e - e0) - (e1 - e0) * (n - n0) > 0.0 for (n0, e0), (n1, e1) in sides)
            assert is_inside(corners, (n, e)) is left


@pytest.mark.parametrize(
    ("at", "metres"), [((5.0, 5.0), 5.0), ((5.0, 12.0), 2.0), ((13.0, 14.0), 5.0), ((1.0, 4.0), 1.0)]
)
def test_how_far_the_border_is(at: tuple[float, float], metres: float) -> None:
    assert distance_to_border(SQUARE, at) == pytest.approx(metres)
    assert distance_to_border([*SQUARE, SQUARE[-1]], at) == pytest.approx(metres)  # a corner that is given twice


@pytest.mark.parametrize("corners", [DIAMOND, DIAMOND[::-1], DIAMOND[2:] + DIAMOND[:2]])
def test_every_side_counts_and_slanted_ones_too(corners: list[tuple[float, float]]) -> None:
    for at in ((2.0, 2.0), (2.0, 8.0), (8.0, 2.0), (8.0, 8.0)):
        assert distance_to_border(corners, at) == pytest.approx(math.sqrt(0.5))
    assert distance_to_border(SQUARE, (5.0, 1.0)) == 1.0  # the side from the last corner to the first


def fence(*corners_m: tuple[float, float], **more: object) -> SupervisorConfig:
    return SupervisorConfig.model_validate({"geofence": [FRAME.to_geodetic(*at) for at in corners_m], **more})


WATER = fence((-20.0, -20.0), (-20.0, 30.0), (30.0, 30.0), (30.0, -20.0))  # the boat is at (1, 2)


def degrees(n_m: float, e_m: float) -> dict[str, float]:
    lat_deg, lon_deg = FRAME.to_geodetic(n_m, e_m)
    return {"lat_deg": lat_deg, "lon_deg": lon_deg}


def test_a_station_outside_is_refused_and_one_inside_is_held() -> None:
    bench = SupervisorBench(WATER)
    refusal = bench.hold(**degrees(0.0, 35.0))
    assert refusal is not None and refusal.reason is Reason.OUTSIDE_FENCE
    assert dict(refusal.detail) == {"what": "station", "metres": pytest.approx(5.0, abs=0.01)}
    assert bench.step().phase is Phase.STANDBY
    assert bench.hold(**degrees(0.0, 25.0)) is None
    moved = bench.move(**degrees(33.0, 0.0))
    assert moved is not None and moved.reason is Reason.OUTSIDE_FENCE
    station = bench.step().station
    assert station is not None and station.e_m == pytest.approx(25.0, abs=1e-6)


def test_a_hold_of_a_boat_outside_does_not_begin() -> None:
    bench = SupervisorBench(WATER)
    bench.estimate = replace(ESTIMATE, n_m=-21.0)
    refusal = bench.hold(**degrees(0.0, 0.0))
    assert refusal is not None and ("what", "boat") in refusal.detail


def test_a_hold_whose_boat_gets_outside_ends_neutral_first() -> None:
    bench = SupervisorBench(WATER)
    assert bench.hold() is None
    assert bench.drive().phase is Phase.HOLD
    bench.estimate = replace(ESTIMATE, e_m=29.9)
    assert bench.drive(0.5).phase is Phase.HOLD
    bench.estimate = replace(ESTIMATE, e_m=30.1)
    decision = bench.step()
    assert decision.phase is Phase.STANDBY and decision.why.reason is Reason.OUTSIDE_FENCE
    assert decision.neutral and not decision.drive


def test_an_estimate_that_is_not_valid_says_nothing_of_the_fence() -> None:
    bench = SupervisorBench(WATER)
    assert bench.hold() is None
    bench.drive()
    bench.estimate = replace(ESTIMATE, e_m=90.0, valid=False)
    assert bench.step().why.reason is not Reason.OUTSIDE_FENCE


@pytest.mark.parametrize(("n_m", "begins"), [(25.0, True), (35.0, False)])
def test_a_hold_by_itself_keeps_to_the_fence(n_m: float, begins: bool) -> None:
    lat_deg, lon_deg = FRAME.to_geodetic(n_m, 0.0)
    station = StationConfig(lat_deg=lat_deg, lon_deg=lon_deg, heading_deg=0.0)
    bench = SupervisorBench(WATER.model_copy(update={"engage": "auto", "station": station}))
    decision = bench.step()
    assert decision.phase is (Phase.HOLD if begins else Phase.STANDBY)
    assert (decision.why.reason is Reason.OUTSIDE_FENCE) is not begins


@pytest.mark.parametrize("corners", [[(40.0, -86.0)], [(40.0, -86.0), (40.1, -86.0)], [(40.0, -86.0)] * 3])
def test_fewer_than_three_corners_are_no_fence(corners: Sequence[tuple[float, float]]) -> None:
    with pytest.raises(ValidationError, match="3 corners"):
        SupervisorConfig.model_validate({"geofence": corners})


@pytest.mark.parametrize(
    "corners_m",
    [
        [(0.0, 0.0), (50.0, 0.0), (100.0, 0.0)],
        [(0.0, 0.0), (70.0, 35.0), (1000.0, 500.0), (-20.0, -10.0)],
        [(0.0, 0.0), (1000.0, 0.0), (1000.0, 0.8), (0.0, 0.8)],
        [(0.0, 0.0), (0.0, 40.0), (40.0, 0.0), (40.0, 40.0)],
    ],
)
def test_corners_that_enclose_no_water_are_no_fence(corners_m: Sequence[tuple[float, float]]) -> None:
    with pytest.raises(ValidationError, match="corners that enclose water, in turn around it; these leave a strip of"):
        fence(*corners_m)


@pytest.mark.parametrize("lon_deg", [-86.9, 179.99999])
def test_a_small_pool_is_enough_on_either_side_of_the_antimeridian(lon_deg: float) -> None:
    frame = LocalFrame(lat_deg=60.0, lon_deg=lon_deg)
    pool = [frame.to_geodetic(*at) for at in ((-3.0, -3.0), (-3.0, 3.0), (3.0, 3.0), (3.0, -3.0))]
    assert len(SupervisorConfig.model_validate({"geofence": pool}).geofence) == 4
    assert len(SupervisorConfig.model_validate({"geofence": [*pool[::-1], pool[-1]]}).geofence) == 5


def test_without_corners_there_is_none() -> None:
    bench = SupervisorBench()
    assert bench.hold(**degrees(0.0, 90.0)) is None
