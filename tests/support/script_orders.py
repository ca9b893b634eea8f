"""Rules of the script on the autopilot about single orders: which move the motors, and which do nothing."""

from __future__ import annotations

from typing import Any

from asvhil.autopilot.script_protocol import Order, ScriptReason
from asvhil.io.mavlink.frames import checksum
from asvhil.io.mavlink.frames import dialect as mav
from tests.support.autopilot_script import NEUTRAL, ScriptBoat
from tests.support.simplant_boat import times

HELD = (1600, 1400)
OTHER = (1700, 1300)


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
