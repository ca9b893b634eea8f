"""The simulated PX4, rule by rule, against what was measured on a real one (docs/simulated-autopilots.md)."""

from __future__ import annotations

import math
import struct
from collections import Counter
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asvhil.config import load_config
from asvhil.config.autopilots import PX4_MODES
from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import FrameSplitter, message_id
from asvhil.io.mavlink.frames import dialect as mav
from asvhil.simplant.plant import Plant
from tests.support.simplant_boat import Boat, of, times

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4
MANUAL, OFFBOARD, LOITER = (PX4_MODES[name] for name in ("MANUAL", "OFFBOARD", "AUTO.LOITER"))
NAN = math.nan
BIASED = (
    "plant.sensors.imu.accel_bias_mps2=0.05",
    "plant.sensors.imu.accel_white_mps2=0",
    "plant.weather.wind.speed_mps=0",
)
LEVEL = [1.0, 0.0, 0.0, 0.0]


class Px4Boat(Boat):
    """A boat with a PX4 and a companion that can keep OFFBOARD alive."""

    def __init__(self, *overrides: str) -> None:
        super().__init__("plant.autopilot=px4", *overrides)

    def mode(self, number: int) -> int | None:
        return self.command(mav.MAV_CMD_DO_SET_MODE, 1.0, number >> 16 & 0xFF, number >> 24)

    def alive(self, seconds: float, type_mask: int = 128) -> None:
        for _ in range(round(seconds * 10)):
            self.send(mav.MAVLink_set_attitude_target_message(0, 1, 1, type_mask, LEVEL, 0, 0, 0, 0))
            self.run(0.1)

    def actuate(self, *values: float, index: float = 0.0) -> int | None:
        return self.command(mav.MAV_CMD_DO_SET_ACTUATOR, *values, *[NAN] * (6 - len(values)), index)

    def offboard(self) -> Px4Boat:
        """Armed in OFFBOARD."""
        self.ready()
        self.alive(1.5)
        assert self.mode(OFFBOARD) == ACCEPTED and self.arm() == ACCEPTED
        return self

    def beat(self) -> Any:
        return of(self.run(1.0), "HEARTBEAT")[-1]


@pytest.mark.parametrize(("version", "at_rest", "dropped"), [("1.15", 895, 229), ("1.16", 959, 165)])
def test_heartbeat_and_readiness_flags(version: str, at_rest: int, dropped: int) -> None:
    boat = Px4Boat("plant.frontseat.ready_after_s=20", f"plant.frontseat.px4_version='{version}'")
    before = boat.run(19.9)
    beat = of(before, "HEARTBEAT")[2]
    # Hold at power-on: custom mode, guided, stabilised and automatic; nothing arms without a position there.
    assert (beat.type, beat.autopilot, beat.custom_mode, beat.base_mode, beat.system_status) == (11, 12, LOITER, 29, 0)
    assert {m.flags for m in of(before, "ESTIMATOR_STATUS")} == {dropped}
    assert of(before, "GLOBAL_POSITION_INT") == []  # PX4 publishes none before it is valid
    assert {m.onboard_control_sensors_health & mav.MAV_SYS_STATUS_PREARM_CHECK for m in of(before, "SYS_STATUS")} == {0}
    assert {m.landed_state for m in of(before, "EXTENDED_SYS_STATE")} == {1}
    after = boat.run(4.0)
    assert {m.flags for m in of(after, "ESTIMATOR_STATUS")} == {at_rest}
    assert of(after, "SYS_STATUS")[-1].onboard_control_sensors_health & mav.MAV_SYS_STATUS_PREARM_CHECK
    assert of(after, "HEARTBEAT")[-1].system_status == mav.MAV_STATE_STANDBY
    assert len(of(after, "GLOBAL_POSITION_INT")) == 20  # 5 Hz, where nobody asks
    assert boat.arm() == ACCEPTED
    boat.run(2.0)
    assert {m.flags for m in of(boat.run(4.0), "ESTIMATOR_STATUS")} == {831}
    assert (boat.beat().base_mode, boat.beat().system_status) == (157, 4)
    assert boat.mode(MANUAL) == ACCEPTED
    assert boat.beat().base_mode == 193
    boat.alive(0.3)
    assert boat.mode(OFFBOARD) == ACCEPTED
    assert boat.beat().base_mode == 129


