"""What the page is told of a daemon: messages in, JSON out, on a clock of the test's own."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from asvhil.config import load_config
from asvhil.daemon.computer import ComputerStatus
from asvhil.dashboard.boat_facts import boat_facts
from asvhil.dashboard.picture import HISTORY_ROWS, NOTE_S, RESTART_S, STALE_S, BoatPicture
from asvhil.io.mavlink.frames import decode, dialect
from asvhil.io.mavlink.texts import Texts
from asvhil.operator.state_arrays import BoatState, state_arrays
from asvhil.types import Control, Station
from tests.support.supervisor_bench import ESTIMATE

DAEMON = dialect.MAVLink(None, srcSystem=1, srcComponent=191)
PLAN = ((0.0, 1.0, 2.0, 0.5), (0.2, 1.5, 2.0, 0.5))
HELD = BoatState(
    estimate=ESTIMATE,
    station=Station(n_m=4.0, e_m=-2.0, psi_rad=0.5),
    point=Station(n_m=4.0, e_m=-2.0, psi_rad=0.5),
    control=Control(command=(0.1, 0.2), ok=True, iterations=3, cost=0.0, plan=PLAN),
    pulses_us=(1550, 1600),
    armed=True,
    origin_deg=(40.0, -86.0),
)
WARNING, NOTICE, INFO = 4, 5, 6


class PictureBench:
    def __init__(self, **options: Any) -> None:
        self.picture = BoatPicture(**options)
        self.t_s = 1000.0
        self._texts = Texts()

    def hear(self, *messages: Any, after_s: float = 0.2) -> None:
        self.t_s += after_s
        for message in messages:
            self.picture.receive(self.t_s, decode(bytes(message.pack(DAEMON))))

    def say(self, text: str, severity: int = NOTICE, after_s: float = 0.2) -> None:
        self.hear(*self._texts.messages(severity, text), after_s=after_s)

    def list_notes(self, *notes: tuple[str, int], mode: str = "MANUAL, armed") -> None:
        """The daemon's answer to the question of texts, of one tick."""
        texts = ("standby: waiting for a hold command", NOTICE), (f"mode: {mode}", INFO), *notes
        self.hear(*(message for text, severity in texts for message in self._texts.messages(severity, text)))

    def live(self) -> dict[str, Any]:
        """As the page gets it: through JSON, which knows no NaN."""
        return dict(json.loads(json.dumps(self.picture.live(self.t_s), allow_nan=False)))

    def events(self) -> list[str]:
        return [event["text"] for event in self.live()["events"]]


def computer() -> Any:
    return decode(ComputerStatus(load_config("sitl").links.autopilot, Path("/")).encode())


def parameters(**values: float) -> list[Any]:
    return [dialect.MAVLink_param_value_message(name.encode(), value, 9, 40, 3) for name, value in values.items()]


def heartbeat(phase: int, state: int) -> Any:
    return dialect.MAVLink_heartbeat_message(18, 8, 0, phase, state, 3)


def test_choices_are_those_that_the_daemon_tells_and_unknown_until_then() -> None:
    bench = PictureBench()
    assert bench.live()["choices"] == {"policy": None, "effort": None}

    def told(name: str, value: float) -> dict[str, str | None]:
        bench.hear(dialect.MAVLink_param_value_message(name.encode(), value, 9, 40, 3))
        return dict(bench.live()["choices"])

    assert told("ST_POLICY", 2.0) == {"policy": "stern", "effort": None}
    assert told("MPC_EFFORT", 0.0) == {"policy": "stern", "effort": "precise"}
    for odd in (3.0, -1.0, float("nan"), 1e30):
        assert told("MPC_EFFORT", odd)["effort"] == "precise"
    assert told("W_NEAR_HEAD", 1.0)["effort"] == "precise"


