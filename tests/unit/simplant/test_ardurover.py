"""The simulated ArduRover, rule by rule, against the measured behaviour of a real one."""

from __future__ import annotations

import itertools
import math

import pytest

from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import dialect as mav
from asvhil.types import Frame, Radio
from tests.support.after_silence import MEASURED
from tests.support.simplant_boat import Boat, of, times

GCS = {"system": 255, "component": 190, "peer": "station"}
MANUAL, HOLD, LOITER, GUIDED = 0, 4, 5, 15
ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4
NO_RECEIVER = "plant.frontseat.rc_receiver=false"

ATTITUDE, GPS_RAW_INT, SERVO_OUTPUT_RAW, RC_CHANNELS, SIM_STATE = 30, 24, 36, 65, 108


def intervals(boat: Boat, name: str, seconds: float) -> list[float]:
    seen = times(boat.run(seconds), name)
    return [round(b - a, 6) for a, b in itertools.pairwise(seen)]


# --- boot and readiness -------------------------------------------------------------------------------------


def test_nothing_is_sent_and_no_motor_has_a_signal_before_boot() -> None:
    boat = Boat()
    boat.send(mav.MAVLink_timesync_message(0, 5))
    assert boat.run(0.99) == []
    assert boat.seat.outputs_us == (0, 0)
    first = boat.run(0.02)
    assert [m.get_type() for _, m in first] == ["HEARTBEAT", "STATUSTEXT"]
    assert boat.seat.outputs_us == (1500, 1500)


def test_heartbeat_is_that_of_a_disarmed_boat_in_manual() -> None:
    boat = Boat()
    beat = of(boat.run(1.1), "HEARTBEAT")[0]
    assert (beat.type, beat.autopilot, beat.base_mode, beat.custom_mode, beat.system_status) == (11, 3, 65, 0, 4)
    assert (beat.get_srcSystem(), beat.get_srcComponent(), beat.mavlink_version) == (1, 1, 3)


def test_by_default_every_stream_comes_at_1_hz() -> None:
    boat = Boat().ready()
    log = boat.run(10.0)
    names = {m.get_type() for _, m in log} - {"TIMESYNC"}
    assert names == {
        "HEARTBEAT",
        "ATTITUDE",
        "GLOBAL_POSITION_INT",
        "VFR_HUD",
        "SYS_STATUS",
        "SERVO_OUTPUT_RAW",
        "RC_CHANNELS",
        "RAW_IMU",
        "SCALED_IMU2",
        "GPS_RAW_INT",
        "SYSTEM_TIME",
        "EKF_STATUS_REPORT",
        "LOCAL_POSITION_NED",
    }
    for name in names:
        seen = times(log, name)
        assert len(seen) == 10 and seen[-1] - seen[0] == pytest.approx(9.0)


def test_readiness_is_told_by_the_ekf_flags_and_positions_wait_for_it() -> None:
    boat = Boat("plant.frontseat.ready_after_s=31")
    before = boat.run(30.98)
    flags = [m.flags for m in of(before, "EKF_STATUS_REPORT")]
    assert set(flags) == {1024, 167} and flags == sorted(flags, reverse=True)
    assert {(m.lat, m.lon, m.vx) for m in of(before, "GLOBAL_POSITION_INT")} == {(0, 0, 0)}
    assert {m.fix_type for m in of(before, "GPS_RAW_INT")} == {1}
    assert of(before, "LOCAL_POSITION_NED") == []
    assert {m.time_unix_usec for m in of(before, "SYSTEM_TIME")} == {0}
    after = boat.run(0.5)
    assert {m.flags for m in of(after, "EKF_STATUS_REPORT")} == {831}
    assert {(m.lat, m.lon) for m in of(after, "GLOBAL_POSITION_INT")} == {(404237000, -869212000)}
    assert {m.fix_type for m in of(after, "GPS_RAW_INT")} == {3}
    assert len(of(after, "LOCAL_POSITION_NED")) == 1
    assert of(after, "SYSTEM_TIME")[0].time_unix_usec > 1_700_000_000_000_000


def test_time_since_boot_counts_from_power_on() -> None:
    boat = Boat()
    for t, message in boat.run(5.0):
        if message.get_type() == "ATTITUDE":
            assert message.time_boot_ms == round(1000 * t)


def test_what_is_written_while_it_sets_itself_up_may_be_lost() -> None:
    boat = Boat("plant.frontseat.setup_s=1", "plant.frontseat.rc1_dz_us=30", "plant.frontseat.rc3_dz_us=30")
    beats = of(boat.run(1.5), "HEARTBEAT")
    assert {(m.custom_mode, m.system_status) for m in beats} == {(16, 2)}
    assert set_parameter(boat, "RC1_DZ", 0.0) == 0.0  # as it reads now anyway
    assert set_parameter(boat, "RC3_DZ", 5.0) == 5.0
    boat.run(1.0)
    assert of(boat.log, "HEARTBEAT")[-1].system_status == 4
    assert (boat.seat.rover.parameters["RC1_DZ"], boat.seat.rover.parameters["RC3_DZ"]) == (30.0, 5.0)


# --- streams ------------------------------------------------------------------------------------------------


def test_set_message_interval_changes_one_stream() -> None:
    boat = Boat().ready()
    assert boat.interval(ATTITUDE, 50_000) == ACCEPTED
    assert set(intervals(boat, "ATTITUDE", 2.0)) == {0.06, 0.04}  # 20 Hz on a loop of 50 Hz: 39 to 61 ms, as measured
    assert boat.interval(SERVO_OUTPUT_RAW, 200_000) == ACCEPTED
    log = boat.run(2.0)
    assert len(of(log, "ATTITUDE")) == 40
    assert len(of(log, "SERVO_OUTPUT_RAW")) == 10
    assert len(of(log, "RAW_IMU")) == 2


def test_faster_than_0_8_of_the_loop_is_denied_and_the_old_rate_stays() -> None:
    boat = Boat().ready()
    assert boat.interval(ATTITUDE, 100_000) == ACCEPTED
    assert boat.interval(ATTITUDE, 20_000) == DENIED
    assert set(intervals(boat, "ATTITUDE", 1.0)) == {0.1}
    assert boat.interval(ATTITUDE, 25_000) == ACCEPTED  # 40 Hz is the limit
    assert len(of(boat.run(1.0), "ATTITUDE")) == 40