def test_streams_have_px4s_rates_and_the_heartbeat_keeps_its_own() -> None:
    boat = Px4Boat().ready()
    log = boat.run(4.0)
    counted = {"ATTITUDE": 60, "RC_CHANNELS": 20, "HEARTBEAT": 4, "SERVO_OUTPUT_RAW": 4}
    assert {name: len(of(log, name)) for name in counted} == counted
    assert of(log, "ACTUATOR_OUTPUT_STATUS") == []
    assert boat.interval(375, 100_000) == ACCEPTED
    assert boat.interval(0, 100_000) == FAILED  # HEARTBEAT
    assert boat.interval(193, 100_000) == FAILED  # EKF_STATUS_REPORT is ArduPilot's
    log = boat.run(2.0)
    assert len(of(log, "ACTUATOR_OUTPUT_STATUS")) == 20 and len(of(log, "HEARTBEAT")) == 2
    boat.send(mav.MAVLink_request_data_stream_message(1, 1, 0, 20, 1))
    assert len(of(boat.run(1.0), "RC_CHANNELS")) == 5  # not listened to


def test_a_mode_change_is_told_by_the_next_heartbeat_alone() -> None:
    boat = Px4Boat().ready()
    assert boat.mode(MANUAL) == ACCEPTED
    told = [m.custom_mode for _, m in boat.run(1.0) if m.get_type() == "HEARTBEAT"]
    assert told == [MANUAL]
    assert boat.command(mav.MAV_CMD_DO_SET_MODE, 1.0, 99, 0) == TEMPORARILY_REJECTED
    assert boat.command(mav.MAV_CMD_DO_SET_MODE, 0.0, 1, 0) == DENIED


def test_offboard_needs_set_points_that_set_something_and_no_position() -> None:
    boat = Px4Boat("plant.frontseat.ready_after_s=60")
    boat.run(5.0)
    assert boat.mode(OFFBOARD) == TEMPORARILY_REJECTED
    boat.alive(3.0, type_mask=128 | 1 | 2)  # neither attitude nor rates
    assert boat.mode(OFFBOARD) == TEMPORARILY_REJECTED
    assert boat.texts()[-1] == "Switching to Offboard is currently not available"
    boat.alive(0.2)
    assert boat.mode(OFFBOARD) == ACCEPTED and boat.arm() == ACCEPTED  # body rates need an attitude only
    boat = Px4Boat("plant.frontseat.ready_after_s=60")
    boat.run(5.0)
    _position_set_points(boat)
    assert boat.mode(OFFBOARD) == TEMPORARILY_REJECTED
    boat = Px4Boat().ready()
    _position_set_points(boat)
    assert boat.mode(OFFBOARD) == ACCEPTED


def _position_set_points(boat: Px4Boat) -> None:
    for _ in range(5):
        boat.send(mav.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0b110111000111, *[0.0] * 11))
        boat.run(0.1)


def test_manual_needs_sticks_and_hold_a_position() -> None:
    boat = Px4Boat("plant.frontseat.rc_receiver=false").ready()
    assert boat.mode(MANUAL) == TEMPORARILY_REJECTED
    assert boat.texts()[-1] == "Switching to Manual is currently not available"
    assert boat.arm() == ACCEPTED and boat.beat().custom_mode == LOITER
    boat = Px4Boat("plant.frontseat.ready_after_s=20")
    boat.run(3.0)
    assert boat.arm() == TEMPORARILY_REJECTED
    assert boat.arm(21196) == ACCEPTED  # by force
    assert boat.mode(LOITER) == TEMPORARILY_REJECTED


