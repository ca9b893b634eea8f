"""The autopilot and operator conversations, byte for byte."""

from typing import Any

import pytest

from asvhil.autopilot.ardurover import ArduRoverAutopilot
from asvhil.config import AutopilotLinkConfig, PwmConfig
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect
from asvhil.io.mavlink.streams import StreamRequester
from asvhil.operator.encoding import encode_hold, encode_release
from asvhil.operator.session import OperatorSession
from asvhil.supervisor.reasons import Reason, describe, explain
from asvhil.types import (
    Frame,
    FrontseatStatus,
    GroundVelocity,
    Heading,
    HoldCommand,
    Measurement,
    Position,
    ReleaseCommand,
    SpecificForce,
    YawRate,
)

MS, S = 1_000_000, 1_000_000_000
CONFIG = AutopilotLinkConfig(
    endpoint="udpin:127.0.0.1:0", battery_hz=0.0, streams_hz={"ATTITUDE": 20.0, "GLOBAL_POSITION_INT": 10.0}
)
AUTOPILOT = dialect.MAVLink(None, srcSystem=1, srcComponent=1)


def link(**changes: object) -> ArduRoverAutopilot:
    return ArduRoverAutopilot(CONFIG.model_copy(update=changes), PwmConfig())


def feed(ardurover: ArduRoverAutopilot, *messages: object, t_ns: int = 5, mav: object = AUTOPILOT) -> list[Measurement]:
    data = b"".join(bytes(message.pack(mav)) for message in messages)  # type: ignore[attr-defined]
    return [measurement for _, measurement in ardurover.receive(Frame(t_ns=t_ns, port="autopilot", data=data))]


def messages(frames: list[Frame]) -> list[object]:
    splitter = FrameSplitter()
    return [decode(data) for frame in frames for data in splitter.receive(frame.data)]


def heartbeat(armed: bool = False, mode: int = 0, autopilot: int = 3) -> object:
    return dialect.MAVLink_heartbeat_message(11, autopilot, 65 | 128 * armed, mode, 4, 3)


READY = dialect.MAVLink_ekf_status_report_message(831, 0, 0, 0, 0, 0)
NOT_READY = dialect.MAVLink_ekf_status_report_message(167, 0, 0, 0, 0, 0)
POSITION = dialect.MAVLink_global_position_int_message(1000, 404237000, -869212000, 0, 0, 12, -34, 0, 9000)


def test_status_comes_from_the_autopilots_heartbeat_alone() -> None:
    ardurover = link()
    (status,) = feed(ardurover, heartbeat(armed=True, mode=4))
    assert isinstance(status, FrontseatStatus) and status.armed and status.mode == "HOLD" and not status.ready
    assert feed(ardurover, heartbeat(autopilot=8)) == []  # another component of the same vehicle
    stranger = dialect.MAVLink(None, srcSystem=2, srcComponent=1)
    assert feed(ardurover, heartbeat(armed=False), mav=stranger) == []
    (status,) = feed(ardurover, heartbeat(mode=99))
    assert isinstance(status, FrontseatStatus) and status.mode == "MODE_99"


def test_position_counts_once_the_autopilots_own_filter_is_ready() -> None:
    ardurover = link()
    assert feed(ardurover, POSITION) == []
    assert feed(ardurover, NOT_READY, POSITION)[1:] == []
    status, place, velocity = feed(ardurover, READY, POSITION)
    assert isinstance(status, FrontseatStatus) and status.ready
    assert place == Position(t_ns=5, lat_deg=40.4237, lon_deg=-86.9212, h_acc_m=0.0)
    assert velocity == GroundVelocity(t_ns=5, vn_mps=0.12, ve_mps=-0.34, fused=True)


