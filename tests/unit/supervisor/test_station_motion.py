"""A station that moves: on a course, after a leader, and when it stays."""

import math
import random
import struct
from dataclasses import replace

import pytest

from asvhil.config import MovingConfig, StationConfig, SupervisorConfig, load_config
from asvhil.supervisor.reasons import Reason, describe, explain
from asvhil.supervisor.station_motion import SHARE, SUBJECT, VELOCITY_SUBJECT, StationMotion, fastest_mps
from asvhil.types import CourseCommand, HoldCommand, LeaderMessage, MoveCommand, Phase, Station
from tests.support.supervisor_bench import ESTIMATE, FRAME, SupervisorBench

HERE = (ESTIMATE.n_m, ESTIMATE.e_m)
FENCE = tuple(FRAME.to_geodetic(n, e) for n, e in ((-10.0, -10.0), (5.0, -10.0), (5.0, 10.0), (-10.0, 10.0)))


class Moving(SupervisorBench):
    """A boat that holds a station where it is, and is wherever its station is from then on."""

    def __init__(self, **config: object) -> None:
        super().__init__(SupervisorConfig(**config))  # type: ignore[arg-type]
        assert self.hold() is None
        self.follows = True

    def course(self, **fields: float) -> object:
        return self.step(0, CourseCommand(t_ns=self.t_ns, **fields)).answers[0]  # type: ignore[arg-type]

    def wait(self, seconds: float) -> Station:
        for _ in range(round(seconds * 20)):
            station = self.step().station
            assert station is not None
            if self.follows:
                self.estimate = replace(ESTIMATE, n_m=station.n_m, e_m=station.e_m)
        return station

    def leader(self, n_m: float, e_m: float, vn: float, ve: float, system_id: int = 42) -> None:
        lat_deg, lon_deg = FRAME.to_geodetic(n_m, e_m)
        at = {"lat_deg": lat_deg, "lon_deg": lon_deg, "velocity_mps": (vn, ve)}
        self.step(0, LeaderMessage(t_ns=self.t_ns, system_id=system_id, **at))  # type: ignore[arg-type]

    def led(self, seconds: float, vn: float, ve: float, start: tuple[float, float] = HERE) -> Station:
        """A leader that tells where it is each second, from a place on."""
        for second in range(round(seconds)):
            self.leader(start[0] + vn * second, start[1] + ve * second, vn, ve)
            station = self.wait(1.0)
        return station

    @property
    def note(self) -> str | None:
        return self.note_on(SUBJECT)

    def note_on(self, subject: str) -> str | None:
        return next((note.text for note in self.step(0).notes if note.subject == subject), None)


def place(station: Station) -> tuple[float, float]:
    return station.n_m - HERE[0], station.e_m - HERE[1]


def test_a_course_moves_the_station_and_tells_so() -> None:
    bench = Moving()
    assert bench.note is None
    assert bench.course(course_rad=math.pi / 2, speed_mps=0.3) is None
    station = bench.wait(10.0)
    assert place(station) == pytest.approx((0.0, 3.0), abs=0.02)
    assert (station.vn_mps, station.ve_mps) == pytest.approx((0.0, 0.3))
    decision = bench.step()
    assert not decision.station_changed and bench.note == "0.3 m/s toward 90"
    assert decision.course == CourseCommand(t_ns=bench.t_ns, speed_mps=0.3, course_rad=math.pi / 2, way_m=0.0, leader=0)
    assert bench.course(speed_mps=0.0) is None
    station = bench.wait(0.1)
    assert not station.moves and bench.wait(5.0) == station and bench.note is None


@pytest.mark.parametrize("most", [0.8, 0.7, 0.3])
def test_the_greatest_speed_is_allowed_as_the_link_brings_it(most: float) -> None:
    bench = Moving(moving=MovingConfig(max_speed_mps=most))
    (sent,) = struct.unpack("<f", struct.pack("<f", most))
    assert bench.course(speed_mps=sent) is None
    assert bench.step().course.speed_mps == pytest.approx(most, abs=1e-7) and bench.step().course.speed_mps <= most
    assert bench.course(speed_mps=most + 1e-4) == explain(Reason.STATION_TOO_FAST, speed=most + 1e-4, most=most)
    bench.course(leader=42)
    bench.led(2.0, 0.0, sent)
    assert (bench.note or "").endswith("after system 42"), "not faster than it may be"


