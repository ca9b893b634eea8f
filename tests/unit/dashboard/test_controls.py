"""Controls of the page: JSON to a request, and a request to what the daemon understands."""

from __future__ import annotations

import math
from typing import Any

import pytest

from asvhil.dashboard.controls import encode_control, read_control
from asvhil.types import Frame, HoldCommand, MoveCommand, NeutralCommand, ReleaseCommand
from tests.support.operator_bench import CONFIG, Bench


def asked(body: Any) -> Any:
    """What the daemon takes a control for."""
    data = encode_control(read_control(body), CONFIG)
    (request,) = Bench().link.receive(Frame(t_ns=1, port="operator", data=data, peer="page:1"))
    return request.command


REST = {"ST_SPEED": 0.0, "ST_COURSE": 10.0, "ST_WAY": 0.0, "ST_FOLLOW": 0.0}


def test_each_control_is_what_it_says() -> None:
    hold = asked({"action": "hold"})
    assert isinstance(hold, HoldCommand) and (hold.lat_deg, hold.psi_rad) == (None, None)
    assert isinstance(asked({"action": "neutral"}), NeutralCommand)
    assert isinstance(asked({"action": "release"}), ReleaseCommand)
    move = asked({"action": "move", "n_m": 12.5, "e_m": -3})
    assert isinstance(move, MoveCommand) and (move.n_m, move.e_m, move.psi_rad) == (12.5, -3.0, None)
    turn = asked({"action": "heading", "heading_deg": 270})
    assert isinstance(turn, MoveCommand) and (turn.n_m, turn.psi_rad) == (None, pytest.approx(1.5 * math.pi))
    assert read_control({"action": "heading", "heading_deg": 360}).heading_deg == 0.0


@pytest.mark.parametrize(
    ("action", "parameter", "words"),
    [
        ("policy", "ST_POLICY", ("fixed", "bow", "stern", "either", "free")),
        ("effort", "MPC_EFFORT", ("precise", "normal", "gentle")),
    ],
)
def test_a_choice_sets_the_parameter_of_the_daemon(action: str, parameter: str, words: tuple[str, ...]) -> None:
    for place, word in enumerate(words):
        control = read_control({"action": action, action: word})
        assert control.settings({}) == ((parameter, place),) and control.mav_cmd is None
        assert control.describe() == f"{action} {word}"


def test_a_motion_sets_the_parameters_that_the_command_sets_and_the_speed_last() -> None:
    drift = read_control({"action": "drift", "speed_mps": 0.25, "course_deg": 360})
    assert drift.settings(REST) == (("ST_COURSE", 0.0), ("ST_WAY", 0.0), ("ST_SPEED", 0.25))
    assert drift.mav_cmd is None and drift.describe() == "drift 0.25 m/s toward 0 deg"
    ends = read_control({"action": "drift", "speed_mps": 0.25, "course_deg": 90, "way_m": 40})
    assert ends.settings(REST) == (("ST_COURSE", 90.0), ("ST_WAY", 40.0), ("ST_SPEED", 0.25))
    assert ends.describe() == "drift 0.25 m/s toward 90 deg for 40 m"
    follow = read_control({"action": "follow", "system_id": 42})
    assert follow.settings({}) == (("ST_FOLLOW", 42.0),) and follow.describe() == "follow system 42"
    stay = read_control({"action": "stay"})
    assert stay.settings({}) == (("ST_SPEED", 0.0),) and stay.describe() == "stay"


def test_the_speed_which_may_be_refused_comes_first_where_the_station_moves_on_a_course() -> None:
    drift = read_control({"action": "drift", "speed_mps": 5, "course_deg": 90})
    first = [
        drift.settings(REST | changes)[0][0] for changes in ({"ST_SPEED": 0.2}, {"ST_SPEED": 0.2, "ST_FOLLOW": 42})
    ]
    assert first == ["ST_SPEED", "ST_COURSE"], "a leader's course is not that of the parameter"


@pytest.mark.parametrize("course_deg", [359.999999, 360.0, 0.0])
def test_a_course_is_one_that_a_float_of_the_link_tells_and_that_the_daemon_tells_back(course_deg: float) -> None:
    drift = read_control({"action": "drift", "speed_mps": 0.25, "course_deg": course_deg})
    assert drift.velocity == (0.25, 0.0)


@pytest.mark.parametrize(
    "body",
    [
        *(None, [], "hold", 3, {}, {"action": None}, {"action": "sail"}, {"action": ["hold"]}),
        *({"action": "hold", "n_m": 1.0}, {"action": "move"}, {"action": "move", "n_m": 1.0}),
        *({"action": "move", "n_m": "1", "e_m": 0}, {"action": "move", "n_m": True, "e_m": 0}),
        *({"action": "move", "n_m": math.nan, "e_m": 0}, {"action": "move", "n_m": 6000, "e_m": 0}),
        *({"action": "heading", "heading_deg": -1}, {"action": "heading", "heading_deg": 361}),
        {"action": "heading", "heading_deg": 10**400},
        *({"action": "heading", "heading_deg": math.inf}, {"action": "heading", "heading_deg": 1, "x": 2}),
        *({"action": "policy"}, {"action": "policy", "policy": "sideways"}, {"action": "policy", "policy": 1}),
        *({"action": "drift", "speed_mps": 0.2}, {"action": "drift", "course_deg": 1, "speed_mps": 0}),
        *({"action": "drift", "speed_mps": 1e39, "course_deg": 1}, {"action": "stay", "speed_mps": 0}),
        *(
            {"action": "drift", "speed_mps": 0.2, "course_deg": 361},
            {"action": "drift", "speed_mps": -1, "course_deg": 1},
        ),
        *({"action": "drift", "speed_mps": 0.2, "course_deg": 1, "way_m": way} for way in (-1, 5001, None, math.nan)),
        *({"action": "follow"}, {"action": "stay", "way_m": 1}, {"action": "heading", "heading_deg": 1, "way_m": 1}),
        *({"action": "follow", "system_id": number} for number in (0, 256, 1.5, "1", True, math.inf)),
        *({"action": "effort", "effort": None}, {"action": "effort", "effort": "gentle", "policy": "bow"}),
    ],
)
def test_nonsense_is_refused_in_words(body: Any) -> None:
    with pytest.raises(ValueError, match=r"must be|takes no|JSON object|more than"):
        read_control(body)


def test_a_move_is_shown_by_the_station_that_it_asked_for() -> None:
    move = read_control({"action": "move", "n_m": 10.0, "e_m": 5.0})
    assert move.is_shown_by((10.0, 5.001, 33.0)) and not move.is_shown_by((10.0, 5.1, 33.0))
    turn = read_control({"action": "heading", "heading_deg": 0.0})
    assert turn.is_shown_by((1.0, 2.0, 359.97)) and not turn.is_shown_by((1.0, 2.0, 2.0))
    assert not move.is_shown_by(None)
    assert move.is_shown_by((10.3, 5.0, 33.0), 0.3) and not move.is_shown_by((10.35, 5.0, 33.0), 0.3), "it has gone on"
    assert move.describe() == "move to 10.0 m north, 5.0 m east" and turn.describe() == "heading 0 deg"
