"""Where a station is that is asked for, and when it is too far off."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from asvhil.supervisor.reasons import Reason, describe, explain
from asvhil.supervisor.stations import (
    MAX_STATION_DISTANCE_M,
    has_leapt,
    place_of_point,
    station_of_hold,
    station_of_move,
    station_of_origin,
    station_of_point,
    too_far,
)
from asvhil.types import HoldCommand, MoveCommand, Station
from tests.support.supervisor_bench import ESTIMATE, FRAME

HELD = Station(n_m=10.0, e_m=20.0, psi_rad=1.0)
LAT_DEG, LON_DEG = FRAME.to_geodetic(30.0, -40.0)
AWAY = replace(ESTIMATE, n_m=300.0, e_m=-400.0)


def near(station: Station, n_m: float, e_m: float, psi_rad: float) -> bool:
    return (station.n_m, station.e_m, station.psi_rad) == pytest.approx((n_m, e_m, psi_rad), abs=1e-3)


def test_a_hold_is_at_the_place_that_is_named_as_a_whole_else_where_the_boat_is() -> None:
    boat = (ESTIMATE.n_m, ESTIMATE.e_m, ESTIMATE.psi_rad)
    assert near(station_of_hold(HoldCommand(t_ns=0), ESTIMATE, FRAME), *boat)
    for half in ({"lat_deg": LAT_DEG}, {"lon_deg": LON_DEG}):
        assert near(station_of_hold(HoldCommand(t_ns=0, **half), ESTIMATE, FRAME), *boat)
    named = HoldCommand(t_ns=0, lat_deg=LAT_DEG, lon_deg=LON_DEG, psi_rad=0.0)
    assert near(station_of_hold(named, ESTIMATE, FRAME), 30.0, -40.0, 0.0)


@pytest.mark.parametrize(
    ("move", "to"),
    [
        ({}, (10.0, 20.0, 1.0)),
        ({"lat_deg": LAT_DEG}, (30.0, 20.0, 1.0)),
        ({"lon_deg": LON_DEG}, (10.0, -40.0, 1.0)),
        ({"lat_deg": LAT_DEG, "lon_deg": LON_DEG}, (30.0, -40.0, 1.0)),
        ({"lat_deg": LAT_DEG, "lon_deg": LON_DEG, "n_m": 0.0}, (0.0, -40.0, 1.0)),
        ({"e_m": 0.0, "psi_rad": 0.0}, (10.0, 0.0, 0.0)),
    ],
)
def test_a_move_leaves_what_it_does_not_name(move: dict[str, float], to: tuple[float, float, float]) -> None:
    assert near(station_of_move(MoveCommand(t_ns=0, **move), HELD, FRAME), *to)


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, 1.0), (0.6, -0.8), (-0.6, 0.8)])
def test_the_distance_from_the_boat_counts_in_every_direction(direction: tuple[float, float]) -> None:
    def at(distance_m: float, most_m: float) -> object:
        n_m, e_m = (origin + distance_m * part for origin, part in zip((AWAY.n_m, AWAY.e_m), direction, strict=True))
        return too_far(Station(n_m=n_m, e_m=e_m, psi_rad=0.0), AWAY, most_m)

    assert at(100.0 - 1e-6, 100.0) is None
    unconfirmed, beyond = at(100.001, 100.0), at(2000.001, 9000.0)
    assert unconfirmed is not None and beyond is not None
    assert at(2000.0 - 1e-6, 9000.0) is None


def test_the_limits_themselves_are_within_reach_and_the_distance_is_told() -> None:
    here = replace(ESTIMATE, n_m=0.0, e_m=0.0)
    station = Station(n_m=60.0, e_m=-80.0, psi_rad=0.0)
    assert too_far(station, here, 100.0) is None
    limit = "99 m unless the hold command names more"
    assert too_far(station, here, 99.0) == explain(Reason.STATION_UNCONFIRMED, metres=100.0, limit=limit)
    farthest = Station(n_m=0.0, e_m=MAX_STATION_DISTANCE_M, psi_rad=0.0)
    assert too_far(farthest, here, 2000.0) is None
    nowhere = too_far(replace(farthest, n_m=math.nan), here, 9000.0)
    assert nowhere is not None and nowhere.reason is Reason.STATION_TOO_FAR


@pytest.mark.parametrize(
    ("off_m", "named_m", "words"),
    [
        (287.0, 0.0, "station is 287 m away, at most 100 m unless the hold command names more"),
        (287.0, 50.0, "station is 287 m away, at most 100 m unless the hold command names more"),
        (287.0, math.nan, "station is 287 m away, at most 100 m unless the hold command names more"),
        (287.0, 200.0, "station is 287 m away, at most 200 m by the hold command"),
        (287.0, 300.0, None),
        (2200.0, 0.0, "station is 2.2 km away, 2 km at most, and 100 m unless the hold command names more"),
        (2200.0, 9000.0, "station is 2.2 km away, 2 km at most"),
    ],
)
def test_a_station_too_far_off_is_told_with_the_limit_that_applies(
    off_m: float, named_m: float, words: str | None
) -> None:
    here = replace(ESTIMATE, n_m=0.0, e_m=0.0)
    refusal = too_far(Station(n_m=off_m, e_m=0.0, psi_rad=0.0), here, 100.0, named_m)
    assert (None if refusal is None else describe(refusal)) == words


ASTERN = (-3.0, 1.0)  # 3 m astern and 1 m to starboard


def test_a_point_of_the_boat_is_at_the_station_where_its_origin_is_at_the_origins() -> None:
    east = Station(n_m=10.0, e_m=20.0, psi_rad=math.pi / 2, vn_mps=0.2)
    origin = station_of_origin(east, ASTERN)
    assert near(origin, 11.0, 23.0, math.pi / 2) and origin.vn_mps == 0.2
    assert near(station_of_point(origin, ASTERN), 10.0, 20.0, math.pi / 2)
    there = replace(ESTIMATE, n_m=origin.n_m, e_m=origin.e_m, psi_rad=origin.psi_rad)
    point = place_of_point(there, ASTERN)
    assert (point.n_m, point.e_m) == pytest.approx((10.0, 20.0))
    assert replace(point, n_m=there.n_m, e_m=there.e_m) == there


def test_a_boat_that_is_kept_by_its_origin_is_where_it_is_to_the_bit() -> None:
    assert station_of_origin(HELD, (0.0, 0.0)) is HELD is station_of_point(HELD, (0.0, 0.0))
    assert place_of_point(ESTIMATE, (0.0, 0.0)) is ESTIMATE


@pytest.mark.parametrize(
    ("velocities", "most_m"),
    [((0.0, 0.0), 0.05), ((0.2, 0.0), 0.5), ((0.0, 0.2), 0.5), ((0.2, 0.2), 0.5)],
    ids=["rests", "stops", "sets off", "moves"],
)
@pytest.mark.parametrize("toward", [(1.0, 0.0), (0.0, -1.0)])
def test_a_station_leaps_that_is_farther_off_than_its_motion_of_a_tick(
    velocities: tuple[float, float], most_m: float, toward: tuple[float, float]
) -> None:
    before, after = (Station(n_m=0.0, e_m=0.0, psi_rad=1.0, ve_mps=ve_mps) for ve_mps in velocities)
    for off_m, leaps in ((most_m, False), (most_m * 1.001, True)):
        assert has_leapt(replace(after, n_m=off_m * toward[0], e_m=off_m * toward[1]), before) is leaps


def test_a_heading_that_the_place_depends_on_is_not_the_weathers() -> None:
    follows = replace(HELD, of_weather=True)
    assert station_of_origin(follows, ASTERN).of_weather is False
    assert station_of_origin(follows, (0.0, 0.0)).of_weather is True


def test_an_origin_that_goes_round_the_point_leaps_nowhere() -> None:
    before = station_of_origin(HELD, ASTERN)
    assert not has_leapt(station_of_origin(replace(HELD, psi_rad=1.01), ASTERN), before)
    assert has_leapt(station_of_origin(replace(HELD, psi_rad=1.1), ASTERN), before)