def test_a_raw_fix_counts_only_once() -> None:
    ardurover = link()
    raw = dialect.MAVLink_gps_raw_int_message(77, 6, 10, 20, 0, 121, 200, 100, 9000, 10, 0, 300)
    feed(ardurover, READY)
    place, velocity = feed(ardurover, raw)
    assert isinstance(place, Position) and place.h_acc_m == 0.3
    assert isinstance(velocity, GroundVelocity) and (velocity.vn_mps, velocity.ve_mps) == pytest.approx((0.0, 1.0))
    assert feed(ardurover, raw) == []
    no_fix = dialect.MAVLink_gps_raw_int_message(78, 1, 10, 20, 0, 121, 200, 100, 9000, 10, 0, 300)
    assert feed(ardurover, no_fix) == []
    no_velocity = dialect.MAVLink_gps_raw_int_message(79, 3, 10, 20, 0, 121, 200, 65535, 65535, 10, 0, 300)
    (place,) = feed(ardurover, no_velocity)
    assert isinstance(place, Position)


def test_attitude_and_imu_units() -> None:
    ardurover = link()
    feed(ardurover, READY)
    found = feed(ardurover, dialect.MAVLink_attitude_message(1, 0, 0, -2.5, 0, 0, 0.125))
    assert found == [Heading(t_ns=5, psi_rad=-2.5), YawRate(t_ns=5, r_radps=0.125)]
    found = feed(ardurover, dialect.MAVLink_raw_imu_message(1, 1000, -500, 0, 0, 0, 250, 0, 0, 0))
    assert found == [YawRate(t_ns=5, r_radps=0.25), SpecificForce(t_ns=5, ax_mps2=9.80665, ay_mps2=-4.903325)]


def test_heartbeat_each_second_as_an_onboard_controller() -> None:
    ardurover = link()
    sent = [message for ms in range(0, 3000, 50) for message in messages(ardurover.data_to_send(ms * MS))]
    assert len(sent) == 3  # and nothing else while no autopilot is heard
    first = sent[0]
    assert (first.type, first.autopilot, first.get_srcSystem(), first.get_srcComponent()) == (18, 8, 1, 191)  # type: ignore[attr-defined]


def test_streams_are_asked_one_by_one_until_acknowledged() -> None:
    ardurover = link()
    feed(ardurover, heartbeat())

    def asked(ms: int) -> list[tuple[float, float]]:
        found = messages(ardurover.data_to_send(ms * MS))
        return [(m.param1, m.param2) for m in found if m.get_type() == "COMMAND_LONG"]  # type: ignore[attr-defined]

    assert asked(0) == [(30.0, 50_000.0)]
    assert asked(100) == []
    assert asked(600) == [(30.0, 50_000.0)]  # no answer: again
    others = []
    for ms in range(650, 1650, 50):
        feed(ardurover, dialect.MAVLink_command_ack_message(511, 0))
        others += asked(ms)
    assert (33.0, 100_000.0) in others and (193.0, 500_000.0) in others  # and those that the profile adds
    assert len(others) == len(CONFIG.streams_hz) - 1
    feed(ardurover, dialect.MAVLink_system_time_message(0, 90_000), dialect.MAVLink_system_time_message(0, 500))
    assert asked(1650) == [(30.0, 50_000.0)]  # its boot clock ran back: it has forgotten


def test_a_stream_that_dries_up_is_asked_for_again_and_a_denied_one_is_named() -> None:
    requester = StreamRequester({"ATTITUDE": 10.0, "SIM_STATE": 10.0}, 1)

    def asked(t_ns: int) -> list[tuple[float, float]]:
        return [(m.param1, m.param2) for m in requester.data_to_send(t_ns)]

    def receive(message: Any) -> None:
        requester.receive(message.get_msgId(), bytes(message.pack(AUTOPILOT)))

    assert asked(0) == [(30, 100_000.0)]
    receive(dialect.MAVLink_command_ack_message(511, 0))
    assert asked(0) == [(108, 100_000.0)]
    receive(dialect.MAVLink_command_ack_message(400, 2))  # of another command
    assert requester.denied == set()
    receive(dialect.MAVLink_command_ack_message(511, 2))
    assert requester.denied == {"SIM_STATE"}
    t_ns, again = 0, []
    while t_ns < 12 * S:
        t_ns += 100 * MS
        receive(dialect.MAVLink_attitude_message(0, 0, 0, 0, 0, 0, 0))
        for msg_id, _ in asked(t_ns):
            again.append(msg_id)
            receive(dialect.MAVLink_command_ack_message(511, 2))
    assert again == [108]