def test_the_speed_that_a_refusal_names_is_allowed() -> None:
    motion = StationMotion(MovingConfig(), 0.7366)
    refusal = motion.choose(CourseCommand(t_ns=1, speed_mps=0.74))
    assert refusal is not None and "0.73 m/s at most" in describe(refusal)
    assert motion.choose(CourseCommand(t_ns=1, speed_mps=0.73)) is None


def test_a_new_hold_rests_and_a_move_goes_on() -> None:
    bench = Moving()
    bench.course(speed_mps=0.4)
    bench.wait(1.0)
    assert bench.move(n_m=50.0) is None
    bench.follows = False
    bench.estimate = replace(ESTIMATE, n_m=50.0)
    assert bench.wait(1.0).n_m == pytest.approx(50.4, abs=0.03)
    assert bench.hold() is None
    assert not bench.wait(1.0).moves


def test_the_way_ends_where_it_is_to_end() -> None:
    bench = Moving()
    bench.course(speed_mps=0.33, way_m=2.0)
    station = bench.wait(10.0)
    assert place(station) == pytest.approx((2.0, 0.0), abs=1e-9) and not station.moves


@pytest.mark.parametrize("speed_mps", [0.81, 5.0, -0.1, math.nan])
def test_a_speed_that_the_boat_has_not_is_refused(speed_mps: float) -> None:
    bench = Moving()
    refusal = bench.course(speed_mps=speed_mps)
    assert getattr(refusal, "reason", None) is Reason.STATION_TOO_FAST
    assert not bench.wait(0.5).moves


def test_the_boats_own_thrust_bounds_the_speed() -> None:
    vessel = load_config("sitl").vehicle.vessel
    speed = fastest_mps(vessel, MovingConfig(max_speed_mps=3.0))
    drag = vessel.surge_drag_n_per_mps * speed + vessel.surge_drag_n_per_mps2 * speed**2
    assert speed < 3.0 and drag == pytest.approx(SHARE * 2.0 * vessel.thrust_curve[-1][1])
    assert fastest_mps(vessel, MovingConfig(max_speed_mps=0.2)) == 0.2
    free = {"surge_drag_n_per_mps": 0.0, "surge_drag_n_per_mps2": 0.0}
    assert fastest_mps(vessel.model_copy(update=free), MovingConfig()) == 0.8


def test_no_course_without_a_station() -> None:
    bench = SupervisorBench()
    assert bench.step(0, CourseCommand(t_ns=0, speed_mps=0.1)).answers == (explain(Reason.NO_STATION_HELD),)


def test_the_station_waits_for_a_boat_that_falls_behind() -> None:
    bench = Moving()
    bench.course(speed_mps=0.5)
    bench.follows = False
    station = bench.wait(30.0)
    assert not station.moves and 6.0 < place(station)[0] < 6.1 and "waits" in (bench.note or "")
    bench.estimate = replace(ESTIMATE, n_m=station.n_m - 3.1)
    assert bench.wait(1.0) == station, "it goes on at half the distance"
    bench.estimate = replace(ESTIMATE, n_m=station.n_m - 2.9)
    assert bench.wait(0.2).moves and bench.note == "0.5 m/s toward 0"


def test_the_station_waits_while_the_estimate_is_not_known() -> None:
    bench = Moving()
    bench.course(speed_mps=0.5)
    before = bench.wait(1.0)
    bench.follows, bench.estimate = False, replace(ESTIMATE, valid=False)
    after = bench.wait(0.5)
    assert bench.step(0).phase is Phase.FAILSAFE and not after.moves
    assert bench.note == "waits until the boat is steered again"
    assert (after.n_m, after.e_m) == pytest.approx((before.n_m, before.e_m), abs=0.03)


def test_the_station_does_not_leave_the_fence() -> None:
    bench = Moving(geofence=FENCE)
    bench.course(speed_mps=0.8)
    station = bench.wait(20.0)
    assert 4.9 < station.n_m <= 5.0 and not station.moves and "outside the geofence" in (bench.note or "")