def test_interval_0_is_the_default_and_minus_1_is_off() -> None:
    boat = Boat().ready()
    assert boat.interval(ATTITUDE, 100_000) == ACCEPTED
    assert boat.interval(ATTITUDE, -1) == ACCEPTED
    assert of(boat.run(3.0), "ATTITUDE") == []
    assert boat.interval(ATTITUDE, 0) == ACCEPTED
    assert set(intervals(boat, "ATTITUDE", 3.5)) == {1.0}
    assert boat.interval(SIM_STATE, 100_000) == ACCEPTED
    assert len(of(boat.run(1.0), "SIM_STATE")) == 10
    assert boat.interval(SIM_STATE, 0) == ACCEPTED  # not streamed by default
    assert of(boat.run(2.0), "SIM_STATE") == []


@pytest.mark.parametrize("msg_id", [331, 231, 63, 64, 375, 93, 9999, -5])
def test_unavailable_messages_are_denied(msg_id: int) -> None:
    assert Boat().ready().interval(msg_id, 100_000) == DENIED


@pytest.mark.parametrize("msg_id", [24, 33, 32, 30, 31, 27, 26, 116, 36, 105, 74, 193, 65, 2, 108, 0])
def test_available_messages_arrive_at_the_rate_asked_for(msg_id: int) -> None:
    boat = Boat().ready()
    assert boat.interval(msg_id, 100_000) == ACCEPTED
    assert sum(m.get_msgId() == msg_id for _, m in boat.run(2.0)) == 20


@pytest.mark.parametrize("msg_id", [168, 124])
def test_wind_and_second_gps_are_accepted_and_never_sent(msg_id: int) -> None:
    boat = Boat().ready()
    assert boat.interval(msg_id, 100_000) == ACCEPTED
    assert all(m.get_msgId() != msg_id for _, m in boat.run(3.0))


@pytest.mark.parametrize("interval_us", [math.nan, math.inf])
def test_intervals_that_are_not_finite_are_denied(interval_us: float) -> None:
    boat = Boat().ready()
    assert boat.interval(ATTITUDE, interval_us) == DENIED
    assert boat.command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, interval_us, 1e5) == DENIED


def test_get_message_interval() -> None:
    boat = Boat().ready()
    boat.interval(ATTITUDE, 50_000)
    assert boat.command(mav.MAV_CMD_GET_MESSAGE_INTERVAL, ATTITUDE) == ACCEPTED
    assert boat.command(mav.MAV_CMD_GET_MESSAGE_INTERVAL, SIM_STATE) == ACCEPTED
    found = [(m.message_id, m.interval_us) for m in of(boat.log, "MESSAGE_INTERVAL")]
    assert found == [(ATTITUDE, 50_000), (SIM_STATE, -1)]


def test_gnss_fixes_come_at_5_hz_and_repeat_when_streamed_faster() -> None:
    boat = Boat().ready()
    boat.interval(GPS_RAW_INT, 50_000)
    stamps = [m.time_usec for m in of(boat.run(2.0), "GPS_RAW_INT")]
    assert len(stamps) == 40 and len(set(stamps)) in (10, 11)
    assert {b - a for a, b in itertools.pairwise(stamps)} == {0, 200_000}


def test_legacy_data_stream_requests_are_taken_without_an_ack() -> None:
    boat = Boat().ready()
    boat.send(mav.MAVLink_request_data_stream_message(1, 1, mav.MAV_DATA_STREAM_EXTRA1, 4, 1))
    boat.run(0.02)
    assert set(intervals(boat, "ATTITUDE", 2.0)) == {0.26, 0.24}
    boat.send(mav.MAVLink_request_data_stream_message(1, 1, mav.MAV_DATA_STREAM_ALL, 4, 0))
    boat.run(0.02)
    assert {m.get_type() for _, m in boat.run(3.0)} == {"HEARTBEAT"}
    boat.send(mav.MAVLink_request_data_stream_message(1, 1, mav.MAV_DATA_STREAM_ALL, 100, 1))  # cut to 40 Hz
    boat.run(0.02)
    log = boat.run(1.0)
    assert len(of(log, "ATTITUDE")) == len(of(log, "SERVO_OUTPUT_RAW")) == 40
    assert of(boat.log, "COMMAND_ACK") == []


def test_request_message_answers_the_asker_after_the_ack() -> None:
    boat = Boat().ready()
    boat.peers.clear()
    assert boat.command(mav.MAV_CMD_REQUEST_MESSAGE, 148, peer="ground") == ACCEPTED
    kinds = [m.get_type() for _, m in boat.log]
    assert kinds == ["COMMAND_ACK", "AUTOPILOT_VERSION"]
    assert boat.peers == ["ground", "ground"]
    version = boat.log[1][1]
    assert version.flight_sw_version == 0x040603FF
    assert version.capabilities & mav.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    assert boat.command(mav.MAV_CMD_REQUEST_MESSAGE, 331) == FAILED
    assert boat.command(mav.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 1) == ACCEPTED
    assert len(of(boat.log, "AUTOPILOT_VERSION")) == 2


# --- commands and addresses ---------------------------------------------------------------------------------


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


# --- modes --------------------------------------------------------------------------------------------------


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


# --- arming -------------------------------------------------------------------------------------------------


def test_arming_is_refused_until_ready_with_the_reason() -> None:
    boat = Boat()
    boat.run(1.5)
    assert boat.arm() == FAILED
    assert boat.texts()[-1] == "Arm: Need Position Estimate"
    boat.run(2.0)
    assert boat.arm() == ACCEPTED


def test_arming_is_refused_while_the_sticks_are_not_neutral() -> None:
    boat = Boat().ready()
    boat.seat.set_sticks({3: 1510})
    assert boat.arm() == FAILED and boat.texts() == ["Arm: Throttle (RC3) is not neutral"]
    boat.seat.set_sticks({3: 1500, 1: 1499})
    assert boat.arm() == FAILED and boat.texts()[-1] == "Arm: Roll (RC1) is not neutral"
    boat.seat.set_sticks({1: 1500})
    boat.override(1600, 1500)  # an override counts as the stick
    boat.run(0.02)
    assert boat.arm() == FAILED
    boat.override(1500, 1500)
    boat.run(0.02)
    assert boat.arm() == ACCEPTED


