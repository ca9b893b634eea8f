"""The PX4 profile: modes, readiness, outputs and the sign of life, message by message."""

import pytest

from asvhil.autopilot.px4 import Px4Autopilot
from asvhil.config import AutopilotLinkConfig, PwmConfig
from asvhil.config.autopilots import PX4_MODES, px4_custom_mode
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect
from asvhil.types import Frame, FrontseatStatus, GroundVelocity, Heading, Measurement, Position, YawRate

MS, S = 1_000_000, 1_000_000_000
CONFIG = AutopilotLinkConfig(endpoint="udpin:127.0.0.1:0", profile="px4", streams_hz={"ATTITUDE": 20.0})
PX4 = dialect.MAVLink(None, srcSystem=1, srcComponent=1)


def link() -> Px4Autopilot:
    return Px4Autopilot(CONFIG, PwmConfig())


def feed(px4: Px4Autopilot, *messages: object, t_ns: int = 5) -> list[Measurement]:
    data = b"".join(bytes(message.pack(PX4)) for message in messages)  # type: ignore[attr-defined]
    return [measurement for _, measurement in px4.receive(Frame(t_ns=t_ns, port="autopilot", data=data))]


def sent(frames: list[Frame], name: str) -> list[object]:
    found = [decode(data) for frame in frames for data in FrameSplitter().receive(frame.data)]
    return [m for m in found if m.get_type() == name]  # type: ignore[union-attr]


def heartbeat(mode: int, armed: bool = False, autopilot: int = 12) -> object:
    return dialect.MAVLink_heartbeat_message(11, autopilot, 1 | 128 * armed, mode, 4, 3)


def estimator(flags: int) -> object:
    return dialect.MAVLink_estimator_status_message(0, flags, 0, 0, 0, 0, 0, 0, 0, 0)


POSITION = dialect.MAVLink_global_position_int_message(1000, 404237000, -869212000, 0, 0, 12, -34, 0, 9000)


@pytest.mark.parametrize(
    ("custom_mode", "name"),
    [
        (0x00010000, "MANUAL"),
        (0x00060000, "OFFBOARD"),
        (0x03040000, "AUTO.LOITER"),
        (0x04040000, "AUTO.MISSION"),
        (0x00030000, "POSCTL"),
        (0x7F040000, f"MODE_{0x7F040000}"),
    ],
)
def test_modes_are_packed_in_the_upper_half(custom_mode: int, name: str) -> None:
    (status,) = feed(link(), heartbeat(custom_mode, armed=True))
    assert isinstance(status, FrontseatStatus) and (status.mode, status.armed) == (name, True)


def test_a_mode_is_asked_for_by_its_two_numbers_and_an_unknown_one_not_at_all() -> None:
    px4 = link()
    (m,) = sent(px4.request_mode(0, "AUTO.LOITER"), "COMMAND_LONG")
    assert (m.command, m.param1, m.param2, m.param3) == (176, 1.0, 4.0, 3.0)  # type: ignore[attr-defined]
    assert px4.request_mode(2 * S, "GUIDED") == []
    assert PX4_MODES["AUTO.LOITER"] == px4_custom_mode(4, 3) == 0x03040000
    (m,) = sent(px4.request_arming(0), "COMMAND_LONG")
    assert (m.command, m.param1, m.param2) == (400, 1.0, 0.0)  # type: ignore[attr-defined]


def test_positions_and_attitudes_count_once_the_estimator_has_a_position() -> None:
    px4 = link()
    attitude = dialect.MAVLink_attitude_message(1, 0, 0, -2.5, 0, 0, 0.125)
    assert feed(px4, POSITION, attitude) == []
    # Seen on PX4 1.15 and 1.16: armed; disarmed; at rest in 1.16, which says constant position mode as well.
    for flags in (831, 895, 959):
        status, *found = feed(px4, estimator(flags), POSITION, attitude)
        assert isinstance(status, FrontseatStatus) and status.ready
        assert [type(m) for m in found] == [Position, GroundVelocity, Heading, YawRate]
    for flags in (229, 165, 1):  # GNSS dropped: disarmed; armed; only an attitude, which stays aligned
        status, *found = feed(px4, estimator(flags), POSITION, attitude)
        assert isinstance(status, FrontseatStatus) and not status.ready
        assert [type(m) for m in found] == [Heading, YawRate]
    assert len(feed(px4, estimator(0), POSITION, attitude)) == 1