def test_auto_engage_starts_on_its_course() -> None:
    lat_deg, lon_deg = FRAME.to_geodetic(*HERE)
    at = StationConfig(lat_deg=lat_deg, lon_deg=lon_deg, heading_deg=0.0, speed_mps=0.2, course_deg=180.0)
    bench = SupervisorBench(SupervisorConfig(engage="auto", station=at))
    for _ in range(21):
        station = bench.step().station
    assert station is not None and place(station) == pytest.approx((-0.2, 0.0), abs=0.02)


# --- a leader -------------------------------------------------------------------------------------------------------


def test_a_leader_is_followed_with_its_velocity_and_only_the_one_that_was_named() -> None:
    bench = Moving(moving={"offset_m": (0.0, -3.0)})
    bench.leader(*HERE, 0.0, 0.5)
    assert not bench.wait(1.0).moves, "nobody has asked for it"
    assert bench.course(leader=42) is None and bench.note == "system 42 is not heard"
    bench.leader(*HERE, 0.0, 0.5, system_id=43)
    assert not bench.wait(1.0).moves
    station = bench.led(20.0, 0.0, 0.3, (HERE[0], HERE[1] + 3.0))
    assert place(station) == pytest.approx((0.0, 6.0), abs=0.05) and station.ve_mps == 0.3
    assert bench.note == "0.3 m/s toward 90, after system 42"


def test_a_system_without_a_number_is_nobodys_leader() -> None:
    bench = Moving()
    bench.leader(HERE[0] + 3.0, HERE[1], 0.5, 0.0, system_id=0)
    assert not bench.wait(2.0).moves and bench.note is None


def test_the_offset_may_turn_with_the_course() -> None:
    bench = Moving(moving={"offset_m": (-2.0, 1.0), "offset_frame": "course"})
    bench.course(leader=42)
    station = bench.led(30.0, 0.0, 0.2, (HERE[0] + 1.0, HERE[1] + 2.0))
    # East is ahead: 2 m astern of the leader is west, 1 m to starboard is south.
    assert place(station) == pytest.approx((0.0, 6.0), abs=0.05)


def test_a_leader_that_falls_silent_or_is_found_elsewhere() -> None:
    bench = Moving()
    bench.course(leader=42)
    bench.led(5.0, 0.4, 0.0)
    station = bench.wait(10.0)
    assert not station.moves and place(station)[0] == pytest.approx(0.4 * 7.0, abs=0.1)
    assert bench.note == "system 42 is silent: it stays"
    bench.leader(HERE[0] + 12.0, HERE[1], 0.4, 0.0)
    assert bench.wait(1.0) == station and "m from where the last message" in (bench.note or "")
    bench.course(leader=42)
    bench.leader(HERE[0] + 12.0, HERE[1], 0.4, 0.0)
    assert bench.wait(1.0).moves, "following it was asked for again"


def test_the_station_is_never_faster_than_allowed() -> None:
    bench = Moving(moving={"max_speed_mps": 0.5})
    bench.course(leader=42)
    before = bench.wait(0.1)
    for second in range(4):
        bench.leader(HERE[0] + 2.0 * second, HERE[1] + 1.0, 2.0, 0.0)
        for _ in range(20):
            after = bench.wait(0.05)
            assert math.hypot(after.n_m - before.n_m, after.e_m - before.e_m) <= 0.025 + 1e-9
            assert math.hypot(after.vn_mps, after.ve_mps) <= 0.5 + 1e-9
            before = after
    assert bench.note == "system 42 is faster than 0.5 m/s"


def test_the_station_goes_to_where_its_leader_lies() -> None:
    bench = Moving()
    bench.course(leader=42)
    assert place(bench.led(20.0, 0.0, 0.0, (HERE[0] - 1.0, HERE[1] + 2.0))) == pytest.approx((-1.0, 2.0), abs=0.01)


def test_a_leader_that_is_too_far_or_beyond_the_fence_is_not_followed() -> None:
    bench = Moving(max_distance_m=50.0)
    bench.course(leader=42)
    bench.leader(200.0, 0.0, 0.1, 0.0)
    assert not bench.wait(1.0).moves and "is not followed: station is 199 m away" in (bench.note or "")
    bench = Moving(geofence=FENCE)
    bench.course(leader=42)
    bench.leader(HERE[0], 12.0, 0.1, 0.0)
    assert not bench.wait(1.0).moves and "outside the geofence" in (bench.note or "")