def test_sticks_within_the_dead_zone_are_neutral() -> None:
    boat = Boat("plant.frontseat.rc1_dz_us=30", "plant.frontseat.rc3_dz_us=30").ready()
    boat.seat.set_sticks({1: 1530, 3: 1470})
    assert boat.arm() == ACCEPTED


@pytest.mark.parametrize("magic", [21196.0, 2989.0])
def test_forced_arming_skips_all_checks(magic: float) -> None:
    boat = Boat(NO_RECEIVER, "plant.frontseat.ready_after_s=60")
    boat.run(1.5)
    assert boat.arm(force=1.0) == FAILED
    assert boat.arm(force=magic) == ACCEPTED


def test_arming_by_any_value_but_0_or_1_is_unsupported() -> None:
    assert Boat().ready().command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 2) == UNSUPPORTED


def test_without_a_receiver_arming_waits_for_2_s_of_overrides() -> None:
    boat = Boat(NO_RECEIVER).ready()
    assert boat.arm() == FAILED and boat.texts()[-1] == "Arm: Radio failsafe on"
    boat.hold(1500, 1500, 1.6, rate_hz=5.0)
    assert boat.arm() == FAILED
    boat.hold(1500, 1500, 0.6, rate_hz=5.0)
    assert boat.arm() == ACCEPTED


def test_it_says_what_fails_twice_a_minute_and_when_it_is_asked() -> None:
    boat = Boat(NO_RECEIVER).ready()
    assert boat.command(mav.MAV_CMD_RUN_PREARM_CHECKS) == ACCEPTED
    assert boat.texts() == ["PreArm: Radio failsafe on"]
    boat.log.clear()
    boat.run(60.0)
    assert boat.texts() == ["PreArm: Radio failsafe on"] * 2
    boat.hold(1500, 1500, 3.0)
    boat.log.clear()
    assert boat.command(mav.MAV_CMD_RUN_PREARM_CHECKS) == ACCEPTED and boat.texts() == []
    assert boat.arm() == ACCEPTED
    assert boat.command(mav.MAV_CMD_RUN_PREARM_CHECKS) == TEMPORARILY_REJECTED


def sensors(boat: Boat, seconds: float = 1.1) -> tuple[str, str]:
    """(receiver, checks before arming) by the last SYS_STATUS: "" where not present, else bad or good."""
    told = of(boat.run(seconds), "SYS_STATUS")[-1]

    def bit(which: int) -> str:
        if not told.onboard_control_sensors_enabled & which:
            return ""
        return "good" if told.onboard_control_sensors_health & which else "bad"

    return bit(mav.MAV_SYS_STATUS_SENSOR_RC_RECEIVER), bit(mav.MAV_SYS_STATUS_PREARM_CHECK)


def channels(boat: Boat) -> int:
    return int(of(boat.run(1.1), "RC_CHANNELS")[-1].chancount)


def test_sys_status_without_a_receiver_takes_overrides_for_one() -> None:
    boat = Boat(NO_RECEIVER).ready()
    assert sensors(boat) == ("", "bad") and channels(boat) == 0
    boat.hold(1500, 1500, 3.0)
    told = of(boat.log, "SYS_STATUS")[-1]
    assert told.onboard_control_sensors_health & mav.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
    assert channels(boat) == 0
    assert sensors(boat) == ("bad", "bad")


def test_sys_status_of_a_lost_receiver_whose_channels_stay() -> None:
    boat = Boat().ready()
    assert sensors(boat) == ("good", "good") and channels(boat) == 8
    boat.seat.set_receiver(False)
    assert sensors(boat, 2.1) == ("bad", "bad") and channels(boat) == 8


def test_a_receiver_that_is_lost_while_overrides_flow_raises_no_fail_safe() -> None:
    boat = Boat().armed()
    boat.hold(1600, 1420, 1.0, rate_hz=20)
    boat.seat.set_receiver(False)
    boat.hold(1600, 1420, 8.0, rate_hz=20)
    assert boat.outputs() == (1600, 1420) and "Radio Failsafe" not in boat.texts()
    told = of(boat.log, "SYS_STATUS")[-1]
    assert told.onboard_control_sensors_health & mav.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
    boat.run(0.55)
    assert boat.outputs() == (1500, 1500)
    boat.run(2.0)
    assert boat.texts()[-1] == "Radio Failsafe"


@pytest.mark.parametrize(
    ("functions", "said"),
    [
        ({1: 0, 3: 0}, "PreArm: no motor, sail or scripting outputs defined"),
        ({1: 0, 3: 74}, "PreArm: check skid steering config"),
        ({1: 0, 3: 0, 5: 26}, "PreArm: check steering and throttle config"),
        ({1: 0, 3: 0, 5: 94}, ""),
    ],
)
def test_outputs_without_motors_do_not_arm(functions: dict[int, int], said: str) -> None:
    values = ", ".join(f"SERVO{n}_FUNCTION: {value}" for n, value in functions.items())
    boat = Boat(f"plant.frontseat.parameters={{{values}}}").ready()
    assert boat.arm() == (FAILED if said else ACCEPTED)
    assert boat.texts() == [said or "Throttle armed"]


@pytest.mark.parametrize(
    ("rudder", "port_us", "starboard_us", "armed"),
    [
        (2, 2000, 1500, True),
        (1, 2000, 1500, True),
        (0, 2000, 1500, False),
        (2, 1900, 1500, False),
        (2, 2000, 1510, False),
    ],
)
def test_the_port_stick_held_full_ahead_arms_and_drives_its_motor(
    rudder: int, port_us: int, starboard_us: int, armed: bool
) -> None:
    boat = Boat(f"plant.frontseat.parameters={{ARMING_RUDDER: {rudder}}}").ready()
    boat.seat.set_sticks({1: port_us, 3: starboard_us})
    boat.run(1.9)
    assert boat.outputs() == (1500, 1500)
    boat.run(0.3)
    assert boat.outputs() == ((2000, 1500) if armed else (1500, 1500))


