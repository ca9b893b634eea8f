"""What the operator's session sends: messages that are asked for, reports, parameters and texts."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.io.mavlink.frames import decode, dialect
from asvhil.io.mavlink.texts import TextReader, Texts
from asvhil.operator.reports import OperatorReport
from asvhil.operator.state_arrays import ENERGY_FIELDS
from asvhil.supervisor.reasons import Reason, describe, explain
from asvhil.types import EVERYONE, DockingWindow, EnergyUse, Frame, ParameterChange, Phase
from tests.support.operator_bench import GCS, NAMES, POSITION_ONLY, Bench, S, acks, messages

# --- messages ---------------------------------------------------------------------------------------------------------


def test_the_version_is_told_after_the_acknowledgement() -> None:
    bench = Bench()
    for command, param in ((512, 148.0), (520, 1.0)):
        bench.say(dialect.MAVLink_command_long_message(1, 191, command, 0, param, 0, 0, 0, 0, 0, 0))
        ack, version = (m for m in bench.hear() if m.get_type() in ("COMMAND_ACK", "AUTOPILOT_VERSION"))
        assert (ack.command, ack.result) == (command, 0)
        assert version.capabilities & dialect.MAV_PROTOCOL_CAPABILITY_COMMAND_INT and version.flight_sw_version


@pytest.mark.parametrize(
    ("command", "param1", "param2", "result"),
    [
        (512, 33.0, 0.0, dialect.MAV_RESULT_DENIED),
        (512, math.nan, 0.0, dialect.MAV_RESULT_DENIED),
        (510, 30.0, 0.0, dialect.MAV_RESULT_DENIED),
        (511, 30.0, 1e6, dialect.MAV_RESULT_DENIED),
        (511, 0.0, 1e6, dialect.MAV_RESULT_DENIED),
        (511, 251.0, 10.0, dialect.MAV_RESULT_DENIED),
        (511, 251.0, math.nan, dialect.MAV_RESULT_DENIED),
        (511, 251.0, 1e30, dialect.MAV_RESULT_DENIED),  # more than MESSAGE_INTERVAL can tell
        (511, 251.0, 200_000.0, dialect.MAV_RESULT_ACCEPTED),
        (519, 1.0, 0.0, dialect.MAV_RESULT_UNSUPPORTED),
    ],
)
def test_message_commands(command: int, param1: float, param2: float, result: int) -> None:
    bench = Bench()
    bench.say(dialect.MAVLink_command_long_message(1, 191, command, 0, param1, param2, 0, 0, 0, 0, 0))
    assert acks(bench.hear()) == [(command, result, 191)]
    bench.say(dialect.MAVLink_command_long_message(1, 191, 510, 0, 251, 0, 0, 0, 0, 0, 0))
    assert acks(bench.hear()) == [(510, dialect.MAV_RESULT_ACCEPTED, 191)]


def rates(bench: Bench, seconds: float = 10.0) -> dict[str, float]:
    """Messages a second by name, with a tick each 50 ms; of named values those of one name."""
    station = OperatorReport(phase=Phase.HOLD, distance_m=1.0, heading_error_rad=0.1, station=(40.0, -86.0, 0.5))
    counts: dict[str, int] = {}
    for _ in range(round(seconds * 20)):
        bench.t_ns += S // 20
        for message in messages(bench.link.data_to_send(bench.t_ns, station)):
            name = getattr(message, "name", message.get_type())
            counts[name] = counts.get(name, 0) + 1
    return {name: count / seconds for name, count in counts.items()}


def test_reports_come_at_their_rates_once_somebody_is_there() -> None:
    bench = Bench()
    assert rates(bench) == {}
    bench.say(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    assert rates(bench) == {
        "HEARTBEAT": 1.0,
        "phase": 2.0,
        "dist_err": 2.0,
        "head_err": 2.0,
        "solve_ok": 2.0,
        "POSITION_TARGET_GLOBAL_INT": 2.0,
    }
    for msg_id, interval_us in ((251, 200_000.0), (87, -1.0)):
        bench.say(dialect.MAVLink_command_long_message(1, 191, 511, 0, msg_id, interval_us, 0, 0, 0, 0, 0))
    bench.say(dialect.MAVLink_command_long_message(1, 191, 510, 0, 251, 0, 0, 0, 0, 0, 0))
    (interval,) = (m for m in bench.hear() if m.get_type() == "MESSAGE_INTERVAL")
    assert (interval.message_id, interval.interval_us) == (251, 200_000)
    now = rates(bench)
    assert now["dist_err"] == 5.0 and "POSITION_TARGET_GLOBAL_INT" not in now
    quiet = Bench(report_hz=0.0)
    quiet.say(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    assert rates(quiet) == {"HEARTBEAT": 1.0}


def test_reports_end_when_nobody_is_there_any_more() -> None:
    bench = Bench()
    bench.say(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    rates(bench, 16.0)
    assert rates(bench) == {"HEARTBEAT": 1.0}
    bench.say(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    assert rates(bench)["dist_err"] == pytest.approx(2.0, abs=0.1)


def test_what_the_reports_say() -> None:
    bench = Bench()
    bench.say(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    heard = bench.hear(
        OperatorReport(
            phase=Phase.FAILSAFE, distance_m=2.5, heading_error_rad=-math.pi / 4, solve_ms=3.5, iterations=4.0,
            control_ok=False, station=(40.5, -86.25, 1.5),
        )
    )  # fmt: skip
    values = {m.name: m.value for m in heard if m.get_type() == "NAMED_VALUE_FLOAT"}
    assert values == {
        "phase": 3.0, "dist_err": 2.5, "head_err": -45.0, "solve_ms": 3.5, "solve_iter": 4.0, "solve_ok": 0.0,
    }  # fmt: skip
    (target,) = (m for m in heard if m.get_type() == "POSITION_TARGET_GLOBAL_INT")
    assert (target.lat_int, target.lon_int, target.yaw) == (405000000, -862500000, 1.5)
    assert target.type_mask == POSITION_ONLY & ~1024 | 4
    (heartbeat,) = (m for m in heard if m.get_type() == "HEARTBEAT")
    assert (heartbeat.autopilot, heartbeat.type, heartbeat.system_status) == (8, 18, dialect.MAV_STATE_CRITICAL)


@pytest.mark.parametrize(
    ("window", "told"),
    [
        (None, {}),
        (DockingWindow(open_s=None), {"dock_open": 0.0, "dock_30": 0.0, "dock_60": 0.0, "dock_150": 0.0}),
        (DockingWindow(open_s=7.5), {"dock_open": 7.5}),
        (
            DockingWindow(open_s=40.0, stays=(0.75, 0.5, 0.125)),
            {"dock_open": 40.0, "dock_30": 0.75, "dock_60": 0.5, "dock_150": 0.125},
        ),
    ],
)
def test_the_docking_window_is_told_as_far_as_it_is_known(window: DockingWindow | None, told: dict[str, float]) -> None:
    bench = Bench()
    bench.say(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    heard = bench.hear(OperatorReport(phase=Phase.HOLD, docking=window))
    values = {m.name: m.value for m in heard if m.get_type() == "NAMED_VALUE_FLOAT"}
    assert {name: value for name, value in values.items() if name.startswith("dock")} == told


@pytest.mark.parametrize(
    ("use", "told"),
    [
        (None, {}),
        (EnergyUse(), {}),
        (EnergyUse(hold_wh=0.5, by="curve"), {"hold_wh": 0.5, "w_measured": 0.0}),
        (
            EnergyUse(hold_wh=2.5, power_w=50.0, mean_w=40.0, hours_left=6.25, by="measured"),
            {"hold_wh": 2.5, "mean_w": 40.0, "hours_left": 6.25, "w_measured": 1.0},
        ),
    ],
)
def test_the_energy_is_told_as_far_as_it_is_known(use: EnergyUse | None, told: dict[str, float]) -> None:
    bench = Bench()
    bench.say(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    heard = bench.hear(OperatorReport(phase=Phase.HOLD, energy=use))
    values = {m.name: m.value for m in heard if m.get_type() == "NAMED_VALUE_FLOAT"}
    assert {name: value for name, value in values.items() if name in ENERGY_FIELDS} == told


def test_frames_are_numbered() -> None:
    bench = Bench()
    bench.say(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    numbers = [frame.data[4] for _ in range(3) for frame in bench.link.data_to_send(bench.t_ns + S)]
    assert numbers == list(range(len(numbers))) and numbers


# --- parameters -------------------------------------------------------------------------------------------------------


def test_a_list_is_paced_and_whole() -> None:
    bench = Bench(NAMES)
    bench.say(dialect.MAVLink_param_request_list_message(1, 0))
    bench.say(dialect.MAVLink_param_request_list_message(1, 191))  # asked again meanwhile: not twice
    ticks = [[m for m in bench.hear() if m.get_type() == "PARAM_VALUE"] for _ in range(6)]
    assert [len(tick) for tick in ticks] == [5, 5, 2, 0, 0, 0]
    told = [m for tick in ticks for m in tick]
    assert [(m.param_id, m.param_index, m.param_count) for m in told] == [(n, i, 12) for i, n in enumerate(NAMES)]


def test_reading_by_name_and_by_index() -> None:
    bench = Bench(NAMES)
    for name, index in ((b"P_3", -1), (b"", 7), (b"P_99", -1), (b"", 99), (b"", -2)):
        bench.say(dialect.MAVLink_param_request_read_message(1, 191, name, index))
    assert [m.param_id for m in bench.hear() if m.get_type() == "PARAM_VALUE"] == ["P_3", "P_7"]


def test_setting_is_answered_to_everybody_with_the_value_that_holds() -> None:
    bench = Bench(NAMES)
    (request,) = bench.say(dialect.MAVLink_param_set_message(1, 191, b"P_3", 8.25, 9))
    assert request.command == ParameterChange(t_ns=bench.t_ns, name="P_3", value=8.25)
    refusal = explain(Reason.PARAMETER_OUT_OF_RANGE, name="P_3", range="0 to 1")
    bench.link.answer(bench.t_ns, request, refusal)
    frames = bench.link.data_to_send(bench.t_ns, OperatorReport(), lambda name: 0.25)
    heard = [(frame, messages([frame])[0]) for frame in frames]
    (text,) = (m for _, m in heard if m.get_type() == "STATUSTEXT")
    assert text.text == describe(refusal)
    ((frame, value),) = (pair for pair in heard if pair[1].get_type() == "PARAM_VALUE")
    assert frame.address == EVERYONE and (value.param_id, value.param_value) == ("P_3", 0.25)
    assert bench.say(dialect.MAVLink_param_set_message(1, 191, b"NONE", 8.25, 9)) == []
    assert bench.say(dialect.MAVLink_param_set_message(1, 1, b"P_3", 8.25, 9)) == []


# --- texts ------------------------------------------------------------------------------------------------------------


@given(st.text(alphabet=st.characters(min_codepoint=32, max_codepoint=126), max_size=400))
def test_texts_of_any_length_arrive_whole(text: str) -> None:
    texts, reader = Texts(), TextReader()
    for _ in range(2):
        told = [reader.receive(m) for m in messages(
            [Frame(t_ns=0, port="operator", data=bytes(m.pack(GCS))) for m in texts.messages(4, text)]
        )]  # fmt: skip
        assert told[-1] == text and told[:-1] == [None] * (len(told) - 1)
        assert len(told) == 1 if len(text) <= 50 else len(told) == len(text) // 50 + 1


def test_a_lost_piece_takes_its_text_with_it_and_no_other() -> None:
    texts, reader = Texts(), TextReader()
    first, second = texts.messages(4, "a" * 120), texts.messages(4, "b" * 120)
    pieces = [first[0], *first[2:], *second]
    heard = [reader.receive(decode(bytes(m.pack(GCS)))) for m in pieces]
    assert [text for text in heard if text] == ["b" * 120]