def test_a_setting_is_told_from_when_it_was_asked_for_on() -> None:
    bench = PictureBench()
    assert not bench.picture.tells_setting("ST_SPEED", 0.0, 0.0)
    bench.hear(dialect.MAVLink_param_value_message(b"ST_SPEED", 0.3, 9, 40, 3))
    told_s = bench.t_s
    assert bench.picture.tells_setting("ST_SPEED", 0.3, told_s), "as exactly as a float of the link tells it"
    assert not bench.picture.tells_setting("ST_SPEED", 0.3, told_s + 0.1)
    assert not bench.picture.tells_setting("ST_SPEED", 0.2999, told_s)
    assert not bench.picture.tells_setting("ST_COURSE", 0.3, told_s)


@pytest.mark.parametrize(
    "refusal",
    [
        "no station is held: send a hold command first",
        "not armed: neutral is sent for 30 s, arm it in MANUAL and hold again",
        "the heading follows the weather (bow): choose the policy fixed first",
        "too slow: RC_CHANNELS, less than a third of 10 Hz",
        "reversed output: port",
        "SERVO1_FUNCTION is 74: it must be 73",
    ],
)
def test_a_refusal_with_a_colon_is_no_note_however_often_it_is_heard(refusal: str) -> None:
    bench = PictureBench()
    bench.list_notes(("links: autopilot up", NOTICE), ("outputs: reversed output: port", WARNING))
    for _ in range(2):
        bench.say(refusal, WARNING)
        assert not bench.picture.is_note(refusal)
    assert [note["subject"] for note in bench.live()["notes"]] == ["links", "outputs"]
    assert bench.events()[-2:] == [refusal] * 2


def test_a_refusal_that_is_heard_with_the_notes_or_after_another_message_is_none_of_them() -> None:
    bench = PictureBench()
    refusal = "not armed: neutral is sent for 30 s, arm it in MANUAL and hold again"
    bench.list_notes(("links: autopilot up", NOTICE), (refusal, WARNING))
    bench.list_notes(("links: autopilot up", NOTICE))
    bench.hear(*state_arrays(0, HELD), after_s=0.0)
    bench.say("SERVO1_FUNCTION is 74: it must be 73", WARNING, after_s=0.0)
    assert [note["subject"] for note in bench.live()["notes"]] == ["links"]
    assert not bench.picture.is_note(refusal)


def test_before_anything_is_heard_it_says_so() -> None:
    live = PictureBench().live()
    assert live["stale"] is True and live["age_s"] is None and live["trouble"] == "no answer yet"
    assert live["boat"] == {} and live["plan"] == [] and live["phase"] is None


def test_state_plan_and_phase_are_those_of_the_messages() -> None:
    bench = PictureBench()
    moving = replace(HELD, point=Station(n_m=4.0, e_m=-2.0, psi_rad=0.5, vn_mps=0.25, ve_mps=-0.5))
    bench.hear(*state_arrays(0, moving), heartbeat(2, 4))
    live = bench.live()
    assert (live["boat"]["station_vn_mps"], live["boat"]["station_ve_mps"]) == (0.25, -0.5)
    assert (live["stale"], live["age_s"], live["phase"], live["state"]) == (False, 0.0, "hold", "active")
    assert (
        live["boat"]["distance_m"] == 5.0 and live["boat"]["port_us"] == 1550.0 and live["boat"]["wind_n_mps"] is None
    )
    assert live["plan"] == [[1.0, 2.0, 28.64789], [1.5, 2.0, 28.64789]]
    assert bench.picture.station_m == pytest.approx((4.0, -2.0, 28.64789), abs=1e-4)


def test_a_daemon_that_falls_silent_is_old_at_once_and_told_once() -> None:
    bench = PictureBench()
    bench.hear(*state_arrays(0, HELD))
    bench.t_s += STALE_S - 0.01
    assert not bench.live()["stale"]
    bench.t_s += 0.02
    bench.picture.note_trouble("udpin: nobody is there")
    assert bench.live()["stale"] and bench.live()["trouble"] == "udpin: nobody is there"
    bench.t_s += 5.0
    assert bench.live()["age_s"] == pytest.approx(STALE_S + 5.01, abs=0.011)
    assert bench.events() == ["the daemon answers", "the daemon does not answer"]
    bench.hear(*state_arrays(0, HELD))
    assert bench.events()[-1] == "the daemon answers" and not bench.live()["stale"]


