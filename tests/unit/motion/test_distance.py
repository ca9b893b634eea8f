"""The watch over the distance: how far off is too far, and whose fault it is."""

from __future__ import annotations

import math
from dataclasses import replace
from random import Random

import pytest

from asvhil.config import MotionConfig, ProcedureConfig, load_config
from asvhil.motion.distance import DistanceWatch
from asvhil.supervisor.reasons import Explanation, Reason
from asvhil.types import Estimate, Station

VESSEL = load_config("sitl").vehicle.vessel
STATION = Station(n_m=0.0, e_m=0.0, psi_rad=0.0)
PROCEDURE = ProcedureConfig(enabled=True, r_s_m=15.0, r_d_m=20.0, turn_radius_m=8.0)


def at(n_m: float, u_mps: float = 0.0) -> Estimate:
    return Estimate(
        t_ns=0, n_m=n_m, e_m=0.0, psi_rad=0.0, u_mps=u_mps, v_mps=0.0, r_radps=0.0,
        motor=(), std=(), disturbance=(0.0, 0.0, 0.0), valid=True,
    )  # fmt: skip


class Path:
    """A boat that is moved along the north axis, a tick each 0.1 m."""

    def __init__(self, start_m: float, u_mps: float = 0.0, current: tuple[float, float] = (0.0, 0.0)) -> None:
        self.watch = DistanceWatch(MotionConfig(), VESSEL)
        self.t_ns, self.n_m, self.u_mps, self.current = 0, start_m, u_mps, current
        self.station = STATION

    def to(self, n_m: float, command: tuple[float, float] = (0.2, 0.2)) -> Explanation | None:
        step = 0.1 if n_m >= self.n_m else -0.1
        for _ in range(round(abs(n_m - self.n_m) / 0.1) + 1):
            self.t_ns += 50_000_000
            found = self.watch.step(self.t_ns, at(self.n_m, self.u_mps), self.station, command, self.current)
            if found is not None:
                return found
            self.n_m += step
        return None


def test_so_much_farther_than_at_the_begin_is_too_far() -> None:
    path = Path(5.0)
    assert path.to(12.9) is None
    found = path.to(13.2)
    assert found is not None and found.reason is Reason.DRIFTED_OFF and dict(found.detail)["metres"] > 8.0


def test_it_counts_from_where_the_boat_has_been_nearest() -> None:
    path = Path(12.0)
    assert path.to(1.0) is None and path.to(8.9) is None
    assert path.to(9.3) is not None


def test_motors_at_their_limit_are_named() -> None:
    path = Path(0.0)
    found = path.to(9.0, (1.0, -1.0))
    assert found is not None and found.reason is Reason.BEYOND_MOTORS


def test_from_far_off_there_is_room_to_turn() -> None:
    path = Path(60.0)
    assert path.to(74.5) is None and path.to(75.5) is not None


def test_a_boat_with_way_on_may_stop() -> None:
    """At 3 m/s the WAM-V, with half of 186 N astern on 280 kg, needs 13.5 m."""
    assert Path(0.0, u_mps=3.0).to(13.0) is None
    assert Path(0.0, u_mps=3.0).to(14.0) is not None


def test_a_boat_that_is_carried_has_no_way_on() -> None:
    found = Path(0.0, u_mps=2.5, current=(2.5, 0.0)).to(8.5)
    assert found is not None


def test_a_station_that_is_moved_gives_room_to_turn() -> None:
    path = Path(0.0)
    assert path.to(5.0) is None
    path.station = Station(n_m=-30.0, e_m=0.0, psi_rad=0.0)  # 35 m off now
    assert path.to(12.0) is None
    assert path.to(15.0) is not None


@pytest.mark.parametrize("begin", [True, False])
def test_a_new_hold_at_the_same_station_begins_anew(begin: bool) -> None:
    path = Path(0.0)
    assert path.to(7.0) is None
    if begin:
        path.watch.begin()
    assert (path.to(10.0) is None) is begin