def test_a_yaw_stick_out_of_neutral_refuses_too() -> None:
    boat = Boat().ready()
    boat.seat.set_sticks({4: 1600, 3: 1700})
    assert boat.arm() == FAILED
    assert boat.texts() == ["Arm: Yaw (RC4) is not neutral", "Arm: Throttle (RC3) is not neutral"]


def test_fs_thr_enable_0_is_blind_to_a_loss_and_keeps_one_that_was_found() -> None:
    boat = Boat(NO_RECEIVER, "plant.frontseat.parameters={FS_THR_ENABLE: 0}").ready()
    assert boat.arm() == ACCEPTED  # without any radio
    assert boat.outputs() == (1000, 1000)  # measured: sticks that were never heard are full astern
    boat = Boat(NO_RECEIVER).ready()
    set_parameter(boat, "FS_THR_ENABLE", 0.0)
    boat.hold(1500, 1500, 3.0)
    boat.log.clear()
    assert boat.arm() == FAILED and boat.texts() == ["Arm: Radio failsafe on"]  # until it is restarted


def test_without_a_receiver_a_pause_in_the_overrides_starts_the_2_s_again() -> None:
    boat = Boat(NO_RECEIVER).ready()
    boat.hold(1500, 1500, 1.6)
    boat.run(0.6)
    boat.hold(1500, 1500, 1.0)
    assert boat.arm() == FAILED


# --- overrides and motors -----------------------------------------------------------------------------------


def test_in_manual_armed_the_outputs_follow_the_overrides_one_to_one() -> None:
    boat = Boat().armed()
    for port_us, starboard_us in ((1600, 1425), (1900, 1100), (1501, 1499), (1000, 2000), (1500, 1500)):
        boat.override(port_us, starboard_us)
        assert boat.outputs() == (port_us, starboard_us)
    assert boat.plant.truth.outputs_us == (1500, 1500)


def test_overrides_beyond_the_travel_are_cut() -> None:
    boat = Boat().armed()
    boat.override(2200, 950)
    assert boat.outputs() == (2000, 1000)


def test_a_throttle_stick_below_fs_thr_value_is_a_lost_transmitter_though_it_is_overridden() -> None:
    boat = Boat("plant.frontseat.parameters={FS_THR_VALUE: 1100}").armed()
    boat.hold(1300, 1100, 3.0)
    assert boat.outputs() == (1300, 1100)
    boat.override(1300, 1099)
    assert boat.outputs() == (1500, 1500) and boat.seat.rover.mode == MANUAL
    boat.hold(1300, 1099, 2.5)
    assert boat.seat.rover.mode == HOLD


def test_disarmed_or_in_hold_the_outputs_are_neutral() -> None:
    boat = Boat().ready()
    boat.override(1700, 1700)
    assert boat.outputs() == (1500, 1500)
    boat = Boat().armed()
    boat.hold(1700, 1700, 0.5)
    assert boat.outputs() == (1700, 1700)
    boat.mode(HOLD)
    assert boat.outputs() == (1500, 1500)
    boat.mode(MANUAL)
    boat.override(1700, 1700)
    assert boat.outputs() == (1700, 1700)
    boat.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0)
    assert boat.outputs() == (1500, 1500)


@pytest.mark.parametrize(("override_us", "output_us"), [(1520, 1500), (1600, 1574), (1470, 1500), (2000, 2000)])
def test_a_dead_zone_of_30_bends_the_command(override_us: int, output_us: int) -> None:
    boat = Boat("plant.frontseat.rc1_dz_us=30", "plant.frontseat.rc3_dz_us=30").armed()
    boat.override(override_us, override_us)
    assert boat.outputs() == (output_us, output_us)


def test_rc_channels_report_the_override_and_servo_output_the_motors() -> None:
    boat = Boat().armed()
    boat.interval(RC_CHANNELS, 100_000)
    boat.interval(SERVO_OUTPUT_RAW, 100_000)
    boat.override(1650, 1375)
    log = boat.run(0.3)
    channels, outputs = of(log, "RC_CHANNELS")[-1], of(log, "SERVO_OUTPUT_RAW")[-1]
    assert (channels.chan1_raw, channels.chan2_raw, channels.chan3_raw, channels.chan4_raw) == (1650, 1500, 1375, 1500)
    assert (channels.chancount, channels.chan5_raw, channels.chan6_raw) == (8, 1800, 1000)
    assert (outputs.servo1_raw, outputs.servo2_raw, outputs.servo3_raw) == (1650, 0, 1375)


def test_overrides_from_another_system_than_sysid_mygcs_are_dropped_without_a_word() -> None:
    boat = Boat().armed()
    boat.run(0.02)
    boat.override(1700, 1700, system=255)
    assert boat.run(0.04) == []
    assert boat.outputs() == (1500, 1500)
    boat = Boat("plant.frontseat.mygcs_system_id=255").armed()
    boat.override(1700, 1700)
    assert boat.outputs() == (1500, 1500)
    boat.override(1700, 1700, system=255)
    assert boat.outputs() == (1700, 1700)


@pytest.mark.parametrize(("high", "obeyed"), [(0, {254}), (253, {254}), (255, {254, 255})])
def test_since_4_7_a_range_of_systems_may_override(high: int, obeyed: set[int]) -> None:
    firmware = ("plant.frontseat.firmware='4.7'", f"plant.frontseat.parameters={{MAV_GCS_SYSID_HI: {high}}}")
    boat = Boat("plant.frontseat.mygcs_system_id=254", *firmware).armed()
    for system in (1, 253, 254, 255):
        boat.override(1500, 1500, system=254)
        boat.outputs()
        boat.override(1700, 1700, system=system)
        assert (boat.outputs() == (1700, 1700)) is (system in obeyed), system


def test_an_override_that_is_released_in_the_same_loop_is_not_seen() -> None:
    """Without a receiver a channel goes on with what it was last read with."""
    boat = Boat(NO_RECEIVER, "plant.frontseat.parameters={FS_THR_ENABLE: 0}").armed()
    boat.mode(MANUAL)
    boat.override(1700, 1700)
    assert boat.outputs() == (1700, 1700)
    boat.override(1500, 1500)
    boat.override(0, 0)
    assert boat.outputs() == (1700, 1700)
    boat.override(1500, 1500)
    boat.run(0.02)
    boat.override(0, 0)
    assert boat.outputs() == (1500, 1500)


