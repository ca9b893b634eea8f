"""The motion of a station step by step: how far each goes, when it waits, ends or is not followed, and what is told."""

from __future__ import annotations

import math
import struct
from dataclasses import replace

import numpy as np
import pytest

from asvhil.config import MovingConfig
from asvhil.supervisor.leader_report import LeaderReport
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.supervisor.station_motion import SUBJECT, StationMotion
from asvhil.types import CourseCommand, Note, Station

S = 1_000_000_000
MOST_MPS, WAIT_M, JUMP_M, SILENCE_S = 0.8, 6.0, 5.0, 3  # the defaults
HERE = Station(n_m=10.0, e_m=-20.0, psi_rad=1.0)
DIRECTIONS = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (0.6, -0.8)]
OUTSIDE = explain(Reason.OUTSIDE_FENCE, what="station", metres=1.0)


class Steps:
    """A station that rests, with its boat at it, and what has it move."""

    def __init__(self, **moving: object) -> None:
        self.motion = StationMotion(MovingConfig.model_validate(moving), math.inf)
        self.motion.begin()
        self.t_ns, self.at = 1_000 * S, HERE
        self.step(0.0)

    def course(self, **command: float) -> Explanation | None:
        return self.motion.choose(CourseCommand(t_ns=self.t_ns, **command))  # type: ignore[arg-type]

    def step(
        self, seconds: float = 0.5, boat_off_m: tuple[float, float] = (0.0, 0.0), outside: Explanation | None = None
    ) -> Station:
        self.t_ns += round(seconds * S)
        boat_m = self.at.n_m + boat_off_m[0], self.at.e_m + boat_off_m[1]
        self.at = self.motion.step(self.t_ns, self.at, boat_m, lambda _: outside)
        return self.at

    def report(self, off_m: tuple[float, float], velocity: tuple[float, float] = (0.0, 0.0)) -> Explanation | None:
        """A leader is so far from where the station was at first."""
        place = {"n_m": HERE.n_m + off_m[0], "e_m": HERE.e_m + off_m[1]}
        return self.motion.report(LeaderReport(t_ns=self.t_ns, vn_mps=velocity[0], ve_mps=velocity[1], **place))

    @property
    def off_m(self) -> tuple[float, float]:
        return self.at.n_m - HERE.n_m, self.at.e_m - HERE.e_m

    @property
    def note(self) -> Note | None:
        return next(iter(self.motion.notes(self.at)), None)


def told(text: str) -> Note:
    return Note(subject=SUBJECT, text=text, ok=True)


def trouble(text: str) -> Note:
    return Note(subject=SUBJECT, text=text, ok=False)


def of(direction: tuple[float, float], size: float) -> tuple[float, float]:
    return direction[0] * size, direction[1] * size


def course_rad(direction: tuple[float, float]) -> float:
    return math.atan2(direction[1], direction[0])


# --- on a course ----------------------------------------------------------------------------------------------------


def test_before_any_command_and_after_a_new_hold_nothing_is_in_force() -> None:
    at_rest = CourseCommand(t_ns=0, speed_mps=0.0, course_rad=0.0, way_m=0.0, leader=0)
    assert StationMotion(MovingConfig(), math.inf).course == at_rest
    steps = Steps()
    for command in ({"speed_mps": 0.3, "course_rad": 1.0, "way_m": 9.0}, {"leader": 42}):
        steps.course(**command)
        steps.motion.begin()
        assert steps.motion.course == replace(at_rest, t_ns=steps.t_ns, course_rad=1.0)
        assert steps.note is None and steps.step() == HERE


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_each_step_goes_as_far_as_its_time_allows_and_in_none_it_stays(direction: tuple[float, float]) -> None:
    steps = Steps()
    assert steps.course(speed_mps=0.4, course_rad=course_rad(direction), way_m=9.0) is None
    assert steps.step(0.0) == HERE
    steps.step(0.5)
    assert steps.off_m == pytest.approx(of(direction, 0.2))
    steps.step(1.0)
    assert steps.off_m == pytest.approx(of(direction, 0.6))
    assert steps.at.moves and not steps.step(1.001).moves, "a longer time is a pause"
    assert steps.off_m == pytest.approx(of(direction, 0.6))