def test_the_procedure_has_room_for_a_turn_with_the_station_astern() -> None:
    path = Path(24.0)
    path.watch = DistanceWatch(MotionConfig(), VESSEL, PROCEDURE)
    assert path.to(24.0 + 8.0 + 16.0 - 0.2) is None
    found = path.to(24.0 + 8.0 + 16.0 + 0.3)
    assert found is not None and found.reason is Reason.DRIFTED_OFF


@pytest.mark.parametrize("start_m", [0.0, 14.0])
def test_the_procedure_may_start_over_before_the_hold_ends(start_m: float) -> None:
    """A station that was kept within 8 m of r_d_m would never be approached again."""
    path = Path(start_m)
    path.watch = DistanceWatch(MotionConfig(), VESSEL, PROCEDURE)
    assert path.to(20.0 + 16.0 - 0.2) is None
    found = path.to(20.0 + 16.0 + 0.3)
    assert found is not None and found.reason is Reason.DRIFTED_OFF


def test_no_procedure_is_waited_for_in_a_strong_current_or_where_the_place_is_in_doubt() -> None:
    strong = (DistanceWatch(MotionConfig(), VESSEL)._strong_mps, 0.0)
    for current, doubt_m, most_m in ((strong, 0.0, 4.0), ((0.0, 0.0), 0.5, 7.5)):
        watch = DistanceWatch(MotionConfig(), VESSEL, PROCEDURE)
        watch.step(1, at(0.0), STATION, (0.0, 0.0))
        assert watch.step(2, at(most_m - 0.1), STATION, (0.0, 0.0), current, doubt_m) is None
        assert watch.step(3, at(most_m + 0.1), STATION, (0.0, 0.0), current, doubt_m) is not None


class Leaving:
    """A watch whose boat is at the station for a time, and then 9 m off to the east."""

    def __init__(self) -> None:
        self.watch, self.t_ns = DistanceWatch(MotionConfig(), VESSEL), 5_000_000_000

    def run(self, seconds: float, command: tuple[float, float], e_m: float = 0.0) -> Explanation | None:
        found = None
        for _ in range(round(20 * seconds)):
            self.t_ns += 50_000_000
            found = self.watch.step(self.t_ns, replace(at(0.0), e_m=e_m), STATION, command)
        return found


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ((0.95, 0.0), Reason.BEYOND_MOTORS),
        ((0.0, -0.95), Reason.BEYOND_MOTORS),
        ((0.94, -0.94), Reason.DRIFTED_OFF),
    ],
)
def test_one_motor_at_its_limit_is_enough(command: tuple[float, float], reason: Reason) -> None:
    boat = Leaving()
    boat.run(12.0, command)
    found = boat.run(0.05, command, 9.0)
    assert found is not None and found.reason is reason and dict(found.detail) == {"metres": pytest.approx(9.0)}


@pytest.mark.parametrize(("at_limit_s", "reason"), [(6.95, Reason.DRIFTED_OFF), (7.1, Reason.BEYOND_MOTORS)])
def test_the_limit_counts_for_the_most_of_the_last_10_s(at_limit_s: float, reason: Reason) -> None:
    boat = Leaving()
    boat.run(30.0, (1.0, 1.0))
    boat.run(10.05 - at_limit_s, (0.0, 0.0))
    assert boat.run(at_limit_s - 0.05, (1.0, 1.0)) is None
    found = boat.run(0.05, (1.0, 1.0), 9.0)
    assert found is not None and found.reason is reason


