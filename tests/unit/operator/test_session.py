"""The daemon as a component: gotos in every form, parameters, reports and texts, byte in and byte out."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.config import OperatorLinkConfig, load_config
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect
from asvhil.io.mavlink.texts import TextReader, Texts
from asvhil.operator.reports import OperatorReport
from asvhil.operator.session import OperatorRequest, OperatorSession
from asvhil.operator.setpoint_streams import STREAM_NS
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.types import EVERYONE, Address, Frame, HoldCommand, MoveCommand, ParameterChange, Phase, ReleaseCommand

S = 1_000_000_000
CONFIG = load_config("sitl").links.autopilot
GCS = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
LAT, LON = 404237000, -869212000
ALL = 0b111111111111
POSITION_ONLY = 0b110111111000  # position; not yaw, rates or accelerations


class Bench:
    """An operator's link, its clock, and a ground station's mouth and ears."""

    def __init__(self, parameters: tuple[str, ...] = (), **operator: object) -> None:
        self.link = OperatorSession(CONFIG, OperatorLinkConfig(**operator), parameters)  # type: ignore[arg-type]
        self.t_ns = 0

    def say(self, message, peer: str = "gcs:1", after_ns: int = 100_000_000) -> list[OperatorRequest]:  # type: ignore[no-untyped-def]
        self.t_ns += after_ns
        data = bytes(message.pack(GCS))
        return self.link.receive(Frame(t_ns=self.t_ns, port="operator", data=data, peer=peer))

    def hear(self, situation: OperatorReport = OperatorReport(), values=lambda name: 0.5) -> list:  # type: ignore[no-untyped-def,type-arg]  # noqa: B008
        self.t_ns += 1
        return messages(self.link.data_to_send(self.t_ns, situation, values))

    def answer(self, request: OperatorRequest, refusal: Explanation | None, after_ns: int = 0) -> list:  # type: ignore[type-arg]
        """The acknowledgement and the texts that answer a request."""
        self.t_ns += after_ns
        self.link.answer(self.t_ns, request, refusal)
        return [m for m in self.hear() if m.get_type() in ("COMMAND_ACK", "STATUSTEXT")]


def messages(frames: list[Frame]) -> list:  # type: ignore[type-arg]
    return [decode(data) for frame in frames for data in FrameSplitter().receive(frame.data)]


def acks(heard: list) -> list[tuple[int, int, int]]:  # type: ignore[type-arg]
    return [(m.command, m.result, m.get_srcComponent()) for m in heard if m.get_type() == "COMMAND_ACK"]


def reposition(frame: int = 0, x: int = LAT, y: int = LON, yaw: float = math.nan, to=(1, 191)):  # type: ignore[no-untyped-def]
    return dialect.MAVLink_command_int_message(*to, frame, 192, 0, 0, -1, 0, 0, yaw, x, y, 0)


def setpoint(mask: int = POSITION_ONLY, frame: int = 6, x: int = LAT, y: int = LON, to=(1, 191), **fields: float):  # type: ignore[no-untyped-def]
    values = {
        "vx": 0.0,
        "vy": 0.0,
        "vz": 0.0,
        "afx": 0.0,
        "afy": 0.0,
        "afz": 0.0,
        "yaw": 0.0,
        "yaw_rate": 0.0,
        **fields,
    }
    return dialect.MAVLink_set_position_target_global_int_message(0, *to, frame, mask, x, y, 0.0, *values.values())


def loiter_long(lat: float, lon: float, yaw_deg: float = math.nan):  # type: ignore[no-untyped-def]
    return dialect.MAVLink_command_long_message(1, 191, 17, 0, 0, 0, 0, yaw_deg, lat, lon, 0)


# --- gotos ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("frame", [0, 3, 5, 6, 10, 11])
def test_positions_in_any_global_frame(frame: int) -> None:
    bench = Bench()
    for message in (reposition(frame), setpoint(frame=frame)):
        (request,) = bench.say(message, after_ns=2 * STREAM_NS)
        command = request.command
        assert isinstance(command, HoldCommand)
        assert (command.lat_deg, command.lon_deg, command.psi_rad) == (LAT * 1e-7, LON * 1e-7, None)


@pytest.mark.parametrize("frame", [1, 2, 4, 7, 8, 9, 12, 20])
def test_local_and_unknown_frames_are_refused(frame: int) -> None:
    bench = Bench()
    assert bench.say(reposition(frame)) == [] and bench.say(setpoint(frame=frame)) == []
    heard = bench.hear()
    assert acks(heard) == [(192, dialect.MAV_RESULT_DENIED, 191)]
    why = describe(explain(Reason.FRAME_NOT_GLOBAL, frame=frame))
    assert [m.text for m in heard if m.get_type() == "STATUSTEXT"] == 2 * [why]


def test_headings_are_radians_or_degrees_as_the_protocol_has_them() -> None:
    bench = Bench()
    (request,) = bench.say(reposition(yaw=1.25))
    assert request.command.psi_rad == 1.25  # type: ignore[union-attr]
    assert bench.say(reposition(yaw=90.0)) == []
    assert acks(bench.hear()) == [(192, dialect.MAV_RESULT_DENIED, 191)]
    (request,) = bench.say(loiter_long(40.5, -86.5, yaw_deg=90.0))
    assert request.command.psi_rad == pytest.approx(math.pi / 2)  # type: ignore[union-attr]


def test_loiter_here_and_there() -> None:
    bench = Bench()
    int_here = dialect.MAVLink_command_int_message(1, 191, 0, 17, 0, 0, 0, 0, 0, math.nan, 0, 0, 0)
    for message in (loiter_long(0.0, 0.0), loiter_long(math.nan, math.nan), int_here):
        (request,) = bench.say(message)
        assert request.command == HoldCommand(t_ns=bench.t_ns)
    (request,) = bench.say(loiter_long(40.5, -86.25))
    assert (request.command.lat_deg, request.command.lon_deg) == (40.5, -86.25)  # type: ignore[union-attr]
    assert bench.say(loiter_long(40.5, math.nan)) == [] and bench.say(loiter_long(91.0, 0.0)) == []
    assert [result for _, result, _ in acks(bench.hear())] == 2 * [dialect.MAV_RESULT_DENIED]


def test_guided_enable_holds_here_and_releases() -> None:
    bench = Bench()
    on, off = (dialect.MAVLink_command_long_message(1, 191, 92, 0, flag, 0, 0, 0, 0, 0, 0) for flag in (1, 0))
    assert bench.say(on)[0].command == HoldCommand(t_ns=bench.t_ns)
    assert isinstance(bench.say(off)[0].command, ReleaseCommand)


@pytest.mark.parametrize(
    ("mask", "fields", "meant"),
    [
        (POSITION_ONLY, {"yaw": 1.0, "vx": 3.0, "yaw_rate": 1.0}, None),  # masked fields are not looked at
        (POSITION_ONLY & ~1024, {"yaw": 1.0}, 1.0),
        (POSITION_ONLY & ~1024, {"yaw": math.nan}, None),
        (POSITION_ONLY & ~24, {}, None),  # a velocity of zero is what a station has
    ],
)
def test_the_type_mask_tells_what_is_meant(mask: int, fields: dict[str, float], meant: float | None) -> None:
    (request,) = Bench().say(setpoint(mask, **fields))
    assert isinstance(request.command, HoldCommand) and request.command.psi_rad == meant


@pytest.mark.parametrize(
    ("mask", "fields"),
    [
        (ALL, {}),
        (POSITION_ONLY | 1, {}),
        (POSITION_ONLY & ~8, {"vx": 0.5}),
        (POSITION_ONLY & ~128, {"afy": -0.5}),
        (POSITION_ONLY & ~2048, {"yaw_rate": 0.1}),
        (POSITION_ONLY & ~1024, {"yaw": 90.0}),
        (POSITION_ONLY & ~1024, {"yaw": math.inf}),
    ],
)
def test_set_points_that_are_no_station_are_refused_once_in_a_while(mask: int, fields: dict[str, float]) -> None:
    bench = Bench()
    for _ in range(20):
        assert bench.say(setpoint(mask, **fields)) == []
    texts = [m for m in bench.hear() if m.get_type() == "STATUSTEXT" and m.chunk_seq == 0]
    assert len(texts) == 1


def test_only_the_first_of_a_stream_takes_a_station() -> None:
    bench = Bench()
    commands = [bench.say(setpoint(x=LAT + step))[0].command for step in range(5)]
    assert [type(command) for command in commands] == [HoldCommand, *[MoveCommand] * 4]
    assert isinstance(bench.say(setpoint(), peer="gcs:2")[0].command, HoldCommand)
    assert isinstance(bench.say(setpoint(), after_ns=STREAM_NS - S)[0].command, MoveCommand)
    assert isinstance(bench.say(setpoint(), after_ns=STREAM_NS + 1)[0].command, HoldCommand)


def test_set_points_are_not_acknowledged() -> None:
    bench = Bench()
    (request,) = bench.say(setpoint())
    assert bench.answer(request, None) == []
    refusal = explain(Reason.NOT_ARMED)
    (text,) = bench.answer(request, refusal)
    assert text.text == describe(refusal)
    assert bench.answer(request, refusal, after_ns=S) == []
    assert len(bench.answer(request, refusal, after_ns=5 * S)) == 1


# --- who is meant --------------------------------------------------------------------------------------------------


def test_gotos_to_the_autopilot_are_claimed_only_where_that_is_asked_for() -> None:
    for to in ((1, 1), (1, 0)):
        assert Bench().say(reposition(to=to)) == [] and Bench().say(setpoint(to=to)) == []
        bench = Bench(claim_goto=True)
        (request,) = bench.say(reposition(to=to))
        (ack,) = bench.answer(request, None)
        assert (ack.get_srcSystem(), ack.get_srcComponent(), ack.result) == (1, 1, 0)
        assert len(bench.say(setpoint(to=to))) == 1
    bench = Bench(claim_goto=True)
    arm = dialect.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    assert bench.say(arm) == [] and bench.say(reposition(to=(2, 1))) == [] and acks(bench.hear()) == []


def test_what_is_for_all_components_is_answered_only_where_we_do_it() -> None:
    bench = Bench()
    for message in (
        dialect.MAVLink_command_long_message(1, 0, 400, 0, 1, 0, 0, 0, 0, 0, 0),
        dialect.MAVLink_command_long_message(1, 0, 512, 0, 33, 0, 0, 0, 0, 0, 0),
        reposition(frame=1, to=(1, 0)),
    ):
        assert bench.say(message) == []
    assert acks(bench.hear()) == []
    bench.say(dialect.MAVLink_command_long_message(1, 0, 512, 0, 148, 0, 0, 0, 0, 0, 0))
    assert acks(bench.hear()) == [(512, 0, 191)]


def test_answers_go_back_by_the_link_and_to_the_peer_that_asked() -> None:
    link = OperatorSession(CONFIG, OperatorLinkConfig(), NAMES)
    askers = [Address("", "gcs:1"), Address("ground.qgc", "gcs:1"), Address("ground.radio", "")]
    asked = (
        reposition(),
        dialect.MAVLink_command_long_message(1, 191, 512, 0, 148, 0, 0, 0, 0, 0, 0),
        dialect.MAVLink_param_request_read_message(1, 191, b"P_3", -1),
        dialect.MAVLink_timesync_message(0, 42),
    )
    for via, peer in askers:
        for message in asked:
            data = bytes(message.pack(GCS))
            for request in link.receive(Frame(t_ns=S, port="operator", data=data, peer=peer, via=via)):
                link.answer(S, request, None)
    frames = link.data_to_send(S)
    for name, count in (("COMMAND_ACK", 2), ("AUTOPILOT_VERSION", 1), ("PARAM_VALUE", 1), ("TIMESYNC", 1)):
        sent_to = [frame.address for frame in frames if messages([frame])[0].get_type() == name]
        assert sorted(sent_to) == sorted(askers * count), name


def test_what_another_link_brings_in_pieces_is_no_stream_of_ours() -> None:
    """Frames that come by another link are whole; half of one is dropped, and joined with nobody's next bytes."""
    link = OperatorSession(CONFIG)
    data = bytes(reposition().pack(GCS))
    for part, via in ((data[:20], "ground.radio"), (data[20:], "ground.radio"), (data[20:], "")):
        assert link.receive(Frame(t_ns=S, port="operator", data=part, via=via)) == []
    assert len(link.receive(Frame(t_ns=S, port="operator", data=data, via="ground.radio"))) == 1