def test_long_texts_come_in_chunks() -> None:
    boat = Px4Boat("plant.frontseat.ready_after_s=20")
    boat.run(3.0)
    for number in (1, 2):
        boat.log.clear()
        assert boat.arm() == TEMPORARILY_REJECTED
        chunks = of(boat.log, "STATUSTEXT")
        assert [(m.id, m.chunk_seq, m.text) for m in chunks] == [
            (number, 0, "Arming denied: Resolve system health failures firs"),
            (number, 1, "t\t"),
        ]
    boat.log.clear()
    boat.arm(21196)
    assert [(m.id, m.chunk_seq, m.text) for m in of(boat.log, "STATUSTEXT")] == [(0, 0, "Armed by external command\t")]


def test_a_boat_adrift_and_disarmed_loses_its_position_until_it_is_armed() -> None:
    """As on a real one at 6 m/s of wind: EKF2 takes a boat without vibration for one at rest, its receiver for bad."""
    adrift = ("plant.weather.current.speed_mps=0.3",)
    default = "plant.frontseat.parameters={EKF2_GPS_CHECK: 245}"
    boat = Px4Boat(*adrift, default).ready()
    log = boat.run(40.0)
    last_s = times(log, "GLOBAL_POSITION_INT")[-1]
    assert 5.0 < last_s < 25.0
    assert of(log, "ESTIMATOR_STATUS")[-1].flags == 229 and len(of(log, "GPS_RAW_INT")) == 40
    assert of(log, "GPS_RAW_INT")[-1].fix_type == 3
    assert boat.texts() == ["Preflight: GPS Horizontal Pos Drift too high"]
    assert boat.arm() == TEMPORARILY_REJECTED and boat.beat().system_status == mav.MAV_STATE_UNINIT
    boat.alive(0.3)
    assert boat.mode(OFFBOARD) == ACCEPTED and boat.arm() == ACCEPTED
    boat.alive(7.0)
    assert len(of(boat.run(0.9), "GLOBAL_POSITION_INT")) > 3
    boat = Px4Boat(*adrift).ready()  # set right: 21
    assert len(of(boat.run(40.0), "GLOBAL_POSITION_INT")) == 200
    assert len(of(Px4Boat(default).ready().run(40.0), "GLOBAL_POSITION_INT")) == 200  # moored, so to say


def test_actuators_drive_the_outputs_while_armed_in_any_mode_and_hold_for_ever() -> None:
    boat = Px4Boat().ready()
    assert boat.mode(MANUAL) == ACCEPTED
    assert boat.actuate(1.0, -0.5) == ACCEPTED
    assert boat.outputs() == (1500, 1500)  # disarmed
    assert boat.arm() == ACCEPTED
    assert boat.outputs() == (1900, 1300)
    boat.run(60.0)  # in MANUAL nothing minds that we are silent: the hazard of this command
    assert boat.outputs() == (1900, 1300)
    assert boat.actuate(0.25, 7.0) == ACCEPTED  # accepted whatever it says
    assert boat.outputs() == (1600, 1900)
    assert boat.actuate(0.0, 0.0, index=1.0) == ACCEPTED
    assert boat.outputs() == (1600, 1900)  # another set
    assert boat.actuate(0.5, -0.5) == ACCEPTED and boat.actuate(0.25, NAN) == ACCEPTED
    assert boat.outputs() == (1600, 1300)  # no number: left alone
    assert boat.actuate(NAN, 0.125) == ACCEPTED
    assert boat.outputs() == (1600, 1550)
    boat.seat.arm(False)
    assert boat.outputs() == (1500, 1500)
    assert boat.arm() == ACCEPTED
    assert boat.outputs() == (1600, 1550)  # kept through disarming: the hazard of arming again


def test_sticks_move_nothing_and_overrides_and_servo_commands_do_not_exist() -> None:
    boat = Px4Boat().armed()
    boat.seat.set_sticks({1: 1900, 3: 1900})
    boat.override(1800, 1800)
    assert boat.outputs() == (1500, 1500)
    assert of(boat.run(0.5), "RC_CHANNELS")[-1].chan1_raw == 1900
    assert boat.command(mav.MAV_CMD_DO_SET_SERVO, 1, 1700) == UNSUPPORTED