def test_at_the_edges_of_what_is_allowed() -> None:
    """Exactly so far, so strong a current, so long ago, so often at the limit, and so near."""
    watch = DistanceWatch(MotionConfig(), VESSEL)
    watch.step(1, at(0.0), STATION, (0.0, 0.0))
    turned = replace(STATION, psi_rad=2.0)
    assert watch.step(2, at(8.0), turned, (0.0, 0.0)) is None and watch.farther_m == 8.0, "not another station"
    strong = (watch._strong_mps, 0.0)
    assert watch.step(3, at(4.1), turned, (0.0, 0.0), strong) is not None

    small = PROCEDURE.model_copy(update={"r_d_m": 15.1, "turn_radius_m": 2.0})
    near = DistanceWatch(MotionConfig(), VESSEL, small)
    near.step(1, at(15.0), STATION, (0.0, 0.0))
    assert near.step(2, at(23.1), STATION, (0.0, 0.0)) is not None, "no approach begins here, and no turn"

    often = DistanceWatch(MotionConfig(), VESSEL)
    for tick in range(1, 10):
        often.step(tick, at(0.0), STATION, (1.0, 1.0) if tick <= 7 else (0.0, 0.0))
    found = often.step(10, at(9.0), STATION, (0.0, 0.0))
    assert found is not None and found.reason is Reason.BEYOND_MOTORS, "7 of 10"
    ago = DistanceWatch(MotionConfig(), VESSEL)
    ago.step(1, at(0.0), STATION, (0.0, 0.0))
    found = ago.step(10_000_000_001, at(9.0), STATION, (1.0, 1.0))
    assert found is not None and found.reason is Reason.DRIFTED_OFF, "1 of 2"


def test_it_tells_how_much_farther_off_the_boat_is() -> None:
    boat = Leaving()
    assert boat.watch.farther_m == 0.0
    boat.run(1.0, (0.0, 0.0), 3.0)
    boat.run(1.0, (0.0, 0.0), -2.0)
    assert boat.watch.farther_m == 0.0
    boat.run(1.0, (0.0, 0.0), 6.5)
    assert boat.watch.farther_m == pytest.approx(4.5)
    boat.watch.begin()
    assert boat.watch.farther_m == 0.0


def test_way_to_the_side_counts_as_well_and_a_current_by_the_heading() -> None:
    for estimate, current, far_m in (
        (replace(at(0.0), v_mps=3.0), (0.0, 0.0), 13.5),
        (replace(at(0.0), u_mps=1.5, psi_rad=math.pi / 2.0), (0.0, 1.5), 8.0),
        (replace(at(0.0), v_mps=1.5, psi_rad=math.pi / 2.0), (-1.5, 0.0), 8.0),
        (replace(at(0.0), u_mps=3.0, psi_rad=math.pi / 2.0), (1.5, 0.0), 16.95),
    ):
        watch = DistanceWatch(MotionConfig(), VESSEL)
        assert watch.step(1, estimate, STATION, (0.0, 0.0), current) is None
        assert watch.step(2, replace(estimate, e_m=far_m - 0.2), STATION, (0.0, 0.0), current) is None
        assert watch.step(3, replace(estimate, e_m=far_m + 0.2), STATION, (0.0, 0.0), current) is not None


@pytest.mark.parametrize(("drag", "top_mps"), [((50.0, 100.0), 2.0), ((100.0, 0.0), 5.0), ((0.0, 125.0), 2.0)])
def test_in_a_current_near_the_top_speed_half_of_the_distance_is_allowed(
    drag: tuple[float, float], top_mps: float
) -> None:
    """The boat's top speed is where drag and thrust of both motors are alike: here 500 N."""
    changes = {
        "thrust_curve": ((-1.0, -200.0), (0.0, 0.0), (1.0, 250.0)),
        "surge_drag_n_per_mps": drag[0],
        "surge_drag_n_per_mps2": drag[1],
    }
    vessel = VESSEL.model_copy(update=changes)
    for share, allowed_m in ((0.69, 8.0), (0.71, 4.0)):
        current = (0.6 * share * top_mps, -0.8 * share * top_mps)
        for far_m, is_far in ((allowed_m - 0.1, False), (allowed_m + 0.1, True)):
            watch = DistanceWatch(MotionConfig(), vessel)
            start = replace(at(0.0), u_mps=current[0], v_mps=current[1])
            watch.step(1, start, STATION, (0.0, 0.0), current)
            assert (watch.step(2, at(far_m), STATION, (0.0, 0.0), current) is not None) is is_far


