"""The simulated ArduRover's commands, addresses and modes, against the measured behaviour of a real one."""

from __future__ import annotations

import itertools
import math

import pytest

from asvhil.io.mavlink.frames import dialect as mav
from asvhil.types import Radio
from tests.support.after_silence import MEASURED
from tests.support.ardurover import (
    ACCEPTED,
    ATTITUDE,
    DENIED,
    FAILED,
    GCS,
    GUIDED,
    HOLD,
    LOITER,
    MANUAL,
    UNSUPPORTED,
    set_parameter,
)
from tests.support.simplant_boat import Boat, of, times

# --- commands and addresses -------------------------------------------------------------------------------------------


def test_acks_go_to_the_asker_and_streams_to_all() -> None:
    boat = Boat().ready()
    boat.peers.clear()
    boat.send(mav.MAVLink_command_long_message(1, 1, 511, 0, ATTITUDE, 1e5, 0, 0, 0, 0, 0), **GCS)
    (ack,) = of(boat.run(0.02), "COMMAND_ACK")
    assert (ack.target_system, ack.target_component, ack.command) == (255, 190, 511)
    assert boat.peers == ["station"]
    boat.peers.clear()
    boat.run(1.0)
    assert set(boat.peers) == {""}


def test_commands_to_others_are_ignored() -> None:
    boat = Boat().ready()
    for system, component in ((2, 1), (1, 191), (255, 0)):
        boat.send(mav.MAVLink_command_long_message(system, component, 400, 0, 1, 21196, 0, 0, 0, 0, 0))
    boat.send(mav.MAVLink_param_set_message(2, 1, b"RC1_DZ", 30.0, 4))
    boat.send(mav.MAVLink_set_mode_message(2, 1, HOLD))
    log = boat.run(1.5)
    assert of(log, "COMMAND_ACK") == of(log, "PARAM_VALUE") == []
    assert {(m.base_mode, m.custom_mode) for m in of(log, "HEARTBEAT")} == {(65, 0)}


def test_broadcast_and_int_commands_are_taken_and_unknown_ones_are_unsupported() -> None:
    boat = Boat().ready()
    boat.send(mav.MAVLink_command_long_message(0, 0, 176, 0, 1, HOLD, 0, 0, 0, 0, 0))
    boat.send(mav.MAVLink_command_int_message(1, 1, 0, 511, 0, 0, ATTITUDE, 1e5, 0, 0, 0, 0, 0))
    boat.send(mav.MAVLink_command_long_message(1, 1, 31000, 0, 0, 0, 0, 0, 0, 0, 0))
    acks = of(boat.run(0.02), "COMMAND_ACK")
    assert [(m.command, m.result) for m in acks] == [(176, ACCEPTED), (511, ACCEPTED), (31000, UNSUPPORTED)]


def test_its_own_frames_sent_back_to_it_are_ignored() -> None:
    boat = Boat().ready()
    boat.send(mav.MAVLink_command_long_message(1, 1, 176, 0, 1, HOLD, 0, 0, 0, 0, 0), system=1, component=1)
    assert of(boat.run(0.02), "COMMAND_ACK") == []


def test_sequence_numbers_run_on_without_gaps() -> None:
    boat = Boat()
    boat.run(1.0)
    boat.interval(ATTITUDE, 25_000)
    boat.run(20.0)
    numbers = [m.get_seq() for _, m in boat.log]
    assert len(numbers) > 600
    assert all(b == (a + 1) % 256 for a, b in itertools.pairwise(numbers))


def test_timesync_is_answered_with_the_time_since_boot() -> None:
    boat = Boat().ready()
    boat.send(mav.MAVLink_timesync_message(0, 123_456_789_012), peer="ground")
    t, answer = boat.run(0.02)[0]
    assert answer.get_type() == "TIMESYNC"
    assert (answer.ts1, answer.tc1) == (123_456_789_012, round(1e9 * t))
    boat.send(mav.MAVLink_timesync_message(77, 88))  # somebody else's answer
    assert of(boat.run(0.5), "TIMESYNC") == []