def test_a_plan_that_is_no_longer_told_and_a_station_that_is_let_go_are_gone() -> None:
    bench = PictureBench()
    bench.hear(*state_arrays(0, HELD))
    for _ in range(6):
        bench.hear(*state_arrays(0, replace(HELD, station=None, point=None, control=None, pulses_us=None)))
    live = bench.live()
    assert live["plan"] == [] and live["boat"]["station_n_m"] is None and live["station_deg"] is None
    assert bench.picture.station_m is None


def test_words_are_phase_mode_notes_and_events() -> None:
    bench = PictureBench()
    bench.hear(*state_arrays(0, HELD))
    sources = "sources: position autopilot.GPS_RAW_INT, wind not heard, and some more that makes it long"
    bench.say("gyro: silent", WARNING)  # as soon as it is so
    for _ in range(3):  # answers, once a second
        bench.list_notes((sources, INFO), ("outputs: follow the commands", NOTICE), ("gyro: silent", WARNING))
    bench.say("hold: holding")
    bench.say("vehicle is not armed", WARNING)
    bench.hear(*state_arrays(0, HELD))
    live = bench.live()
    assert (live["phase"], live["reason"], live["mode"]) == ("hold", "holding", "MANUAL, armed")
    assert live["sources"].endswith("makes it long")
    assert live["notes"] == [
        {"subject": "outputs", "text": "follow the commands", "ok": True},
        {"subject": "gyro", "text": "silent", "ok": False},
    ]
    told = ["the daemon answers", "gyro: silent", "standby: waiting for a hold command", "hold: holding"]
    assert bench.events() == [*told, "vehicle is not armed"], "each once, however often it is answered"
    assert bench.picture.is_note("gyro: silent") and not bench.picture.is_note("vehicle is not armed")
    bench.say("gyro: recovered")
    assert [note["subject"] for note in bench.live()["notes"]] == ["outputs"]


def test_a_note_that_is_answered_no_more_is_gone_and_one_with_other_numbers_is_no_news() -> None:
    bench = PictureBench()
    for metres in (1.5, 2.5, 13.25):
        bench.hear(*state_arrays(0, HELD))
        bench.list_notes((f"gnss position: jumped by {metres} m", WARNING))
    assert bench.events().count("gnss position: jumped by 1.5 m") == 1 and len(bench.events()) == 3
    for _ in range(round(NOTE_S / 0.2) + 1):
        bench.hear(*state_arrays(0, HELD))
    assert bench.live()["notes"] == []


def test_an_emergency_is_an_event() -> None:
    bench = PictureBench()
    bench.hear(*state_arrays(0, HELD), heartbeat(2, 4))
    bench.hear(heartbeat(0, 6))
    bench.hear(heartbeat(0, 6))
    assert [text for text in bench.events() if text.startswith("emergency")] == [bench.events()[-1]]


def test_history_has_a_row_a_second_and_an_end() -> None:
    bench = PictureBench()
    for _ in range(5 * 10):
        bench.hear(*state_arrays(0, HELD))
    rows = bench.picture.history()["rows"]
    assert 9 <= len(rows) <= 11 and all(b[0] - a[0] >= 1.0 for a, b in pairwise(rows))
    for _ in range(HISTORY_ROWS + 50):
        bench.hear(*state_arrays(0, HELD), after_s=1.0)
    assert len(bench.picture.history()["rows"]) == HISTORY_ROWS


