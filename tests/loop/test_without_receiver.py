"""A boat without an RC receiver, in the whole loop: it is armed and held as README says, and stops when we die."""

from __future__ import annotations

import pytest

from asvhil.config import load_config
from asvhil.types import Phase
from tests.support.loop import PLAIN_CONTROLLER, STATION_DEG, GroundStationLoop

MANUAL = 0
SETTINGS = (PLAIN_CONTROLLER, "supervisor.engage=command", "plant.frontseat.rc_receiver=false")


def loop_without_receiver(*overrides: str) -> GroundStationLoop:
    """A boat that is switched on, and its daemon."""
    return GroundStationLoop(load_config("sitl", (*SETTINGS, *overrides)))


def sent_us(loop: GroundStationLoop) -> list[tuple[int, int]]:
    """All overrides that were sent."""
    return [pulses for tick in loop.overrides_us for pulses in tick]


def hold(loop: GroundStationLoop) -> int:
    """The answer (MAV_RESULT) to a hold command."""
    loop.ask_to_hold(STATION_DEG, 0.0)
    return loop.results[-1]


def test_as_readme_says_it_is_armed_and_held_without_a_transmitter() -> None:
    loop = loop_without_receiver()
    outputs = loop.wait(20.0)
    assert loop.frontseat.rover.mode == 4 and not loop.frontseat.arm(True)  # it boots into HOLD and does not arm
    notes = {note.subject: note.text for note in outputs.health.notes if not note.ok}
    assert notes == {"arming": "Radio failsafe on"}
    assert sent_us(loop) == []
    assert hold(loop) == 1
    assert "not armed: neutral is sent for 30 s, arm it in MANUAL and hold again" in loop.texts
    outputs = loop.wait(3.0)
    assert outputs.phase is Phase.PREPARE and set(sent_us(loop)) == {(1500, 1500)}
    assert loop.frontseat.set_mode(MANUAL) and loop.frontseat.arm(True)
    loop.wait(10.0)
    assert set(sent_us(loop)) == {(1500, 1500)} and loop.frontseat.outputs_us == (1500, 1500)  # armed, and still
    assert hold(loop) == 0
    outputs = loop.wait(60.0)
    assert outputs.phase is Phase.HOLD and outputs.estimate is not None and outputs.station is not None
    assert "Radio Failsafe" not in loop.frontseat.rover.texts
    loop.t_ns += 600_000_000  # the daemon dies
    loop.plant.advance(loop.t_ns)
    assert loop.frontseat.outputs_us == (1500, 1500)


def test_a_boat_that_is_not_armed_in_time_is_left_alone() -> None:
    loop = loop_without_receiver()
    loop.wait(10.0)
    assert hold(loop) == 1
    outputs = loop.wait(31.0)
    assert outputs.phase is Phase.STANDBY
    assert outputs.health.reason == "neutral is no longer sent: no hold within 30 s"
    assert sent_us(loop)[-4:] == [(1500, 1500), (0, 0), (1500, 1500), (0, 0)]
    loop.overrides_us.clear()
    loop.wait(5.0)
    assert sent_us(loop) == [] and not loop.frontseat.arm(True)


def test_a_transmitter_that_is_switched_on_meanwhile_is_the_pilots() -> None:
    loop = loop_without_receiver()
    loop.wait(10.0)
    hold(loop)
    loop.wait(3.0)
    loop.frontseat.set_receiver(True)
    loop.wait(0.3)
    loop.overrides_us.clear()
    outputs = loop.wait(2.0)
    assert outputs.phase is Phase.STANDBY and sent_us(loop) == []
    assert outputs.health.reason == "a transmitter is heard: the sticks are the pilot's"
    loop.frontseat.set_sticks({1: 1700})
    assert loop.frontseat.set_mode(MANUAL) and not loop.frontseat.arm(True)  # by his sticks, which are not neutral


def test_a_transmitter_that_was_heard_has_nothing_sent_in_its_place() -> None:
    loop = loop_without_receiver("plant.frontseat.rc_receiver=true")
    loop.wait(10.0)
    loop.frontseat.set_receiver(False)
    outputs = loop.wait(3.0)
    assert {n.subject: n.text for n in outputs.health.notes if not n.ok} == {
        "transmitter": "lost: the pilot's sticks and switches have no effect",
        "arming": "Radio failsafe on",
    }
    assert hold(loop) == 1
    loop.wait(2.0)
    assert sent_us(loop) == []
    assert any(text == "vehicle is not armed (Radio failsafe on)" for text in loop.texts)


def test_the_loss_of_a_transmitter_can_be_rehearsed_as_a_fault() -> None:
    loop = loop_without_receiver(
        "plant.frontseat.rc_receiver=true", "plant.faults=[{kind: transmitter, from_s: 8, until_s: 12}]"
    )
    told = []
    for _ in range(15):
        outputs = loop.wait(1.0)
        told.append({note.subject for note in outputs.health.notes if not note.ok} & {"transmitter", "arming"})
    assert told[6] == set() and told[10] == {"transmitter", "arming"} and told[14] == set()


@pytest.mark.parametrize(("reports", "phase"), [(True, Phase.STANDBY), (False, Phase.HOLD)])
def test_a_transmitter_lost_in_a_hold_is_seen_where_it_reports_its_signal(reports: bool, phase: Phase) -> None:
    loop = loop_without_receiver("plant.frontseat.rc_receiver=true")
    loop.frontseat.rover.rc.strength = 180 if reports else None
    loop.wait(10.0)
    assert loop.frontseat.arm(True)
    loop.wait(0.5)
    assert hold(loop) == 0
    loop.wait(20.0)
    loop.frontseat.set_receiver(False)
    outputs = loop.wait(5.0)
    assert outputs.phase is phase
    if reports:
        assert outputs.health.code == "transmitter-lost"
        assert loop.frontseat.rover.mode == 4 and loop.frontseat.outputs_us == (
            1500,
            1500,
        )  # its own fail-safe has acted