def test_a_leader_that_comes_back_far_off_is_told_once_with_what_to_do() -> None:
    bench = Moving()
    bench.course(leader=42)
    bench.led(5.0, 0.3, 0.0)
    bench.wait(30.0)
    assert bench.note == "system 42 is silent: it stays"
    notes = set()
    for second in range(60):
        bench.leader(HERE[0] + 10.2 + 0.3 * second, HERE[1], 0.3, 0.0)
        bench.wait(1.0)
        notes.add(bench.note)
    (note,) = notes
    assert note is not None and note.endswith("5 m at most; set ST_FOLLOW anew to follow it from there")
    bench.wait(5.0)
    assert bench.note == "system 42 is silent: it stays"
    bench.leader(HERE[0] + 28.0, HERE[1], 0.3, 0.0)
    assert bench.note == note, "as it was told"
    bench.course(leader=42)
    bench.leader(HERE[0] + 28.5, HERE[1], 0.3, 0.0)
    assert bench.wait(0.5).moves and "after system 42" in (bench.note or "")


@pytest.mark.parametrize("lost", ["estimate", "frame", "hold"])
def test_a_leader_is_not_heeded_without_a_station_or_a_place_of_the_boat(lost: str) -> None:
    bench = Moving()
    bench.course(leader=42)
    station = bench.wait(1.0)
    if lost == "hold":
        bench.release()
    else:
        setattr(bench, lost, None)
    bench.leader(HERE[0] + 1.0, HERE[1], 0.3, 0.0)
    bench.frame, bench.estimate = FRAME, ESTIMATE
    assert bench.step().station == (None if lost == "hold" else station)


def test_a_speed_ends_following() -> None:
    bench = Moving()
    bench.course(leader=42)
    bench.led(3.0, 0.3, 0.0)
    bench.course(speed_mps=0.0)
    assert not bench.wait(0.5).moves and bench.note is None
    bench.leader(HERE[0] + 2.0, HERE[1], 0.3, 0.0)
    assert not bench.wait(0.5).moves


@pytest.mark.parametrize("stray_m", [0.0, 0.5])
def test_a_leader_that_tells_no_velocity_has_that_of_its_positions(stray_m: float) -> None:
    bench, strays = Moving(), random.Random(1)
    bench.course(leader=42)
    for second in range(40):
        bench.leader(
            HERE[0] + strays.gauss(0.0, stray_m), HERE[1] + 0.4 * second + strays.gauss(0.0, stray_m), 0.0, 0.0
        )
        station = bench.wait(1.0)
        assert second < 12 or not (bench.note or "").startswith("0.8"), "not how fast it catches up with a stray"
    assert math.hypot(station.vn_mps, station.ve_mps - 0.4) <= 1e-6 + 0.35 * stray_m
    assert place(station) == pytest.approx((0.0, 16.0), abs=0.01 + 1.5 * stray_m), "no way behind it"
    words = bench.note or ""
    assert words.endswith("after system 42") and (stray_m or words.startswith("0.4 m/s toward 90"))
    for _ in range(12):
        bench.leader(HERE[0] + strays.gauss(0.0, stray_m), HERE[1] + 15.6 + strays.gauss(0.0, stray_m), 0.0, 0.0)
        station = bench.wait(1.0)
    assert not station.moves and bench.note is None and bench.note_on(VELOCITY_SUBJECT) is None


@pytest.mark.parametrize("told", [(0.0, 0.0), (0.02, -0.01)])
def test_a_leader_at_rest_whose_receiver_wanders_does_not_move_the_station(told: tuple[float, float]) -> None:
    bench, strays = Moving(), random.Random(2)
    bench.course(leader=42)
    north = east = 0.0
    moved = 0
    for _ in range(300):  # by a metre over half a minute, and 0.3 m from one position to the next
        north, east = (0.97 * wander + strays.gauss(0.0, 0.25) for wander in (north, east))
        bench.leader(HERE[0] + north + strays.gauss(0.0, 0.3), HERE[1] + east + strays.gauss(0.0, 0.3), *told)
        station = bench.wait(1.0)
        moved += math.hypot(station.vn_mps, station.ve_mps) > 0.05
    assert moved <= 6 and bench.note_on(VELOCITY_SUBJECT) is None


