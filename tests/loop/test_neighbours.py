"""Other components, vehicles and paths on the autopilot's link: the hold goes on, or ends with a reason."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable

import pytest

from asvhil.io.mavlink.frames import decode, dialect
from asvhil.supervisor.reasons import Reason
from asvhil.types import Frame, Outputs, Phase
from tests.support.shared_loop import BOAT, OTHER_BOAT, S, SharedLoop


class Voice:
    """A component that is not the autopilot: a heartbeat at 1 Hz, and at 10 Hz whatever else it sends."""

    def __init__(
        self, system: int, component: int, kind: int, autopilot: int, *messages: object, peer: str = BOAT
    ) -> None:
        self._mav = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        self._heartbeat = dialect.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 4, 3)
        self._messages, self._peer = messages, peer

    def __call__(self, tick: int, t_ns: int) -> Iterable[Frame]:
        due = [self._heartbeat] if tick % 20 == 7 else []
        due += self._messages if tick % 2 else ()  # type: ignore[arg-type]
        for message in due:
            data = bytes(message.pack(self._mav))  # type: ignore[attr-defined]
            self._mav.seq = (self._mav.seq + 1) % 256
            yield Frame(t_ns=t_ns, port="autopilot", data=data, peer=self._peer)


FALSE = (  # what another component may say of itself, and must not be taken for the autopilot's
    dialect.MAVLink_attitude_message(1, 0.0, 0.0, 2.5, 0.0, 0.0, 1.5),
    dialect.MAVLink_global_position_int_message(1, 100000000, 200000000, 0, 0, 900, 900, 0, 0),
    dialect.MAVLink_servo_output_raw_message(1, 0, 1100, 1500, 1900, *[0] * 13),
    dialect.MAVLink_rc_channels_message(1, 8, 1100, 1900, 1900, 1100, *[1500] * 14, 255),
    dialect.MAVLink_command_ack_message(511, 4, 0, 0, 1, 191),
    dialect.MAVLink_param_value_message(b"SERVO3_MIN", 1400.0, 4, 900, 3),
    dialect.MAVLink_param_value_message(b"SYSID_MYGCS", 255.0, 4, 900, 3),
    dialect.MAVLink_statustext_message(2, b"PreArm: storage failed"),
    dialect.MAVLink_ekf_status_report_message(0, 9.0, 9.0, 9.0, 9.0, 9.0),
    dialect.MAVLink_system_time_message(0, 77),
    dialect.MAVLink_timesync_message(12345, 99),
)
T = dialect
VOICES = {
    "a camera": Voice(1, 100, T.MAV_TYPE_GENERIC, T.MAV_AUTOPILOT_GENERIC, *FALSE),
    "a gimbal": Voice(1, 154, T.MAV_TYPE_GIMBAL, T.MAV_AUTOPILOT_ARDUPILOTMEGA, *FALSE),
    "an ADS-B receiver": Voice(1, 156, T.MAV_TYPE_ADSB, T.MAV_AUTOPILOT_ARDUPILOTMEGA, *FALSE, peer="10.0.0.3:1"),
    "a second computer": Voice(1, 192, T.MAV_TYPE_ONBOARD_CONTROLLER, T.MAV_AUTOPILOT_INVALID, *FALSE),
    "a ground station": Voice(255, 190, T.MAV_TYPE_GCS, T.MAV_AUTOPILOT_INVALID, *FALSE, peer="10.0.0.4:1"),
    "another boat": Voice(2, 1, T.MAV_TYPE_SURFACE_BOAT, T.MAV_AUTOPILOT_ARDUPILOTMEGA, *FALSE, peer=OTHER_BOAT),
    "acknowledgements to others": Voice(
        1, 1, T.MAV_TYPE_GCS, T.MAV_AUTOPILOT_INVALID, T.MAVLink_command_ack_message(511, 4, 0, 0, 255, 190)
    ),
}


@functools.cache
def held_beside(name: str) -> Outputs:
    """The outputs of a boat that has held its station beside a voice, or alone."""
    loop = SharedLoop()
    if name:
        loop.talk = VOICES[name]
    assert loop.ready().ask_to_hold().phase is Phase.HOLD
    return loop.held(8.0)


MORE_LIKE_OTHERS = list(VOICES)[2:-1:2]


@pytest.mark.parametrize(
    "name", [pytest.param(v, marks=[pytest.mark.thorough] * (v in MORE_LIKE_OTHERS)) for v in VOICES]
)
def test_other_components_on_the_link_do_not_end_the_hold(name: str) -> None:
    plain, outputs = held_beside(""), held_beside(name)
    assert outputs.estimate is not None and plain.estimate is not None
    assert outputs.estimate == plain.estimate and outputs.pwm_us == plain.pwm_us
    assert [note for note in outputs.health.notes if not note.ok] == []
    counters, plain_counters = dict(outputs.health.counters), dict(plain.health.counters)
    for counter in ("autopilot.streams_denied", "autopilot.reboots", "autopilot.stream_requests"):
        assert counters[counter] == plain_counters[counter]


def test_who_calls_itself_an_autopilot_is_noted_by_name() -> None:
    loop = SharedLoop()
    loop.talk = VOICES["a gimbal"]
    _, outputs = loop.ready().tick()
    assert [(n.subject, n.text, n.ok) for n in outputs.health.notes if n.subject == "neighbours"] == [
        ("neighbours", "gimbal 1/154: not the autopilot, though its heartbeat says so", True)
    ]


@pytest.mark.parametrize("name", ["a camera", "a gimbal", "an ADS-B receiver"])
def test_another_component_does_not_keep_the_link_of_a_dead_autopilot_alive(name: str) -> None:
    loop = SharedLoop().ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    loop.talk = VOICES[name]
    loop.held(3.0)
    loop.way = lambda frame: ()  # the autopilot dies
    start_ns = loop.t_ns
    phases = []
    while (loop.t_ns - start_ns) < 6 * S:
        _, outputs = loop.tick()
        phases.append(outputs.phase)
    assert Phase.FAILSAFE in phases[:70] and outputs.phase is Phase.STANDBY
    assert outputs.health.code == Reason.HEARTBEAT_LOST


@pytest.mark.parametrize(
    ("kind", "word"),
    [
        (T.MAV_TYPE_QUADROTOR, "quadrotor"),
        (T.MAV_TYPE_FIXED_WING, "fixed wing"),
        (T.MAV_TYPE_SUBMARINE, "submarine"),
        (T.MAV_TYPE_GENERIC, "generic"),
    ],
)
def test_a_vehicle_that_does_not_float_is_refused_by_name(kind: int, word: str) -> None:
    loop = SharedLoop()

    def kind_of(frame: Frame) -> Iterable[Frame]:
        message = decode(frame.data)
        if message is not None and message.get_type() == "HEARTBEAT":
            message.type = kind
            mav = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
            mav.seq = message.get_seq()
            frame = dataclasses.replace(frame, data=bytes(message.pack(mav)))
        yield frame

    loop.way = kind_of
    outputs = loop.ready().ask_to_hold()
    assert outputs.phase is Phase.STANDBY
    loop.tick()
    assert f"this vehicle is no boat: {word}" in loop.texts
    assert ("autopilot", f"this vehicle is no boat: {word}") in {(n.subject, n.text) for n in outputs.health.notes}
    # Where it comes beside our boat, a hold ends.
    loop = SharedLoop().ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    loop.talk = Voice(1, 1, kind, T.MAV_AUTOPILOT_ARDUPILOTMEGA, peer=OTHER_BOAT)
    while loop.tick()[1].phase is Phase.HOLD:
        assert loop.ticks < 250
    _, outputs = loop.tick()
    assert outputs.health.code == Reason.NOT_A_BOAT


def test_another_program_with_our_own_id_is_told_and_our_own_echo_is_not() -> None:
    loop = SharedLoop()
    echo: list[bytes] = []
    loop.talk = lambda tick, t_ns: [Frame(t_ns=t_ns, port="autopilot", data=data, peer="10.0.0.7:1") for data in echo]
    for _ in range(200):
        echo[:] = loop.sent
        _, outputs = loop.tick()
    assert [n.subject for n in outputs.health.notes if n.subject == "our own id"] == []
    loop.talk = Voice(1, 191, T.MAV_TYPE_ONBOARD_CONTROLLER, T.MAV_AUTOPILOT_INVALID, peer="10.0.0.7:1")
    for _ in range(60):
        _, outputs = loop.tick()
    (note,) = [n for n in outputs.health.notes if n.subject == "our own id"]
    assert note.text == "another program sends as 1/191: stop it, or give us another" and not note.ok