def test_0_releases_a_channel_and_65535_leaves_it_alone() -> None:
    boat = Boat().armed()
    boat.override(1700, 1600)
    assert boat.outputs() == (1700, 1600)
    boat.override(65535, 1650)
    assert boat.outputs() == (1700, 1650)
    boat.override(0, 65535)
    assert boat.outputs() == (1500, 1650)
    boat.seat.set_sticks({1: 1550, 3: 1550})
    assert boat.outputs() == (1550, 1650)


def test_channels_above_8_take_0_as_ignore_and_65534_as_release() -> None:
    boat = Boat().ready()
    boat.seat.set_sticks({9: 1234})

    def override(ninth: int) -> int:
        boat.send(mav.MAVLink_rc_channels_override_message(1, 1, *[65535] * 8, chan9_raw=ninth))
        boat.run(0.02)
        return boat.seat.rover.rc.radio_us[8]

    assert [override(v) for v in (1700, 0, 65535, 65534)] == [1700, 1700, 1700, 1234]


def test_target_system_0_is_taken_and_another_is_not() -> None:
    boat = Boat().armed()
    boat.send(mav.MAVLink_rc_channels_override_message(0, 0, 1600, *[65535] * 7))
    assert boat.outputs() == (1600, 1500)
    boat.send(mav.MAVLink_rc_channels_override_message(7, 1, 1700, *[65535] * 7))
    assert boat.outputs() == (1600, 1500)


def test_manual_control_moves_the_motor_channels() -> None:
    boat = Boat().armed()
    boat.send(mav.MAVLink_manual_control_message(1, 32767, 500, -200, 32767, 0))
    assert boat.outputs() == (1750, 1400)
    boat.send(mav.MAVLink_manual_control_message(1, 0, -2000, 32767, 0, 0))
    assert boat.outputs() == (1000, 1500)  # an axis without a value gives its channel back
    for target in (0, 2):
        boat.send(mav.MAVLink_manual_control_message(target, 0, 500, 500, 0, 0))
        assert boat.outputs() == (1000, 1500), "only its own number is meant"


def test_sticks_of_the_ground_station_count_as_its_heartbeat() -> None:
    boat = Boat("plant.frontseat.parameters={FS_GCS_ENABLE: 1}").armed()
    boat.send(mav.MAVLink_manual_control_message(1, 0, 0, 0, 0, 0))
    boat.run(6.0)
    assert boat.seat.rover.mode == MANUAL
    boat.run(1.0)
    assert boat.seat.rover.mode == HOLD


# --- overrides that stop ------------------------------------------------------------------------------------


def test_with_a_receiver_stopped_overrides_go_back_to_the_sticks_after_2_9_s_in_manual() -> None:
    boat = Boat().armed()
    boat.seat.set_sticks({1: 1520, 3: 1530})
    boat.override(1700, 1700)
    boat.run(2.86)
    assert boat.seat.outputs_us == (1700, 1700)
    boat.run(0.08)
    assert boat.seat.outputs_us == (1520, 1530)
    boat.run(5.0)
    beat = of(boat.log, "HEARTBEAT")[-1]
    assert (beat.base_mode, beat.custom_mode, beat.system_status) == (193, MANUAL, 4)


def test_without_a_receiver_stopped_overrides_give_neutral_then_hold() -> None:
    boat = Boat(NO_RECEIVER).ready()
    boat.mode(MANUAL)
    boat.hold(1500, 1500, 2.2)
    assert boat.arm() == ACCEPTED
    boat.log.clear()
    boat.override(1700, 1700)
    stop_s = boat.t_ns / 1e9
    boat.run(0.46)
    assert boat.seat.outputs_us == (1700, 1700)
    boat.run(0.08)
    assert boat.seat.outputs_us == (1500, 1500)
    log = boat.run(1.5)
    (failsafe_s,) = times(log, "STATUSTEXT")
    assert failsafe_s - stop_s == pytest.approx(1.9, abs=0.03)
    assert boat.texts() == ["Radio Failsafe"]
    beat = of(log, "HEARTBEAT")[-1]
    assert (beat.base_mode, beat.custom_mode, beat.system_status) == (129, HOLD, 5)
    # Overrides come back: still HOLD, until MANUAL is commanded.
    boat.hold(1700, 1700, 1.0)
    assert boat.texts()[-1] == "Radio Failsafe Cleared"
    assert boat.outputs() == (1500, 1500)
    assert boat.mode(MANUAL) == ACCEPTED
    assert boat.outputs() == (1700, 1700)


def test_without_a_receiver_the_third_missed_override_at_5_hz_is_neutral_and_10_hz_is_steady() -> None:
    boat = Boat(NO_RECEIVER).ready()
    boat.mode(MANUAL)
    boat.hold(1500, 1500, 2.2)
    boat.arm()
    boat.hold(1600, 1600, 3.0, rate_hz=5.0)
    assert boat.seat.outputs_us == (1600, 1600)
    boat.run(0.4)
    assert boat.seat.outputs_us == (1500, 1500)


def test_without_a_receiver_the_boat_falls_into_hold_soon_after_boot() -> None:
    boat = Boat(NO_RECEIVER)
    log = boat.run(4.0)
    assert [m.custom_mode for m in of(log, "HEARTBEAT")] == [0, 0, 4, 4, 4]
    assert [t for t, m in log if m.get_type() == "STATUSTEXT" and m.text == "Radio Failsafe"] == [2.9]


def test_a_receiver_that_is_lost_and_found() -> None:
    boat = Boat().armed()
    boat.seat.set_sticks({1: 1600, 3: 1600})
    assert boat.outputs() == (1600, 1600)
    boat.seat.set_receiver(False)
    boat.run(0.4)
    assert boat.seat.outputs_us == (1600, 1600)
    boat.run(0.2)
    assert boat.seat.outputs_us == (1500, 1500)
    boat.run(1.5)
    assert boat.texts()[-1] == "Radio Failsafe"
    boat.seat.set_sticks({1: 1550, 3: 1550})
    boat.seat.set_receiver(True)
    boat.run(0.04)
    assert boat.texts()[-1] == "Radio Failsafe Cleared"
    boat.mode(MANUAL)
    assert boat.outputs() == (1550, 1550)


