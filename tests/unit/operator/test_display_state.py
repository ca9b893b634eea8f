"""The state in numbers for displays, there and back, and the two requests that a display adds: move, and neutral."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from asvhil.io.mavlink.frames import decode, dialect
from asvhil.operator.encoding import encode_move, encode_neutral, encode_question
from asvhil.operator.reports import OperatorReport
from asvhil.operator.state_arrays import (
    ENERGY_FIELDS,
    PLAN_ROWS,
    STATE_FIELDS,
    BoatState,
    read_plan,
    read_state,
    state_arrays,
)
from asvhil.supervisor.reasons import Reason, describe, explain
from asvhil.types import Control, DockingWindow, EnergyUse, Frame, MoveCommand, NeutralCommand, Station, Wind
from tests.support.operator_bench import CONFIG, GCS, Bench, acks
from tests.support.supervisor_bench import ESTIMATE

PLAN = tuple((0.2 * i, 1.0 * i, -0.5 * i, 0.01 * i) for i in range(41))
STATE = BoatState(
    estimate=ESTIMATE,
    station=Station(n_m=4.0, e_m=-2.0, psi_rad=-0.5),
    point=Station(n_m=4.0, e_m=-2.0, psi_rad=-0.5),
    wind=Wind(t_ns=0, vn_mps=3.0, ve_mps=-4.0, std_mps=0.7, valid=True),
    control=Control(command=(0.25, -0.5), ok=True, iterations=7, cost=1.0, plan=PLAN),
    pulses_us=(1625, 1250),
    solve_ms=8.5,
    mode="MANUAL",
    armed=True,
    battery_v=12.5,
    fix=3,
    satellites=11,
    origin_deg=(40.42371234, -86.92123456),
    sources=(("wind", "anemometer.MWV"), ("heading", "")),
    docking=DockingWindow(open_s=12.5, stays=(0.5, 0.25, 0.125)),
    energy=EnergyUse(hold_wh=12.25, power_w=90.0, mean_w=120.0, hours_left=3.5, by="measured"),
)


def sent(message: Any) -> Any:
    return decode(bytes(message.pack(GCS)))


def test_what_is_known_arrives_and_what_is_not_is_none() -> None:
    state, plan = (sent(message) for message in state_arrays(0, STATE))
    told = read_state(state)
    assert set(told) == set(STATE_FIELDS) and [name for name, value in told.items() if value is None] == [
        "battery_percent"
    ]
    assert (told["n_m"], told["station_n_m"], told["port_us"], told["fix"]) == (1.0, 4.0, 1625.0, 3.0)
    assert tuple(told[name] for name in ENERGY_FIELDS) == (12.25, 120.0, 3.5, 1.0)
    assert (told["dock_open"], told["dock_30"], told["dock_150"]) == (12.5, 0.5, 0.125)
    assert told["distance_m"] == pytest.approx(5.0) and told["heading_error_deg"] == pytest.approx(math.degrees(1.0))
    assert told["station_heading_deg"] == pytest.approx(360.0 - math.degrees(0.5), abs=1e-4)
    origin = [(told[f"origin_{axis}_deg"] or 0.0) + (told[f"origin_{axis}_rest_deg"] or 0.0) for axis in ("lat", "lon")]
    assert origin == pytest.approx(STATE.origin_deg, abs=1e-9), "to a tenth of a millimetre"
    rows = read_plan(plan)
    assert len(rows) == PLAN_ROWS and rows[0][:2] == (0.0, 0.0) and rows[-1][:2] == (40.0, -20.0)
    assert rows[-1][2] == pytest.approx(math.degrees(0.4))
    assert STATE.words() == [("mode", "MANUAL, armed"), ("sources", "wind anemometer.MWV, heading not heard")]


def test_nothing_known_is_told_as_such() -> None:
    (state,) = (sent(message) for message in state_arrays(0, BoatState()))
    assert set(read_state(state).values()) == {None}
    assert BoatState().words() == [("mode", "not known")]


def test_a_short_plan_keeps_its_rows() -> None:
    control = replace(STATE.control, plan=PLAN[:3])
    _, plan = (sent(message) for message in state_arrays(0, replace(STATE, control=control)))
    assert [row[0] for row in read_plan(plan)] == [0.0, 1.0, 2.0]


def test_they_go_to_whoever_asks_and_never_by_themselves() -> None:
    bench = Bench()
    report = OperatorReport(boat=STATE)
    bench.say(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    for _ in range(40):
        bench.t_ns += 100_000_000
        assert not [m for m in bench.hear(report) if m.get_type() == "DEBUG_FLOAT_ARRAY"]
    question = encode_question(CONFIG, dialect.MAVLINK_MSG_ID_DEBUG_FLOAT_ARRAY)
    bench.link.receive(Frame(t_ns=bench.t_ns, port="operator", data=question, peer="page:1"))
    frames = bench.link.data_to_send(bench.t_ns, report)
    arrays = [f for f in frames if decode(f.data).get_type() == "DEBUG_FLOAT_ARRAY"]
    assert [f.peer for f in arrays] == ["page:1", "page:1"]
    message = dialect.MAVLink_command_long_message(1, 191, 511, 0, 350, 200_000.0, 0, 0, 0, 0, 0)
    bench.say(message)
    assert acks(bench.hear()) == [(511, dialect.MAV_RESULT_DENIED, 191)], "no stream of them"


def requests(bench: Bench, data: bytes) -> list[Any]:
    bench.t_ns += 100_000_000
    return bench.link.receive(Frame(t_ns=bench.t_ns, port="operator", data=data, peer="page:1"))


@pytest.mark.parametrize(
    ("place_m", "psi_rad"), [((12.5, -3.25), None), (None, 1.25), ((0.0, 0.0), 0.0), ((-1.0, 2.0), -1.5)]
)
def test_a_move_is_what_was_asked_for(place_m: tuple[float, float] | None, psi_rad: float | None) -> None:
    (request,) = requests(Bench(), encode_move(CONFIG, place_m, psi_rad))
    n_m, e_m = place_m or (None, None)
    asked = request.command
    assert isinstance(asked, MoveCommand) and (asked.n_m, asked.e_m, asked.psi_rad) == (n_m, e_m, psi_rad)
    assert asked.lat_deg is None and asked.lon_deg is None and request.mav_cmd is None


def local(frame: int = 1, mask: int = 0b100111111000, x: float = 1.0, yaw: float = 0.0, vx: float = 0.0) -> bytes:
    fields = (x, 2.0, 0.0, vx, 0.0, 0.0, 0.0, 0.0, 0.0, yaw, 0.0)
    return bytes(dialect.MAVLink_set_position_target_local_ned_message(0, 1, 191, frame, mask, *fields).pack(GCS))


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (local(frame=8), explain(Reason.FRAME_NOT_LOCAL, frame=8)),
        (local(mask=0b110111111011), explain(Reason.SETPOINT_WITHOUT_POSITION)),
        (local(mask=0b110111111001), explain(Reason.SETPOINT_WITHOUT_POSITION)),
        (local(mask=0b100111111001), explain(Reason.SETPOINT_WITHOUT_POSITION)),
        (local(mask=0b100111110000, vx=1.0), explain(Reason.VELOCITY_IMPOSSIBLE)),
        (local(mask=0b100111100000, vx=math.nan), explain(Reason.VELOCITY_IMPOSSIBLE)),
        (local(x=math.nan), explain(Reason.PLACE_IMPOSSIBLE)),
        (local(yaw=90.0), explain(Reason.HEADING_IMPOSSIBLE)),
    ],
)
def test_what_no_station_can_follow_is_refused_in_words(data: bytes, why: Any) -> None:
    bench = Bench()
    assert requests(bench, data) == []
    assert [m.text for m in bench.hear() if m.get_type() == "STATUSTEXT"] == [describe(why)]


def test_a_local_set_point_to_the_autopilot_is_not_ours_even_where_its_gotos_are() -> None:
    bench = Bench(claim_goto=True)
    message = dialect.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0b110111111000, *[1.0] * 11)
    assert bench.say(message) == []
    assert not [m for m in bench.hear() if m.get_type() in ("COMMAND_ACK", "STATUSTEXT")]


def test_neutral_is_asked_for_by_disarming_our_component_alone() -> None:
    bench = Bench()
    (request,) = requests(bench, encode_neutral(CONFIG))
    assert isinstance(request.command, NeutralCommand)
    assert acks(bench.answer(request, None)) == [(400, dialect.MAV_RESULT_ACCEPTED, 191)]
    assert requests(bench, encode_neutral(CONFIG)) == [], "a repetition is answered and not done again"
    assert acks(bench.hear()) == [(400, dialect.MAV_RESULT_ACCEPTED, 191)]
    everybody = dialect.MAVLink_command_long_message(1, 0, 400, 0, 0, 0, 0, 0, 0, 0, 0)
    assert bench.say(everybody) == [] and acks(bench.hear()) == [], "the autopilot is disarmed, and says so itself"
    arm = dialect.MAVLink_command_long_message(1, 191, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    assert bench.say(arm) == [] and acks(bench.hear()) == [(400, dialect.MAV_RESULT_UNSUPPORTED, 191)]