def test_acknowledgements_to_others_are_not_ours() -> None:
    ardurover = link(output="set_servo")
    feed(ardurover, heartbeat())
    refused = dialect.MAV_RESULT_DENIED
    for to, counts in (((255, 190), False), ((1, 100), False), ((1, 191), True), ((0, 0), True)):
        feed(ardurover, dialect.MAVLink_command_ack_message(183, 0, 0, 0, 1, 191))
        feed(ardurover, dialect.MAVLink_command_ack_message(183, refused, 0, 0, *to))
        assert ("motor commands" in {note.subject for note in ardurover.notes}) == counts, to


@pytest.mark.parametrize("answer", ["UNSUPPORTED", "DENIED", None])
def test_where_intervals_cannot_be_set_whole_streams_are_asked_for_as_of_old(answer: str | None) -> None:
    ardurover = link(streams_hz={"ATTITUDE": 20.0, "RC_CHANNELS": 4.5, "SERVO_OUTPUT_RAW": 10.0, "SCALED_IMU": 1.0})
    feed(ardurover, heartbeat())
    asked, seen = [], set()
    for ms in range(0, 12_000, 100):
        for m in messages(ardurover.data_to_send(ms * MS)):
            if m.get_type() == "REQUEST_DATA_STREAM":  # type: ignore[attr-defined]
                asked.append((m.req_stream_id, m.req_message_rate, m.start_stop))  # type: ignore[attr-defined]
            if m.get_type() == "COMMAND_LONG":  # type: ignore[attr-defined]
                seen.add(m.param1)  # type: ignore[attr-defined]
                if answer is not None:
                    result = getattr(dialect, f"MAV_RESULT_{answer}")
                    feed(ardurover, dialect.MAVLink_command_ack_message(511, result))
    assert seen == {30.0, 65.0, 36.0, 26.0}
    # The highest rate wanted of each stream, a stream again for each message that it holds.
    assert set(asked) == {(10, 20, 1), (3, 10, 1), (1, 1, 1)}
    assert 4 <= len(asked) <= 8


def test_the_override_touches_the_two_motor_channels_only() -> None:
    (message,) = messages(link(override_system_id=7).drive(9, 1600, 1400))
    fields = message.to_dict()  # type: ignore[attr-defined]
    assert [fields[f"chan{i}_raw"] for i in range(1, 9)] == [1600, 65535, 1400, 65535, 65535, 65535, 65535, 65535]
    assert (message.get_srcSystem(), message.target_system) == (7, 1)  # type: ignore[attr-defined]
    (message,) = messages(link().release(9))
    assert (message.chan1_raw, message.chan3_raw, message.chan2_raw) == (0, 0, 65535)  # type: ignore[attr-defined]


def test_override_bytes() -> None:
    # Channels 9 to 18 are zero (ignored) and trailing zeros are cut by MAVLink 2: 18 bytes of payload.
    (frame,) = link().drive(9, 1600, 1400)
    data = frame.data
    assert data[:10] == bytes.fromhex("fd12000000 01bf 460000".replace(" ", ""))
    assert data[10:28] == bytes.fromhex("4006ffff7805ffffffffffffffffffff0101")


def test_requests_are_made_once_a_second() -> None:
    ardurover = link()
    assert len(ardurover.request_arming(0)) == 1 and ardurover.request_arming(500 * MS) == []
    (message,) = messages(ardurover.request_mode(0, "MANUAL"))
    assert (message.command, message.param1, message.param2) == (176, 1.0, 0.0)  # type: ignore[attr-defined]
    assert len(ardurover.request_arming(1000 * MS)) == 1


# --- the operator's port ---------------------------------------------------------------------------------


