"""Precedence of the pilot: at 200 random moments he takes over, and has the motors in the tick of the news."""

import random

import pytest

from asvhil.config import load_config
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect
from asvhil.operator.encoding import encode_hold
from asvhil.simplant.lockstep import Lockstep
from asvhil.supervisor.reasons import Reason, describe, explain
from asvhil.types import Inputs, Outputs, Phase
from tests.support.copies import on_a_copy
from tests.support.loop import PLAIN_CONTROLLER

MANUAL, HOLD = 0, 4
MOMENTS = [20, pytest.param(200, marks=pytest.mark.thorough)]


class Witness:
    """Reads the raw frames of each tick with nothing but the protocol, to know when the news of the pilot came."""

    def __init__(self) -> None:
        self._splitter = FrameSplitter()

    def news(self, inputs: Inputs) -> str | None:
        for frame in inputs.frames:
            if frame.port != "autopilot":
                continue
            for data in self._splitter.receive(frame.data):
                message = decode(data)
                assert message is not None
                if message.get_type() == "HEARTBEAT":
                    if not message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED:
                        return "disarmed"
                    if message.custom_mode != MANUAL:
                        return "mode"
                if message.get_type() == "RC_CHANNELS" and abs(message.chan4_raw - 1500) > 60:
                    return "stick"
        return None


def overrides(outputs: Outputs) -> list[tuple[int, int]]:
    """(port, starboard) of every RC_CHANNELS_OVERRIDE among the frames of a tick."""
    found = []
    for frame in outputs.frames:
        for data in FrameSplitter().receive(frame.data):
            message = decode(data)
            if message is not None and message.get_type() == "RC_CHANNELS_OVERRIDE":
                found.append((message.chan1_raw, message.chan3_raw))
    return found


def tick_until(loop: Lockstep, phase: Phase, limit: int = 200) -> None:
    for _ in range(limit):
        if loop.tick()[1].phase is phase:
            return
    raise AssertionError(f"{phase} was not reached")


@pytest.mark.parametrize("moments", MOMENTS)
@pytest.mark.parametrize("act", ["mode", "disarmed", "stick"])
def test_the_pilot_has_the_boat_in_the_tick_that_hears_of_it(act: str, moments: int) -> None:
    """Each time a copy of the boat is taken over; at every tenth the boat itself, which is asked to hold again."""
    chance = random.Random(f"pilot {act}")
    loop = Lockstep(load_config("sitl", (PLAIN_CONTROLLER,)))
    tick_until(loop, Phase.HOLD)
    for moment in range(moments):
        for _ in range(chance.randrange(3, 20)):
            _, outputs = loop.tick()
            assert outputs.phase is Phase.HOLD and overrides(outputs)
        fourth_us = chance.choice([1100, 1350, 1620, 1900])
        if moment % 10:
            on_a_copy(lambda fourth_us=fourth_us: take_over(loop, act, fourth_us))
        else:
            take_over(loop, act, fourth_us)
            hold_again(loop)


def take_over(loop: Lockstep, act: str, fourth_us: int) -> None:
    """The pilot acts, and has the motors in the tick that hears of it."""
    frontseat = loop.plant.frontseat
    if act == "mode":
        assert frontseat.set_mode(HOLD)
    elif act == "disarmed":
        assert frontseat.arm(False)
    else:
        frontseat.set_sticks({4: fourth_us})
    witness = Witness()
    for _ in range(5):  # at the rates asked for, news takes 0.2 s at most
        inputs, outputs = loop.tick()
        heard = witness.news(inputs)
        if heard == act:
            break
        assert outputs.phase is Phase.HOLD
    assert heard == act
    assert outputs.phase is Phase.STANDBY and outputs.pwm_us is None
    assert overrides(outputs) == [(0, 0)], "released, and nothing else said"
    for _ in range(3):
        _, outputs = loop.tick()
        assert outputs.phase is Phase.STANDBY and all(pair == (0, 0) for pair in overrides(outputs))


def hold_again(loop: Lockstep) -> None:
    """Once the pilot has given the boat back, and not before an operator asks."""
    frontseat = loop.plant.frontseat
    frontseat.set_sticks({4: 1500})
    frontseat.set_mode(MANUAL)
    loop.tick()  # the release arrives, the sticks are neutral again
    assert frontseat.arm(True)
    for _ in range(20):
        _, outputs = loop.tick()
        assert outputs.phase is Phase.STANDBY and all(pair == (0, 0) for pair in overrides(outputs))
    loop.inject("operator", encode_hold(loop.config.links.autopilot, None, None, None), "127.0.0.1:9")
    tick_until(loop, Phase.HOLD, 2)
    assert loop.tick()[1].phase is Phase.HOLD