@pytest.mark.parametrize("seed", [1, 3, 5, 10, 11, 16, 18, 24])
def test_a_leader_at_rest_whose_receiver_wanders_has_no_course_for_the_offset_to_turn_with(seed: int) -> None:
    bench, strays = Moving(moving={"offset_m": (-10.0, 0.0), "offset_frame": "course"}), random.Random(seed)
    bench.course(leader=42)
    north = east = 0.0
    for second in range(300):
        north, east = (0.97 * wander + strays.gauss(0.0, 0.25) for wander in (north, east))
        bench.leader(HERE[0] + north + strays.gauss(0.0, 0.3), HERE[1] + east + strays.gauss(0.0, 0.3), 0.0, 0.0)
        station = bench.wait(1.0)
        assert second < 20 or math.dist(place(station), (-10.0, 0.0)) < 4.5, "not farther than the receiver wanders"


def test_the_offset_turns_with_the_course_of_a_leader_that_tells_no_velocity() -> None:
    bench = Moving(moving={"offset_m": (-2.0, 1.0), "offset_frame": "course"})
    bench.course(leader=42)
    for second in range(40):
        bench.leader(HERE[0], HERE[1] + 0.4 * second, 0.0, 0.0)
        station = bench.wait(1.0)
    assert place(station) == pytest.approx((-1.0, 14.0), abs=0.05)


@pytest.mark.parametrize("way", ["stops", "reverses"])
@pytest.mark.parametrize("speed_mps", [0.4, 0.7])
def test_a_leader_that_tells_no_velocity_is_not_overrun_when_it_stops(way: str, speed_mps: float) -> None:
    bench, beyond_m = Moving(), []
    bench.course(leader=42)
    for second in range(60):
        gone_s = min(second, 30) if way == "stops" else 30 - abs(second - 30)
        bench.leader(HERE[0], HERE[1] + speed_mps * gone_s, 0.0, 0.0)
        beyond_m.append(place(bench.wait(1.0))[1] - speed_mps * gone_s)
    # A second's way before the first report of it; then it is back, or the leader comes nearer as fast as it goes away.
    assert max(beyond_m[31:]) < speed_mps * (0.65 if way == "stops" else 1.6)
    assert beyond_m[-1] < 0.05


@pytest.mark.parametrize("stray_m", [0.1, 0.5])
def test_a_leader_that_goes_straight_on_is_seldom_taken_to_stop(stray_m: float) -> None:
    rested = 0
    for seed in range(5):
        bench, strays = Moving(), random.Random(seed)
        bench.course(leader=42)
        for second in range(60):
            n_m, e_m = strays.gauss(0.0, stray_m), 0.5 * second + strays.gauss(0.0, stray_m)
            bench.leader(HERE[0] + n_m, HERE[1] + e_m, 0.0, 0.0)
            rested += second >= 20 and not bench.wait(1.0).moves
    assert rested <= 10  # of 200


@pytest.mark.parametrize("told", [(0.0, 0.3), (-0.3, 0.0), (0.7, 0.0), (0.22, 0.0)])
def test_a_velocity_that_contradicts_the_positions_is_told_once_and_not_used(told: tuple[float, float]) -> None:
    bench, words = Moving(), set()
    bench.course(leader=42)
    for second in range(60):
        bench.leader(HERE[0] + 0.3 * second, HERE[1], *told)
        station = bench.wait(1.0)
        words.add(bench.note_on(VELOCITY_SUBJECT))
    if told == (0.22, 0.0):
        assert words == {None}, "as near as a receiver may have it"
        return
    assert (station.vn_mps, station.ve_mps) == pytest.approx((0.3, 0.0), abs=1e-6)
    (text,) = words - {None}
    assert text is not None and "m/s toward" in text and "the positions go 0.3 m/s toward 0, which counts" in text
    assert (bench.note or "").startswith("0.3 m/s toward 0, after")
    for second in range(60, 90):
        bench.leader(HERE[0] + 0.3 * second, HERE[1], 0.3, 0.0)
        bench.wait(1.0)
    assert bench.note_on(VELOCITY_SUBJECT) is None, "it has learnt to tell it"


