"""The script on the autopilot, rule by rule, on the simulated ArduRover; and without each rule in turn."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest

from asvhil.autopilot.script_protocol import Order, ScriptReason
from asvhil.io.mavlink.frames import checksum
from asvhil.io.mavlink.frames import dialect as mav
from tests.support.autopilot_script import HOLD, MANUAL, NEUTRAL, PATH, SCRIPT, ScriptBoat, order_frame, parameters
from tests.support.simplant_boat import of, times

HELD = (1600, 1400)
OTHER = (1700, 1300)


# --- what it does with good orders ---------------------------------------------------------------------------


def drives_both_motors_exactly(text: str) -> None:
    boat = ScriptBoat(text).driving()
    for pulses_us in ((1501, 1499), (1000, 2000), (1999, 1001), (1234, 1777)):
        boat.drive(pulses_us)
        assert boat.motors == pulses_us
    assert boat.reason is ScriptReason.DRIVING


def past_reversal_and_neutral(text: str) -> None:
    boat = ScriptBoat(text, SERVO3_REVERSED=1, SERVO1_TRIM=1510, MOT_SLEWRATE=20, MOT_THST_ASYM=1.6).driving()
    boat.drive((1600, 1600))
    assert boat.motors == (1600, 1600)


def finds_the_motors_by_their_functions(text: str) -> None:
    boat = ScriptBoat(text, SERVO1_FUNCTION=74, SERVO3_FUNCTION=73).armed().start(HELD)
    assert boat.motors == HELD[::-1]


def neutral_when_orders_stop(text: str) -> None:
    boat = ScriptBoat(text).driving()
    boat.drive(OTHER)
    boat.run(0.24)
    assert boat.motors == OTHER
    boat.run(0.06)
    assert boat.motors == NEUTRAL
    assert boat.reason is ScriptReason.SILENT
    boat.drive(HELD)  # the session goes on
    assert boat.motors == HELD
    assert boat.reason is ScriptReason.DRIVING


def gone_with_the_script(text: str) -> None:
    boat = ScriptBoat(text).driving()
    assert boat.command(mav.MAV_CMD_SCRIPTING, 2.0) == 0
    boat.run(0.32)
    assert boat.motors == NEUTRAL


def takes_the_newest_of_a_burst(text: str) -> None:
    boat = ScriptBoat(text).driving()
    boat.put(b"".join(boat.next_order((1500 + n, 1500 - n)) for n in range(1, 6)))
    assert boat.motors == (1505, 1495)
    assert boat.state.dropped == 0


def counts_the_orders_that_it_uses(text: str) -> None:
    boat = ScriptBoat(text).driving()
    for _ in range(20):
        boat.drive(HELD)
        boat.run(0.03)
    boat.run(0.5)
    assert (boat.state.used, boat.state.dropped) == (21, 0)


def releases(text: str) -> None:
    boat = ScriptBoat(text).driving()
    boat.drive(HELD, order=Order.RELEASE)
    assert boat.now == NEUTRAL
    assert boat.motors == NEUTRAL
    assert boat.reason is ScriptReason.RELEASED
    boat.drive(OTHER)  # a late order of the session
    assert boat.motors == NEUTRAL


def releases_whatever_comes_after_it_in_a_burst(text: str) -> None:
    boat = ScriptBoat(text).driving()
    boat.put(boat.next_order(HELD, order=Order.RELEASE) + boat.next_order(OTHER))
    assert boat.motors == NEUTRAL


def gives_signs_of_life(text: str) -> None:
    boat = ScriptBoat(text)
    log = boat.run(10.0)
    assert len(times(log, "NAMED_VALUE_FLOAT")) in (80, 84)  # four of them at 2 Hz
    assert boat.state.version == 1
    assert boat.reason is ScriptReason.DISARMED
    log = boat.armed().run(0.02)
    boat.start()
    assert boat.reason is ScriptReason.DRIVING  # at once


# --- orders that move nothing --------------------------------------------------------------------------------


def dropped(boat: ScriptBoat, pulses_us: tuple[int, int] = OTHER, **wrong: Any) -> bool:
    """Whether an order moves nothing, while the session drives on."""
    boat.drive(HELD)
    boat.drive(pulses_us, **wrong)
    return boat.now == HELD


def drops_what_is_damaged(text: str) -> None:
    boat = ScriptBoat(text).driving()
    assert dropped(boat, check_xor=1 << 20)


def drops_a_flipped_bit_of_a_frame_with_a_wrong_checksum(text: str) -> None:
    """The autopilot hands these to scripts: every bit from the frame's number to the end of its checksum."""
    boat = ScriptBoat(text).driving()
    for bit in [*range(8 * 4, 8 * 7), *range(8 * 10, 8 * 33)]:
        boat.drive(HELD)
        frame = bytearray(boat.next_order(OTHER))
        frame[bit // 8] ^= 1 << bit % 8
        boat.put(bytes(frame))
        assert boat.now == HELD, bit


def leaves_no_damage_to_luck(text: str) -> None:
    """A frame that was damaged and got a right MAVLink checksum again, as by a bridge that packs messages anew."""
    boat = ScriptBoat(text).driving()
    for bit in range(8 * 10, 8 * 31):
        boat.drive(HELD)
        frame = bytearray(boat.next_order(OTHER))
        frame[bit // 8] ^= 1 << bit % 8
        boat.put(bytes(frame[:-2]) + checksum(bytes(frame[:-2])))
        assert boat.now == HELD, bit


def drops_what_another_system_sends(text: str) -> None:
    boat = ScriptBoat(text).driving()
    for sender in ((255, 191), (2, 191)):
        assert dropped(boat, sender=sender)


def starts_for_onboard_computers_alone(text: str) -> None:
    for component in (190, 195, 1, 240):
        boat = ScriptBoat(text).armed().start(sender=(1, component))
        assert boat.motors == NEUTRAL, component
    boat = ScriptBoat(text).armed().start(sender=(1, 194))
    assert boat.motors == HELD


def drops_what_another_component_sends(text: str) -> None:
    boat = ScriptBoat(text).driving()
    assert dropped(boat, sender=(1, 192))


def drops_what_carries_the_check_of_another_sender(text: str) -> None:
    boat = ScriptBoat(text).armed().start(sender=(1, 192), check_as=(1, 191))
    assert boat.motors == NEUTRAL


def drops_what_is_for_another_vehicle(text: str) -> None:
    boat = ScriptBoat(text).driving()
    for target in ((2, 1), (0, 1)):
        assert dropped(boat, target=target)


def drops_what_is_for_another_component(text: str) -> None:
    boat = ScriptBoat(text).driving()
    for target in ((1, 0), (1, 154)):
        assert dropped(boat, target=target)


def drops_other_versions(text: str) -> None:
    boat = ScriptBoat(text).driving()
    assert dropped(boat, version=2)


def drops_unknown_orders(text: str) -> None:
    boat = ScriptBoat(text).driving()
    assert dropped(boat, order=2)


def drops_other_lengths(text: str) -> None:
    boat = ScriptBoat(text).driving()
    assert dropped(boat, length=17)


def is_not_kept_busy_by_long_messages(text: str) -> None:
    """A script that takes too many steps in one pass is ended."""
    boat = ScriptBoat(text).driving()
    for _ in range(3):
        boat.drive(HELD)
        long = bytearray(boat.next_order(OTHER)[:-2] + bytes(111) + b"x")
        long[1] = len(long) - 10
        boat.put(b"".join([bytes(long) + checksum(bytes(long))] * 5))
    assert boat.now == HELD
    assert not [words for words in boat.texts() if words.startswith("Lua")]


def leaves_tunnels_of_others_alone(text: str) -> None:
    boat = ScriptBoat(text).driving()
    assert dropped(boat, payload_type=200)
    boat.run(0.5)
    assert boat.state.dropped == 0


def drops_what_is_no_pulse(text: str) -> None:
    boat = ScriptBoat(text).driving()
    for pulses_us in ((799, 1500), (1500, 799), (2201, 1500), (1500, 2201), (0, 0), (65535, 1500)):
        assert dropped(boat, pulses_us)


def keeps_to_the_travel_of_each_output(text: str) -> None:
    boat = ScriptBoat(text, SERVO1_MIN=1200, SERVO1_MAX=1800, SERVO3_MIN=1100, SERVO3_MAX=1900).driving()
    boat.drive((2200, 2200))
    assert boat.motors == (1800, 1900)
    boat.drive((800, 800))
    assert boat.motors == (1200, 1100)


def drops_what_comes_again(text: str) -> None:
    boat = ScriptBoat(text).driving()
    again = boat.next_order(OTHER)
    boat.put(again)
    boat.drive(HELD)
    boat.put(again)
    assert boat.motors == HELD


def does_not_go_on_by_a_repeated_order(text: str) -> None:
    boat = ScriptBoat(text).driving()
    last = boat.next_order(OTHER)
    for _ in range(20):
        boat.put(last)
    assert boat.motors == NEUTRAL


def drops_what_is_late(text: str) -> None:
    boat = ScriptBoat(text).driving()
    late = boat.next_order(OTHER)
    boat.drive(HELD)
    boat.put(late)
    assert boat.now == HELD


def drops_orders_of_an_earlier_session(text: str) -> None:
    boat = ScriptBoat(text).driving()
    earlier, boat.count = boat.session, 0
    boat.run(0.5)
    boat.start(HELD)
    assert dropped(boat, start=earlier, count=1000)


# --- starts --------------------------------------------------------------------------------------------------


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


# --- what ends a session, for good ---------------------------------------------------------------------------


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


# --- outputs and vehicle -------------------------------------------------------------------------------------


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


RULES = {
    name: function for name, function in list(globals().items()) if re.match(r"[a-z]", name) and callable(function)
}
RULES = {
    name: function
    for name, function in RULES.items()
    if getattr(function, "__module__", "") == __name__ and list(function.__annotations__) == ["text", "return"]
}


@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
def test_rule(rule: Callable[[str], None]) -> None:
    rule(SCRIPT)


# --- each rule left out in turn -------------------------------------------------------------------------------

WITHOUT: list[tuple[str, str, Callable[[str], None]]] = [
    ("  if not arming:is_armed() then return DISARMED end\n", "", ends_when_disarmed),
    ("  if not arming:is_armed() then return DISARMED end\n", "", a_start_while_disarmed_is_used_up),
    ("  if vehicle:get_mode() ~= HOLD then return MODE end\n", "", ends_when_the_mode_changes),
    ("  if SRV_Channels:get_emergency_stop() then return ESTOP end\n", "", ends_at_an_emergency_stop),
    ("  if stick_moved() then return STICK end\n", "", ends_when_the_pilot_moves_a_stick),
    ("  if stick_moved() then return STICK end\n", "", a_stick_forbids_a_start),
    ("  if not motors then return OUTPUTS end\n", "", wants_both_functions),
    ("      if found[motor] then return nil end\n", "", wants_each_function_on_one_output),
    ("  if running and why then let_go(why) end\n", "", ends_when_disarmed),
    ("running, ended = false, why", "ended = why", ends_when_disarmed),
    ("running, ended = false, why", "running = false", ends_when_the_mode_changes),
    ("set_output_pwm_chan_timeout(motor.output, motor.trim, 0)", "get_emergency_stop()", ends_when_disarmed),
    (
        "math.max(motor.low, math.min(motor.high, pulse))",
        "math.max(motor.low, pulse)",
        keeps_to_the_travel_of_each_output,
    ),
    (
        "math.max(motor.low, math.min(motor.high, pulse))",
        "math.min(motor.high, pulse)",
        keeps_to_the_travel_of_each_output,
    ),
    ("TIMEOUT_MS, PASS_MS, ALIVE_MS = 300,", "TIMEOUT_MS, PASS_MS, ALIVE_MS = 1000,", neutral_when_orders_stop),
    ("TIMEOUT_MS, PASS_MS, ALIVE_MS = 300,", "TIMEOUT_MS, PASS_MS, ALIVE_MS = 150,", neutral_when_orders_stop),
    ("  if payload_type ~= PAYLOAD_TYPE then return nil end\n", "", leaves_tunnels_of_others_alone),
    ("    and undamaged(message)\n", "", drops_a_flipped_bit_of_a_frame_with_a_wrong_checksum),
    ("system == vehicle_id and component", "component", drops_what_another_system_sends),
    ("component >= FIRST_SENDER and ", "", starts_for_onboard_computers_alone),
    (" and component <= LAST_SENDER", "", starts_for_onboard_computers_alone),
    ("to_system == vehicle_id and ", "", drops_what_is_for_another_vehicle),
    (" and to_component == AUTOPILOT", "", drops_what_is_for_another_component),
    ("length == LENGTH and message", "message", drops_other_lengths),
    (" and message:byte(4) <= 5 + LENGTH", "", is_not_kept_busy_by_long_messages),
    ("version == VERSION and ", "", drops_other_versions),
    (" and (order == DRIVE or order == RELEASE)", "", drops_unknown_orders),
    ("math.min(port, starboard) >= SHORTEST_US and ", "", drops_what_is_no_pulse),
    (" and math.max(port, starboard) <= LONGEST_US", "", drops_what_is_no_pulse),
    ("    and crc32(message:sub(8, 9) .. message:sub(13, 29)) == check", "   ", drops_what_is_damaged),
    (
        "    and crc32(message:sub(8, 9) .. message:sub(13, 29)) == check",
        "   ",
        leaves_no_damage_to_luck,
    ),
    (
        "message:sub(8, 9) .. message:sub(13, 29)",
        "'\\1\\191' .. message:sub(13, 29)",
        drops_what_carries_the_check_of_another_sender,
    ),
    ("order.sender == session.sender and ", "", drops_what_another_component_sends),
    (" and order.start == session.start\n", "\n", drops_orders_of_an_earlier_session),
    (" and order.count > session.count", "", drops_what_comes_again),
    (" and order.count > session.count", "", drops_what_is_late),
    ("order.count > session.count", "order.count >= session.count", does_not_go_on_by_a_repeated_order),
    ("  return running --", "  return true --", a_start_while_disarmed_is_used_up),
    ("  return running --", "  return true --", ends_when_disarmed),
    (" and order.start == next_start then", " then", starts_by_the_number_told_alone),
    ("next_start = (next_start + 1) & 0xFFFF", "next_start = next_start", a_start_counts_once),
    ("running, ended = not why, why or ended", "running = true", a_start_while_disarmed_is_used_up),
    ("        let_go(RELEASED)\n", "", releases),
    ("        newest = nil\n", "", releases),
    (
        "if order.order == RELEASE then",
        "if order.order == RELEASE and not mavlink:receive_chan() then",
        releases_whatever_comes_after_it_in_a_burst,
    ),
    ("order.order == DRIVE and order.start", "order.start", a_release_is_no_start),
    ("pulse ~= 0 and ", "", drives_both_motors_exactly),
    (" > STICK_US", " > 6 * STICK_US", ends_when_the_pilot_moves_a_stick),
    (" > STICK_US", " > 0", goes_on_while_sticks_rest),
    ("pulse - stick.trim", "pulse - 1500", looks_at_the_sticks_that_drive),
    ("  if not running then look_up() end\n", "", sees_outputs_that_are_set_right),
    (" or param:get('MAV_SYSID')", "", knows_the_system_id_by_its_name_of_4_7),
    ("  if reason == told and now - told_ms < ALIVE_MS then return end\n", "", gives_signs_of_life),
    ("reason == told and now", "now", gives_signs_of_life),
    ("used, last_ms = (used + 1) % MOST, now", "last_ms = now", counts_the_orders_that_it_uses),
    ("used, last_ms = (used + 1) % MOST, now", "used = used + 1", neutral_when_orders_stop),
    ("  for _ = 1, QUEUE do\n", "  for _ = 1, 1 do\n", takes_the_newest_of_a_burst),
]


@pytest.mark.parametrize(("line", "instead", "rule"), WITHOUT, ids=lambda value: getattr(value, "__name__", None))
def test_a_rule_left_out_is_noticed(line: str, instead: str, rule: Callable[[str], None]) -> None:
    assert SCRIPT.count(line) == 1, line
    with pytest.raises(AssertionError):
        rule(SCRIPT.replace(line, instead))


def test_every_rule_is_left_out_once() -> None:
    """Rules of which nothing can be left out are the script as a whole."""
    whole = {
        past_reversal_and_neutral,
        finds_the_motors_by_their_functions,
        gone_with_the_script,
        a_new_start_takes_over,
    }
    whole |= {stays_neutral_disarmed_with_the_emergency_stop}
    assert set(RULES.values()) - whole == {rule for _, _, rule in WITHOUT}


# --- as a whole ----------------------------------------------------------------------------------------------


def test_a_full_queue_fits_into_the_steps_that_a_script_has() -> None:
    """With half of what ArduPilot gives one pass by default."""
    boat = ScriptBoat(SCRIPT, parameters(SCR_VM_I_COUNT=5000)).armed().start()
    for _ in range(10):
        boat.put(b"".join(boat.next_order(HELD) for _ in range(5)))
        boat.run(0.05)
    assert boat.motors == HELD
    assert not [text for text in boat.texts() if text.startswith("Lua")]


def test_it_says_that_it_runs_and_ends_on_other_vehicles() -> None:
    boat = ScriptBoat()
    assert "asvhil: script 1 is running" in boat.texts()
    other = ScriptBoat(SCRIPT.replace("local ROVER, HOLD = 1, 4", "local ROVER, HOLD = 2, 4"))
    assert "asvhil: not a rover, this script ends" in other.texts()
    assert other.alive.state is None


def test_another_script_that_takes_the_queue_starves_it() -> None:
    """As on a real one: what is sent, and neither used nor dropped, tells."""
    thief = "mavlink:init(5, 1) mavlink:register_rx_msgid(385)\n"
    thief += "local function update() while mavlink:receive_chan() do end return update, 10 end\nreturn update()"
    boat = ScriptBoat()
    boat.seat.files["/APM/scripts/a_thief.lua"] = thief.encode()
    assert boat.command(mav.MAV_CMD_SCRIPTING, 3.0) == 0
    boat.alive.forget()
    boat.run(2.0)
    boat.armed().start()
    for _ in range(50):
        boat.drive(HELD)
    assert boat.state.used + boat.state.dropped < 5


def test_a_script_that_fails_is_told_and_the_others_go_on() -> None:
    boat = ScriptBoat()
    boat.seat.files["/APM/scripts/bad.lua"] = b"local n\nreturn n + 1"
    boat.seat.files["/APM/scripts/loop.lua"] = b"while true do end"
    boat.seat.files["/APM/scripts/none.lua"] = b"return ("
    boat.command(mav.MAV_CMD_SCRIPTING, 3.0)
    boat.run(2.0)
    texts = boat.texts()
    assert "Lua: scripts/bad.lua:2: attempt to perform arithmetic on a nil value (local 'n')" in texts
    assert "Lua: scripts/loop.lua exceeded time limit" in texts
    assert any(text.startswith("Lua: Error: scripts/none.lua:1:") for text in texts)
    assert boat.alive.state is not None


@pytest.mark.parametrize("enabled", [0, 1])
def test_scripting_is_for_boats_that_have_it_enabled_at_boot(enabled: int) -> None:
    boat = ScriptBoat(SCRIPT, parameters(SCR_ENABLE=enabled))
    assert (boat.alive.state is not None) == bool(enabled)
    boat.send(mav.MAVLink_param_set_message(1, 1, b"SCR_ENABLE", float(not enabled), 2))
    boat.run(1.0)
    boat.alive.forget()
    boat.run(3.0)
    assert boat.alive.state is None
    boat.send(mav.MAVLink_param_set_message(1, 1, b"SCR_ENABLE", 1.0, 2))
    boat.run(3.0)
    assert (boat.alive.state is not None) == bool(enabled)
    assert ("Scripting: restarted" in boat.texts()) == bool(enabled)


def test_the_start_is_another_after_each_restart() -> None:
    boat = ScriptBoat().driving()
    before = boat.state.start
    boat.command(mav.MAV_CMD_SCRIPTING, 3.0)
    boat.alive.forget()
    boat.run(3.0)
    assert boat.state.start != before
    boat.drive(HELD)
    assert boat.motors == NEUTRAL


def test_nothing_is_sent_to_stations_but_the_sign_of_life() -> None:
    boat = ScriptBoat().driving()
    boat.log.clear()
    boat.drive(HELD)
    boat.run(2.0)
    assert not of(boat.log, "TUNNEL")
    assert not of(boat.log, "STATUSTEXT")
    assert PATH in boat.seat.files
