"""Operators' frames to requests, and decisions to answers: in order, and each to its sender."""

from __future__ import annotations

import math
from typing import Any

import pytest

from asvhil.config import load_config
from asvhil.config.loading import shipped_names
from asvhil.geo import LocalFrame
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect
from asvhil.operator.encoding import encode_hold, encode_parameter_question, encode_question, encode_release
from asvhil.operator.operations import Operations
from asvhil.operator.session import OperatorSession
from asvhil.operator.state_arrays import read_state
from asvhil.operator.station_parameters import (
    COURSE_PARAMETERS,
    LIMIT_PARAMETERS,
    PLACE_PARAMETERS,
    STATION_PARAMETERS,
    request_of_change,
    station_value,
)
from asvhil.operator.tunables import Tunables
from asvhil.supervisor.decision import Decision, Request
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.supervisor.situation import Situation
from asvhil.types import (
    CourseCommand,
    Frame,
    HeadingCommand,
    HoldCommand,
    MoveCommand,
    ParameterChange,
    Phase,
    ReleaseCommand,
    Station,
)
from tests.support.supervisor_bench import status

CONFIG = load_config("sitl", ("controller.name=loiter",))
LINK = CONFIG.links.autopilot
GCS = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
STATION = Station(n_m=3.0, e_m=-4.0, psi_rad=0.5)
FRAME = LocalFrame(lat_deg=40.0, lon_deg=-86.0)
POLICY_RANGE = "0 (fixed), 1 (bow), 2 (stern), 3 (either), 4 (free)"


class Retuned:
    """A controller that takes other settings."""

    def retune(self, config: object) -> None:
        """Nothing to do here."""


def test_a_choice_is_a_number_on_the_link() -> None:
    tunables = Tunables(load_config("sitl").controller, Retuned())
    assert tunables.value("MPC_EFFORT") == 1.0
    assert tunables.set("MPC_EFFORT", 2.0) is None and tunables.value("MPC_EFFORT") == 2.0
    for wrong in (0.5, 3.0, -1.0, math.nan):
        refused = tunables.set("MPC_EFFORT", wrong)
        assert refused is not None and "0 (precise), 1 (normal), 2 (gentle)" in describe(refused)
    assert tunables.value("MPC_EFFORT") == 2.0


def test_a_set_of_weights_that_the_config_has_not_has_no_parameters() -> None:
    tunables = Tunables(load_config("sitl").controller, Retuned())
    assert tunables.value("W_WTHR_HDG") == 30.0
    assert tunables.set("W_WTHR_HDG", 60.0) is None and tunables.value("W_WTHR_HDG") == 60.0
    without = Tunables(load_config("sitl", ("controller.mpc.weather=null",)).controller, Retuned())
    assert set(tunables.names) - set(without.names) == {
        f"W_WTHR_{what}" for what in ("POS", "SIDE", "HDG", "VEL", "SLEW", "TERM")
    }


@pytest.mark.parametrize("set_of", ["NEAR", "ALONG", "WTHR", "FAR", "POSN"])
def test_what_nothing_would_keep_the_boat_with_is_refused_with_the_range(set_of: str) -> None:
    tunables = Tunables(load_config("sitl").controller, Retuned())
    refused = {"POS": "0.1 to 10000", "SIDE": "0.05 to 1"} | (
        {} if set_of in ("FAR", "POSN") else {"HDG": "1 to 100000"}
    )
    for what in ("POS", "SIDE", "HDG", "VEL", "SLEW", "TERM"):
        before = tunables.value(name := f"W_{set_of}_{what}")
        why = tunables.set(name, 0.0)
        if what in refused:
            assert why is not None and refused[what] in describe(why) and tunables.value(name) == before
        else:
            assert why is None and tunables.value(name) == 0.0


@pytest.mark.parametrize("name", [name for name in shipped_names() if name.startswith(("sitl", "field"))])
def test_what_the_shipped_configs_have_may_be_set(name: str) -> None:
    tunables = Tunables(load_config(name).controller, Retuned())
    assert [row for row in tunables.names if tunables.set(row, tunables.value(row)) is not None] == []