def test_outputs_are_pulses_in_microseconds_and_nothing_else() -> None:
    px4 = link()
    told = [1600.4, 0.0, 1400.0, 1.0, -1.0, 8191.0, 1e9, float("nan"), *[0.0] * 24]
    (status,) = feed(px4, dialect.MAVLink_actuator_output_status_message(0, 8, told))
    assert isinstance(status, FrontseatStatus)
    assert status.outputs_us[:8] == (1600, 0, 1400, 0, 0, 0, 0, 0)
    (status,) = feed(px4, dialect.MAVLink_servo_output_raw_message(0, 0, *range(1501, 1509)))
    assert isinstance(status, FrontseatStatus) and status.outputs_us[2] == 1503


def test_the_sign_of_life_comes_ten_times_a_second_once_px4_is_heard() -> None:
    px4 = link()
    assert sent([f for ms in range(0, 500, 50) for f in px4.data_to_send(ms * MS)], "SET_ATTITUDE_TARGET") == []
    feed(px4, heartbeat(0x00010000))
    signs = sent([f for ms in range(500, 1500, 50) for f in px4.data_to_send(ms * MS)], "SET_ATTITUDE_TARGET")
    assert len(signs) == 10
    first = signs[0]
    # Rates are given, all zero, with no thrust; the attitude is not.
    assert (first.type_mask, first.thrust) == (128, 0.0)  # type: ignore[attr-defined]
    assert (first.body_roll_rate, first.body_pitch_rate, first.body_yaw_rate) == (0.0, 0.0, 0.0)  # type: ignore[attr-defined]


def test_where_another_mode_is_the_control_mode_offboard_is_left_to_others() -> None:
    px4 = Px4Autopilot(CONFIG, PwmConfig(), keeps_offboard=False)
    feed(px4, heartbeat(0x00010000))
    assert sent([f for ms in range(0, 2000, 50) for f in px4.data_to_send(ms * MS)], "SET_ATTITUDE_TARGET") == []


def test_neutral_is_said_when_px4_is_first_heard_and_when_it_has_started_anew() -> None:
    px4 = link()
    feed(px4, heartbeat(0x00010000))
    assert len(sent(px4.data_to_send(MS), "COMMAND_LONG")) == 2  # a stream, and both motors neutral
    px4.drive(MS, 1600, 1600)
    assert sent(px4.data_to_send(4 * S), "SET_ATTITUDE_TARGET") and not _actuators(px4.data_to_send(5 * S))
    feed(px4, dialect.MAVLink_system_time_message(0, 90_000), dialect.MAVLink_system_time_message(0, 500), t_ns=6 * S)
    (m,) = _actuators(px4.data_to_send(6 * S))
    assert (m.param1, m.param2) == (0.0, 0.0) and px4.reboots == 1  # type: ignore[attr-defined]


def test_neutral_is_said_again_after_a_silence_and_while_disarmed() -> None:
    """PX4 keeps the last command through disarming, and starts the motors with it at the next arming."""
    px4 = link()
    feed(px4, heartbeat(0x00060000, armed=True), t_ns=0)
    px4.drive(MS, 1900, 1900)
    assert _neutral_times(px4, 0, 6) == []
    feed(px4, heartbeat(0x00060000, armed=True), t_ns=6 * S)  # who knows what happened meanwhile
    assert _neutral_times(px4, 6, 8) == [6000 + 100 * k for k in range(20)]
    feed(px4, heartbeat(0x00060000, armed=True), t_ns=8 * S)
    assert _neutral_times(px4, 8, 10) == [8000 + 100 * k for k in range(11)]
    for second in range(10, 14):
        feed(px4, heartbeat(0x00060000), t_ns=second * S)
        assert _neutral_times(px4, second, second + 1) == [1000 * second]


def _neutral_times(px4: Px4Autopilot, from_s: int, until_s: int) -> list[int]:
    """When (ms) both motors were commanded to neutral; no other command is."""
    times_ms = []
    for ms in range(1000 * from_s, 1000 * until_s, 50):
        for m in _actuators(px4.data_to_send(ms * MS)):
            assert (m.param1, m.param2) == (0.0, 0.0)  # type: ignore[attr-defined]
            times_ms.append(ms)
    return times_ms


def _actuators(frames: list[Frame]) -> list[object]:
    return [m for m in sent(frames, "COMMAND_LONG") if m.command == 187]  # type: ignore[attr-defined]


def test_another_make_of_autopilot_is_named() -> None:
    px4 = link()
    feed(px4, heartbeat(0, autopilot=3))
    assert px4.notes[0].text == "is ardurover, but links.autopilot.profile is px4"
    feed(px4, heartbeat(0x00010000))
    assert [note.subject for note in px4.notes] == ["motor output"]
