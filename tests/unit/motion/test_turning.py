"""A held boat that turns round and round."""

from __future__ import annotations

import math

import pytest

from asvhil.geo import wrap_rad
from asvhil.motion.turning import TurningWatch
from asvhil.supervisor.reasons import Reason
from asvhil.types import Estimate, Station

S = 1_000_000_000
HZ = 20


def heading(psi_rad: float) -> Estimate:
    return Estimate(
        t_ns=0, n_m=0.0, e_m=0.0, psi_rad=psi_rad, u_mps=0.0, v_mps=0.0, r_radps=0.0,
        motor=(), std=(), disturbance=(0.0, 0.0, 0.0), valid=True,
    )  # fmt: skip


def found_after(rate_radps: float, seconds: float, station_radps: float = 0.0) -> float | None:
    """When the watch lets a boat go that turns at a rate, on a station that turns at one too (s); None: never."""
    watch = TurningWatch()
    for tick in range(round(seconds * HZ)):
        t_s = tick / HZ
        station = Station(n_m=0.0, e_m=0.0, psi_rad=wrap_rad(station_radps * t_s))
        told = watch.step(round(t_s * S), heading(wrap_rad(rate_radps * t_s)), station)
        if told is not None:
            assert told.reason is Reason.TURNS_ROUND and dict(told.detail)["turns"] >= 2.5
            return t_s
    return None


@pytest.mark.parametrize("rate_radps", [1.3, -1.3, 0.5])
def test_two_turns_and_a_half_one_way_are_enough(rate_radps: float) -> None:
    assert found_after(rate_radps, 60.0) == pytest.approx(5.0 * math.pi / abs(rate_radps), abs=0.2)


def test_a_slow_turn_is_none() -> None:
    assert found_after(0.2, 200.0) is None


def test_a_station_that_turns_along_is_no_turn_of_the_boat() -> None:
    assert found_after(0.6, 60.0, station_radps=0.6) is None


def test_a_boat_that_swings_is_not_let_go() -> None:
    watch = TurningWatch()
    station = Station(n_m=0.0, e_m=0.0, psi_rad=0.0)
    for tick in range(120 * HZ):
        t_s = tick / HZ
        assert watch.step(round(t_s * S), heading(2.0 * math.sin(1.5 * t_s)), station) is None


def test_a_turn_that_pauses_begins_anew() -> None:
    watch = TurningWatch()
    station, psi, t_ns = Station(n_m=0.0, e_m=0.0, psi_rad=0.0), 0.0, 0
    for _ in range(5):
        for rate_radps, seconds in ((1.0, 7.0), (0.0, 6.0)):  # a turn each time
            for _ in range(round(seconds * HZ)):
                t_ns += S // HZ
                psi = wrap_rad(psi + rate_radps / HZ)
                assert watch.step(t_ns, heading(psi), station) is None
