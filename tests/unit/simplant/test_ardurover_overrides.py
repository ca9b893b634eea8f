"""Overrides of the simulated ArduRover, and what follows when they stop, as measured with a real one."""

from __future__ import annotations

import pytest

from asvhil.io.mavlink.frames import dialect as mav
from asvhil.simplant.vehicle.rc import IGNORE, RcInputs
from tests.support.ardurover import ACCEPTED, HOLD, MANUAL, NO_RECEIVER, RC_CHANNELS, SERVO_OUTPUT_RAW
from tests.support.simplant_boat import Boat, of, times

# --- overrides and motors ---------------------------------------------------------------------------------------------


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


# --- overrides that stop ----------------------------------------------------------------------------------------------


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


def test_each_override_ends_a_time_out_after_it_came() -> None:
    rc = RcInputs(receiver=True, t_ns=0)
    rc.override(1_000, [1600], 10_000)
    rc.override(3_000, [IGNORE, 1700], 10_000)
    rc.read()
    rc.expire(3_999, 3_000)
    assert rc.radio_us[:2] == [1600, 1700]
    rc.expire(4_000, 3_000)
    assert rc.radio_us[:2] == [1500, 1700]
    rc.override(5_000, [1650], 10_000)
    rc.read()
    rc.expire(6_000, 3_000)
    assert rc.radio_us[:2] == [1650, 1500]
    rc.expire(6_000, 1_000)  # a time-out that is shorter now
    assert rc.radio_us[:2] == [1500, 1500]