def test_a_speed_beyond_the_most_is_refused_with_both() -> None:
    steps = Steps()
    assert steps.course(speed_mps=MOST_MPS) is None
    assert steps.course(speed_mps=struct.unpack("f", struct.pack("f", MOST_MPS))[0]) is None, (
        "as a 32-bit float of the link tells it"
    )
    assert steps.course(speed_mps=MOST_MPS + 1e-4) is not None
    assert steps.course(speed_mps=0.9) == explain(Reason.STATION_TOO_FAST, speed=0.9, most=MOST_MPS)


@pytest.mark.parametrize(("way_m", "ends_m"), [(0.5, 0.5), (0.25, 0.25), (0.75, 0.75), (0.0, 2.0)])
def test_the_way_ends_in_the_step_in_which_it_is_over_and_0_is_without_an_end(way_m: float, ends_m: float) -> None:
    steps = Steps()
    steps.course(speed_mps=0.5, course_rad=0.0, way_m=way_m)
    for tick in range(1, 5):
        steps.step(1.0)
        over = way_m > 0.0 and 0.5 * tick >= way_m
        assert (steps.motion.course.speed_mps, steps.motion.course.way_m == 0.0) == (
            (0.0, True) if over else (0.5, way_m == 0.0)
        )
    assert steps.off_m == pytest.approx((ends_m, 0.0))


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_it_waits_for_a_boat_that_is_too_far_off_until_that_is_half_as_far(direction: tuple[float, float]) -> None:
    steps = Steps()
    assert steps.step(0.5, of(direction, 9.0)) == HERE and steps.note is None, "a station that rests waits for nobody"
    steps.course(speed_mps=0.4, course_rad=course_rad(direction))
    assert steps.step(0.5, of(direction, WAIT_M - 0.01)).moves
    assert not steps.step(0.5, of(direction, WAIT_M + 0.01)).moves
    assert steps.note == trouble("waits, the boat is more than 3 m off")
    assert not steps.step(0.5, of(direction, WAIT_M / 2 + 0.01)).moves
    assert steps.step(0.5, of(direction, WAIT_M / 2 - 0.01)).moves


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_where_it_may_not_go_it_stays_for_good_and_says_so(direction: tuple[float, float]) -> None:
    steps = Steps()
    steps.course(speed_mps=0.4, course_rad=course_rad(direction))
    before = steps.step()
    assert before.moves
    rests = replace(before, vn_mps=0.0, ve_mps=0.0)
    assert steps.step(outside=OUTSIDE) == rests == steps.step()
    assert (
        steps.note is not None
        and steps.note.text.startswith("stays, until it is given a speed again: ")
        and not steps.note.ok
    )


# --- after a leader -------------------------------------------------------------------------------------------------


def test_a_leader_is_approached_with_a_time_constant_of_2_s_from_where_its_velocity_has_it_by_then() -> None:
    steps = Steps()
    steps.report((0.6, -0.3))
    steps.step(1.0)
    assert steps.off_m == pytest.approx((0.2, -0.1))  # 1 s of 1 s + 2 s
    steps = Steps()
    steps.report((0.0, 0.0), (0.3, -0.4))
    assert (steps.step(1.0).vn_mps, steps.at.ve_mps) == (0.3, -0.4)
    assert steps.off_m == pytest.approx((0.3, -0.4)), "where it is already it goes on with it"