def test_it_asks_for_the_time_itself_every_10_s() -> None:
    boat = Boat()
    asked = [(t, m.tc1) for t, m in boat.run(32.0) if m.get_type() == "TIMESYNC"]
    assert asked == [(11.0, 0), (21.0, 0), (31.0, 0)]


def test_servo_command_is_refused_on_motors_and_holds_on_a_free_output() -> None:
    boat = Boat().ready()
    assert boat.command(mav.MAV_CMD_DO_SET_SERVO, 1, 1700) == FAILED
    assert boat.command(mav.MAV_CMD_DO_SET_SERVO, 3, 1700) == FAILED
    assert boat.command(mav.MAV_CMD_DO_SET_SERVO, 5, 1700) == ACCEPTED  # disarmed, and for ever
    assert boat.mode(HOLD) == ACCEPTED
    assert of(boat.run(5.0), "SERVO_OUTPUT_RAW")[-1].servo5_raw == 1700


def test_a_reboot_forgets_streams_mode_and_arming_but_not_parameters() -> None:
    boat = Boat().armed()
    assert boat.command(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == FAILED  # not while armed
    boat.send(mav.MAVLink_param_set_message(1, 1, b"RC1_DZ", 30.0, 4))
    boat.interval(ATTITUDE, 100_000)
    boat.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0)
    boat.mode(HOLD)
    assert boat.command(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == ACCEPTED
    assert boat.run(0.9) == [] and boat.seat.outputs_us == (0, 0)
    log = boat.run(3.0)
    assert set(times(log, "ATTITUDE")) and len(of(log, "ATTITUDE")) <= 3
    assert of(log, "ATTITUDE")[0].time_boot_ms < 2100
    assert of(log, "HEARTBEAT")[0].custom_mode == MANUAL
    assert boat.seat.rover.parameters["RC1_DZ"] == 30.0


def test_a_fix_of_before_a_reboot_has_the_time_zero() -> None:
    """It is told until the receiver has another one; a time since boot cannot be negative."""
    boat = Boat("plant.sensors.gnss.rate_hz=0.2", "plant.frontseat.ready_after_s=0.1").ready()
    assert boat.command(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == ACCEPTED
    boat.run(1.0)
    boat.interval(mav.MAVLINK_MSG_ID_GPS_RAW_INT, 100_000)
    fixes = of(boat.run(6.0), "GPS_RAW_INT")
    assert fixes and min(fix.time_usec for fix in fixes) == 0


@pytest.mark.parametrize(("radio", "changed", "measured_s"), MEASURED)
def test_what_stops_the_motors_after_a_crash_is_as_measured(
    radio: Radio, changed: dict[str, float], measured_s: float | None
) -> None:
    boat = Boat(f"plant.frontseat.rc_receiver={str(radio is not Radio.ABSENT).lower()}")
    boat.ready()
    boat.send(mav.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
    boat.hold(1500, 1500, 3.0, rate_hz=20)
    assert boat.mode(MANUAL) == ACCEPTED and boat.arm() == ACCEPTED
    for name, value in ({"RC_OVERRIDE_TIME": 3.0} | changed).items():
        set_parameter(boat, name, value)
    boat.hold(1600, 1420, 1.0, rate_hz=20)
    if radio is Radio.LOST:
        boat.seat.set_receiver(False)
    boat.hold(1600, 1420, 2.0, rate_hz=20)
    boat.send(mav.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
    boat.hold(1600, 1420, 0.5, rate_hz=20)
    assert boat.outputs() == (1600, 1420)
    silent_ns = boat.t_ns
    for _ in range(120):
        if boat.outputs() != (1600, 1420):
            break
        boat.run(0.08)
    stopped_s = None if boat.seat.outputs_us == (1600, 1420) else (boat.t_ns - silent_ns) * 1e-9
    assert stopped_s == (None if measured_s is None else pytest.approx(measured_s, abs=0.65))


# --- modes ------------------------------------------------------------------------------------------------------------


def test_a_mode_change_is_told_at_once() -> None:
    boat = Boat().ready()
    boat.run(0.1)  # 3.6 s: heartbeats come at whole seconds
    boat.log.clear()
    assert boat.mode(HOLD) == ACCEPTED
    beat = of(boat.log, "HEARTBEAT")[0]
    assert (beat.base_mode, beat.custom_mode, beat.system_status) == (1, 4, 3)
    boat.log.clear()
    assert boat.mode(HOLD) == ACCEPTED
    assert of(boat.log, "HEARTBEAT") == []  # nothing changed


def test_arming_is_told_at_once() -> None:
    boat = Boat().ready()
    assert boat.arm() == ACCEPTED
    assert [m.base_mode for m in of(boat.log, "HEARTBEAT")] == [193]
    assert boat.texts() == ["Throttle armed"]
    assert boat.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0) == ACCEPTED
    assert [m.base_mode for m in of(boat.log, "HEARTBEAT")] == [193, 65]
    assert boat.texts()[-1] == "Throttle disarmed"


@pytest.mark.parametrize("number", [2, 13, 16, 99])
def test_unknown_modes_fail(number: int) -> None:
    boat = Boat().ready()
    assert boat.mode(number) == FAILED
    assert boat.texts() == [f"No such mode {number}"]
    assert of(boat.run(1.0), "HEARTBEAT")[-1].custom_mode == MANUAL


def test_a_mode_without_the_custom_flag_is_denied() -> None:
    boat = Boat().ready()
    assert boat.command(mav.MAV_CMD_DO_SET_MODE, 0.0, HOLD) == DENIED
    assert boat.command(mav.MAV_CMD_DO_SET_MODE, math.nan, HOLD) == DENIED


@pytest.mark.parametrize("number", [0, 1, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 15])
def test_the_rover_modes_are_entered_and_leave_the_motors_neutral_except_manual(number: int) -> None:
    boat = Boat().armed()
    assert boat.mode(number) == ACCEPTED
    boat.hold(1600, 1600, 0.5)
    assert boat.outputs() == ((1600, 1600) if number == MANUAL else (1500, 1500))


def test_modes_that_need_a_position_wait_for_it() -> None:
    boat = Boat("plant.frontseat.ready_after_s=10")
    boat.run(3.0)
    assert boat.mode(LOITER) == FAILED
    assert boat.mode(HOLD) == ACCEPTED
    boat.run(8.0)
    assert boat.mode(GUIDED) == ACCEPTED


def test_the_old_set_mode_message_works_and_is_acknowledged_under_its_own_number() -> None:
    boat = Boat().ready()
    for base_mode, mode in ((1, HOLD), (1, 99), (0, MANUAL)):
        boat.send(mav.MAVLink_set_mode_message(1, base_mode, mode))
    acks = of(boat.run(0.02), "COMMAND_ACK")
    assert [(m.command, m.result) for m in acks] == [(11, ACCEPTED), (11, FAILED), (11, DENIED)]
    assert of(boat.run(1.0), "HEARTBEAT")[-1].custom_mode == HOLD


def test_the_pilot_switches_modes_and_arms_beside_the_link() -> None:
    boat = Boat().ready()
    assert boat.seat.arm(True) and boat.seat.set_mode(HOLD) and not boat.seat.set_mode(99)
    (beat,) = of(boat.run(0.02), "HEARTBEAT")
    assert (beat.base_mode, beat.custom_mode) == (129, HOLD)
    assert boat.seat.arm(False)
    assert of(boat.run(0.02), "HEARTBEAT")[0].base_mode == 1