def ask(operator: OperatorSession, data: bytes, peer: str = "127.0.0.1:9") -> list[object]:
    return list(operator.receive(Frame(t_ns=3, port="operator", data=data, peer=peer)))


def test_hold_here_hold_there_and_release() -> None:
    operator = OperatorSession(CONFIG)
    (request,) = ask(operator, encode_hold(CONFIG, None, None, None))
    assert request.command == HoldCommand(t_ns=3)  # type: ignore[attr-defined]
    (request,) = ask(operator, encode_hold(CONFIG, 40.4237, -86.9212, 1.5, 250.0))
    assert isinstance(request.command, HoldCommand) and request.command.within_m == 250.0
    (request,) = ask(operator, encode_hold(CONFIG, 40.4237, -86.9212, 1.5))
    assert isinstance(request.command, HoldCommand) and request.command.within_m == 0.0
    assert request.command == HoldCommand(t_ns=3, lat_deg=404237000 * 1e-7, lon_deg=-869212000 * 1e-7, psi_rad=1.5)  # type: ignore[attr-defined]
    (request,) = ask(operator, encode_release(CONFIG))
    assert isinstance(request.command, ReleaseCommand)  # type: ignore[attr-defined]


def test_answers_go_to_the_asker() -> None:
    operator = OperatorSession(CONFIG)
    (request,) = ask(operator, encode_hold(CONFIG, None, None, None), peer="127.0.0.1:77")
    operator.answer(4, request, None)  # type: ignore[arg-type]
    frame = operator.data_to_send(4)[0]
    (ack,) = messages([frame])
    assert frame.peer == "127.0.0.1:77"
    assert (ack.command, ack.result, ack.target_system) == (192, 0, 255)  # type: ignore[attr-defined]
    refusal = explain(Reason.NOT_ARMED)
    operator.answer(5, request, refusal)  # type: ignore[arg-type]
    text, ack = messages(operator.data_to_send(5))[:2]
    assert (text.text, ack.result) == (describe(refusal), dialect.MAV_RESULT_TEMPORARILY_REJECTED)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("message", "result"),
    [
        (dialect.MAVLink_command_long_message(1, 191, 400, 0, 1, 0, 0, 0, 0, 0, 0), dialect.MAV_RESULT_UNSUPPORTED),
        (dialect.MAVLink_command_long_message(1, 191, 92, 0, 2, 0, 0, 0, 0, 0, 0), dialect.MAV_RESULT_DENIED),
        (
            dialect.MAVLink_command_long_message(1, 191, 192, 0, 0, 0, 0, 0, 0, 0, 0),
            dialect.MAV_RESULT_COMMAND_INT_ONLY,
        ),
        (dialect.MAVLink_command_int_message(1, 191, 0, 192, 0, 0, 0, 0, 0, 0, 0, 0, 0), dialect.MAV_RESULT_DENIED),
        (
            dialect.MAVLink_command_int_message(1, 191, 0, 192, 0, 0, 0, 0, 0, 0, 950000000, 1, 0),
            dialect.MAV_RESULT_DENIED,
        ),
    ],
)
def test_what_is_not_understood_is_refused_in_words_of_the_protocol(message: object, result: int) -> None:
    operator = OperatorSession(CONFIG)
    assert ask(operator, bytes(message.pack(dialect.MAVLink(None, 255, 190)))) == []  # type: ignore[attr-defined]
    acks = [m for m in messages(operator.data_to_send(4)) if m.get_type() == "COMMAND_ACK"]  # type: ignore[attr-defined]
    assert [ack.result for ack in acks] == [result]  # type: ignore[attr-defined]


def test_commands_to_others_are_none_of_our_business() -> None:
    operator = OperatorSession(CONFIG)
    other = dialect.MAVLink_command_long_message(1, 1, 92, 0, 0, 0, 0, 0, 0, 0, 0)
    assert ask(operator, bytes(other.pack(dialect.MAVLink(None, 255, 190)))) == []
    assert "COMMAND_ACK" not in [m.get_type() for m in messages(operator.data_to_send(4))]  # type: ignore[attr-defined]