def test_a_boat_without_drag_has_no_top_speed() -> None:
    vessel = VESSEL.model_copy(update={"surge_drag_n_per_mps": 0.0, "surge_drag_n_per_mps2": 0.0})
    watch = DistanceWatch(MotionConfig(), vessel)
    watch.step(1, replace(at(0.0), u_mps=9.0), STATION, (0.0, 0.0), (9.0, 0.0))
    assert watch.step(2, at(7.9), STATION, (0.0, 0.0), (9.0, 0.0)) is None


@pytest.mark.parametrize(
    ("moved", "room_m"),
    [
        (replace(STATION, psi_rad=1.0), 0.0),
        (replace(STATION, psi_rad=math.pi), 0.0),
        (replace(STATION, n_m=-2.9), 0.0),
        (replace(STATION, e_m=2.9), 0.0),
        (replace(STATION, n_m=-3.1), 6.0),
        (replace(STATION, e_m=3.1), 6.0),
    ],
)
def test_a_move_takes_nothing_back_of_how_far_the_boat_was_carried_and_a_large_one_gives_room(
    moved: Station, room_m: float
) -> None:
    """6 m off when the station is moved: 8 m in all, or 8 m more where the boat may have to turn."""
    watch = DistanceWatch(MotionConfig(), VESSEL)
    watch.step(1, at(0.0), STATION, (0.0, 0.0))
    watch.step(2, at(6.0), STATION, (0.0, 0.0))
    watch.step(3, at(6.0), moved, (0.0, 0.0))
    assert watch.farther_m == pytest.approx(6.0)
    away = 6.0 - moved.n_m, -moved.e_m
    off_m = math.hypot(*away)
    for far_m, is_far in ((8.0 + room_m - 0.1, False), (8.0 + room_m + 0.1, True)):
        share = (off_m + far_m - 6.0) / off_m
        boat = replace(at(moved.n_m + share * away[0]), e_m=moved.e_m + share * away[1])
        assert (watch.step(4, boat, moved, (0.0, 0.0)) is not None) is is_far


@pytest.mark.parametrize(
    ("current", "wrong_m", "most_m"), [((0.0, 0.0), 17.0, 22.5), ((0.0, 0.0), 3.0, 11.0), ((1.6, 0.0), 9.0, 11.25)]
)
def test_a_move_takes_no_room_away_that_a_boat_on_its_way_round_needs(
    current: tuple[float, float], wrong_m: float, most_m: float
) -> None:
    """Held 90 m off, it may go 22.5 m the wrong way, half of that in a strong current: so also with a station near."""
    path = Path(0.0, current=current)
    path.station = Station(n_m=90.0, e_m=0.0, psi_rad=0.0)
    assert path.to(-wrong_m) is None
    path.station = Station(n_m=10.0, e_m=0.0, psi_rad=0.0)
    assert path.to(0.2 - most_m) is None
    assert path.to(-0.3 - most_m) is not None


@pytest.mark.parametrize("doubt_m", [0.0, 3.0])
def test_a_move_lets_no_boat_go_in_its_own_tick(doubt_m: float) -> None:
    for far_m in (60.0, 90.0, 150.0):
        for current in ((0.0, 0.0), (1.6, 0.0)):
            for to_m in (30.0, 10.0, 0.0):
                watch, tick, found = DistanceWatch(MotionConfig(), VESSEL), 0, None
                far = replace(STATION, n_m=far_m)
                watch.step(0, at(0.0), far, (0.5, 0.5), current, doubt_m)
                last_m = watch._allowed_m * (0.5 if current[0] else 1.0) - doubt_m - 0.05
                for tick in range(1, 21):
                    found = watch.step(tick, at(-last_m * tick / 20.0), far, (0.5, 0.5), current, doubt_m)
                    assert found is None
                moved = replace(STATION, n_m=to_m)
                assert watch.step(21, at(-last_m), moved, (0.5, 0.5), current, doubt_m) is None