@pytest.mark.parametrize(
    ("action", "outputs", "mode", "armed"),
    [(7, (1500, 1500), OFFBOARD, False), (6, (1450, 1500), OFFBOARD, True), (5, (1800, 1800), LOITER, True)],
)
def test_silence_in_offboard_ends_as_the_parameters_say(
    action: int, outputs: tuple[int, int], mode: int, armed: bool
) -> None:
    boat = Px4Boat(f"plant.frontseat.parameters={{COM_OBL_RC_ACT: {action}, PWM_MAIN_FAIL1: 1450}}").offboard()
    boat.actuate(0.75, 0.75)
    boat.alive(1.0)
    boat.run(0.88)
    assert boat.seat.outputs_us == (1800, 1800)
    boat.run(0.2)  # a second after the last sign of life
    assert boat.seat.outputs_us == outputs
    beat = boat.beat()
    assert (beat.custom_mode, bool(beat.base_mode & 128)) == (mode, armed)


@pytest.mark.parametrize(
    ("parameters", "modes", "armed"),
    [
        ("{}", ["AUTO.LOITER", "AUTO.RTL"], True),  # PX4's defaults: 5 s of Hold, then Return
        ("{NAV_RCL_ACT: 3, COM_FAIL_ACT_T: 0}", ["AUTO.LAND", "AUTO.LAND"], True),
        ("{NAV_RCL_ACT: 6}", ["OFFBOARD", "OFFBOARD"], False),  # disarming does not wait
        ("{NAV_RCL_ACT: 5}", ["OFFBOARD", "OFFBOARD"], True),
    ],
)
def test_lost_sticks_end_offboard_as_the_parameters_say(parameters: str, modes: list[str], armed: bool) -> None:
    boat = Px4Boat(f"plant.frontseat.parameters={parameters}").offboard()
    boat.seat.set_receiver(False)
    boat.alive(2.0)
    beats = [boat.beat()]
    boat.alive(3.0)
    beats.append(boat.beat())
    assert [beat.custom_mode for beat in beats] == [PX4_MODES[name] for name in modes]
    assert [bool(beat.base_mode & 128) for beat in beats] == [armed, armed]
    assert beats[1].system_status == (8 if "5" in parameters else 5 if armed else 3)


def test_the_pilot_can_take_over_while_a_fail_safe_is_in_hold() -> None:
    boat = Px4Boat().offboard()
    boat.seat.set_receiver(False)
    boat.alive(2.0)
    assert boat.texts()[-1] == "Failsafe activated: entering Hold for 5 seconds"
    boat.seat.set_receiver(True)
    assert boat.mode(MANUAL) == ACCEPTED
    boat.run(10.0)
    assert (boat.beat().custom_mode, boat.beat().system_status) == (MANUAL, 4)


def test_sticks_lost_before_arming_or_excepted_end_nothing() -> None:
    for override in ("plant.frontseat.parameters={COM_RCL_EXCEPT: 4}", "plant.frontseat.rc_receiver=false"):
        boat = Px4Boat(override).offboard()
        boat.seat.set_receiver(False)
        boat.alive(3.0)
        assert boat.seat.vehicle.armed and boat.seat.vehicle.mode == OFFBOARD


def test_rc_channels_come_once_a_transmitter_was_heard() -> None:
    boat = Px4Boat("plant.frontseat.rc_receiver=false").ready()
    assert of(boat.run(5.0), "RC_CHANNELS") == []
    boat.seat.set_receiver(True)
    channels = of(boat.run(1.0), "RC_CHANNELS")
    assert len(channels) == 5 and channels[0].chancount == 8
    assert (channels[0].chan8_raw, channels[0].chan9_raw, channels[0].chan18_raw) == (1800, 65535, 65535)
    radio = mav.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
    told = of(boat.log, "SYS_STATUS")
    assert [bool(told[k].onboard_control_sensors_present & radio) for k in (0, -1)] == [False, True]
    boat.seat.set_receiver(False)
    assert of(boat.run(1.0), "RC_CHANNELS") == []


