"""Ways to the motors, byte for byte: what each says to drive, and how each lets go."""

import json
import math

import pytest

from asvhil.autopilot.ardurover_wiring import wiring_of
from asvhil.autopilot.motor_outputs import Output, make_output
from asvhil.autopilot.px4_wiring import wiring_of as px4_wiring_of
from asvhil.config import AutopilotLinkConfig, PwmConfig, config_from_json, load_config
from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect

MS = 1_000_000
PWM = PwmConfig(astern_us=1100, neutral_us=1480, ahead_us=1900)


def output(kind: str, **changes: object) -> Output:
    profile = "px4" if kind == "set_actuator" else "ardurover"
    link = AutopilotLinkConfig(endpoint="udpin:127.0.0.1:0", profile=profile, output=kind, **changes)
    return make_output(link, PWM, px4_wiring_of(link, PWM, {}) if profile == "px4" else wiring_of(link, PWM, {}))


def acknowledge(way: Output, command: int, result: int) -> None:
    way.receive(dialect.MAVLink_command_ack_message(command, result))


def messages(packed: list[bytes]) -> list[object]:
    return [decode(data) for frame in packed for data in FrameSplitter().receive(frame)]


def said(packed: list[bytes]) -> list[tuple[float, ...]]:
    """What the motors are told, whatever the message: (port, starboard) or (channel, pulse) or six actuators."""
    found = []
    for m in messages(packed):
        match m.get_type():  # type: ignore[attr-defined]
            case "RC_CHANNELS_OVERRIDE":
                found.append((m.chan1_raw, m.chan3_raw))  # type: ignore[attr-defined]
            case "MANUAL_CONTROL":
                found.append((m.y, m.z))  # type: ignore[attr-defined]
            case _:
                found.append((m.command, m.param1, m.param2))  # type: ignore[attr-defined]
    return found


def test_manual_control_bytes() -> None:
    (data,) = output("manual_control", override_system_id=7).drive(1600, 1420)
    # Target 1; x and r are no value; y = 200, z = -160; MAVLink 2, from 7/191; the extension fields are zeros and cut.
    assert data[:10] == bytes.fromhex("fd0b0000000 7bf450000".replace(" ", ""))
    assert data[10:21] == bytes.fromhex("ff7fc80060ffff7f000001")


def test_manual_control_reaches_its_ends_and_releases_by_axes_without_value() -> None:
    way = output("manual_control")
    assert said(way.drive(900, 2100)) == [(-1000, 1000)]
    assert said(way.drive(1500, 1499)) == [(0, -2)]
    assert said(way.release(0)) == [(32767, 32767)]


def test_servo_commands_name_both_channels() -> None:
    way = output("set_servo")
    assert said(way.drive(1600, 1420)) == [(183, 1.0, 1600.0), (183, 3.0, 1420.0)]
    for m in messages(way.drive(1, 2)):
        assert (m.target_system, m.target_component, m.get_srcComponent()) == (1, 1, 191)  # type: ignore[attr-defined]


def test_actuators_span_the_output_range_and_leave_the_others_alone() -> None:
    (m,) = messages(output("set_actuator", port_actuator=4, starboard_actuator=2).drive(1900, 1480))
    values = [m.param1, m.param2, m.param3, m.param4, m.param5, m.param6]  # type: ignore[attr-defined]
    assert (m.command, m.param7) == (187, 0.0)  # type: ignore[attr-defined]
    assert values[3] == 1.0 and values[1] == pytest.approx(-0.05)  # 1480 is 20 us below the middle of 1100..1900
    assert [number for number, value in enumerate(values, 1) if math.isnan(value)] == [1, 3, 5, 6]
    (m,) = messages(output("set_actuator").drive(1000, 2100))  # beyond the range
    assert (m.param1, m.param2) == (-1.0, 1.0)  # type: ignore[attr-defined]


@pytest.mark.parametrize("kind", ["rc_override", "manual_control"])
def test_sticks_are_given_back_once_and_need_no_more(kind: str) -> None:
    way = output(kind)
    way.on_connect(0)
    way.on_disarmed(0)
    assert way.data_to_send(0) == [] and len(way.release(0)) == 1
    assert all(way.data_to_send(t_ns) == [] for t_ns in range(0, 4000 * MS, 50 * MS))
    assert way.hazard == ""