# --- parameters ---------------------------------------------------------------------------------------------


def set_parameter(boat: Boat, name: str, value: float) -> float | None:
    boat.send(mav.MAVLink_param_set_message(1, 1, name.encode(), value, 9))
    values = of(boat.run(0.04), "PARAM_VALUE")
    assert all(m.param_id == name for m in values)
    return values[-1].param_value if values else None


def test_parameters_are_read_by_name_and_by_index() -> None:
    boat = Boat().ready()
    boat.send(mav.MAVLink_param_request_read_message(1, 1, b"SYSID_MYGCS", -1))
    boat.send(mav.MAVLink_param_request_read_message(1, 1, b"", 2))
    boat.send(mav.MAVLink_param_request_read_message(1, 1, b"NO_SUCH", -1))
    boat.send(mav.MAVLink_param_request_read_message(1, 1, b"", 1000))
    first, second = of(boat.run(0.02), "PARAM_VALUE")
    assert (first.param_id, first.param_value, first.param_index) == ("SYSID_MYGCS", 1.0, 1)
    assert (second.param_id, second.param_value, second.param_index) == ("ARMING_CHECK", 1.0, 2)


def test_the_list_of_parameters_is_complete() -> None:
    boat = Boat().ready()
    boat.send(mav.MAVLink_param_request_list_message(1, 1))
    found = of(boat.run(0.02), "PARAM_VALUE")
    assert [m.param_index for m in found] == list(range(found[0].param_count))
    values = {m.param_id: m.param_value for m in found}
    assert values["RC1_DZ"] == values["RC3_DZ"] == values["MOT_SLEWRATE"] == 0.0
    assert (values["SERVO1_FUNCTION"], values["SERVO3_FUNCTION"]) == (73.0, 74.0)
    assert values["RC_OVERRIDE_TIME"] == pytest.approx(2.9)


def test_sysid_mygcs_takes_effect_at_once() -> None:
    boat = Boat().armed()
    assert set_parameter(boat, "SYSID_MYGCS", 255.0) == 255.0
    boat.override(1700, 1700)
    assert boat.outputs() == (1500, 1500)
    boat.override(1700, 1700, system=255)
    assert boat.outputs() == (1700, 1700)


def test_dead_zone_parameters_take_effect_and_are_whole_numbers() -> None:
    boat = Boat().armed()
    assert set_parameter(boat, "RC1_DZ", 29.6) == 30.0
    boat.override(1600, 1600)
    assert boat.outputs() == (1574, 1600)


def test_override_time_parameter() -> None:
    boat = Boat().armed()
    assert set_parameter(boat, "RC_OVERRIDE_TIME", 1.0) == 1.0
    boat.override(1700, 1700)
    boat.run(0.9)
    assert boat.seat.outputs_us == (1700, 1700)
    boat.run(0.2)
    assert boat.seat.outputs_us == (1500, 1500)
    set_parameter(boat, "RC_OVERRIDE_TIME", -1.0)
    boat.override(1700, 1700)
    boat.run(60.0)
    assert boat.seat.outputs_us == (1700, 1700)
    set_parameter(boat, "RC_OVERRIDE_TIME", 0.0)
    boat.override(1700, 1700)
    assert boat.outputs() == (1500, 1500)


def test_rc_options_can_ignore_overrides() -> None:
    boat = Boat().armed()
    boat.override(1700, 1700)
    assert boat.outputs() == (1700, 1700)
    set_parameter(boat, "RC_OPTIONS", 34.0)
    assert boat.outputs() == (1500, 1500)
    boat.override(1700, 1700)
    assert boat.outputs() == (1500, 1500)


def test_steering_mix_flips_going_astern_with_pilot_steer_type_0() -> None:
    boat = Boat().armed()
    set_parameter(boat, "PILOT_STEER_TYPE", 0.0)
    boat.override(1600, 1700)  # steering 0.2, throttle 0.4
    assert boat.outputs() == (1800, 1600)
    boat.override(1600, 1300)
    assert boat.outputs() == (1200, 1400)
    boat.override(2000, 2000)  # more than the motors have: the ratio is kept
    assert boat.outputs() == (2000, 1500)


def test_slew_rate_slows_the_throttle_but_not_the_steering() -> None:
    boat = Boat().armed()
    set_parameter(boat, "MOT_SLEWRATE", 100.0)  # percent per second: 500 us per second, 10 us per loop
    boat.override(1700, 1700)
    assert boat.outputs() == (1510, 1510)
    boat.run(0.3)
    assert boat.seat.outputs_us == (1660, 1660)
    boat.override(1700, 1500)
    assert boat.outputs() == (1750, 1550)


def test_fs_thr_enable_0_takes_the_fail_safe_away() -> None:
    boat = Boat(NO_RECEIVER).ready()
    boat.mode(MANUAL)
    boat.hold(1500, 1500, 2.2)
    boat.arm()
    set_parameter(boat, "FS_THR_ENABLE", 0.0)
    boat.override(1700, 1700)
    boat.run(10.0)
    assert boat.seat.outputs_us == (1700, 1700)


def test_parameters_that_are_not_modelled_keep_their_value_and_the_others_their_range() -> None:
    boat = Boat().ready()
    assert set_parameter(boat, "FRAME_CLASS", 1.0) == 2.0
    assert set_parameter(boat, "RC1_DZ", math.nan) == 0.0
    assert set_parameter(boat, "RC1_DZ", 500.0) == 200.0  # the end of its range
    assert set_parameter(boat, "NO_SUCH", 1.0) is None


def test_a_changed_parameter_is_told_to_everybody_without_its_index() -> None:
    boat = Boat().ready()
    boat.peers.clear()
    boat.send(mav.MAVLink_param_set_message(1, 1, b"RC1_DZ", 20.0, 4), **GCS)
    (told,) = of(boat.run(0.02), "PARAM_VALUE")
    assert (told.param_id, told.param_value, told.param_index) == ("RC1_DZ", 20.0, 65535)
    assert boat.peers == [""]


