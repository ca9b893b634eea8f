"""The script on the autopilot, rule by rule, on the simulated ArduRover; and without each rule in turn."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.support import script_orders, script_sessions
from tests.support.autopilot_script import SCRIPT
from tests.support.script_orders import (
    counts_the_orders_that_it_uses,
    does_not_go_on_by_a_repeated_order,
    drives_both_motors_exactly,
    drops_a_flipped_bit_of_a_frame_with_a_wrong_checksum,
    drops_orders_of_an_earlier_session,
    drops_other_lengths,
    drops_other_versions,
    drops_unknown_orders,
    drops_what_another_component_sends,
    drops_what_another_system_sends,
    drops_what_carries_the_check_of_another_sender,
    drops_what_comes_again,
    drops_what_is_damaged,
    drops_what_is_for_another_component,
    drops_what_is_for_another_vehicle,
    drops_what_is_late,
    drops_what_is_no_pulse,
    finds_the_motors_by_their_functions,
    gives_signs_of_life,
    gone_with_the_script,
    is_not_kept_busy_by_long_messages,
    keeps_to_the_travel_of_each_output,
    leaves_no_damage_to_luck,
    leaves_tunnels_of_others_alone,
    neutral_when_orders_stop,
    past_reversal_and_neutral,
    releases,
    releases_whatever_comes_after_it_in_a_burst,
    starts_for_onboard_computers_alone,
    takes_the_newest_of_a_burst,
)
from tests.support.script_sessions import (
    a_new_start_takes_over,
    a_release_is_no_start,
    a_start_counts_once,
    a_start_while_disarmed_is_used_up,
    a_stick_forbids_a_start,
    ends_at_an_emergency_stop,
    ends_when_disarmed,
    ends_when_the_mode_changes,
    ends_when_the_pilot_moves_a_stick,
    goes_on_while_sticks_rest,
    knows_the_system_id_by_its_name_of_4_7,
    looks_at_the_sticks_that_drive,
    sees_outputs_that_are_set_right,
    starts_by_the_number_told_alone,
    stays_neutral_disarmed_with_the_emergency_stop,
    wants_both_functions,
    wants_each_function_on_one_output,
)

# --- outputs and vehicle ----------------------------------------------------------------------------------------------


RULES = {
    name: function
    for module in (script_orders, script_sessions)
    for name, function in vars(module).items()
    if getattr(function, "__module__", "") == module.__name__ and list(function.__annotations__) == ["text", "return"]
}


@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
def test_rule(rule: Callable[[str], None]) -> None:
    rule(SCRIPT)


# --- each rule left out in turn ---------------------------------------------------------------------------------------


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
