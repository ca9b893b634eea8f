"""A boat without an RC receiver, in the whole loop: it is armed and held as README says, and stops when we die."""

from __future__ import annotations

import pytest

from asvhil.config import load_config
from asvhil.io.mavlink.frames import FrameSplitter, decode
from asvhil.io.mavlink.texts import TextReader
from asvhil.operator.session import encode_hold
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Outputs, Phase

MANUAL = 0
SETTINGS = ("supervisor.engage=command", "plant.frontseat.rc_receiver=false")


class Boat:
    """Switched on, and its daemon up, with a ground station that can arm and choose a mode."""

    def __init__(self, *overrides: str) -> None:
        self.loop = Lockstep(load_config("sitl", (*SETTINGS, *overrides)))
        self.seat = self.loop.plant.frontseat
        self.said: list[str] = []
        self.acks: list[int] = []
        self.sent: list[tuple[int, int]] = []
        self._texts = TextReader()
        self._calls = 0

    def run(self, seconds: float) -> Outputs:
        for _ in range(round(seconds * 20)):
            outputs = self.tick()
        return outputs

    def tick(self) -> Outputs:
        _, outputs = self.loop.tick()
        for frame in outputs.frames:
            for data in FrameSplitter().receive(frame.data):
                message = decode(data)
                assert message is not None
                if message.get_type() == "RC_CHANNELS_OVERRIDE":
                    self.sent.append((message.chan1_raw, message.chan3_raw))
                elif message.get_type() == "COMMAND_ACK" and frame.port == "operator":
                    self.acks.append(message.result)
                elif message.get_type() == "STATUSTEXT" and (text := self._texts.receive(message)) is not None:
                    self.said.append(text)
        return outputs

    def hold(self) -> int:
        """The answer (MAV_RESULT) to a hold command; each comes from a station of its own."""
        self._calls += 1
        data = encode_hold(self.loop.config.links.autopilot, 40.4237, -86.9212, 0.0)
        self.loop.inject("operator", data, f"10.0.0.{self._calls}:9")
        self.acks.clear()
        self.tick()
        return self.acks[-1]


def test_as_readme_says_it_is_armed_and_held_without_a_transmitter() -> None:
    boat = Boat()
    outputs = boat.run(20.0)
    assert boat.seat.rover.mode == 4 and not boat.seat.arm(True)  # it boots into HOLD and does not arm
    notes = {note.subject: note.text for note in outputs.health.notes if not note.ok}
    assert notes == {"arming": "Radio failsafe on"}
    assert boat.sent == []
    assert boat.hold() == 1
    assert "not armed: neutral is sent for 30 s, arm it in MANUAL and hold again" in boat.said
    outputs = boat.run(3.0)
    assert outputs.phase is Phase.PREPARE and set(boat.sent) == {(1500, 1500)}
    assert boat.seat.set_mode(MANUAL) and boat.seat.arm(True)
    boat.run(10.0)
    assert set(boat.sent) == {(1500, 1500)} and boat.seat.outputs_us == (1500, 1500)  # armed, and still
    assert boat.hold() == 0
    outputs = boat.run(60.0)
    assert outputs.phase is Phase.HOLD and outputs.estimate is not None and outputs.station is not None
    assert "Radio Failsafe" not in boat.seat.rover.texts
    boat.loop.t_ns += 600_000_000  # the daemon dies
    boat.loop.plant.advance(boat.loop.t_ns)
    assert boat.seat.outputs_us == (1500, 1500)


def test_a_boat_that_is_not_armed_in_time_is_left_alone() -> None:
    boat = Boat()
    boat.run(10.0)
    assert boat.hold() == 1
    outputs = boat.run(31.0)
    assert outputs.phase is Phase.STANDBY
    assert outputs.health.reason == "neutral is no longer sent: no hold within 30 s"
    assert boat.sent[-4:] == [(1500, 1500), (0, 0), (1500, 1500), (0, 0)]
    boat.sent.clear()
    boat.run(5.0)
    assert boat.sent == [] and not boat.seat.arm(True)


def test_a_transmitter_that_is_switched_on_meanwhile_is_the_pilots() -> None:
    boat = Boat()
    boat.run(10.0)
    boat.hold()
    boat.run(3.0)
    boat.seat.set_receiver(True)
    boat.run(0.3)
    boat.sent.clear()
    outputs = boat.run(2.0)
    assert outputs.phase is Phase.STANDBY and boat.sent == []
    assert outputs.health.reason == "a transmitter is heard: the sticks are the pilot's"
    boat.seat.set_sticks({1: 1700})
    assert boat.seat.set_mode(MANUAL) and not boat.seat.arm(True)  # by his sticks, which are not neutral


def test_a_transmitter_that_was_heard_has_nothing_sent_in_its_place() -> None:
    boat = Boat("plant.frontseat.rc_receiver=true")
    boat.run(10.0)
    boat.seat.set_receiver(False)
    outputs = boat.run(3.0)
    assert {n.subject: n.text for n in outputs.health.notes if not n.ok} == {
        "transmitter": "lost: the pilot's sticks and switches have no effect",
        "arming": "Radio failsafe on",
    }
    assert boat.hold() == 1
    boat.run(2.0)
    assert boat.sent == []
    assert any(text == "vehicle is not armed (Radio failsafe on)" for text in boat.said)


def test_the_loss_of_a_transmitter_can_be_rehearsed_as_a_fault() -> None:
    boat = Boat("plant.frontseat.rc_receiver=true", "plant.faults=[{kind: transmitter, from_s: 8, until_s: 12}]")
    told = []
    for _ in range(15):
        outputs = boat.run(1.0)
        told.append({note.subject for note in outputs.health.notes if not note.ok} & {"transmitter", "arming"})
    assert told[6] == set() and told[10] == {"transmitter", "arming"} and told[14] == set()


@pytest.mark.parametrize(("reports", "phase"), [(True, Phase.STANDBY), (False, Phase.HOLD)])
def test_a_transmitter_lost_in_a_hold_is_seen_where_it_reports_its_signal(reports: bool, phase: Phase) -> None:
    boat = Boat("plant.frontseat.rc_receiver=true")
    boat.seat.rover.rc.strength = 180 if reports else None
    boat.run(10.0)
    assert boat.seat.arm(True)
    boat.run(0.5)
    assert boat.hold() == 0
    boat.run(20.0)
    boat.seat.set_receiver(False)
    outputs = boat.run(5.0)
    assert outputs.phase is phase
    if reports:
        assert outputs.health.code == "transmitter-lost"
        assert boat.seat.rover.mode == 4 and boat.seat.outputs_us == (1500, 1500)  # its own fail-safe has acted