def test_newer_firmware_has_other_names_and_says_which_it_is() -> None:
    boat = Boat("plant.frontseat.firmware='4.7'", "plant.frontseat.mygcs_system_id=255").armed()
    boat.override(1700, 1700)
    assert boat.outputs() == (1500, 1500)
    assert set_parameter(boat, "SYSID_MYGCS", 1.0) is None
    assert set_parameter(boat, "MAV_GCS_SYSID", 1.0) == 1.0
    boat.override(1700, 1700)
    assert boat.outputs() == (1700, 1700)
    boat.command(mav.MAV_CMD_REQUEST_MESSAGE, 148)
    assert of(boat.log, "AUTOPILOT_VERSION")[0].flight_sw_version >> 16 == 0x0407


def test_parameters_come_from_the_config_and_unknown_ones_are_named() -> None:
    assert Boat("plant.frontseat.parameters={MOT_SLEWRATE: 100}").seat.rover.parameters["MOT_SLEWRATE"] == 100.0
    with pytest.raises(ConfigError, match=r"plant\.frontseat\.parameters: .* no MOT_SLEWRAT$"):
        Boat("plant.frontseat.parameters={MOT_SLEWRAT: 100}")


@pytest.mark.parametrize(
    ("changes", "outputs"),
    [
        ({"SERVO1_FUNCTION": 74, "SERVO3_FUNCTION": 73}, (1400, 1700)),
        ({"SERVO1_REVERSED": 1}, (1300, 1400)),
        ({"SERVO3_REVERSED": 1}, (1700, 1600)),
        ({"RC1_REVERSED": 1}, (1300, 1400)),
        ({"SERVO1_MIN": 1100, "SERVO1_MAX": 1900}, (1660, 1400)),  # 0.8 of the stick's travel
        ({"SERVO3_TRIM": 1480}, (1700, 1384)),
        ({"RC1_TRIM": 1520}, (1687, 1400)),
        ({"MOT_THR_MIN": 10}, (1730, 1360)),
        ({"MOT_THST_EXPO": 0.5}, (1762, 1347)),
        ({"MOT_THST_ASYM": 2}, (1700, 1300)),
        ({"MOT_THR_MAX": 5}, (1675, 1375)),
        ({"MANUAL_STR_EXPO": 0.5}, (1638, 1462)),
        ({"RCMAP_ROLL": 3, "RCMAP_THROTTLE": 1}, (1400, 1700)),
        ({"SERVO1_FUNCTION": 0, "SERVO6_FUNCTION": 73}, (1500, 1400)),
    ],
)
def test_outputs_under_parameters_that_change_them(changes: dict[str, float], outputs: tuple[int, int]) -> None:
    boat = Boat().armed()
    for name, value in changes.items():
        assert set_parameter(boat, name, value) == pytest.approx(value)
    boat.override(1700, 1400)
    assert boat.outputs() == outputs


def test_an_output_that_loses_its_function_keeps_its_pulse_until_power_off() -> None:
    boat = Boat().armed()
    boat.override(1700, 1400)
    assert boat.outputs() == (1700, 1400)
    set_parameter(boat, "SERVO1_FUNCTION", 0.0)
    boat.override(1600, 1450)
    assert boat.outputs() == (1700, 1450)
    assert boat.command(mav.MAV_CMD_DO_SET_SERVO, 1, 1550) == ACCEPTED
    assert boat.command(mav.MAV_CMD_DO_SET_SERVO, 3, 1550) == FAILED
    boat.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0)
    assert boat.outputs() == (1550, 1500)  # disarmed: the hazard of this command
    boat.command(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)
    boat.run(1.5)
    assert boat.outputs() == (0, 1500)


def test_the_safety_switch_keeps_the_motors_dead_until_it_is_pressed() -> None:
    boat = Boat("plant.frontseat.parameters={BRD_SAFETY_DEFLT: 1}").ready()
    assert boat.outputs() == (0, 0)
    assert boat.arm() == FAILED and boat.texts()[-1] == "Arm: Hardware safety switch"
    motors = mav.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    assert not of(boat.run(1.0), "SYS_STATUS")[-1].onboard_control_sensors_enabled & motors
    boat.seat.rover.press_safety_switch()
    assert boat.arm() == ACCEPTED and boat.outputs() == (1500, 1500)
    assert of(boat.run(1.0), "SYS_STATUS")[-1].onboard_control_sensors_enabled & motors


@pytest.mark.parametrize(("name", "value", "firmware"), [("ARMING_CHECK", 0, "4.6"), ("ARMING_SKIPCHK", -1, "4.7")])
def test_without_arming_checks_it_arms_with_sticks_away_from_neutral(name: str, value: int, firmware: str) -> None:
    boat = Boat(f"plant.frontseat.firmware='{firmware}'").ready()
    boat.seat.set_sticks({3: 1700})
    assert boat.arm() == FAILED
    set_parameter(boat, name, value)
    assert boat.arm() == ACCEPTED


@pytest.mark.parametrize(
    ("action", "mode", "armed"), [(0, 0, 1), (1, 11, 1), (2, 4, 1), (3, 12, 1), (4, 12, 1), (5, 0, 0)]
)
def test_what_a_fail_safe_does_is_fs_action(action: int, mode: int, armed: int) -> None:
    boat = Boat(f"plant.frontseat.parameters={{FS_ACTION: {action}}}").armed()
    boat.seat.set_receiver(False)
    boat.run(2.5)
    beat = of(boat.run(1.0), "HEARTBEAT")[-1]
    assert (beat.custom_mode, beat.base_mode >> 7) == (mode, armed)


def test_a_station_that_falls_silent_trips_the_gcs_fail_safe_where_it_is_enabled() -> None:
    heartbeat = mav.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
    boat = Boat("plant.frontseat.parameters={FS_GCS_ENABLE: 1, FS_GCS_TIMEOUT: 3}").armed()
    boat.run(20.0)  # no station was heard yet
    boat.send(heartbeat, system=7)
    boat.run(20.0)  # nor is this one ours
    assert "GCS Failsafe" not in boat.texts()
    boat.send(heartbeat)
    boat.run(4.4)
    assert "GCS Failsafe" not in boat.texts()
    boat.run(0.2)
    assert boat.texts()[-1] == "GCS Failsafe"
    assert of(boat.run(1.0), "HEARTBEAT")[-1].custom_mode == HOLD
    boat.send(heartbeat)
    boat.run(0.1)
    assert boat.texts()[-1] == "GCS Failsafe Cleared"
    boat = Boat().armed()
    boat.send(heartbeat)
    boat.run(60.0)
    assert "GCS Failsafe" not in boat.texts()