@pytest.mark.parametrize(("airframe", "prflt", "after_s"), [(0, 10, 10.0), (0, -1, 15.0), (6, 10, None)])
def test_a_multicopter_that_stays_on_the_ground_is_disarmed(airframe: int, prflt: int, after_s: float | None) -> None:
    boat = Px4Boat(f"plant.frontseat.parameters={{CA_AIRFRAME: {airframe}, COM_DISARM_PRFLT: {prflt}}}").offboard()
    boat.alive((after_s or 20.0) - 0.5)
    assert boat.seat.vehicle.armed
    boat.alive(1.0)
    assert boat.seat.vehicle.armed is (after_s is None)
    how = {10.0: "Disarmed by auto preflight disarming", 15.0: "Disarmed by landing"}
    assert after_s is None or boat.texts()[-1] == how[after_s]


@pytest.mark.parametrize("version", ["1.15", "1.16"])
def test_outputs_of_px4s_own_simulation(version: str) -> None:
    sitl = ("plant.frontseat.px4_outputs=sitl", f"plant.frontseat.px4_version='{version}'")
    boat = Px4Boat(*sitl).ready()
    boat.interval(375, 100_000)
    told = of(boat.run(1.0), "ACTUATOR_OUTPUT_STATUS")
    assert len(told) == (10 if version == "1.15" else 0)
    assert {(m.active, m.actuator[0], m.actuator[15], m.actuator[16]) for m in told} <= {(16, 900.0, 900.0, 0.0)}
    assert boat.seat.outputs_us == (0, 0) and boat.actuate(0.5, -0.5) == ACCEPTED and boat.arm() == ACCEPTED
    (m, *_) = of(boat.run(0.2), "ACTUATOR_OUTPUT_STATUS")
    assert (m.actuator[0], m.actuator[2]) == (1750.0, 1250.0) == boat.seat.outputs_us
    boat.send(mav.MAVLink_param_request_read_message(1, 1, b"PWM_MAIN_MIN1", -1))
    assert of(boat.run(0.2), "PARAM_VALUE") == []
    mute = Px4Boat(*sitl, "plant.frontseat.parameters={PWM_MAIN_FUNC2: 0}").ready()
    mute.interval(375, 100_000)
    assert mute.arm() == ACCEPTED
    assert of(mute.run(1.0), "ACTUATOR_OUTPUT_STATUS") == []  # no output has a function that a controller serves


def test_other_messages_of_a_px4() -> None:
    boat = Px4Boat().ready()
    boat.raw.clear()
    log = boat.run(6.0)
    assert [len(of(log, name)) for name in ("TIMESYNC", "PING")] == [60, 6]
    splitter = FrameSplitter(datagrams=True)
    counts = Counter(message_id(data) for data in boat.raw if not splitter.receive(data))
    assert counts == {8: 6, 290: 60, 291: 60, 380: 3, 410: 3, 411: 2, 436: 3}
    assert (splitter.unknown, splitter.bad_crc, splitter.garbage_bytes) == (sum(counts.values()), 0, 0)


def test_heartbeats_go_on_to_the_other_stations() -> None:
    boat = Px4Boat().ready()
    boat.send(mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), system=255, component=190, peer="ground")
    boat.send(mav.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
    boat.send(mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), system=255, component=190, peer="ground")
    boat.peers.clear()
    told = boat.run(0.1)
    passed_on = [(peer, m.type) for peer, (_, m) in zip(boat.peers, told, strict=True) if peer]
    assert passed_on == [("ground", 18), ("companion", 6)]  # nobody else was known at the first


def test_integer_parameters_travel_as_bytes() -> None:
    boat = Px4Boat().ready()
    boat.send(mav.MAVLink_param_request_read_message(1, 1, b"PWM_MAIN_FUNC3", -1))
    (value,) = of(boat.run(0.02), "PARAM_VALUE")
    assert (value.param_type, struct.unpack("<i", struct.pack("<f", value.param_value))[0]) == (6, 302)
    (as_float,) = struct.unpack("<f", struct.pack("<i", 101))
    boat.send(mav.MAVLink_param_set_message(1, 1, b"PWM_MAIN_FUNC3", as_float, 6))
    boat.send(mav.MAVLink_param_set_message(1, 1, b"COM_OF_LOSS_T", 0.5, 9))
    boat.run(0.02)
    assert (boat.seat.vehicle.parameters["PWM_MAIN_FUNC3"], boat.seat.vehicle.parameters["COM_OF_LOSS_T"]) == (101, 0.5)
    assert boat.arm() == ACCEPTED and boat.actuate(1.0, 1.0) == ACCEPTED
    assert boat.outputs() == (1900, 1500)  # an output with another function does not follow
    with pytest.raises(ConfigError, match="the simulated PX4 has no RC1_DZ"):
        Plant(load_config("sitl", ("plant.autopilot=px4", "plant.frontseat.parameters={RC1_DZ: 0}")), 0)


