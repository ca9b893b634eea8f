"""The state in the heartbeat to operators: held, in trouble, or adrift with nobody at the motors."""

from typing import Any

import pytest

from asvhil.config import load_config
from asvhil.io.mavlink.frames import dialect
from asvhil.operator.encoding import encode_neutral, encode_presence, encode_question, encode_release
from asvhil.operator.state_arrays import read_state
from asvhil.types import Frame, Phase
from tests.support.loop import PLAIN_CONTROLLER, STATION_DEG, GroundStationLoop

ACTIVE, STANDBY = dialect.MAV_STATE_ACTIVE, dialect.MAV_STATE_STANDBY
CRITICAL, EMERGENCY = dialect.MAV_STATE_CRITICAL, dialect.MAV_STATE_EMERGENCY


class StateLoop(GroundStationLoop):
    """A held boat whose autopilot may fall silent."""

    deaf = False

    def __init__(self) -> None:
        super().__init__(load_config("sitl", (PLAIN_CONTROLLER, "supervisor.engage=command")))
        self.say(encode_presence())
        self.wait(6.0)
        assert self.frontseat.set_mode(0) and self.frontseat.arm(True)
        self.wait(1.0)
        self.ask_to_hold(STATION_DEG, 0.0)
        assert self.wait(2.0).phase is Phase.HOLD, self.texts

    def receive(self) -> tuple[Frame, ...]:
        frames = super().receive()
        return tuple(f for f in frames if f.port != "autopilot") if self.deaf else frames

    def state(self) -> int:
        """The state in the next heartbeat."""
        self.heard.clear()
        self.say(encode_presence())
        self.wait(1.2)
        return int([m for m in self.heard if m.get_type() == "HEARTBEAT"][-1].system_status)

    def fail(self) -> None:
        """The autopilot falls silent until the hold has ended, and is back then."""
        self.deaf = True
        self.wait(20.0, until=lambda outputs: outputs.phase is Phase.FAILSAFE)
        assert self.state() == CRITICAL
        self.wait(20.0, until=lambda outputs: outputs.phase is Phase.STANDBY)
        self.deaf = False
        self.wait(1.0)


def test_a_hold_that_a_failure_has_ended_is_an_emergency_until_somebody_takes_over() -> None:
    loop = StateLoop()
    assert loop.state() == ACTIVE
    loop.fail()
    assert loop.state() == EMERGENCY
    loop.wait(30.0)
    assert loop.state() == EMERGENCY, "time does not help"
    loop.ask_to_hold(STATION_DEG, 0.0)
    assert loop.state() == ACTIVE


@pytest.mark.parametrize("takes", ["mode", "disarms"])
def test_the_pilot_ends_the_emergency(takes: str) -> None:
    loop = StateLoop()
    loop.fail()
    assert loop.state() == EMERGENCY
    assert loop.frontseat.set_mode(4) if takes == "mode" else loop.frontseat.arm(False)
    loop.wait(1.0)
    assert loop.state() == STANDBY


@pytest.mark.parametrize("ends", ["release", "mode", "disarms", "stick"])
def test_what_people_end_is_no_emergency(ends: str) -> None:
    loop = StateLoop()
    match ends:
        case "release":
            loop.say(encode_release(loop.config.links.autopilot))
        case "mode":
            loop.frontseat.set_mode(4)
        case "disarms":
            loop.frontseat.arm(False)
        case _:
            loop.frontseat.set_sticks({2: 1900})
    assert loop.wait(3.0, until=lambda outputs: outputs.phase is Phase.STANDBY).phase is Phase.STANDBY
    assert loop.state() == STANDBY


def test_an_operator_who_asks_gets_the_phase_its_reason_and_the_notes() -> None:
    loop = StateLoop()
    loop.texts.clear()
    loop.say(encode_question(loop.config.links.autopilot, dialect.MAVLINK_MSG_ID_STATUSTEXT))
    outputs: Any = loop.step()
    assert loop.results[-1] == dialect.MAV_RESULT_ACCEPTED
    sources = ", ".join(f"{quantity} {name}" for quantity, name in outputs.health.sources)
    assert loop.texts == [
        *(f"hold: {outputs.health.reason}", "mode: MANUAL, armed", f"sources: {sources}"),
        *(f"{note.subject}: {note.text}" for note in outputs.health.notes),
    ]


def test_neutral_goes_to_the_motors_in_the_tick_that_takes_the_command_and_stays_until_a_word() -> None:
    loop = StateLoop()
    loop.wait(3.0)
    assert any(pulse != (1500, 1500) for sent in loop.overrides_us[-40:] for pulse in sent)
    loop.say(encode_neutral(loop.config.links.autopilot))
    outputs = loop.step()
    assert (outputs.phase, outputs.pwm_us) == (Phase.PREPARE, (1500, 1500))
    assert loop.results[-1] == dialect.MAV_RESULT_ACCEPTED
    loop.wait(5.0)
    assert all(sent == [(1500, 1500)] for sent in loop.overrides_us[-101:])
    assert loop.state() == STANDBY and "prepare: neutral, by the operator: the boat drifts" in loop.texts
    # A display that asks gets it in numbers, and nobody else does.
    loop.heard.clear()
    loop.say(encode_question(loop.config.links.autopilot, dialect.MAVLINK_MSG_ID_DEBUG_FLOAT_ARRAY))
    estimate: Any = loop.step().estimate
    (message,) = [m for m in loop.heard if m.get_type() == "DEBUG_FLOAT_ARRAY"]
    told = read_state(message)
    assert told["port_us"] == told["starboard_us"] == 1500 and told["station_n_m"] is None and told["armed"] == 1.0
    assert told["heading_deg"] is not None and told["n_m"] == pytest.approx(estimate.n_m, abs=1e-3)
    assert told["fix"] == 3.0 and (told["satellites"] or 0) > 3
    loop.ask_to_hold()
    assert loop.wait(1.0).phase is Phase.HOLD