def test_neither_a_step_nor_its_velocity_is_faster_than_the_most() -> None:
    steps = Steps()
    steps.report((60.0, -80.0))
    steps.step(0.5)
    assert steps.off_m == pytest.approx((0.6 * 0.4, -0.8 * 0.4))
    assert (steps.at.vn_mps, steps.at.ve_mps) == pytest.approx((0.48, -0.64))
    steps = Steps()
    steps.report((-3.0, 4.0), (1.2, -1.6))  # it comes toward the station, faster than that may be, and will be past it
    steps.step(0.5)
    assert math.hypot(*steps.off_m) < 0.4 + 1e-9
    assert (steps.at.vn_mps, steps.at.ve_mps) == pytest.approx((2.0 * steps.off_m[0], 2.0 * steps.off_m[1]))


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_leader_counts_as_fast_or_elsewhere_in_every_direction(direction: tuple[float, float]) -> None:
    steps = Steps()
    steps.course(leader=42)
    assert steps.report((0.0, 0.0), of(direction, MOST_MPS)) is None and steps.note is None
    assert steps.report((0.0, 0.0), of(direction, MOST_MPS + 0.01)) is None
    assert steps.note == trouble("system 42 is faster than 0.8 m/s")
    assert steps.report((0.0, 0.0)) is None and steps.report(of(direction, JUMP_M)) is None
    assert steps.report((0.0, 0.0)) is None
    refusal = steps.report(of(direction, JUMP_M + 0.01))
    assert refusal is not None and refusal.reason is Reason.LEADER_JUMPED


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_leader_is_carried_on_for_3_s_without_a_message_and_then_it_stays(direction: tuple[float, float]) -> None:
    steps = Steps()
    steps.course(leader=42)
    steps.report((0.0, 0.0), of(direction, 0.3))
    for _ in range(SILENCE_S):
        assert steps.step(1.0).moves
    assert steps.note is not None and steps.note.ok
    assert not steps.step(1e-9).moves
    assert steps.note == trouble("system 42 is silent: it stays")


def test_a_set_point_ends_following_and_leader_0_is_none() -> None:
    steps = Steps()
    steps.course(leader=42)
    assert steps.note == trouble("system 42 is not heard")
    set_point = LeaderReport(t_ns=steps.t_ns, n_m=HERE.n_m, e_m=HERE.e_m, vn_mps=0.1, ve_mps=0.0)
    assert steps.motion.lead(set_point) is None and steps.motion.leader == 0
    steps.course(leader=42)
    assert steps.course(leader=0) is None and steps.note is None and steps.motion.leader == 0


@pytest.mark.parametrize(
    ("frame", "velocity", "place"),
    [
        ("north", (0.0, 0.5), (2.0, -3.0)),
        ("course", (0.0, 0.5), (3.0, 2.0)),
        ("course", (-0.1, 0.0), (-2.0, 3.0)),
        ("course", (0.0, 0.09), (2.0, -3.0)),  # too slow to have a course, and it had none before
    ],
)
def test_the_offset_is_from_the_leader_north_and_east_or_ahead_and_to_starboard(
    frame: str, velocity: tuple[float, float], place: tuple[float, float]
) -> None:
    steps = Steps(offset_m=(2.0, -3.0), offset_frame=frame)
    steps.course(leader=42)
    for tenth in range(200):
        steps.report(of(velocity, 0.1 * tenth), velocity)
        steps.step(0.1)
    assert steps.off_m == pytest.approx((place[0] + 20.0 * velocity[0], place[1] + 20.0 * velocity[1]), abs=0.1)


def test_a_leader_that_turns_round_has_not_jumped_and_its_station_swings_over() -> None:
    steps = Steps(offset_m=(-4.0, 0.0), offset_frame="course")
    steps.course(leader=42)
    n_m = 0.0
    for second in range(60):
        vn = 0.3 if second < 15 else -0.3
        assert steps.report((n_m, 0.0), (vn, 0.0)) is None
        for _ in range(10):
            before = steps.at
            steps.step(0.1)
            assert math.dist((before.n_m, before.e_m), (steps.at.n_m, steps.at.e_m)) <= 0.08 + 1e-9
        n_m += vn
    assert steps.off_m == pytest.approx((n_m + 4.0, 0.0), abs=0.3)


def test_the_noise_of_a_leader_at_rest_is_no_course() -> None:
    steps = Steps(offset_m=(-3.0, 0.0), offset_frame="course")
    steps.course(leader=42)
    noise = np.random.default_rng(5).normal(0.0, 0.07, (1200, 2))
    places = []
    for vn, ve in noise:
        assert steps.report((0.0, 0.0), (float(vn), float(ve))) is None
        steps.step(0.1)
        places.append(steps.off_m)
    assert np.ptp(places[300:], axis=0).max() < 0.4