@pytest.mark.parametrize(
    ("kind", "neutral"),
    [
        ("set_servo", [(183, 1.0, 1480.0), (183, 3.0, 1480.0)]),
        ("set_actuator", [(187, pytest.approx(-0.05), pytest.approx(-0.05))]),
    ],
)
def test_held_outputs_are_let_go_by_saying_neutral_for_three_seconds(kind: str, neutral: list[object]) -> None:
    way = output(kind)
    assert "has no time-out" in way.hazard
    assert way.data_to_send(0) == []  # nobody is there yet
    way.on_connect(0)  # whoever was there before may have died with the motors running
    assert said(way.data_to_send(0)) == neutral
    way.drive(1600, 1600)
    assert all(way.data_to_send(t_ns) == [] for t_ns in range(0, 4000 * MS, 50 * MS))  # neutral never fights a command
    assert said(way.release(5000 * MS)) == neutral
    again = [t_ns for t_ns in range(5000 * MS, 12_000 * MS, 50 * MS) if said(way.data_to_send(t_ns)) == neutral]
    assert len(again) == 30 and again[0] == 5100 * MS and again[-1] == 8000 * MS
    way.on_disarmed(20_000 * MS)  # what is held now is what the motors do at the next arming
    assert [said(way.data_to_send(t_ns)) for t_ns in (20_000 * MS, 20_050 * MS, 20_100 * MS)] == [neutral, [], []]


def test_a_refusal_is_told_in_words_and_forgotten_when_it_is_over() -> None:
    way = output("set_servo")
    acknowledge(way, dialect.MAV_CMD_DO_SET_SERVO, dialect.MAV_RESULT_IN_PROGRESS)
    acknowledge(way, dialect.MAV_CMD_DO_SET_MODE, dialect.MAV_RESULT_FAILED)
    assert way.refused == ""
    acknowledge(way, dialect.MAV_CMD_DO_SET_SERVO, dialect.MAV_RESULT_FAILED)
    assert "refuses DO_SET_SERVO (FAILED): SERVO1_FUNCTION and SERVO3_FUNCTION must be 0" in way.refused
    acknowledge(way, dialect.MAV_CMD_DO_SET_SERVO, dialect.MAV_RESULT_ACCEPTED)
    assert way.refused == ""


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (("links.autopilot.output=set_actuator",), "output set_actuator does not go with profile ardurover"),
        (("links.autopilot.profile=px4", "links.autopilot.output=rc_override"), "does not go with profile px4"),
        (("links.autopilot.profile=px4", "links.autopilot.output=manual_control"), "PX4 mixes sticks"),
        (("links.autopilot.profile=px4", "links.autopilot.output=set_servo"), "PX4 has no MAV_CMD_DO_SET_SERVO"),
        (("links.autopilot.profile=pixhawk",), "key links.autopilot.profile"),
        (("links.autopilot.profile=px4", "links.autopilot.starboard_actuator=1"), "must differ"),
        (("links.autopilot.profile=px4", "links.autopilot.port_actuator=7"), "links.autopilot.port_actuator"),
        (("links.autopilot.profile=px4", "supervisor.control_mode=GUIDED"), "control_mode must be one of px4: MANUAL"),
        (("supervisor.control_mode=OFFBOARD",), "control_mode must be one of ardurover: MANUAL"),
        *(
            (
                (f"links.autopilot.output={way}", f"supervisor.control_mode={mode}"),
                f"{way} in MANUAL alone: set MANUAL",
            )
            for way in ("rc_override", "manual_control")
            for mode in ("HOLD", "GUIDED", "ACRO", "STEERING")
        ),
        (
            ("links.autopilot.output=script", "supervisor.control_mode=MANUAL"),
            "supervisor.control_mode is MANUAL, but motors obey links.autopilot.output script in HOLD alone: set HOLD",
        ),
    ],
)
def test_what_cannot_be_is_one_line(overrides: tuple[str, ...], words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config("sitl", overrides)
    assert words in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("config", "output", "mode"),
    [("sitl", "set_servo", "HOLD"), ("sitl-px4", "set_actuator", "MANUAL"), ("sitl", "script", "HOLD")],
)
def test_a_mode_in_which_the_motors_obey_can_be_the_control_mode(config: str, output: str, mode: str) -> None:
    made = load_config(config, (f"links.autopilot.output={output}", f"supervisor.control_mode={mode}"))
    assert made.supervisor.control_mode == mode


def test_a_log_of_a_mode_that_is_refused_today_can_still_be_read() -> None:
    stored = load_config("sitl").model_dump(mode="json")
    stored["supervisor"]["control_mode"] = "ACRO"
    assert config_from_json(json.dumps(stored), "old.mcap").supervisor.control_mode == "ACRO"


def test_each_profile_brings_its_own_defaults() -> None:
    px4 = load_config("wamv16", ("links.autopilot={endpoint: 'udpin:127.0.0.1:1', profile: px4}",))
    assert (px4.links.autopilot.output, px4.supervisor.control_mode) == ("set_actuator", "OFFBOARD")
    assert "ESTIMATOR_STATUS" in px4.links.autopilot.streams_hz
    assert list(px4.links.autopilot.streams_hz) == sorted(px4.links.autopilot.streams_hz)
    rover = load_config("wamv16", ("links.autopilot={endpoint: 'udpin:127.0.0.1:1'}",))
    assert (rover.links.autopilot.output, rover.supervisor.control_mode) == ("rc_override", "MANUAL")
    assert list(rover.links.autopilot.streams_hz) == sorted(rover.links.autopilot.streams_hz)