def test_what_a_daemon_before_it_told_is_not_told_of_one_that_has_started_again() -> None:
    bench = PictureBench()
    bench.hear(*state_arrays(0, HELD), computer(), *parameters(MPC_EFFORT=2.0, ST_FOLLOW=42.0))
    bench.list_notes(("gyro: silent", WARNING))
    live = bench.live()
    assert (live["choices"]["effort"], live["leader"], live["mode"]) == ("gentle", 42, "MANUAL, armed")
    assert live["computer"] is not None and len(live["notes"]) == 1
    bench.t_s += RESTART_S
    assert bench.live()["choices"]["effort"] == "gentle" and bench.live()["stale"], "old, and told to be"
    bench.hear(*state_arrays(0, BoatState()))
    live = bench.live()
    assert (live["choices"]["effort"], live["leader"], live["mode"]) == (None, 0, "")
    assert live["computer"] is None and live["notes"] == []


def test_what_is_told_no_more_is_gone_while_the_daemon_is_heard() -> None:
    bench = PictureBench()
    bench.hear(*state_arrays(0, HELD), computer(), *parameters(MPC_EFFORT=2.0, ST_FOLLOW=float("nan")))
    for _ in range(round(NOTE_S / 0.2) - 1):
        bench.hear(*state_arrays(0, HELD))
        assert bench.live()["choices"]["effort"] == "gentle"
    bench.hear(*state_arrays(0, HELD), after_s=0.5)
    assert bench.live()["choices"]["effort"] is None and bench.live()["computer"] is None


def test_the_track_begins_anew_where_metres_are_from_another_place() -> None:
    bench = PictureBench()
    bench.hear(*state_arrays(0, HELD))
    bench.hear(*state_arrays(0, BoatState()), after_s=1.0)  # one that has no position yet
    first = bench.picture.history()
    assert len(first["rows"]) == 2 and first["track"] == bench.live()["track"]
    bench.hear(*state_arrays(0, replace(HELD, origin_deg=(40.0004, -86.0))), after_s=1.0)
    again = bench.picture.history()
    assert len(again["rows"]) == 1 and again["track"] == bench.live()["track"] != first["track"]


def test_events_after_a_number_alone_are_told() -> None:
    bench = PictureBench()
    bench.say("hold: holding")
    number = bench.picture.last_event
    bench.picture.tell(bench.t_s, "neutral, asked for by 10.0.0.7", ok=True)
    assert [event["text"] for event in bench.picture.live(bench.t_s, number)["events"]] == [
        "neutral, asked for by 10.0.0.7"
    ]


def test_values_by_name_are_those_that_are_known_and_fresh() -> None:
    bench = PictureBench()
    assert bench.picture.values(bench.t_s) == []
    bench.hear(*state_arrays(0, HELD), heartbeat(2, 4))
    values = dict(line.split("=") for line in bench.picture.values(bench.t_s))
    assert (values["asvhil-phase"], values["asvhil-distance_m"]) == (
        "hold",
        "5.0",
    ) and "asvhil-wind_n_mps" not in values
    assert bench.picture.values(bench.t_s + STALE_S + 0.1) == []


def test_the_fence_is_in_metres_once_it_is_known_where_these_begin() -> None:
    bench = PictureBench(fence_deg=((40.0, -86.0), (40.001, -86.0), (40.0, -86.001)))
    assert bench.live()["fence_m"] == []
    bench.hear(*state_arrays(0, HELD))
    (origin, north, west) = bench.live()["fence_m"]
    assert origin == pytest.approx([0.0, 0.0], abs=0.01) and north == pytest.approx([111.0, 0.0], abs=0.1)
    assert west[1] == pytest.approx(-85.4, abs=0.1)


def test_the_boats_facts_are_those_of_its_config() -> None:
    facts = boat_facts(load_config("sitl", ("controller.procedure.enabled=true",)))
    assert (facts["name"], facts["controller"], facts["pulses_us"]) == ("wamv16", "lagnet-mpc", [1100, 1500, 1900])
    assert [name for name, _ in facts["radii"]] == ["near", "far", "hand-over", "approach again"]
    assert json.loads(json.dumps(facts))["thrust"][0][0] < 0.0 < facts["length_m"]