# --- contents -----------------------------------------------------------------------------------------------


def test_message_contents_agree_with_the_truth() -> None:
    boat = Boat("plant.start_heading_deg=-90", "plant.start_n_m=100", "plant.start_e_m=-50").ready()
    boat.seat.arm(True)
    boat.hold(1700, 1680, 8.0)
    for msg_id in (ATTITUDE, 31, 33, 32, GPS_RAW_INT, 74, 27, 26, 116, 105, SIM_STATE):
        boat.interval(msg_id, 100_000)
    boat.run(0.5)
    while boat.t_ns % 200_000_000:  # to the instant of a fix
        boat.run(0.02)
    log = dict((m.get_type(), m) for _, m in boat.run(0.2))
    truth = boat.plant.truth
    psi = truth.psi_rad
    vn = math.cos(psi) * truth.u_mps - math.sin(psi) * truth.v_mps
    ve = math.sin(psi) * truth.u_mps + math.cos(psi) * truth.v_mps
    assert truth.u_mps > 0.8 and abs(truth.r_radps) > 0.005  # something to see
    near = {"abs": 0.06}  # the messages are up to 0.1 s old
    attitude = log["ATTITUDE"]
    assert (attitude.yaw, attitude.yawspeed, attitude.roll) == (
        pytest.approx(psi, **near),
        pytest.approx(truth.r_radps, abs=0.01),
        0.0,
    )
    quaternion = log["ATTITUDE_QUATERNION"]
    assert 2.0 * math.atan2(quaternion.q4, quaternion.q1) == pytest.approx(psi, **near)
    position = log["GLOBAL_POSITION_INT"]
    n, e = boat.plant.origin.to_ned(position.lat * 1e-7, position.lon * 1e-7)
    assert (n, e) == pytest.approx((truth.n_m, truth.e_m), abs=0.2)
    assert (position.vx / 100, position.vy / 100) == pytest.approx((vn, ve), **near)
    assert position.hdg / 100 == pytest.approx(math.degrees(psi) % 360.0, abs=3.0)
    local = log["LOCAL_POSITION_NED"]
    assert (local.x, local.y, local.vx, local.vy) == pytest.approx((truth.n_m, truth.e_m, vn, ve), abs=0.2)
    gnss = log["GPS_RAW_INT"]
    assert boat.plant.origin.to_ned(gnss.lat * 1e-7, gnss.lon * 1e-7) == pytest.approx((n, e), abs=0.3)
    assert gnss.vel / 100 == pytest.approx(math.hypot(vn, ve), **near)
    assert gnss.cog / 100 == pytest.approx(math.degrees(math.atan2(ve, vn)) % 360.0, abs=4.0)
    hud = log["VFR_HUD"]
    assert hud.groundspeed == pytest.approx(math.hypot(vn, ve), **near)
    assert hud.heading == pytest.approx(math.degrees(psi) % 360.0, abs=4.0)
    sim = log["SIM_STATE"]
    assert (sim.yaw, sim.zgyro, sim.vn, sim.ve) == pytest.approx((psi, truth.r_radps, vn, ve), **near)
    assert boat.plant.origin.to_ned(sim.lat_int * 1e-7, sim.lon_int * 1e-7) == pytest.approx((n, e), abs=0.2)
    for name in ("RAW_IMU", "SCALED_IMU", "SCALED_IMU2"):
        assert log[name].zgyro == pytest.approx(1000.0 * truth.r_radps, abs=10)
        assert log[name].zacc == -1000
    # 0.1 g is 0.980665 m/s^2: the raw messages count in thousandths of g
    assert log["RAW_IMU"].xacc == pytest.approx(log["HIGHRES_IMU"].xacc / 9.80665e-3, abs=2)


def test_garbage_between_frames_costs_nothing_and_peers_do_not_mix() -> None:
    boat = Boat().ready()
    command = mav.MAVLink_command_long_message(1, 1, 176, 0, 1, HOLD, 0, 0, 0, 0, 0)
    data = command.pack(mav.MAVLink(None, srcSystem=255, srcComponent=190))
    for peer, part in (
        ("a", b"\xfd\x09garbage"),
        ("b", b"\xfe" * 300),
        ("", data[:7]),
        ("a", data[:20]),
        ("", data[7:]),
    ):
        boat.plant.receive(Frame(t_ns=boat.t_ns, port="autopilot", data=part, peer=peer))
    assert [m.result for m in of(boat.run(0.02), "COMMAND_ACK")] == [ACCEPTED]


@pytest.mark.parametrize(
    ("firmware", "expected", "absent"),
    [
        ("4.6", {"SYSID_MYGCS": 255, "FS_ACTION": 4, "ARMING_CHECK": 4124, "SYSID_ENFORCE": 0}, "MAV_GCS_SYSID"),
        ("4.7", {"MAV_GCS_SYSID": 255, "MAV_GCS_SYSID_HI": 0, "FS_ACTION": 6, "MOT_REV_DELAY": 0}, "SYSID_MYGCS"),
    ],
)
def test_a_blueboat_has_its_makers_parameters(firmware: str, expected: dict[str, float], absent: str) -> None:
    """And a parameter of the config goes before them."""
    given = f"plant.frontseat.firmware='{firmware}'", "plant.frontseat.parameters={MOT_SLEWRATE: 100}"
    parameters = Boat("plant.frontseat.delivered=blueboat", *given).seat.rover.parameters
    common = {
        **{"SERVO1_FUNCTION": 74, "SERVO3_FUNCTION": 73, "SERVO3_REVERSED": 1, "SERVO1_TRIM": 1510, "RC1_MAX": 1901},
        **{"RC3_DZ": 30, "PILOT_STEER_TYPE": 3, "MOT_THST_ASYM": 1.6, "RC_OPTIONS": 37, "FS_THR_ENABLE": 0},
        **{"WNDVN_TYPE": 4, "MOT_SLEWRATE": 100},
    }
    found = {name: parameters[name] for name in (*common, *expected)}
    assert found == pytest.approx({**common, **expected})
    assert absent not in parameters.names