# --- messages ------------------------------------------------------------------------------------------------------


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


def test_frames_are_numbered() -> None:
    bench = Bench()
    bench.say(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    numbers = [frame.data[4] for _ in range(3) for frame in bench.link.data_to_send(bench.t_ns + S)]
    assert numbers == list(range(len(numbers))) and numbers


# --- parameters ----------------------------------------------------------------------------------------------------

NAMES = tuple(f"P_{number}" for number in range(12))


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


# --- texts ---------------------------------------------------------------------------------------------------------


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


# --- anything at all -----------------------------------------------------------------------------------------------

FLOATS = st.floats(width=32) | st.sampled_from([-1.0, 0.0, 1.0, 30.0, 87.0, 148.0, 251.0, 1e30, -1e30])
INTS = st.sampled_from([0, 1, -1, LAT, LON, 2**31 - 1, -(2**31), 950000000])
NUMBERS = st.sampled_from([16, 17, 92, 176, 192, 400, 510, 511, 512, 519, 520, 65535])
TARGETS = st.sampled_from([(1, 191), (1, 0), (1, 1), (0, 0), (2, 191)])
SAID = st.one_of(
    st.builds(
        lambda to, number, f: dialect.MAVLink_command_long_message(*to, number, 0, *f),
        TARGETS, NUMBERS, st.tuples(*[FLOATS] * 7),
    ),
    st.builds(
        lambda to, frame, number, f, x, y: dialect.MAVLink_command_int_message(*to, frame, number, 0, 0, *f, x, y, 0.0),
        TARGETS, st.integers(0, 255), NUMBERS, st.tuples(*[FLOATS] * 4), INTS, INTS,
    ),
    st.builds(
        lambda to, frame, mask, x, y, f: dialect.MAVLink_set_position_target_global_int_message(
            0, *to, frame, mask, x, y, *f
        ),
        TARGETS, st.integers(0, 255), st.integers(0, 65535), INTS, INTS, st.tuples(*[FLOATS] * 9),
    ),
    st.builds(
        lambda to, name, value, kind: dialect.MAVLink_param_set_message(*to, name, value, kind),
        TARGETS, st.sampled_from([b"P_3", b"ST_LAT", b"", b"\xff\xfe", b"x" * 16]), FLOATS, st.integers(0, 255),
    ),
    st.builds(
        lambda to, name, index: dialect.MAVLink_param_request_read_message(*to, name, index),
        TARGETS, st.sampled_from([b"P_3", b"\xff\xfe"]), st.integers(-32768, 32767),
    ),
)  # fmt: skip


@given(
    st.lists(
        st.tuples(
            SAID,
            st.sampled_from([None, explain(Reason.NOT_ARMED), explain(Reason.AUTOPILOT_PARAMETER, finding="a" * 70)]),
        ),
        max_size=12,
    ),
    st.booleans(),
)
def test_nothing_that_is_asked_raises(said: list, claim: bool) -> None:  # type: ignore[type-arg]
    bench = Bench(NAMES, claim_goto=claim)
    for message, refusal in said:
        for request in bench.say(message):
            bench.link.answer(bench.t_ns, request, refusal)
        bench.t_ns += S
        bench.hear(
            OperatorReport(phase=Phase.HOLD, distance_m=math.inf, station=(40.0, -86.0, 1.0)), lambda name: math.inf
        )