# --- which channel, and the last words -------------------------------------------------------------------------------


def overridden(packed: list[bytes]) -> dict[int, int]:
    """The channels (from 1) of one RC_CHANNELS_OVERRIDE that are not left to the pilot."""
    (m,) = messages(packed)
    values = [getattr(m, f"chan{channel}_raw") for channel in range(1, 19)]
    assert (m.target_system, m.target_component) == (1, 1)  # type: ignore[attr-defined]
    ignored = [65535] * 8 + [0] * 10
    return {n: value for n, (value, none) in enumerate(zip(values, ignored, strict=True), 1) if value != none}


def wired_to(kind: str, port: int, starboard: int) -> Output:
    link = AutopilotLinkConfig(endpoint="udpin:127.0.0.1:0", output=kind)
    return make_output(link, PWM, wiring_of(link, PWM, {"RCMAP_ROLL": port, "RCMAP_THROTTLE": starboard}))


@pytest.mark.parametrize(
    ("port", "starboard", "released"),
    [
        (1, 3, {1: 0, 3: 0}),
        (8, 2, {8: 0, 2: 0}),
        (7, 9, {7: 0, 9: 65534}),  # 0 would mean "ignore" there
        (16, 10, {16: 65534, 10: 65534}),
    ],
)
def test_an_override_moves_the_motors_channels_and_no_other(port: int, starboard: int, released: dict) -> None:
    way = wired_to("rc_override", port, starboard)
    assert overridden(way.drive(1600, 1420)) == {port: 1600, starboard: 1420}
    assert overridden(way.release(0)) == released
    # The release is a message without the fields of MAVLink 2 wherever it can be.
    assert way.drive(1600, 1420)[0][1] == (18 if max(port, starboard) <= 8 else 18 + 2 * (max(port, starboard) - 8))


@pytest.mark.parametrize(
    ("kind", "middle", "given_back"),
    [("rc_override", (1480, 1480), (0, 0)), ("manual_control", (-40, -40), (32767,) * 2)],
)
def test_the_last_words_on_sticks_are_neutral_and_then_the_release(
    kind: str, middle: tuple[int, int], given_back: tuple[int, int]
) -> None:
    way = output(kind)
    way.drive(1600, 1420)
    steps = [said(step) for step in way.last_words(neutral=True)]
    assert steps[-3:] == [[given_back]] * 3
    assert len(steps) == 7 and all(step == steps[0] for step in steps[:4])
    assert steps[0][0] == middle
    assert [said(step) for step in way.last_words(neutral=False)] == [[given_back]] * 3


@pytest.mark.parametrize(
    ("kind", "neutral"),
    [
        ("set_servo", [(183, 1.0, 1480.0), (183, 3.0, 1480.0)]),
        ("set_actuator", [(187, pytest.approx(-0.05), pytest.approx(-0.05))]),
    ],
)
@pytest.mark.parametrize("first", [True, False])
def test_the_last_words_on_held_outputs_are_neutral(kind: str, neutral: list[object], first: bool) -> None:
    way = output(kind)
    way.drive(1600, 1420)
    assert [said(step) for step in way.last_words(neutral=first)] == [neutral] * 7


def test_commands_are_sent_for_the_first_time_by_our_identity_and_without_other_parameters() -> None:
    for m in messages(output("set_servo", system_id=9, component_id=192).drive(1600, 1420)):
        assert (m.get_srcSystem(), m.get_srcComponent(), m.confirmation) == (9, 192, 0)  # type: ignore[attr-defined]
        assert [getattr(m, f"param{n}") for n in range(3, 8)] == [0.0] * 5


def test_each_actuator_has_the_range_of_its_own_output() -> None:
    link = AutopilotLinkConfig(endpoint="udpin:127.0.0.1:0", profile="px4", output="set_actuator")
    wiring = px4_wiring_of(link, PWM, {"PWM_MAIN_MIN1": 1000.0, "PWM_MAIN_MAX1": 2000.0})
    (m,) = messages(make_output(link, PWM, wiring).drive(1900, 1900))
    assert (m.param1, m.param2) == (pytest.approx(0.8), 1.0)  # type: ignore[attr-defined]


def test_a_refusal_without_a_name_is_told_by_its_number() -> None:
    way = output("set_actuator")
    acknowledge(way, dialect.MAV_CMD_DO_SET_ACTUATOR, 77)
    assert way.refused == "the autopilot refuses DO_SET_ACTUATOR (result 77)"
