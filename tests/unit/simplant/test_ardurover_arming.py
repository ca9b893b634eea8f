"""The simulated ArduRover's arming and its checks, against the measured behaviour of a real one."""

from __future__ import annotations

import pytest

from asvhil.io.mavlink.frames import dialect as mav
from tests.support.ardurover import ACCEPTED, FAILED, NO_RECEIVER, TEMPORARILY_REJECTED, UNSUPPORTED, set_parameter
from tests.support.simplant_boat import Boat, of


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