@pytest.mark.parametrize("waits", [False, True])
def test_of_a_leader_that_has_fallen_silent_no_velocity_counts(waits: bool) -> None:
    bench = Moving()
    bench.follows = not waits
    bench.course(leader=42)
    for second in range(30):
        bench.leader(HERE[0] + 0.3 * second, HERE[1], 0.0, 0.3)
        bench.wait(1.0)
    assert "which counts" in (bench.note_on(VELOCITY_SUBJECT) or "")
    bench.wait(5.0)
    note = "waits, the boat is more than 3 m off" if waits else "system 42 is silent: it stays"
    assert bench.note == note and bench.note_on(VELOCITY_SUBJECT) is None
    bench.leader(HERE[0] + 10.0, HERE[1], 0.0, 0.3)
    bench.wait(0.1)
    assert "which counts" in (bench.note_on(VELOCITY_SUBJECT) or ""), "it is heard again, and as wrong as before"


def test_a_leader_that_circles_reverses_and_stops_is_believed() -> None:
    bench = Moving()
    bench.course(leader=42)
    n_m, e_m = HERE
    for second in range(150):
        course = 0.1 * second
        speed = 0.5 if second < 60 else 0.7 if second < 80 else -0.7 if second < 100 else 0.0
        vn, ve = (speed * math.cos(course), speed * math.sin(course)) if second < 60 else (speed, 0.0)
        n_m, e_m = n_m + vn, e_m + ve
        bench.leader(n_m, e_m, vn, ve)
        station = bench.wait(1.0)
        assert bench.note_on(VELOCITY_SUBJECT) is None
        if 100 < second < 103:
            assert abs(station.vn_mps) < 0.8 and place(station)[0] == pytest.approx(n_m - HERE[0], abs=0.8)
    assert not station.moves


# --- a stream of set-points with a velocity -------------------------------------------------------------------------


def test_set_points_with_a_velocity_lead_the_station() -> None:
    bench = Moving()
    lat_deg, lon_deg = FRAME.to_geodetic(*HERE)
    at = {"lat_deg": lat_deg, "lon_deg": lon_deg, "velocity_mps": (0.3, 0.0)}
    assert bench.step(0, HoldCommand(t_ns=bench.t_ns, **at)).answers == (None,)  # type: ignore[arg-type]
    for second in range(1, 10):
        station = bench.wait(1.0)
        move = MoveCommand(t_ns=bench.t_ns, n_m=HERE[0] + 0.3 * second, e_m=HERE[1], velocity_mps=(0.3, 0.0))
        decision = bench.step(0, move)
        assert decision.answers == (None,) and not decision.station_changed
    assert place(station) == pytest.approx((2.7, 0.0), abs=0.05) and station.vn_mps == 0.3
    turn = MoveCommand(t_ns=bench.t_ns, n_m=HERE[0] + 2.7, e_m=HERE[1], psi_rad=-1.0, velocity_mps=(0.3, 0.0))
    assert bench.step(0, turn).answers == (None,) and bench.wait(0.1).psi_rad == -1.0
    far = MoveCommand(t_ns=bench.t_ns, n_m=HERE[0] + 20.0, e_m=HERE[1], psi_rad=2.0, velocity_mps=(0.3, 0.0))
    (refusal,) = bench.step(0, far).answers
    assert refusal is not None and refusal.reason is Reason.LEADER_JUMPED and bench.wait(0.1).psi_rad == -1.0
    assert bench.move(n_m=HERE[0], e_m=HERE[1]) is None, "a set-point without a velocity puts it there"
    station = bench.wait(0.5)
    assert place(station) == (0.0, 0.0) and not station.moves


def test_set_points_whose_velocity_contradicts_their_places_go_by_the_places() -> None:
    bench = Moving()
    for second in range(30):
        at = {"n_m": HERE[0], "e_m": HERE[1] + 0.3 * second, "velocity_mps": (0.3, 0.0)}
        assert bench.step(0, MoveCommand(t_ns=bench.t_ns, **at)).answers == (None,)  # type: ignore[arg-type]
        station = bench.wait(1.0)
    assert (station.vn_mps, station.ve_mps) == pytest.approx((0.0, 0.3), abs=1e-6)
    assert (bench.note_on(VELOCITY_SUBJECT) or "").startswith("the set-points tell 0.3 m/s toward 0, the positions go ")
    assert bench.move(n_m=HERE[0], e_m=HERE[1]) is None and bench.note_on(VELOCITY_SUBJECT) is None