class Bench:
    def __init__(self) -> None:
        tunables = Tunables(CONFIG.controller, Retuned())
        names = (*STATION_PARAMETERS, *LIMIT_PARAMETERS, *tunables.names)
        session = OperatorSession(LINK, CONFIG.links.operator, names)
        self.operations = Operations(session, tunables, fastest_mps=0.75)
        self.t_ns = 0

    def receive(self, message: Any) -> None:
        data = message if isinstance(message, bytes) else bytes(message.pack(GCS))
        self.operations.receive(Frame(t_ns=self.t_ns, port="operator", data=data, peer="gcs:1"))

    def set(self, name: str, value: float) -> None:
        self.receive(dialect.MAVLink_param_set_message(1, 191, name.encode(), value, 9))

    def tick(
        self, *answers: Explanation | None, begun: bool = False, link_ok: bool = True
    ) -> tuple[list[Request], list[Any]]:
        """The requests of a tick, and what is sent once they are decided so."""
        self.t_ns += 50_000_000
        requests = self.operations.take_requests()
        decision = Decision(
            phase=Phase.HOLD,
            why=explain(Reason.HOLDING),
            station=STATION,
            point=STATION,
            answers=answers,
            begun=begun,
            link_ok=link_ok,
        )
        self.operations.answer(self.t_ns, decision)
        situation = Situation(t_ns=self.t_ns, frame=FRAME, status=status(battery_v=12.5, fix=3))
        frames = self.operations.data_to_send(situation, decision, None, (), ())
        sent = [decode(data) for frame in frames for data in FrameSplitter().receive(frame.data)]
        return requests, [m for m in sent if m is not None]


def of_kind(sent: list[Any], *kinds: str) -> list[Any]:
    return [m for m in sent if m.get_type() in kinds]


def test_an_autopilot_that_is_heard_no_more_has_no_state() -> None:
    bench = Bench()

    def asked(*, link_ok: bool) -> tuple[dict[str, float | None], list[str]]:
        for msg_id in (dialect.MAVLINK_MSG_ID_DEBUG_FLOAT_ARRAY, dialect.MAVLINK_MSG_ID_STATUSTEXT):
            bench.receive(encode_question(LINK, msg_id))
        sent = bench.tick(link_ok=link_ok)[1]
        texts = [m.text for m in of_kind(sent, "STATUSTEXT") if m.text.startswith("mode: ")]
        return read_state(of_kind(sent, "DEBUG_FLOAT_ARRAY")[0]), texts

    state, texts = asked(link_ok=True)
    assert (state["armed"], state["battery_v"], state["fix"], texts) == (1.0, 12.5, 3.0, ["mode: MANUAL, armed"])
    state, texts = asked(link_ok=False)
    assert (state["armed"], state["battery_v"], state["fix"], texts) == (None, None, None, ["mode: not known"])


def test_each_request_gets_its_own_answer_in_turn() -> None:
    bench = Bench()
    bench.tick()
    bench.receive(encode_hold(LINK, None, None, None))
    bench.set("LOIT_RADIUS", 1e6)  # decided without the supervisor
    bench.set("ST_NORTH", 7.0)
    bench.receive(encode_release(LINK))
    requests, sent = bench.tick(explain(Reason.NOT_ARMED), explain(Reason.NO_STATION_HELD), None)
    assert [type(request) for request in requests] == [HoldCommand, MoveCommand, ReleaseCommand]
    texts = [m.text for m in of_kind(sent, "STATUSTEXT")]
    range_text = describe(explain(Reason.PARAMETER_OUT_OF_RANGE, name="LOIT_RADIUS", range="0.1 to 100"))
    assert texts == [describe(explain(Reason.NOT_ARMED)), range_text, describe(explain(Reason.NO_STATION_HELD))]
    acks = [(m.command, m.result) for m in of_kind(sent, "COMMAND_ACK")]
    assert acks == [(192, dialect.MAV_RESULT_TEMPORARILY_REJECTED), (92, dialect.MAV_RESULT_ACCEPTED)]
    assert [m.param_id for m in of_kind(sent, "PARAM_VALUE")] == ["LOIT_RADIUS", "ST_NORTH"]
    requests, sent = bench.tick()
    assert requests == [] and of_kind(sent, "STATUSTEXT", "COMMAND_ACK", "PARAM_VALUE") == []


def test_a_parameter_of_the_controller_is_set_before_the_decision_of_its_tick() -> None:
    bench = Bench()
    bench.tick()
    bench.set("LOIT_RADIUS", 2.5)
    requests, sent = bench.tick()
    assert requests == []
    assert [(m.param_id, m.param_value) for m in of_kind(sent, "PARAM_VALUE")] == [("LOIT_RADIUS", 2.5)]


