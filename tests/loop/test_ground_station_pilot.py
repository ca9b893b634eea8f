"""The pilot at a ground station: his stick ends a hold in the tick of the news, whichever way that comes by.

His messages may come by a link of his own to the autopilot, which the daemon hears nothing of but RC_CHANNELS; by the
autopilot's link, through a hub; by a link of the daemon's own, routed; or by the operator's port.
"""

from __future__ import annotations

import functools
import random
from collections.abc import Callable
from typing import Any

import pytest

from asvhil.config import load_config
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect
from asvhil.supervisor.reasons import Reason
from asvhil.types import Frame, Inputs, Outputs, Phase
from tests.support.copies import on_a_copy
from tests.support.loop import PLAIN_CONTROLLER, STATION_DEG, GroundStationLoop
from tests.support.parts import one_in

MOMENTS = [20, pytest.param(200, marks=pytest.mark.thorough)]  # of all ways together
MANUAL, HOLD = 0, 4
LINKS = ("his own link", "the autopilot's link", "a routed link", "the operator's port")
STATION = (255, 240)
THRESHOLD_US = 60
COMMON = (
    "supervisor.engage=command",
    PLAIN_CONTROLLER,
    "plant.frontseat.rc_receiver=false",
    "plant.frontseat.ready_after_s=1.5",
)
AS_255 = ("plant.frontseat.mygcs_system_id=255", "links.autopilot.override_system_id=255")
# Never-ending overrides are as on a boat that is driven from a ground station alone; the hazard is taken on by name.
NO_FAIL_SAFE = "plant.frontseat.parameters={FS_THR_ENABLE: 0}"
WAYS = {
    "rc_override": (*AS_255, NO_FAIL_SAFE, "supervisor.readback.tolerate=[unbounded]"),
    "manual_control": (
        *AS_255,
        NO_FAIL_SAFE,
        "supervisor.readback.tolerate=[unbounded]",
        "links.autopilot.output=manual_control",
    ),
    "script": (
        "plant.frontseat.mygcs_system_id=255",
        "plant.frontseat.script=true",
        "links.autopilot.output=script",
        "plant.frontseat.parameters={SCR_ENABLE: 1, FS_THR_ENABLE: 0}",
    ),
}


def manual_control(y: int, z: int, *, target: int = 1) -> Any:
    return dialect.MAVLink_manual_control_message(target, 32767, y, z, 32767, 0)


HEARTBEAT = dialect.MAVLink_heartbeat_message(
    dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
)


def channels(port_us: int, starboard_us: int, *, fourth_us: int = 65535) -> Any:
    rest = [65535] * 4
    return dialect.MAVLink_rc_channels_override_message(1, 1, port_us, 65535, starboard_us, fourth_us, *rest)


