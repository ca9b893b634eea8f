"""Rules of the script on the autopilot about sessions: what starts one, what ends it for good, and its outputs."""

from __future__ import annotations

from asvhil.autopilot.script_protocol import Order, ScriptReason
from asvhil.io.mavlink.frames import dialect as mav
from tests.support.autopilot_script import HOLD, MANUAL, NEUTRAL, ScriptBoat, order_frame
from tests.support.script_orders import HELD, OTHER


def starts_by_the_number_told_alone(text: str) -> None:
    boat = ScriptBoat(text).armed()
    for wrong in (-1, 1, 1000):
        boat.start(start=(boat.state.start + wrong) % 65536)
        assert boat.motors == NEUTRAL, wrong
    boat.start()
    assert boat.motors == HELD


def a_start_counts_once(text: str) -> None:
    boat = ScriptBoat(text).armed()
    first = boat.state.start
    boat.start()
    boat.drive(HELD, order=Order.RELEASE)
    assert boat.motors == NEUTRAL
    boat.put(order_frame(Order.DRIVE, first, 1, HELD))
    boat.put(order_frame(Order.DRIVE, first, 1000, HELD))
    assert boat.motors == NEUTRAL
    boat.start()
    assert boat.motors == HELD


def a_start_while_disarmed_is_used_up(text: str) -> None:
    boat = ScriptBoat(text)
    boat.run(0.6)
    boat.start()
    assert boat.now == NEUTRAL
    for _ in range(10):
        boat.drive(HELD)
        assert boat.now == NEUTRAL
    assert boat.arm() == 0
    for _ in range(30):
        boat.drive(HELD)
        assert boat.motors == NEUTRAL
    boat.start()
    assert boat.motors == HELD


def a_release_is_no_start(text: str) -> None:
    boat = ScriptBoat(text).armed().start(order=Order.RELEASE)
    assert boat.motors == NEUTRAL
    boat.drive(HELD)  # which is
    assert boat.motors == HELD


def a_new_start_takes_over(text: str) -> None:
    boat = ScriptBoat(text).driving()
    boat.run(0.5)
    boat.start(OTHER, sender=(1, 192))
    assert boat.motors == OTHER
    boat.drive((1555, 1555))  # as before, by component 191
    assert boat.motors == OTHER


def ended(boat: ScriptBoat, reason: ScriptReason) -> None:
    """The motors are neutral within 0.1 s, and stay so whatever the session sends; a new start drives again."""
    boat.run(0.04)
    assert boat.motors == NEUTRAL
    assert boat.reason is reason
    boat.drive(OTHER)
    assert boat.motors == NEUTRAL


def latched(boat: ScriptBoat, reason: ScriptReason) -> None:
    for _ in range(40):
        boat.drive(OTHER)
        assert boat.motors == NEUTRAL
    assert boat.reason is reason
    boat.start(HELD)
    assert boat.motors == HELD


def ends_when_disarmed(text: str) -> None:
    boat = ScriptBoat(text).driving()
    assert boat.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0.0) == 0
    ended(boat, ScriptReason.DISARMED)
    assert boat.arm() == 0
    latched(boat, ScriptReason.DISARMED)


def ends_when_the_mode_changes(text: str) -> None:
    for mode in (MANUAL, 1, 3, 5, 10, 15):
        boat = ScriptBoat(text).driving()
        boat.stick(1500, 1500)
        boat.drive(HELD)
        assert boat.mode(mode) == 0
        ended(boat, ScriptReason.MODE)
        assert boat.mode(HOLD) == 0
        latched(boat, ScriptReason.MODE)


def ends_at_an_emergency_stop(text: str) -> None:
    boat = ScriptBoat(text).driving()
    boat.emergency_stop(True)
    ended(boat, ScriptReason.EMERGENCY_STOP)
    boat.emergency_stop(False)
    latched(boat, ScriptReason.EMERGENCY_STOP)


def stays_neutral_disarmed_with_the_emergency_stop(text: str) -> None:
    """Disarmed, the autopilot would let a script drive, emergency stop or not."""
    boat = ScriptBoat(text).driving()
    boat.emergency_stop(True)
    boat.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)
    boat.run(0.5)
    boat.start()
    assert boat.motors == NEUTRAL


def ends_when_the_pilot_moves_a_stick(text: str) -> None:
    for sticks in ((1600, 1500), (1400, 1500), (1500, 1600), (1500, 1400)):
        boat = ScriptBoat(text).driving()
        boat.stick(*sticks)
        ended(boat, ScriptReason.STICK)
        boat.stick(1500, 1500)
        latched(boat, ScriptReason.STICK)


def goes_on_while_sticks_rest(text: str) -> None:
    boat = ScriptBoat(text).driving()
    boat.stick(1555, 1445)
    boat.drive(OTHER)
    assert boat.motors == OTHER


def looks_at_the_sticks_that_drive(text: str) -> None:
    boat = ScriptBoat(text, RCMAP_ROLL=2, RCMAP_THROTTLE=5, RC5_TRIM=1600).armed()
    boat.seat.rover.rc.radio_us[:5] = [1900, 1500, 1900, 1500, 1600]
    boat.start()
    assert boat.motors == HELD
    boat.seat.rover.rc.radio_us[4] = 1500
    ended(boat, ScriptReason.STICK)


def a_stick_forbids_a_start(text: str) -> None:
    boat = ScriptBoat(text).armed()
    boat.stick(1500, 1700)
    boat.start()
    assert boat.motors == NEUTRAL
    assert boat.reason is ScriptReason.STICK


def wants_each_function_on_one_output(text: str) -> None:
    for wrong in ({"SERVO5_FUNCTION": 73}, {"SERVO7_FUNCTION": 74}):
        boat = ScriptBoat(text, **wrong).armed().start()
        assert boat.motors == NEUTRAL, wrong
        assert boat.reason is ScriptReason.OUTPUTS


def wants_both_functions(text: str) -> None:
    for output in (1, 3):
        boat = ScriptBoat(text, **{f"SERVO{output}_FUNCTION": 0, "ARMING_CHECK": 0}).armed().start()
        assert boat.reason is ScriptReason.OUTPUTS, output


def sees_outputs_that_are_set_right(text: str) -> None:
    boat = ScriptBoat(text, SERVO5_FUNCTION=73).armed()
    assert boat.reason is ScriptReason.OUTPUTS
    boat.send(mav.MAVLink_param_set_message(1, 1, b"SERVO5_FUNCTION", 0.0, 4))
    boat.run(1.1)
    boat.start()
    assert boat.motors == HELD


def knows_the_system_id_by_its_name_of_4_7(text: str) -> None:
    boat = ScriptBoat(text, "plant.frontseat.firmware='4.7'").armed().start()
    assert boat.motors == HELD
