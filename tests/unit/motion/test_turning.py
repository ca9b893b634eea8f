"""A held boat that turns round and round."""

from __future__ import annotations

import math

import pytest

from asvhil.geo import wrap_rad
from asvhil.motion.turning import FORGET_S, ROUND_RAD, TurningWatch
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
            assert told.reason is Reason.TURNS_ROUND and dict(told.detail)["turns"] >= 2.49
            return t_s
    return None


def asked_s(rate_radps: float) -> float:
    """Two turns and a half, which are forgotten with the time constant."""
    return -FORGET_S * math.log(1.0 - ROUND_RAD / (FORGET_S * abs(rate_radps)))


@pytest.mark.parametrize("rate_radps", [1.3, -1.3, 0.5])
def test_two_turns_and_a_half_one_way_are_enough(rate_radps: float) -> None:
    assert found_after(rate_radps, 60.0) == pytest.approx(asked_s(rate_radps), abs=0.2)


@pytest.mark.parametrize("hz", [1, 2, 5])
@pytest.mark.parametrize("rate_radps", [0.2, 0.4])
def test_a_boat_that_turns_as_set_points_say_is_not_let_go(hz: int, rate_radps: float) -> None:
    """A companion that sends a new heading so many times a second."""
    watch = TurningWatch()
    for tick in range(200 * HZ):
        t_s = tick / HZ
        station = Station(n_m=0.0, e_m=0.0, psi_rad=wrap_rad(rate_radps * math.floor(t_s * hz) / hz))
        assert watch.step(round(t_s * S), heading(wrap_rad(rate_radps * t_s)), station) is None


def test_a_station_whose_heading_turns_alone_does_not_have_the_boat_let_go() -> None:
    watch = TurningWatch()
    for tick in range(100 * HZ):
        station = Station(n_m=0.0, e_m=0.0, psi_rad=wrap_rad(0.5 * tick / HZ))
        assert watch.step(tick * S // HZ, heading(0.1), station) is None


def test_a_heading_that_is_laid_to_the_boats_own_excuses_no_turn() -> None:
    """As the policy `free` does where no weather is known."""
    watch, laid_rad = TurningWatch(), 0.0
    for tick in range(20 * HZ):
        psi_rad = wrap_rad(1.3 * tick / HZ)
        if abs(wrap_rad(psi_rad - laid_rad)) > 0.5:
            laid_rad = psi_rad
        station = Station(n_m=0.0, e_m=0.0, psi_rad=laid_rad)
        if watch.step(tick * S // HZ, heading(psi_rad), station, follows=True) is not None:
            break
    assert tick / HZ == pytest.approx(asked_s(1.3), abs=0.2)


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


def test_a_boat_that_turns_slowly_in_a_swell_is_not_let_go() -> None:
    """Its yaw is fast at times, so it is never at rest."""
    watch = TurningWatch()
    for tick in range(600 * HZ):
        t_s = tick / HZ
        psi_rad = wrap_rad(0.1 * t_s + 0.4 * math.sin(1.5 * t_s))
        assert watch.step(round(t_s * S), heading(psi_rad), Station(n_m=0, e_m=0, psi_rad=0), follows=True) is None


def test_a_turn_that_pauses_begins_anew() -> None:
    watch = TurningWatch()
    station, psi, t_ns = Station(n_m=0.0, e_m=0.0, psi_rad=0.0), 0.0, 0
    for _ in range(5):
        for rate_radps, seconds in ((1.0, 7.0), (0.0, 6.0)):  # a turn each time
            for _ in range(round(seconds * HZ)):
                t_ns += S // HZ
                psi = wrap_rad(psi + rate_radps / HZ)
                assert watch.step(t_ns, heading(psi), station) is None
