"""A station of a point of the boat: what operators say and are told is of the point, what is steered is the origin."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from asvhil.config import SupervisorConfig
from asvhil.supervisor.reasons import Reason, explain
from asvhil.types import Phase, Station
from tests.support.supervisor_bench import ESTIMATE, FRAME, SupervisorBench

AHEAD = (4.0, 0.0)


def bench(**keys: object) -> SupervisorBench:
    return SupervisorBench(SupervisorConfig.model_validate({"point_m": AHEAD, **keys}))


def place(station: Station | None) -> tuple[float, float]:
    assert station is not None
    return station.n_m, station.e_m


def test_a_hold_here_leaves_the_boat_where_it_is() -> None:
    at = bench()
    at.estimate = replace(ESTIMATE, psi_rad=math.pi / 2)
    assert at.hold() is None
    decision = at.step()
    assert place(decision.station) == pytest.approx((1.0, 2.0))
    assert place(decision.point) == pytest.approx((1.0, 6.0))


def test_a_place_that_is_named_and_moves_are_of_the_point_and_it_turns_in_its_place() -> None:
    at = bench()
    lat_deg, lon_deg = FRAME.to_geodetic(10.0, 5.0)
    assert at.hold(lat_deg=lat_deg, lon_deg=lon_deg, psi_rad=0.0) is None
    decision = at.step()
    assert place(decision.point) == pytest.approx((10.0, 5.0), abs=1e-3)
    assert place(decision.station) == pytest.approx((6.0, 5.0), abs=1e-3)
    assert at.move(psi_rad=math.pi) is None
    decision = at.step()
    assert place(decision.point) == pytest.approx((10.0, 5.0), abs=1e-3)
    assert place(decision.station) == pytest.approx((14.0, 5.0), abs=1e-3)
    assert at.move(n_m=12.0) is None
    assert place(at.step().station) == pytest.approx((16.0, 5.0), abs=1e-3)


def test_where_the_boat_is_not_known_its_point_is_neither() -> None:
    at = bench()
    at.estimate = None
    assert at.hold() == explain(Reason.NO_ESTIMATE)
    decision = at.step()
    assert decision.station is None and decision.point is None
    at.estimate = ESTIMATE
    assert at.hold() is None
    before = at.step()
    at.estimate = None
    after = at.step()
    assert after.phase is Phase.FAILSAFE and (after.station, after.point) == (before.station, before.point)


def test_neither_the_point_nor_the_origin_may_be_outside_the_fence() -> None:
    corners = [FRAME.to_geodetic(*corner) for corner in ((-20.0, -20.0), (-20.0, 20.0), (20.0, 20.0), (20.0, -20.0))]
    at = bench(geofence=corners)
    assert at.hold(psi_rad=0.0) is None
    for n_m, psi_rad, is_in in ((18.0, 0.0, True), (18.0, math.pi, False), (22.0, 0.0, False)):
        refusal = at.move(n_m=n_m, psi_rad=psi_rad)
        assert (refusal is None) is is_in, (n_m, psi_rad)


def test_how_far_off_a_station_is_counts_from_the_point() -> None:
    at = bench(max_distance_m=50.0)
    at.estimate = replace(ESTIMATE, n_m=0.0, e_m=0.0, psi_rad=0.0)
    for n_m, is_far in ((53.0, False), (55.0, True)):
        lat_deg, lon_deg = FRAME.to_geodetic(n_m, 0.0)
        refusal = at.hold(lat_deg=lat_deg, lon_deg=lon_deg)
        assert (refusal is not None and refusal.reason is Reason.STATION_UNCONFIRMED) is is_far
