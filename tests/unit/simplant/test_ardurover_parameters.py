"""Parameters of the simulated ArduRover and their effects, against the measured behaviour of a real one."""

from __future__ import annotations

import math

import pytest

from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import dialect as mav
from tests.support.ardurover import ACCEPTED, FAILED, GCS, HOLD, MANUAL, NO_RECEIVER, set_parameter
from tests.support.simplant_boat import Boat, of


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
