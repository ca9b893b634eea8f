"""A boat that the estimate has near the station and the receiver's velocity does not."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from asvhil.config import load_config
from asvhil.motion.carried import CarriedWatch
from asvhil.motion.watch import MotionWatch
from asvhil.supervisor.reasons import Explanation, Reason
from asvhil.types import Estimate, GroundVelocity, Station

TICK_NS = 50_000_000


def at(t_ns: int, n_m: float, e_m: float = 0.0) -> Estimate:
    return Estimate(
        t_ns=t_ns, n_m=n_m, e_m=e_m, psi_rad=0.0, u_mps=0.0, v_mps=0.0, r_radps=0.0,
        motor=(), std=(), disturbance=(0.0, 0.0, 0.0), valid=True,
    )  # fmt: skip


class Boat:
    """An estimate that moves at one velocity, and a receiver that tells of another one."""

    def __init__(self) -> None:
        self.watch, self.t_ns, self.n_m, self.e_m = CarriedWatch(), 0, 3.0, -4.0

    def run(
        self,
        seconds: float,
        told: tuple[float, float] | None,
        estimated: tuple[float, float] = (0.0, 0.0),
        late_ns: int = 0,
    ) -> tuple[float, float]:
        """(north, east) that the watch adds to the estimate."""
        found = at(0, 0.0)
        for _ in range(round(seconds * 1e9 / TICK_NS)):
            self.t_ns += TICK_NS
            self.n_m += estimated[0] * TICK_NS * 1e-9
            self.e_m += estimated[1] * TICK_NS * 1e-9
            velocity = None
            if told is not None:
                velocity = GroundVelocity(t_ns=self.t_ns - late_ns, vn_mps=told[0], ve_mps=told[1])
            found = self.watch.step(self.t_ns, velocity, at(self.t_ns, self.n_m, self.e_m))
        return found.n_m - self.n_m, found.e_m - self.e_m


def test_an_estimate_that_follows_stays_as_it_is() -> None:
    boat = Boat()
    assert boat.run(60.0, (2.5, -1.0), (2.5, -1.0)) == (0.0, 0.0)
    assert boat.run(60.0, (2.55, -1.05), (2.5, -1.0)) == (0.0, 0.0), "an error of 0.05 m/s"


def test_one_that_stays_behind_is_put_where_the_velocity_has_brought_the_boat() -> None:
    boat = Boat()
    n_m, e_m = boat.run(4.05, (2.0, -1.5))
    left = (1.0 - math.exp(-4.0 / 8.0)) * 8.0  # of each m/s, with what is forgotten
    assert (n_m, e_m) == pytest.approx((2.0 * left, -1.5 * left), rel=0.03)  # but for the first two readings


@pytest.mark.parametrize("period_ticks", [1, 4, 20])
def test_one_wrong_velocity_carries_nothing(period_ticks: int) -> None:
    """Of a receiver at 20, 5 and 1 Hz: 60 m/s, which count until the next reading."""
    watch, estimate = CarriedWatch(), at(0, 0.0)
    for tick in range(200):
        t_ns = tick * 50_000_000
        if tick % period_ticks == 0:
            velocity = GroundVelocity(t_ns=t_ns, vn_mps=60.0 if tick == 100 else 0.0, ve_mps=0.0)
        assert watch.step(t_ns, velocity, estimate) == estimate


def test_it_is_forgotten_while_nothing_comes() -> None:
    boat = Boat()
    before, _ = boat.run(6.0, (2.0, 0.0))
    silent, _ = boat.run(2.0, None)
    assert silent == pytest.approx(before * math.exp(-2.0 / 8.0), rel=0.01)
    old, _ = boat.run(2.0, (2.0, 0.0), late_ns=1_050_000_000)
    assert old == pytest.approx(before * math.exp(-4.0 / 8.0), rel=0.01)
    assert boat.run(5.0, (2.0, 0.0), late_ns=1_000_000_000)[0] > before


def test_an_estimate_that_jumps_alone_has_not_moved_the_boat() -> None:
    boat = Boat()
    boat.run(1.0, (0.0, 0.0))
    boat.e_m += 20.0
    assert boat.run(0.05, (0.0, 0.0)) == pytest.approx((0.0, -20.0))
    assert boat.watch.off_m == pytest.approx(20.0)


def test_less_than_2_5_m_is_nothing() -> None:
    boat = Boat()
    boat.run(1.0, (0.0, 0.0))
    boat.n_m += 2.49
    assert boat.run(0.05, (0.0, 0.0)) == (0.0, 0.0)
    assert boat.watch.off_m == 0.0
    boat.n_m += 0.03
    assert boat.run(0.05, (0.0, 0.0)) == pytest.approx((-2.51, 0.0), abs=0.02)


def test_a_new_estimate_is_where_the_boat_is() -> None:
    boat = Boat()
    assert boat.run(6.0, (2.0, 0.0))[0] > 8.0
    boat.watch.reset()
    assert boat.run(0.5, (2.0, 0.0)) == (0.0, 0.0)
    boat.watch.reset()
    boat.run(0.05, (0.0, 0.0))
    boat.n_m -= 2.4
    assert boat.run(0.05, (0.0, 0.0)) == (0.0, 0.0), "nothing is left of what was before"


@pytest.mark.parametrize(("ailing", "ends"), [(frozenset(), True), (frozenset({GroundVelocity}), False)])
def test_a_hold_ends_by_the_velocity_where_the_estimate_stays(ailing: frozenset[type], ends: bool) -> None:
    watch, station = MotionWatch(load_config("sitl")), Station(n_m=0.0, e_m=0.0, psi_rad=0.0)
    found: Explanation | None = None
    for tick in range(1, 121):
        t_ns = tick * TICK_NS
        velocity = GroundVelocity(t_ns=t_ns, vn_mps=0.0, ve_mps=2.5)
        found = watch.step(t_ns, (velocity,), (0.5, 0.5), None, at(t_ns, 0.0), ailing) or found
        watch.note_station(station)
    assert (found is not None and found.reason is Reason.DRIFTED_OFF) is ends


@pytest.mark.parametrize(("gap", "ends"), [(False, True), (True, False)], ids=["all the time", "after a gap"])
def test_a_hold_begins_where_the_velocity_has_brought_the_boat(gap: bool, ends: bool) -> None:
    """It has been carried for 5 s while the estimate stayed where it was."""
    watch, station = MotionWatch(load_config("sitl")), Station(n_m=0.0, e_m=0.0, psi_rad=0.0)
    found: Explanation | None = None
    for tick in range(1, 151):
        t_ns = tick * TICK_NS
        velocity = GroundVelocity(t_ns=t_ns, vn_mps=0.0, ve_mps=2.0)
        estimate = replace(at(t_ns, 0.0, -8.0), valid=not (gap and tick == 100))
        found = watch.step(t_ns, (velocity,), (0.5, 0.5), None, estimate, frozenset()) or found
        watch.note_station(station if tick > 100 else None)
    assert (found is not None and found.reason is Reason.DRIFTED_OFF) is ends
