"""The heading of the station that is held follows the weather, as the config or the operator says."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from asvhil.config import SupervisorConfig
from asvhil.supervisor.decision import Decision
from asvhil.supervisor.reasons import Reason, explain
from asvhil.types import CourseCommand, HeadingCommand
from tests.support.supervisor_bench import ESTIMATE, SupervisorBench

LONG_MS = 200_000


def bench(policy: str, bow_rad: float) -> SupervisorBench:
    found = SupervisorBench(SupervisorConfig.model_validate({"heading": {"policy": policy}}))
    found.bow_rad = bow_rad
    return found


def choose(at: SupervisorBench, policy: str) -> Decision:
    return at.step(50, HeadingCommand(t_ns=at.t_ns, policy=policy))


def heading(decision: Decision) -> float:
    assert decision.station is not None
    return decision.station.psi_rad


def test_a_station_that_is_taken_up_has_the_weathers_heading_at_once_and_keeps_it_in_the_dead_band() -> None:
    at = bench("bow", 1.0)
    assert at.hold() is None
    assert heading(at.step()) == pytest.approx(1.0) == heading(at.step(LONG_MS))
    at.bow_rad = 1.1
    assert heading(at.step(LONG_MS)) == pytest.approx(1.0)
    assert at.move(n_m=5.0) is None
    assert heading(at.step()) == pytest.approx(1.0), "elsewhere the weather is the same"
    assert at.hold(psi_rad=2.0) is None
    assert heading(at.step()) == pytest.approx(1.1)


def test_a_heading_that_is_asked_for_while_it_is_the_weathers_is_refused_and_the_place_of_a_set_point_is_not() -> None:
    at = bench("bow", 1.0)
    assert at.hold() is None
    assert heading(at.step(LONG_MS)) == pytest.approx(1.0)
    at.bow_rad = 1.1
    assert at.move(psi_rad=2.0) == explain(Reason.HEADING_OF_WEATHER, policy="bow")
    for n_m in (5.0, 6.0):
        assert at.move(n_m=n_m, e_m=3.0, psi_rad=2.0) is None
        station = at.step().station
        assert station is not None and (station.n_m, station.e_m) == (n_m, 3.0)
        assert station.psi_rad == pytest.approx(1.0) and station.of_weather, "nor does it begin anew"
    choose(at, "fixed")
    assert at.move(psi_rad=2.0) is None and heading(at.step()) == pytest.approx(2.0)
    unknown = bench("bow", 1.0)
    unknown.bow_rad = None
    assert unknown.hold() is None and unknown.move(psi_rad=2.0) is None
    assert heading(unknown.step()) == pytest.approx(2.0), "the heading is asked for until the weather is known"


def test_nudges_of_the_station_do_not_hurry_its_turn() -> None:
    at = bench("bow", 1.0)
    assert at.hold() is None
    assert heading(at.step(LONG_MS)) == pytest.approx(1.0)
    at.bow_rad = 1.7
    place_m = 5.0
    for _ in range(20):
        place_m += 0.001
        assert at.move(n_m=place_m) is None
        assert heading(at.step()) < 1.2


def test_another_policy_is_granted_in_every_phase_and_told() -> None:
    at = bench("fixed", 1.0)
    assert at.step().heading_policy == "fixed"
    decision = choose(at, "stern")
    assert (decision.answers, decision.heading_policy, decision.station) == ((None,), "stern", None)
    assert at.hold() is None
    assert heading(at.step()) == pytest.approx(1.0 - math.pi)
    decision = choose(at, "bow")
    assert decision.answers == (None,) and heading(decision) == pytest.approx(1.0)
    assert heading(choose(at, "fixed")) == pytest.approx(1.0)
    at.bow_rad = 2.0
    assert heading(at.step(LONG_MS)) == pytest.approx(1.0)
    assert at.hold(psi_rad=ESTIMATE.psi_rad) is None and heading(at.step()) == ESTIMATE.psi_rad


def goes(at: SupervisorBench, bow_rad: float, **course: float) -> Decision:
    """The decision 2 s after a course command; the weather of the new motion is known after 1 s."""
    at.step(50, CourseCommand(t_ns=at.t_ns, **course))
    for tick in range(40):
        at.bow_rad = bow_rad if tick >= 20 else at.bow_rad
        decision = at.step()
    return decision


def test_a_course_begins_changes_and_ends_with_the_weathers_heading_at_once() -> None:
    at = bench("bow", 1.0)
    assert at.hold() is None and heading(at.step(LONG_MS)) == pytest.approx(1.0)
    assert heading(goes(at, -0.7, speed_mps=0.3, course_rad=0.0)) == pytest.approx(-0.7)
    assert at.step(LONG_MS).station is not None
    assert heading(goes(at, 2.0, course_rad=3.0)) == pytest.approx(2.0)
    at.step(LONG_MS)
    assert heading(goes(at, 1.0, speed_mps=0.0)) == pytest.approx(1.0)
    at.step(LONG_MS)
    assert heading(goes(at, 2.0)) == pytest.approx(1.0, abs=0.05), "weather that turns by itself is followed slowly"


def test_a_station_that_waits_for_its_boat_does_not_set_off_anew() -> None:
    at = bench("bow", 1.0)
    assert at.hold() is None and heading(at.step(LONG_MS)) == pytest.approx(1.0)
    goes(at, 1.0, speed_mps=0.3, course_rad=0.0)
    at.step(LONG_MS)
    here = at.estimate
    for off_m in (20.0, 0.0):
        at.estimate = replace(here, n_m=here.n_m + off_m)
        before = heading(at.step())
        station = goes(at, 2.5).station
        assert station is not None and station.moves is (off_m == 0.0)
        assert heading(at.step()) == pytest.approx(before, abs=0.05)


def test_a_course_that_changes_its_speed_alone_has_the_weathers_heading_at_once() -> None:
    at = bench("bow", 1.0)
    assert at.hold() is None and heading(at.step(LONG_MS)) == pytest.approx(1.0)
    assert heading(goes(at, -0.7, speed_mps=0.05, course_rad=0.0)) == pytest.approx(1.0, abs=0.05), "next to rest"
    at.bow_rad = 1.0
    at.step(LONG_MS)
    assert heading(goes(at, -0.7, speed_mps=0.7)) == pytest.approx(-0.7)


def test_a_course_that_changes_by_little_leaves_the_heading_to_the_dead_band() -> None:
    at = bench("bow", 1.0)
    assert at.hold() is None and heading(at.step(LONG_MS)) == pytest.approx(1.0)
    goes(at, 1.0, speed_mps=0.3, course_rad=0.0)
    before = heading(at.step(LONG_MS))
    for turn in range(1, 11):
        now = heading(goes(at, 1.0 + 0.4 * (-1.0) ** turn, course_rad=0.01 * turn))
        assert now == pytest.approx(before, abs=0.05)
        before = now


def test_a_course_that_changes_again_and_again_does_not_put_the_weathers_heading_off() -> None:
    at = bench("bow", 1.0)
    assert at.hold() is None and heading(at.step(LONG_MS)) == pytest.approx(1.0)
    at.bow_rad = -0.7
    for turn in range(3):
        at.step(50, CourseCommand(t_ns=at.t_ns, speed_mps=0.3, course_rad=1.0 * turn))
        for _ in range(19):
            decision = at.step()
    assert heading(decision) == pytest.approx(-0.7)
    at.bow_rad = 0.4  # of the last course, which came while the weather of the first was waited for
    for _ in range(50):
        decision = at.step()
    assert heading(decision) == pytest.approx(0.4)