def test_the_boat_is_the_pilots_the_moment_overrides_are_released() -> None:
    loop = Lockstep(load_config("sitl", (PLAIN_CONTROLLER,)))
    tick_until(loop, Phase.HOLD)
    for _ in range(100):
        loop.tick()
    loop.plant.frontseat.set_sticks({1: 1800, 3: 1200, 4: 1700})
    for _ in range(5):
        loop.tick()
    assert loop.plant.truth.outputs_us == (1800, 1200)


def test_hold_is_answered_by_an_ack_and_refused_with_a_reason() -> None:
    loop = Lockstep(load_config("sitl", (PLAIN_CONTROLLER, "supervisor.engage=command")))
    for _ in range(100):
        loop.tick()
    loop.inject("operator", encode_hold(loop.config.links.autopilot, None, None, None), "127.0.0.1:9")
    _, outputs = loop.tick()
    answers = [
        decode(data)
        for frame in outputs.frames
        if frame.port == "operator" and frame.peer == "127.0.0.1:9"
        for data in FrameSplitter().receive(frame.data)
    ]
    assert [m.get_type() for m in answers if m] == ["STATUSTEXT", "COMMAND_ACK"]
    assert answers[0] is not None and answers[0].text == describe(explain(Reason.NOT_ARMED))
    assert outputs.phase is Phase.STANDBY


@pytest.mark.parametrize("port", ["autopilot", "anemometer", "operator"])
def test_a_megabyte_of_noise_while_holding(port: str) -> None:
    noise = random.Random(f"noise {port}")
    loop = Lockstep(load_config("sitl", (PLAIN_CONTROLLER,)))
    tick_until(loop, Phase.HOLD)
    peer = "10.0.0.9:5" if port != "anemometer" else ""
    for _ in range(128):
        loop.inject(port, noise.randbytes(8192), peer)
        _, outputs = loop.tick()
        assert outputs.phase is Phase.HOLD
    counters = dict(outputs.health.counters)
    name = "anemometer.bad" if port == "anemometer" else f"{port}.garbage_bytes"
    assert counters[name] > (1000 if port == "anemometer" else 1_000_000)


def test_noise_in_the_autopilots_own_byte_stream_loses_little() -> None:
    """On a serial line noise and frames share one stream."""
    noise = random.Random("stream")
    loop = Lockstep(load_config("sitl", (PLAIN_CONTROLLER,)))
    tick_until(loop, Phase.HOLD)
    for _ in range(200):
        loop.inject("autopilot", noise.randbytes(512))
        assert loop.tick()[1].phase is Phase.HOLD


def long_hold(confirmation: int, number: int) -> bytes:
    sender = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    sender.seq = number
    return bytes(dialect.MAVLink_command_long_message(1, 191, 92, confirmation, 1, 0, 0, 0, 0, 0, 0).pack(sender))


@pytest.mark.parametrize("again", ["confirmation", "same bytes", "numbered anew", "set-point"])
def test_a_hold_that_is_repeated_does_not_undo_the_pilots_word(again: str) -> None:
    """The station missed our answer and repeats its command, 0.8 s after the pilot has taken the boat back."""
    loop = Lockstep(load_config("sitl", (PLAIN_CONTROLLER, "supervisor.engage=command")))
    peer = "10.0.0.1:14550"
    for _ in range(140):
        loop.tick()
    assert loop.plant.frontseat.arm(True)
    for _ in range(10):
        loop.tick()
    loop.inject("operator", long_hold(0, 40), peer)
    tick_until(loop, Phase.HOLD, 2)
    loop.plant.frontseat.set_sticks({4: 1800})
    tick_until(loop, Phase.STANDBY, 8)
    loop.plant.frontseat.set_sticks({4: 1500})
    for _ in range(15):
        loop.tick()
    setpoint = dialect.MAVLink_set_position_target_global_int_message(
        0, 1, 191, 6, 0b110111111000, 404237000, -869212000, *[0.0] * 9
    )
    said = {
        "confirmation": long_hold(1, 41),
        "same bytes": long_hold(0, 40),
        "numbered anew": long_hold(0, 41),
        "set-point": bytes(setpoint.pack(dialect.MAVLink(None, srcSystem=255, srcComponent=190))),
    }[again]
    loop.inject("operator", said, peer)
    for tick in range(60):
        _, outputs = loop.tick()
        assert outputs.phase is Phase.STANDBY and outputs.health.reason == "stick of channel 4 moved"
        assert tick == 0 or not any(pulse for pair in overrides(outputs) for pulse in pair)
    loop.inject("operator", long_hold(0, 60), peer)  # the operator asks anew
    tick_until(loop, Phase.HOLD, 2)