def test_moves_again_and_again_give_no_more_room_than_a_boat_at_rest_has() -> None:
    """A boat that goes east at 0.8 m/s, whatever the station does to the north of it: 8 m, and 8 m to turn."""
    for step_m, every in ((3.5, 100), (-3.5, 100), (30.0, 400)):
        watch, station = DistanceWatch(MotionConfig(), VESSEL), STATION
        for tick in range(2400):
            if tick % every == 0:
                station = replace(STATION, n_m=step_m * (tick // every % 12))
            boat = replace(at(0.0), e_m=0.04 * tick, n_m=station.n_m)
            found = watch.step(50_000_000 * tick, boat, station, (1.0, -1.0))
            if found is not None:
                break
        assert found is not None and found.reason is Reason.BEYOND_MOTORS and boat.e_m < 20.0


@pytest.mark.parametrize(
    ("speed_mps", "procedure", "most_m"), [(0.3, None, 25.0), (0.7, None, 25.0), (0.9, PROCEDURE, 55.0)]
)
def test_set_points_that_are_placed_from_where_the_boat_is_hide_no_boat_that_is_swept_away(
    speed_mps: float, procedure: ProcedureConfig | None, most_m: float
) -> None:
    """A planner has it go 3.6 m upstream of where it is now, every 2 s."""
    watch, station, found, tick = DistanceWatch(MotionConfig(), VESSEL, procedure), STATION, None, 0
    while found is None and tick < 2400:
        n_m = -speed_mps * tick / 20.0
        if tick % 40 == 0:
            station = replace(STATION, n_m=n_m + 3.6)
        found = watch.step(50_000_000 * tick, at(n_m), station, (1.0, 1.0))
        tick += 1
    assert found is not None and found.reason is Reason.BEYOND_MOTORS and n_m > -most_m


def test_a_station_put_to_the_boat_and_back_takes_nothing_back_either() -> None:
    watch = DistanceWatch(MotionConfig(), VESSEL)
    for tick, n_m in enumerate((0.0, 6.0)):
        watch.step(50_000_000 * tick, at(n_m), STATION, (0.2, 0.2))
    for tick, to_m in ((2, 6.0), (3, 0.0), (4, 6.0)):
        watch.step(50_000_000 * tick, at(6.0), replace(STATION, n_m=to_m), (0.2, 0.2))
        assert watch.farther_m == pytest.approx(6.0, abs=0.02)
    for tick in range(5, 6000):  # but where it stays after that it is well
        found = watch.step(50_000_000 * tick, at(6.0), replace(STATION, n_m=6.0), (0.2, 0.2))
        assert found is None
    assert watch.farther_m < 0.1


@pytest.mark.parametrize("every", [1, 20, 75])
def test_a_boat_that_rocks_in_waves_is_not_carried_off_by_set_points_that_jitter(every: int) -> None:
    for seed in range(3):
        watch, random, station, most_m = DistanceWatch(MotionConfig(), VESSEL), Random(seed), STATION, 0.0
        for tick in range(12_000):
            if tick % every == 0:
                station = replace(STATION, n_m=random.uniform(-1.0, 1.0), e_m=random.uniform(-1.0, 1.0))
            boat = replace(at(0.6 * math.sin(0.11 * tick)), e_m=0.6 * math.sin(0.083 * tick))
            assert watch.step(50_000_000 * tick, boat, station, (0.2, 0.2)) is None
            most_m = max(most_m, watch.farther_m)
        assert most_m < 4.0


def test_moves_that_swap_two_places_give_no_more_room_either() -> None:
    watch = DistanceWatch(MotionConfig(), VESSEL)
    for tick in range(2400):
        station = replace(STATION, n_m=4.0 if tick // 20 % 2 else 0.0)
        if watch.step(50_000_000 * tick, replace(at(2.0), e_m=0.04 * tick), station, (0.2, 0.2)) is not None:
            break
    assert 0.04 * tick < 18.5


def test_a_boat_that_is_on_its_way_to_far_stations_is_not_let_go() -> None:
    """It has 1.5 m/s on, and first goes on for 4 m each time that its station is put to the other side."""
    watch, n_m, station = DistanceWatch(MotionConfig(), VESSEL), 0.0, STATION
    for tick in range(12_000):
        if tick % 400 == 0:
            station = replace(STATION, n_m=n_m + (30.0 if tick // 400 % 2 else -30.0))
        toward = math.copysign(1.0, station.n_m - n_m)
        velocity = toward * min(1.5, 0.4 * (tick % 400) / 20.0 - 1.5)
        n_m += 0.05 * velocity
        assert watch.step(50_000_000 * tick, at(n_m, abs(velocity)), station, (1.0, 1.0)) is None


@pytest.mark.parametrize("every", [1, 4])
@pytest.mark.parametrize("jitter_m", [0.11, 0.5, 1.0])
def test_set_points_that_jitter_take_nothing_back_of_how_far_the_boat_was_carried(jitter_m: float, every: int) -> None:
    watch, random, station = DistanceWatch(MotionConfig(), VESSEL), Random(3), STATION
    for tick in range(4000):
        if tick % every == 0:
            station = replace(STATION, n_m=random.uniform(-jitter_m, jitter_m), e_m=random.uniform(-jitter_m, jitter_m))
        n_m = 0.5 + 0.01 * tick
        if watch.step(50_000_000 * tick, at(n_m), station, (0.2, 0.2)) is not None:
            break
    assert 8.0 - 3.0 * jitter_m < n_m < 8.5 + 3.0 * jitter_m


def test_a_station_of_a_point_away_from_the_origin_may_turn_about_it() -> None:
    """The origin's station goes 6 m to the other side: nobody has moved the station."""
    watch = DistanceWatch(MotionConfig(), VESSEL)
    for tick in range(100):
        psi_rad = 0.15 * tick
        origin = Station(n_m=-3.0 * math.cos(psi_rad), e_m=-3.0 * math.sin(psi_rad), psi_rad=psi_rad)
        found = watch.step(50_000_000 * tick, at(0.2 * tick), origin, (0.2, 0.2), point=STATION)
        if found is not None:
            break
    assert found is not None and 40 <= tick <= 60


def test_a_place_in_doubt_counts_as_farther_off_by_that() -> None:
    watch = DistanceWatch(MotionConfig(), VESSEL)
    assert watch.step(1, at(2.0), STATION, (0.0, 0.0), doubt_m=5.0) is None
    assert watch.farther_m == pytest.approx(5.0)
    assert watch.step(2, at(4.9), STATION, (0.0, 0.0), doubt_m=5.0) is None
    assert watch.step(3, at(5.1), STATION, (0.0, 0.0), doubt_m=5.0) is not None
    assert watch.step(4, at(5.1), STATION, (0.0, 0.0)) is None


def test_the_distance_is_that_to_the_station() -> None:
    watch, station = DistanceWatch(MotionConfig(), VESSEL), Station(n_m=3.0, e_m=-4.0, psi_rad=0.0)
    watch.step(1, replace(at(3.0), e_m=-4.0), station, (0.0, 0.0))
    watch.step(2, at(0.0), station, (0.0, 0.0))
    assert watch.farther_m == pytest.approx(5.0)


def test_a_boat_that_follows_its_station_is_not_carried_off_and_one_that_does_not_is() -> None:
    path = Path(2.0)
    for tick in range(2000):  # 30 m at 0.3 m/s
        path.station = Station(n_m=0.015 * tick, e_m=0.0, psi_rad=0.0, vn_mps=0.3)
        path.n_m = path.station.n_m + 2.0 + math.sin(0.01 * tick)
        assert path.watch.step(50_000_000 * tick, at(path.n_m), path.station, (0.2, 0.2)) is None
    for tick in range(2000, 4000):
        path.station = Station(n_m=0.015 * tick, e_m=0.0, psi_rad=0.0, vn_mps=0.3)
        found = path.watch.step(50_000_000 * tick, at(30.0 - 0.02 * (tick - 2000)), path.station, (0.2, 0.2))
        if found is not None:
            break
    assert found is not None and found.reason is Reason.DRIFTED_OFF and tick < 2400
