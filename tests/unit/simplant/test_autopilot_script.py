"""The script on the autopilot as a whole, on the simulated ArduRover."""

from __future__ import annotations

import pytest

from asvhil.io.mavlink.frames import dialect as mav
from tests.support.autopilot_script import NEUTRAL, PATH, SCRIPT, ScriptBoat, parameters
from tests.support.script_orders import HELD
from tests.support.simplant_boat import of


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