def test_one_message_with_a_wrong_velocity_does_not_lose_the_leader() -> None:
    steps = Steps()
    steps.course(leader=42)
    for second, wrong in enumerate((0.2, 60.0, 1e38, 0.2, 0.2)):
        assert steps.report((0.2 * second, 0.0), (wrong, 0.0)) is None
        steps.step(1.0)
    assert steps.off_m == pytest.approx((1.0, 0.0), abs=0.6) and steps.note is not None and steps.note.ok


def test_one_message_with_a_wrong_velocity_turns_the_course_for_seconds_only() -> None:
    steps = Steps(offset_m=(-3.0, 0.0), offset_frame="course")
    steps.course(leader=42)
    for second in range(40):
        velocity = (0.0, 1e38) if second == 10 else (0.3, 0.0)
        assert steps.report((0.3 * second, 0.0), velocity) is None
        for _ in range(10):
            steps.step(0.1)
    assert steps.off_m == pytest.approx((0.3 * 40 - 3.0, 0.0), abs=0.3)


def test_a_leader_has_no_course_of_the_one_before() -> None:
    steps = Steps(offset_m=(2.0, 0.0), offset_frame="course")
    steps.course(leader=42)
    steps.report((0.0, 0.0), (0.0, 0.5))
    steps.course(leader=43)
    for _ in range(100):
        steps.report((0.0, 0.0))
        steps.step(0.1)
    assert steps.off_m == pytest.approx((2.0, 0.0), abs=0.1)


def test_no_leader_after_no_leader_leaves_a_course_alone() -> None:
    steps = Steps()
    steps.course(speed_mps=0.3)
    assert steps.course(leader=0) is None
    assert steps.step(1.0).vn_mps == pytest.approx(0.3)


def test_a_refused_leader_is_told_once_in_ten_seconds_and_then_that_it_is_silent() -> None:
    steps = Steps()
    steps.course(leader=42)
    texts = []
    for tenth in range(300):
        away = {"n_m": 1000.0 + 0.5 * tenth, "e_m": 0.0, "vn_mps": 0.0, "ve_mps": 0.0}
        far = explain(Reason.STATION_UNCONFIRMED, metres=away["n_m"], limit="100 m")
        refusal = steps.motion.report(LeaderReport(t_ns=steps.t_ns, **away), lambda _, far=far: far)
        assert refusal is far
        steps.motion.refuse(steps.t_ns, refusal)
        steps.step(0.1)
        assert steps.note is not None
        texts.append(steps.note.text)
    assert len(set(texts)) == 3 and "not followed: station is 1000 m away" in texts[0]
    for _ in range(SILENCE_S + 1):
        steps.step(1.0)
    assert steps.note == trouble("system 42 is silent: it stays")


def test_set_points_that_end_are_told_as_such() -> None:
    steps = Steps()
    steps.report((0.0, 0.0), (0.3, 0.0))
    for _ in range(SILENCE_S + 2):
        steps.step(1.0)
    assert steps.note == trouble("the set-points are silent: it stays")


# --- what is told ---------------------------------------------------------------------------------------------------


def test_a_course_is_told_once_and_each_that_follows_it() -> None:
    steps = Steps()
    for speed_mps, course_deg, text in ((0.3, 270, "0.3 m/s toward 270"), (0.2, 180, "0.2 m/s toward 180")):
        steps.course(speed_mps=speed_mps, course_rad=math.radians(course_deg))
        for _ in range(25):
            steps.step(0.5)
            assert steps.note == told(text)


def test_the_velocity_of_a_leader_is_told_anew_after_10_s() -> None:
    steps = Steps()
    steps.course(leader=42)
    steps.report((0.0, 0.0), (0.3, 0.0))
    steps.step()
    assert steps.note == told("0.3 m/s toward 0, after system 42")
    for tick in range(1, 22):
        steps.report(steps.off_m, (0.2, 0.0))
        steps.step(0.5)
        assert steps.note == told(f"{0.3 if tick <= 20 else 0.2} m/s toward 0, after system 42")
