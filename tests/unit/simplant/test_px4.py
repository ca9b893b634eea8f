"""The simulated PX4, rule by rule, against what PX4's sources say."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asvhil.config import load_config
from asvhil.config.autopilots import PX4_MODES
from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import dialect as mav
from asvhil.simplant.plant import Plant
from tests.support.simplant_boat import Boat, of, times

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4
MANUAL, OFFBOARD, LOITER = (PX4_MODES[name] for name in ("MANUAL", "OFFBOARD", "AUTO.LOITER"))
NAN = math.nan
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


def test_heartbeat_and_readiness_flags() -> None:
    boat = Px4Boat("plant.frontseat.ready_after_s=20")
    before = boat.run(19.9)
    beat = of(before, "HEARTBEAT")[0]
    assert (beat.autopilot, beat.custom_mode, beat.base_mode, beat.system_status) == (12, MANUAL, 65, 3)
    assert {m.flags & (16 | 128) for m in of(before, "ESTIMATOR_STATUS")} == {128}
    assert of(before, "GLOBAL_POSITION_INT") == []  # PX4 publishes none before it is valid
    assert {m.onboard_control_sensors_health & mav.MAV_SYS_STATUS_PREARM_CHECK for m in of(before, "SYS_STATUS")} == {0}
    assert {m.landed_state for m in of(before, "EXTENDED_SYS_STATE")} == {1}
    after = boat.run(4.0)
    assert {m.flags & (16 | 128) for m in of(after, "ESTIMATOR_STATUS")} == {16}
    assert of(after, "SYS_STATUS")[-1].onboard_control_sensors_health & mav.MAV_SYS_STATUS_PREARM_CHECK
    assert len(of(after, "GLOBAL_POSITION_INT")) == 20  # 5 Hz, where nobody asks


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
    assert boat.mode(LOITER) == ACCEPTED
    told = [m.custom_mode for _, m in boat.run(1.0) if m.get_type() == "HEARTBEAT"]
    assert told == [LOITER]
    assert boat.command(mav.MAV_CMD_DO_SET_MODE, 1.0, 99, 0) == TEMPORARILY_REJECTED
    assert boat.command(mav.MAV_CMD_DO_SET_MODE, 0.0, 1, 0) == DENIED


def test_offboard_needs_a_second_of_set_points_that_set_something() -> None:
    boat = Px4Boat().ready()
    assert boat.mode(OFFBOARD) == TEMPORARILY_REJECTED
    boat.alive(0.5)
    assert boat.mode(OFFBOARD) == TEMPORARILY_REJECTED
    boat.alive(0.7)
    assert boat.mode(OFFBOARD) == ACCEPTED
    boat = Px4Boat().ready()
    boat.alive(3.0, type_mask=128 | 1 | 2)  # neither attitude nor rates
    assert boat.mode(OFFBOARD) == TEMPORARILY_REJECTED
    for _ in range(15):
        boat.send(mav.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0b110111000111, *[0.0] * 11))
        boat.run(0.1)
    assert boat.mode(OFFBOARD) == ACCEPTED


def test_manual_needs_sticks_and_nothing_arms_before_readiness() -> None:
    boat = Px4Boat("plant.frontseat.rc_receiver=false").ready()
    assert boat.arm() == TEMPORARILY_REJECTED and boat.texts()[-1] == "Arming denied: no manual control input"
    boat = Px4Boat("plant.frontseat.ready_after_s=20")
    boat.run(3.0)
    assert boat.arm() == TEMPORARILY_REJECTED
    assert boat.arm(21196) == ACCEPTED  # by force


def test_actuators_drive_the_outputs_while_armed_in_any_mode_and_hold_for_ever() -> None:
    boat = Px4Boat().ready()
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
    assert boat.actuate(NAN, 0.0) == ACCEPTED
    assert boat.outputs() == (1500, 1500)  # no number: the disarmed pulse
    boat.seat.arm(False)
    assert boat.outputs() == (1500, 1500)


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


def test_lost_sticks_end_offboard_unless_excepted_or_lost_before_arming() -> None:
    boat = Px4Boat().offboard()
    boat.seat.set_receiver(False)
    boat.alive(1.0)
    assert not boat.beat().base_mode & 128  # NAV_RCL_ACT 6: disarm
    for override in ("plant.frontseat.parameters={COM_RCL_EXCEPT: 4}", "plant.frontseat.rc_receiver=false"):
        boat = Px4Boat(override).offboard()
        boat.seat.set_receiver(False)
        boat.alive(3.0)
        assert boat.seat.vehicle.armed and boat.seat.vehicle.mode == OFFBOARD


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


def test_a_reboot_forgets_streams_mode_arming_and_actuators() -> None:
    boat = Px4Boat().ready()
    boat.actuate(1.0, 1.0)
    boat.mode(LOITER)
    assert boat.command(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == ACCEPTED
    assert boat.run(0.9) == [] and boat.seat.outputs_us == (0, 0)
    log = boat.run(3.0)
    assert of(log, "HEARTBEAT")[0].custom_mode == MANUAL and len(times(log, "ATTITUDE")) > 30
    assert boat.arm() == ACCEPTED and boat.outputs() == (1500, 1500)
