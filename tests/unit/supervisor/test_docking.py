"""Docking windows while a station is held: when one opens and ends, and how likely it stays open."""

from __future__ import annotations

import math

import numpy as np
import pytest

from asvhil.supervisor.docking import DOCKING_RATE_RADPS, EVERY_S, LEAST_S, DockingWatch, Peaks
from asvhil.supervisor.docking_odds import CAME_TRUE, COEFFICIENTS, HORIZONS_S, corrected, probability
from asvhil.types import DockingWindow, Estimate, Station, changed

S = 1_000_000_000
STATION = Station(n_m=100.0, e_m=50.0, psi_rad=math.pi)


def estimate(
    *, off_m: float = 0.0, off_deg: float = 0.0, u_mps: float = 0.0, r_degps: float = 0.0, valid: bool = True
) -> Estimate:
    return Estimate(
        t_ns=0, n_m=100.0 + off_m, e_m=50.0, psi_rad=-math.pi + math.radians(off_deg), u_mps=u_mps, v_mps=0.0,
        r_radps=math.radians(r_degps), motor=(), std=(0.0,) * 6, disturbance=(0.0, 0.0, 0.0), valid=valid,
    )  # fmt: skip


class Held:
    """A station that is held, twenty ticks a second."""

    def __init__(self) -> None:
        self.watch, self.t_ns = DockingWatch(), 1_700_000_000 * S

    def wait(
        self, seconds: float, at: Estimate | None, station: Station | None = STATION, *, put: bool = False
    ) -> DockingWindow | None:
        window = None
        for _ in range(round(seconds * 20)):
            self.t_ns += S // 20
            window = self.watch.step(self.t_ns, at, station, put=put)
        return window

    def swing(self, seconds: float, most_degps: float, off_m: float = 0.0) -> DockingWindow | None:
        window, period_s = None, 8.0
        for tick in range(round(seconds * 20)):
            rate = most_degps * math.sin(math.tau * tick / 20.0 / period_s)
            window = self.wait(0.05, estimate(r_degps=rate, off_m=off_m))
        return window


def test_a_boat_that_goes_with_its_station_is_slow() -> None:
    """The velocity is that relative to the station: whoever docks goes along."""
    held, at = Held(), STATION
    for _ in range(100):
        at = changed(at, n_m=at.n_m - 0.045, vn_mps=-0.9)
        window = held.wait(0.05, changed(estimate(u_mps=0.9), n_m=at.n_m), at)
    assert window is not None and window.open_s == pytest.approx(4.95)
    window = held.wait(0.05, changed(estimate(u_mps=0.0), n_m=at.n_m), at)
    assert window is not None and window.open_s is None


@pytest.mark.parametrize(
    ("inside", "outside"),
    [
        ({"off_m": 14.9}, {"off_m": 15.1}),
        ({"off_deg": 19.9}, {"off_deg": 20.1}),
        ({"off_deg": -19.9}, {"off_deg": -20.1}),
        ({"u_mps": -0.49}, {"u_mps": -0.51}),
        ({"r_degps": -4.9}, {"r_degps": -5.1}),
    ],
)
def test_each_limit_of_the_paper_ends_a_window(inside: dict[str, float], outside: dict[str, float]) -> None:
    held = Held()
    window = held.wait(3.0, estimate(**inside))
    assert window is not None and window.open_s == pytest.approx(2.95)
    window = held.wait(0.05, estimate(**outside))
    assert window == DockingWindow(open_s=None, stays=())
    window = held.wait(1.0, estimate(**inside))
    assert window is not None and window.open_s == pytest.approx(0.95)


def test_there_is_none_without_a_station_or_a_valid_estimate_and_a_short_gap_does_not_end_it() -> None:
    held = Held()
    held.wait(5.0, estimate())
    assert held.wait(0.5, estimate(valid=False)) is None and held.wait(0.3, None) is None
    window = held.wait(0.05, estimate())
    assert window is not None and window.open_s == pytest.approx(5.8)
    assert held.wait(2.0, estimate(), None) is None
    window = held.wait(0.05, estimate())
    assert window is not None and window.open_s == 0.0


@pytest.mark.parametrize(
    ("n_m", "turned_deg", "put", "open_s"),
    [
        (100.0, 1.0, False, 5.0),
        (100.0, 15.0, False, 5.0),  # as a free heading does that the boat happens to lie at
        (100.0, 4.0, True, 5.0),
        (100.0, 6.0, True, 0.0),
        (100.4, 0.0, True, 5.0),
        (100.6, 0.0, True, 0.0),
    ],
)
def test_another_station_begins_anew_and_one_that_turns_by_itself_does_not(n_m, turned_deg, put, open_s) -> None:
    held = Held()
    held.wait(5.0, estimate())
    station = Station(n_m=n_m, e_m=50.0, psi_rad=math.pi - math.radians(turned_deg))
    window = held.wait(0.05, estimate(), station, put=put)
    assert window is not None and window.open_s == pytest.approx(open_s)


