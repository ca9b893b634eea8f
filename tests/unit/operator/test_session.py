"""The daemon as a component: gotos in every form, parameters, reports and texts, byte in and byte out."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.config import OperatorLinkConfig
from asvhil.io.mavlink.frames import dialect
from asvhil.operator.reports import OperatorReport
from asvhil.operator.session import OperatorSession
from asvhil.operator.setpoint_streams import STREAM_NS
from asvhil.supervisor.reasons import Reason, describe, explain
from asvhil.types import Address, Frame, HoldCommand, LeaderMessage, MoveCommand, Phase, ReleaseCommand
from tests.support.operator_bench import (
    ALL,
    CONFIG,
    GCS,
    LAT,
    LON,
    NAMES,
    POSITION_ONLY,
    Bench,
    S,
    acks,
    loiter_long,
    messages,
    reposition,
    setpoint,
)

# --- gotos ------------------------------------------------------------------------------------------------------------


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
        (POSITION_ONLY & ~8, {"vx": 0.5}),  # half of a velocity
        (POSITION_ONLY & ~24, {"vx": 0.5, "vy": math.nan}),
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


def test_a_velocity_that_is_meant_is_that_of_the_station() -> None:
    bench = Bench()
    with_velocity = POSITION_ONLY & ~24
    commands = [bench.say(setpoint(with_velocity, vx=0.25, vy=-0.5))[0].command for _ in range(2)]
    assert [type(command) for command in commands] == [HoldCommand, MoveCommand]
    assert [getattr(command, "velocity_mps", None) for command in commands] == 2 * [(0.25, -0.5)]
    (request,) = bench.say(setpoint(with_velocity, vx=0.0, vy=0.0))
    assert getattr(request.command, "velocity_mps", "none") is None


def leader(  # type: ignore[no-untyped-def]
    capabilities: int = 3, lat: int = LAT, vel: tuple[float, float] = (0.3, -0.1), told_ms: int = 0
):
    rest = [[*vel, 0.0], [0.0] * 3, [1.0, 0.0, 0.0, 0.0], [0.0] * 3, [0.0] * 3, 0]
    return dialect.MAVLink_follow_target_message(told_ms, capabilities, lat, LON, 0.0, *rest)


def test_a_vehicle_tells_where_it_is_to_follow() -> None:
    bench = Bench()
    (request,) = bench.say(leader())
    command = request.command
    assert isinstance(command, LeaderMessage) and request.mav_cmd is None
    assert (command.system_id, command.lat_deg, command.lon_deg) == (255, LAT * 1e-7, LON * 1e-7)
    assert command.velocity_mps == pytest.approx((0.3, -0.1))
    for odd in (leader(1), leader(vel=(math.nan, 0.0))):
        (request,) = bench.say(odd)
        assert getattr(request.command, "velocity_mps", None) == (0.0, 0.0)
    for nowhere in (leader(2), leader(lat=1_000_000_000)):
        assert bench.say(nowhere) == []
    assert not [m for m in bench.hear() if m.get_type() in ("COMMAND_ACK", "STATUSTEXT")]


def test_a_report_of_a_leader_that_comes_after_a_newer_one_is_dropped_and_counted() -> None:
    bench = Bench()
    late_ms = (100_000, 90_000, 101_000, 100_999, 101_000, 0)  # 0: no time is told
    assert [len(bench.say(leader(told_ms=ms))) for ms in late_ms] == [1, 0, 1, 0, 0, 1]
    assert dict(bench.link.counters())["operator.late_leaders"] == 3
    assert len(bench.say(leader(told_ms=200_000))) == 1
    assert [len(bench.say(leader(told_ms=ms))) for ms in (5_000, 6_000)] == [1, 1], "it has started anew"
    assert dict(bench.link.counters())["operator.late_leaders"] == 3
    assert "operator.late_leaders" not in dict(Bench().link.counters())


@pytest.mark.parametrize("back_ms", [1_500, 30_000, 39_500])
def test_a_leader_whose_clock_has_gone_back_is_heard_again_before_it_seems_silent(back_ms: int) -> None:
    bench = Bench()
    for second in range(40):
        assert len(bench.say(leader(told_ms=1_000 * second + 500), after_ns=S)) == 1
    told_ms = [1_000 * second + 500 - back_ms for second in range(40, 50)]
    assert [len(bench.say(leader(told_ms=ms), after_ns=S)) for ms in told_ms][2:] == 8 * [1]


@pytest.mark.parametrize("delay_s", [0.3, 0.7, 1.3, 1.9])
def test_copies_over_a_slower_radio_are_dropped_for_as_long_as_both_are_heard(delay_s: float) -> None:
    bench = Bench()
    heard = sorted([(float(k), 0, k) for k in range(20)] + [(k + delay_s, 1, k) for k in range(20)])
    before_s = 0.0
    for at_s, radio, k in heard:
        report = leader(lat=LAT + 30 * k, told_ms=100_000 + 1_000 * k)
        assert len(bench.say(report, after_ns=round((at_s - before_s) * S))) == (radio == 0)
        before_s = at_s


def test_a_leader_whose_clock_stands_still_is_heard() -> None:
    bench = Bench()
    for step in range(5):
        assert len(bench.say(leader(lat=LAT + step, told_ms=7_000), after_ns=S)) == 1, "it is elsewhere, so no copy"
    heard = [len(bench.say(leader(lat=LAT + 4, told_ms=7_000), after_ns=S)) for _ in range(6)]
    assert heard == 3 * [0, 1], "at rest it does not seem silent"


def test_only_the_first_of_a_stream_takes_a_station() -> None:
    bench = Bench()
    commands = [bench.say(setpoint(x=LAT + step))[0].command for step in range(5)]
    assert [type(command) for command in commands] == [HoldCommand, *[MoveCommand] * 4]
    assert isinstance(bench.say(setpoint(), peer="gcs:2")[0].command, HoldCommand)
    assert isinstance(bench.say(setpoint(), after_ns=STREAM_NS - S)[0].command, MoveCommand)
    again = bench.say(setpoint(), after_ns=STREAM_NS + 1)[0].command
    assert isinstance(again, HoldCommand) and again.by_setpoint, "which may be no more than a gap in the link"


def test_set_points_are_not_acknowledged() -> None:
    bench = Bench()
    (request,) = bench.say(setpoint())
    assert bench.answer(request, None) == []
    refusal = explain(Reason.NOT_ARMED)
    (text,) = bench.answer(request, refusal)
    assert text.text == describe(refusal)
    assert bench.answer(request, refusal, after_ns=S) == []
    assert len(bench.answer(request, refusal, after_ns=5 * S)) == 1


# --- who is meant -----------------------------------------------------------------------------------------------------


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


# --- anything at all --------------------------------------------------------------------------------------------------


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