@settings(max_examples=100, deadline=None)
@given(
    number=st.sampled_from([187, 176, 400, 511, 512, 510, 246, 183]),
    values=st.lists(st.floats(width=32), min_size=7, max_size=7),
    x=st.integers(-(2**31), 2**31 - 1),
)
def test_commands_with_any_numbers_never_raise(number: int, values: list[float], x: int) -> None:
    boat = Px4Boat().ready()
    boat.send(mav.MAVLink_command_long_message(1, 1, number, 0, *values))
    boat.send(mav.MAVLink_command_int_message(1, 1, 0, number, 0, 0, *values[:4], x, -x - 1, values[6]))
    boat.send(mav.MAVLink_param_set_message(1, 1, b"PWM_MAIN_FUNC1", values[0], 6))
    boat.send(mav.MAVLink_param_set_message(1, 1, b"COM_OF_LOSS_T", values[1], 9))
    acks = of(boat.run(0.1), "COMMAND_ACK")
    assert [ack.command for ack in acks] == [number, number]
    assert all(800 <= pulse_us <= 2200 for pulse_us in boat.seat.outputs_us) or number == 246


def test_the_accelerometers_bias_is_taken_out_under_way_and_is_back_after_a_reboot() -> None:
    boat = Px4Boat(*BIASED).ready()

    def measured() -> tuple[float, float]:
        boat.command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, mav.MAVLINK_MSG_ID_HIGHRES_IMU, 50_000)
        message = of(boat.run(1.0), "HIGHRES_IMU")[-1]
        return message.xacc, message.yacc

    whole = measured()
    assert min(abs(part) for part in whole) > 0.01
    boat.run(30.0)
    assert measured() == pytest.approx(whole)  # at rest it cannot be told from a tilt
    boat.offboard()
    boat.alive(8.0)
    assert measured() == pytest.approx([0.33 * part for part in whole], rel=0.25)
    boat.alive(40.0)
    assert max(abs(part) for part in measured()) < 1e-3
    assert boat.command(mav.MAV_CMD_DO_SET_MODE, 1.0, LOITER >> 16 & 0xFF, LOITER >> 24) == ACCEPTED
    boat.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0)
    assert boat.command(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == ACCEPTED
    boat.run(4.0)
    assert measured() == pytest.approx(whole)


def test_a_reboot_forgets_streams_mode_arming_and_actuators() -> None:
    boat = Px4Boat().ready()
    boat.actuate(1.0, 1.0)
    boat.mode(LOITER)
    assert boat.command(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == ACCEPTED
    assert boat.run(0.9) == [] and boat.seat.outputs_us == (0, 0)
    log = boat.run(3.0)
    assert of(log, "HEARTBEAT")[0].custom_mode == LOITER and len(times(log, "ATTITUDE")) > 30
    assert boat.arm() == ACCEPTED and boat.outputs() == (1500, 1500)


@pytest.mark.parametrize(("sensor", "used"), [("false", (-100, 0, -1)), ("true", (10_000, 139, -1))])
def test_its_battery_is_told_as_recorded(sensor: str, used: tuple[int, int, int]) -> None:
    """Without a sensor the current is -1 A, and no charge has been used; energy is never told. 100 A for 5 s."""
    boat = Px4Boat(f"plant.frontseat.current_sensor={sensor}", "vehicle.power.hotel_w=1260")
    told = of(boat.run(7.0), "BATTERY_STATUS")[-1]
    assert (told.id, told.battery_function, told.type, told.voltages[:2]) == (0, 1, 1, [12_600, 65_535])
    assert told.current_consumed == pytest.approx(used[1], abs=60)
    assert (told.current_battery, told.energy_consumed) == (used[0], used[2])