class PilotLoop(GroundStationLoop):
    """A boat without a receiver, armed, and a pilot's station."""

    def __init__(self, way: str, *overrides: str) -> None:
        self.script = way == "script"
        super().__init__(load_config("sitl", (*COMMON, *WAYS[way], *overrides)))
        self._station = dialect.MAVLink(None, srcSystem=STATION[0], srcComponent=STATION[1])
        self.wait(6.0)
        assert self.frontseat.set_mode(HOLD if self.script else MANUAL) and self.frontseat.arm(True), self.texts
        self.wait(0.5)

    def receive(self) -> tuple[Frame, ...]:
        """Notes the outputs in the middle of the tick, when what the daemon has sent is in force."""
        frames = [*self._injected, *self.plant.advance(self.t_ns - self.period_ns // 2)]
        self._injected.clear()
        self.between_us = self.frontseat.outputs_us
        return (*frames, *super().receive())

    def held(self) -> PilotLoop:
        self.ask_to_hold(STATION_DEG, 0.0)
        assert self.results[-1] == 0, self.texts[-3:]
        return self

    def from_station(self, message: Any, link: str, *, after_ns: int = 1_000_000, system: int = STATION[0]) -> None:
        """What his station says now, by a link."""
        self._station.srcSystem = system
        data = bytes(message.pack(self._station))
        self._station.seq = (self._station.seq + 1) % 256
        if link != "the operator's port":
            self.frontseat.receive(Frame(t_ns=self.t_ns + after_ns, port="autopilot", data=data, peer="station"))
        if link == "the autopilot's link":
            self.inject("autopilot", data, "10.0.0.7:14550")
        elif link == "a routed link":
            self._injected.append(
                Frame(t_ns=self.t_ns, port="operator", data=data, peer="10.0.0.7:14550", via="ground_station.cockpit")
            )
        elif link == "the operator's port":
            self.inject("operator", data, "10.0.0.7:14551")


@functools.cache
def ready(way: str) -> PilotLoop:
    """An armed boat: for copies."""
    return PilotLoop(way)


def shows_sticks(sticks_us: tuple[int, int]) -> Callable[[Inputs], bool]:
    """Whether a tick's frames tell of these sticks in RC_CHANNELS, read with nothing but the protocol."""
    splitter = FrameSplitter()

    def shows(inputs: Inputs) -> bool:
        found = False
        for frame in inputs.frames:
            for data in splitter.receive(frame.data) if frame.port == "autopilot" and not frame.peer else ():
                message = decode(data)
                if message is not None and message.get_type() == "RC_CHANNELS":
                    now_us = message.chan1_raw, message.chan3_raw
                    found |= max(abs(now - stick) for now, stick in zip(now_us, sticks_us, strict=True)) <= 1
        return found

    return shows


def off_centre(chance: random.Random) -> tuple[Any, tuple[int, int]]:
    """A message of random size above the threshold, of either kind, by one stick or both; and the sticks it sets."""
    sticks_us = [1500, 1500]
    for index in chance.choice([(0,), (1,), (0, 1)]):
        sticks_us[index] += chance.choice([-1, 1]) * chance.randint(THRESHOLD_US + 2, 400)
    axes = [2 * (us - 1500) for us in sticks_us]
    message = manual_control(*axes) if chance.random() < 0.5 else channels(*sticks_us)
    return message, (sticks_us[0], sticks_us[1])


@pytest.mark.parametrize("moments", MOMENTS)
@pytest.mark.parametrize("way", WAYS)
def test_a_stick_at_any_moment_ends_the_hold_in_the_tick_of_the_news(way: str, moments: int) -> None:
    """Each time on a copy of the boat, at random moments of its hold; at every tenth the boat itself, held again."""
    chance = random.Random(f"station {way}")
    loop = PilotLoop(way)
    loop.from_station(HEARTBEAT, LINKS[1])
    loop.held()
    for moment in range(moments // len(WAYS) + 1):
        loop.from_station(HEARTBEAT, LINKS[1])  # each moment takes less than the 5 s after which a station is lost
        loop.wait(0.05 * chance.randint(1, 20))
        assert loop.outputs is not None and loop.outputs.phase is Phase.HOLD, loop.outputs.health.reason
        link, draw = LINKS[moment % len(LINKS)], chance.random()
        if moment % 10:
            on_a_copy(lambda link=link, draw=draw: move_a_stick(loop, link, random.Random(draw)))
        else:
            move_a_stick(loop, link, random.Random(draw))
            if link != "the operator's port":
                loop.from_station(channels(1500, 1500), link)
            loop.wait(1.0)
            assert loop.frontseat.outputs_us == (1500, 1500)
            loop.from_station(HEARTBEAT, LINKS[1])
            loop.held()


def move_a_stick(loop: PilotLoop, link: str, chance: random.Random) -> None:
    """His stick ends the hold in the tick of the news, and is what the motors hear from then on, or nothing is."""
    message, sticks_us = off_centre(chance)
    shows = shows_sticks(sticks_us)
    for _ in range(30):
        loop.from_station(message, link, after_ns=chance.randint(1, 49_000_000))
        inputs, outputs = loop.tick()
        if outputs.phase is not Phase.HOLD or link != LINKS[0] or shows(inputs):
            break
    assert outputs.phase is Phase.STANDBY and outputs.health.code in {
        Reason.STATION_STICK,
        Reason.STICK_MOVED,
        Reason.OVERRIDE_NOT_FOLLOWED,
        Reason.SCRIPT_LET_GO,
    }, (link, outputs.health.reason)
    reaches = link != "the operator's port" and not loop.script
    for tick in range(8):
        if reaches:
            loop.from_station(message, link, after_ns=chance.randint(1, 49_000_000))
        outputs = loop.step()
        assert outputs.phase is Phase.STANDBY
        if tick:
            motors_us = loop.frontseat.outputs_us
            assert motors_us == (1500, 1500) or (
                not loop.script and max(abs(m - s) for m, s in zip(motors_us, sticks_us, strict=True)) <= 1
            ), (link, motors_us, sticks_us)


@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize("way", one_in(3, WAYS))
def test_sticks_that_rest_a_little_off_centre_do_not_end_it(way: str, link: str) -> None:
    chance = random.Random(f"rest {way} {link}")
    loop = ready(way)
    rest_us = 1500 + chance.randint(20, 55), 1500 - chance.randint(20, 55)
    message = manual_control(*(2 * (us - 1500) for us in rest_us))

    def body() -> None:
        loop.held()
        if link == LINKS[0]:  # else nobody could tell whether our commands are heeded
            loop.wait(1.5)
        due_ns, driven = loop.t_ns, 0
        for _ in range(100):
            while due_ns < loop.t_ns + loop.period_ns:  # 25 Hz, beside our 20 Hz
                loop.from_station(message, link, after_ns=due_ns - loop.t_ns)
                due_ns += 40_000_000
            outputs = loop.step()
            assert outputs.phase is Phase.HOLD, (outputs.health.reason, loop.texts[-2:])
            driven += max(abs(us - 1500) for us in loop.between_us) > THRESHOLD_US
        assert driven > 20, "the motors are driven all the same"

    on_a_copy(body)


@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize("way", one_in(3, WAYS))
def test_who_the_autopilot_would_not_obey_does_not_end_it(way: str, link: str) -> None:
    loop = ready(way)
    full = manual_control(1000, -1000), channels(1900, 1100)

    def body() -> None:
        loop.held()
        for tick in range(60):
            loop.from_station(full[tick % 2], link, system=(254, 77, 1)[tick % 3])
            loop.from_station(manual_control(1000, -1000, target=(0, 2)[tick % 2]), link)
            assert loop.step().phase is Phase.HOLD, loop.texts[-2:]

    on_a_copy(body)


@pytest.mark.parametrize(("high", "system", "ends"), [(255, 255, True), (255, 254, True), (255, 253, False),
                                                      (0, 254, True), (0, 255, False)])  # fmt: skip
@pytest.mark.parametrize("way", one_in(3, WAYS))
def test_since_4_7_a_range_of_stations_has_the_boat(way: str, high: int, system: int, ends: bool) -> None:
    parameters = f"{{FS_THR_ENABLE: 0, SCR_ENABLE: 1, MAV_GCS_SYSID_HI: {high}}}"
    firmware = ("plant.frontseat.firmware='4.7'", f"plant.frontseat.parameters={parameters}")
    ids = ("plant.frontseat.mygcs_system_id=254", "links.autopilot.override_system_id=254")
    loop = PilotLoop(way, *firmware, *ids).held()
    loop.wait(1.0)
    for link in LINKS[1:]:
        loop.from_station(manual_control(0, 700), link, system=system)
        outputs = loop.step()
        assert (outputs.phase is Phase.STANDBY) is ends, outputs.health.reason
        if ends:
            assert outputs.health.reason == f"{system}/240: stick of channel 3 off centre"
            break


@pytest.mark.parametrize("way", one_in(2, ["rc_override", "manual_control"]))
@pytest.mark.parametrize("end", ["release", "mode", "disarmed", "shutdown", "crash"])
def test_without_a_receiver_the_motors_do_not_run_on_after_a_hold(way: str, end: str) -> None:
    """On an ArduRover the last override stands after its release: it has to be neutral by then."""
    loop = PilotLoop(way).held()
    loop.wait(5.0, until=lambda outputs: min(abs(us - 1500) for us in loop.frontseat.outputs_us) > 100)
    assert min(abs(us - 1500) for us in loop.frontseat.outputs_us) > 100
    seat = loop.frontseat
    match end:
        case "release":
            loop.say(
                dialect.MAVLink_command_long_message(1, 191, dialect.MAV_CMD_NAV_GUIDED_ENABLE, 0, 0, 0, 0, 0, 0, 0, 0)
            )
        case "mode":
            assert seat.set_mode(HOLD)
        case "disarmed":
            assert seat.arm(False)
        case "shutdown":
            loop.run(0.0)
        case _:
            loop.deliver(tuple(loop.backseat.release_to_pilot(loop.t_ns)))
    if end == "shutdown":  # nothing is sent any more
        loop.plant.advance(loop.t_ns + 1_000_000_000)
    elif end == "crash":
        loop.plant.advance(loop.t_ns + 200_000_000)
    else:
        loop.wait(1.0)
    seat.set_mode(MANUAL)
    assert seat.arm(True), seat.rover.texts
    loop.plant.advance(loop.t_ns + 2_000_000_000)
    assert seat.outputs_us == (1500, 1500)


def test_the_hold_of_a_transmitter_boat_is_released_in_the_same_tick() -> None:
    """With a receiver its sticks take the place of what was released, at once."""
    loop = PilotLoop("rc_override", "plant.frontseat.rc_receiver=true").held()
    loop.wait(1.5)
    loop.frontseat.set_sticks({4: 1800})
    outputs: Outputs = loop.wait(1.0, until=lambda outputs: outputs.phase is Phase.STANDBY)
    assert outputs.health.code == Reason.STICK_MOVED and loop.overrides_us[-1] == [(0, 0)]


def beat() -> Any:
    return dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)


@pytest.mark.parametrize("link", LINKS[1:])
@pytest.mark.parametrize("way", ["rc_override", "script"])
def test_the_loss_of_his_station_ends_the_hold_by_name_and_refuses_another(way: str, link: str) -> None:
    loop = ready(way)

    def body() -> None:
        loop.held()
        for _ in range(6):
            loop.from_station(beat(), link)
            assert loop.wait(1.0).phase is Phase.HOLD
        silent = 20  # ticks since the last one
        while loop.step().phase is Phase.HOLD:
            silent += 1
            loop.from_station(beat(), link, system=(254, 1)[silent % 2])  # a stranger's, and one of the vehicle
            assert silent < 120
        assert 98 <= silent <= 101
        assert loop.outputs is not None and loop.outputs.health.code == Reason.STATION_LOST
        loop.wait(0.5)
        assert loop.frontseat.outputs_us == (1500, 1500)
        loop.ask_to_hold(STATION_DEG, 0.0)
        assert loop.results[-1] != 0 and loop.texts[-1] == "the pilot's ground station is lost: silent for 5 s"
        loop.from_station(beat(), link)
        loop.step()
        assert loop.held().step().phase is Phase.HOLD

    on_a_copy(body)


def test_it_may_be_left_unwatched_or_watched_for_longer() -> None:
    for setting, lasts in (("null", True), ("20", True), ("2", False)):
        loop = PilotLoop("script", f"supervisor.ground_station_timeout_s={setting}")
        loop.from_station(beat(), LINKS[1])
        loop.held()
        assert (loop.wait(10.0).phase is Phase.HOLD) is lasts


@pytest.mark.parametrize("receiver", [True, False])
def test_with_the_script_a_station_that_was_never_heard_is_noted(receiver: bool) -> None:
    """Not refused: an autopilot need not pass on the heartbeats of a station on another link of it."""
    loop = PilotLoop("script", f"plant.frontseat.rc_receiver={str(receiver).lower()}").held()
    outputs = loop.wait(8.0)
    notes = {note.subject: note.text for note in outputs.health.notes}
    assert outputs.phase is Phase.HOLD
    assert notes.get("ground station", "") == ("" if receiver else "none is heard: nobody would notice its loss")


@pytest.mark.parametrize("act", ["disarmed", "emergency stop"])
def test_with_the_script_a_new_start_is_demanded_after_a_stop(act: str) -> None:
    loop = PilotLoop("script").held()
    loop.wait(5.0, until=lambda outputs: min(abs(us - 1500) for us in loop.frontseat.outputs_us) > 50)
    seat = loop.frontseat
    if act == "disarmed":
        assert seat.arm(False)
    else:
        seat.rover.emergency_stop = True
    assert loop.wait(1.0, until=lambda outputs: outputs.phase is Phase.STANDBY).phase is Phase.STANDBY
    seat.rover.emergency_stop = False
    assert seat.arm(True)
    for _ in range(60):
        loop.step()
        assert seat.outputs_us == (1500, 1500), "arming, or lifting the stop, starts no motor"
    loop.held()
    loop.wait(5.0, until=lambda outputs: min(abs(us - 1500) for us in seat.outputs_us) > 50)
    assert min(abs(us - 1500) for us in seat.outputs_us) > 50