def test_a_set_point_that_jitters_is_one_station_and_one_that_creeps_is_not() -> None:
    held = Held()
    for tick in range(100):
        window = held.wait(0.05, estimate(), Station(n_m=100.0 + 0.2 * (tick % 2), e_m=50.0, psi_rad=math.pi), put=True)
    assert window is not None and window.open_s == pytest.approx(4.95)
    for tick in range(12):
        station = Station(n_m=100.0 + 0.06 * tick, e_m=50.0, psi_rad=math.pi)
        window = held.wait(0.05, estimate(), station, put=True)
    assert window is not None and window.open_s is not None and window.open_s < 0.2


def test_rices_rate_is_that_of_the_crossings() -> None:
    """Of a Gaussian signal with a period of some seconds, against the crossings that are counted."""
    rng = np.random.default_rng(5)
    t_s = np.arange(0.0, 4000.0, EVERY_S)
    bands = np.linspace(0.02, 0.12, 60)
    phases = rng.uniform(0.0, math.tau, len(bands))
    signal = 0.3 * np.sqrt(2.0 / len(bands)) * np.cos(math.tau * np.outer(t_s, bands) + phases).sum(axis=1)
    peaks, rates = Peaks(0.45), []
    for value in signal.tolist():
        peaks.add(value)
        rates.append(peaks.rate_per_s)
    beyond = np.abs(signal) > 0.45
    counted = np.count_nonzero(beyond[1:] & ~beyond[:-1]) / t_s[-1]
    assert np.mean(rates[200:]) == pytest.approx(counted, rel=0.25)


def test_a_forecast_needs_some_motion_to_tell_by() -> None:
    held = Held()
    window = held.wait(LEAST_S - 1.5, estimate())
    assert window is not None and window.stays == ()
    window = held.wait(3.0, estimate())
    assert window is not None and len(window.stays) == len(HORIZONS_S)


def test_a_boat_that_lies_still_stays_likelier_than_one_that_swings_near_the_limit() -> None:
    still, near, beyond = (Held() for _ in range(3))
    lies, swings = still.swing(90.0, 0.5), near.swing(90.0, 4.5)
    beyond.swing(90.0, 7.0)
    often_ended = beyond.wait(1.0, estimate())
    assert lies is not None and swings is not None and often_ended is not None
    assert lies.open_s == pytest.approx(89.95) and swings.open_s == pytest.approx(89.95)
    for calm, rough, ends in zip(lies.stays, swings.stays, often_ended.stays, strict=True):
        assert 1.0 > calm > rough >= ends >= 0.0
    for window in (lies, swings, often_ended):
        assert list(window.stays) == sorted(window.stays, reverse=True)
    assert lies.stays[0] > 0.8 and often_ended.stays[0] < 0.65


def test_a_calm_boat_far_from_its_station_will_have_to_go_back() -> None:
    at_it, off_it = Held(), Held()
    here, there = at_it.swing(90.0, 3.5, off_m=0.2), off_it.swing(90.0, 3.5, off_m=3.0)
    assert here is not None and there is not None
    assert here.stays[0] > there.stays[0] + 0.1


def test_it_is_the_same_with_the_same_motion() -> None:
    assert Held().swing(40.0, 4.0) == Held().swing(40.0, 4.0)
    assert pytest.approx(math.radians(5.0)) == DOCKING_RATE_RADPS


def test_a_probability_is_one_however_large_the_features() -> None:
    for row, table in zip(COEFFICIENTS, CAME_TRUE, strict=True):
        for size in (1e3, -1e3):
            assert 0.0 <= corrected(probability(row, (1.0, *[size] * (len(row) - 1))), table) <= 1.0


def test_a_correction_lies_between_its_points_and_ends_with_them() -> None:
    table = ((0.1, 0.0), (0.3, 0.4), (0.5, 0.4), (0.9, 0.8))
    told = (0.0, 0.1, 0.2, 0.3, 0.4, 0.7, 0.9, 1.0)
    assert [corrected(p, table) for p in told] == pytest.approx([0.0, 0.0, 0.2, 0.4, 0.4, 0.6, 0.8, 0.8])


def test_a_correction_that_ships_rises() -> None:
    for table in CAME_TRUE:
        assert [p for p, _ in table] == sorted(p for p, _ in table)
        assert [share for _, share in table] == sorted(share for _, share in table)