def test_how_fast_a_station_may_be_is_read_and_not_set() -> None:
    bench = Bench()
    bench.receive(encode_parameter_question(LINK, "ST_SPEED_MAX"))
    _, sent = bench.tick()
    assert [(m.param_id, m.param_value) for m in of_kind(sent, "PARAM_VALUE")] == [("ST_SPEED_MAX", 0.75)]
    bench.set("ST_SPEED_MAX", 9.0)
    requests, sent = bench.tick()
    assert requests == [] and [m.param_value for m in of_kind(sent, "PARAM_VALUE")] == [0.75]
    read_only = explain(Reason.PARAMETER_READ_ONLY, name="ST_SPEED_MAX")
    assert [m.text for m in of_kind(sent, "STATUSTEXT")] == [describe(read_only)]


def test_a_hold_that_begins_tells_the_station_to_everyone() -> None:
    bench = Bench()
    bench.tick()
    bench.receive(encode_hold(LINK, None, None, None))
    _, sent = bench.tick(None, begun=True)
    values = {m.param_id: m.param_value for m in of_kind(sent, "PARAM_VALUE")}
    assert list(values) == list(PLACE_PARAMETERS) and (values["ST_NORTH"], values["ST_EAST"]) == (3.0, -4.0)


@pytest.mark.parametrize(
    ("name", "value", "meant"),
    [
        ("ST_LAT", 40.5, MoveCommand(t_ns=1, lat_deg=40.5)),
        ("ST_LON", -86.5, MoveCommand(t_ns=1, lon_deg=-86.5)),
        ("ST_NORTH", 7.0, MoveCommand(t_ns=1, n_m=7.0)),
        ("ST_EAST", -7.0, MoveCommand(t_ns=1, e_m=-7.0)),
        ("ST_HDG", 0.0, MoveCommand(t_ns=1, psi_rad=0.0)),
        ("ST_POLICY", 2.0, HeadingCommand(t_ns=1, policy="stern")),
        ("ST_SPEED", 0.25, CourseCommand(t_ns=1, speed_mps=0.25)),
        ("ST_COURSE", 180.0, CourseCommand(t_ns=1, course_rad=math.pi)),
        ("ST_WAY", 0.0, CourseCommand(t_ns=1, way_m=0.0)),
        ("ST_FOLLOW", 42.0, CourseCommand(t_ns=1, leader=42)),
        ("ST_SPEED", -0.1, explain(Reason.PARAMETER_OUT_OF_RANGE, name="ST_SPEED", range="0 or more")),
        ("ST_SPEED", math.nan, explain(Reason.PARAMETER_OUT_OF_RANGE, name="ST_SPEED", range="0 or more")),
        ("ST_COURSE", 361.0, explain(Reason.PARAMETER_OUT_OF_RANGE, name="ST_COURSE", range="0 to 360")),
        ("ST_FOLLOW", 1.5, explain(Reason.PARAMETER_OUT_OF_RANGE, name="ST_FOLLOW", range="0 to 255")),
        ("ST_LAT", 90.5, explain(Reason.PARAMETER_OUT_OF_RANGE, name="ST_LAT", range="-90 to 90")),
        ("ST_HDG", 361.0, explain(Reason.PARAMETER_OUT_OF_RANGE, name="ST_HDG", range="-360 to 360")),
        ("ST_POLICY", 5.0, explain(Reason.PARAMETER_OUT_OF_RANGE, name="ST_POLICY", range=POLICY_RANGE)),
        ("ST_POLICY", math.nan, explain(Reason.PARAMETER_OUT_OF_RANGE, name="ST_POLICY", range=POLICY_RANGE)),
        ("ST_EAST", float("inf"), explain(Reason.PARAMETER_OUT_OF_RANGE, name="ST_EAST", range="a finite number")),
    ],
)
def test_setting_a_parameter_of_the_station_asks_for_a_move_or_a_policy(name: str, value: float, meant: object) -> None:
    assert request_of_change(ParameterChange(t_ns=1, name=name, value=value)) == meant


def test_the_parameters_of_the_station_are_those_of_the_one_that_is_held() -> None:
    values = [station_value(name, STATION, FRAME, "either") for name in STATION_PARAMETERS]
    assert FRAME.to_ned(values[0], values[1]) == pytest.approx((3.0, -4.0), abs=1e-6)
    assert values[2:] == pytest.approx([28.6478898, 3.0, -4.0, 3.0, *[0.0] * 4])
    *place, policy = (station_value(name, None, FRAME, "bow") for name in STATION_PARAMETERS[:6])
    assert all(math.isnan(value) for value in place) and policy == 1.0
    course = CourseCommand(t_ns=1, speed_mps=0.25, course_rad=-math.pi / 2, way_m=12.0, leader=42)
    values = [station_value(name, STATION, FRAME, "bow", course) for name in COURSE_PARAMETERS]
    assert values == pytest.approx([0.25, 270.0, 12.0, 42.0])
