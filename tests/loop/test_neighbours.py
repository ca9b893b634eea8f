"""Other components, vehicles and paths on the autopilot's link: the hold goes on, or ends with a reason."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable

import pytest

from asvhil.config import Config, load_config
from asvhil.io.mavlink.frames import decode, dialect, source
from asvhil.simplant.plant import Plant
from asvhil.supervisor.reasons import Reason
from asvhil.types import Frame, Outputs, Phase
from tests.support.loop import GroundStationLoop
from tests.support.lossy_plant import Way, losing_messages, whole

S = 1_000_000_000
BOAT, OTHER_BOAT = "10.0.0.1:14550", "10.0.0.2:14550"
Talk = Callable[[int, int], Iterable[Frame]]  # (tick, t_ns) to what others send
NEUTRAL = (1500, 1500)
HOLD_MODE = 4  # of an ArduRover


class SharedLoop(GroundStationLoop):
    """A boat at a peer of its own, and whoever talks beside it.

    `way` gives what becomes of a frame of the boat. `others` are boats at one more peer, and `talk` anybody else.
    """

    def __init__(self, *overrides: str, config: str = "sitl") -> None:
        super().__init__(load_config(config, ("supervisor.engage=command", *overrides)))
        self.talk: Talk = lambda tick, t_ns: ()
        self.way: Way = whole
        self.sent: list[bytes] = []  # to the autopilot, in the last tick
        self.others: list[Plant] = []
        self.peers = (BOAT, OTHER_BOAT)

    def receive(self) -> tuple[Frame, ...]:
        frames: list[Frame] = []
        for frame in super().receive():
            if frame.port == "autopilot":
                frames += self.way(dataclasses.replace(frame, peer=self.peers[0]))
            else:
                frames.append(frame)
        for other in self.others:
            frames += [
                dataclasses.replace(frame, peer=self.peers[1])
                for frame in other.advance(self.t_ns)
                if frame.port == "autopilot"
            ]
        return (*frames, *self.talk(self.ticks, self.t_ns))

    def deliver(self, frames: tuple[Frame, ...]) -> None:
        super().deliver(frames)
        self.sent = [frame.data for frame in frames if frame.port == "autopilot"]
        for frame in frames:
            for boat in self.others:
                boat.receive(frame)

    def ready(self) -> SharedLoop:
        """Armed, and ready for a hold."""
        self.wait(7.5)
        for boat in (self.plant, *self.others):
            assert boat.frontseat.arm(True)
        self.wait(0.5)
        return self

    def held(self, seconds: float) -> Outputs:
        """Ticks for a time in which the station is held throughout: the last outputs."""
        outputs = self.wait(seconds, lambda outputs: outputs.phase is not Phase.HOLD)
        assert outputs.phase is Phase.HOLD, outputs.health.reason
        return outputs

    def neutral_at_the_end(self) -> None:
        """The last tick has sent neutral, then release."""
        assert self.overrides_us[-1][0] == NEUTRAL and self.overrides_us[-1][-1] == (0, 0)


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


@pytest.mark.parametrize("name", VOICES)
def test_other_components_on_the_link_do_not_end_the_hold(name: str) -> None:
    alone, loop = SharedLoop(), SharedLoop()
    loop.talk = VOICES[name]
    for one in (alone, loop):
        one.ready()
        assert one.ask_to_hold().phase is Phase.HOLD
    plain, outputs = alone.held(12.0), loop.held(12.0)
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


# --- two boats with one id, and one boat by two ways ------------------------------------------------------------


def another_boat(config: Config, *overrides: str, boots_after_s: float = 0.0) -> Plant:
    """A boat of the same system id, at the same port."""
    settings = ("supervisor.engage=command", "plant.seed=77", *overrides)
    return Plant(load_config("sitl", settings), SharedLoop().t_ns + round(boots_after_s * S))


@pytest.mark.parametrize(
    ("case", "overrides", "boots_after_s"),
    [
        ("booted later", ("plant.start_n_m=30",), 20.0),
        ("booted 3 s later, near by", (), 3.0),
        ("booted in the same instant", ("plant.start_n_m=2",), 0.0),
        ("booted in the same instant, far away", ("plant.start_n_m=60",), 0.013),
    ],
)
def test_a_second_boat_with_the_same_id_ends_the_hold_in_words(
    case: str, overrides: tuple[str, ...], boots_after_s: float
) -> None:
    loop = SharedLoop().ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    loop.held(2.0)
    second = another_boat(loop.config, *overrides, boots_after_s=boots_after_s)
    while loop.t_ns < second.t_ns + 15 * S:
        loop.held(0.05)
    second.advance(loop.t_ns)
    second.frontseat.set_receiver(True)
    assert second.frontseat.arm(True)
    loop.others.append(second)
    while (ended := loop.tick()[1]).phase is Phase.HOLD:
        assert loop.ticks < 1400
    assert ended.phase is Phase.STANDBY and ended.health.code == Reason.TWO_VEHICLES
    assert ended.health.reason == "two vehicles have system id 1"
    loop.neutral_at_the_end()
    for _ in range(100):
        _, outputs = loop.tick()
        assert outputs.pwm_us is None
    assert loop.ask_to_hold().phase is Phase.STANDBY and loop.tick() and "two vehicles have system id 1" in loop.texts
    # Once the other is gone, 10 s later, ours is ours again.
    loop.others.clear()
    for _ in range(260):
        _, outputs = loop.tick()
    assert [n for n in outputs.health.notes if n.subject == "autopilot"] == []
    assert loop.ask_to_hold().phase is Phase.HOLD


def test_two_boats_from_the_start_are_never_armed_into_a_hold() -> None:
    loop = SharedLoop()
    loop.others.append(another_boat(loop.config, "plant.start_n_m=20", boots_after_s=0.37))
    assert loop.ready().ask_to_hold().phase is Phase.STANDBY
    loop.tick()
    assert "two vehicles have system id 1" in loop.texts


@pytest.mark.parametrize("says", ["disarmed", "another mode"])
def test_a_second_boat_ends_the_hold_by_what_it_says_and_is_named_once_it_is_known(says: str) -> None:
    """A heartbeat that says so may be the pilot's word, and is not waited on."""
    loop = SharedLoop().ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    second = another_boat(loop.config)
    second.advance(loop.t_ns)
    if says == "another mode":
        second.frontseat.set_receiver(True)
        assert second.frontseat.arm(True)
        second.frontseat.set_mode(HOLD_MODE)
    loop.others.append(second)
    codes = [loop.tick()[1].health.code for _ in range(120)]
    assert codes[-1] == Reason.TWO_VEHICLES
    assert set(codes) <= {Reason.HOLDING, Reason.DISARMED, Reason.MODE_CHANGED, Reason.TWO_VEHICLES}
    assert loop.ask_to_hold().phase is Phase.STANDBY and loop.tick() and "two vehicles have system id 1" in loop.texts


def test_a_hold_that_has_ended_long_before_keeps_its_reason() -> None:
    loop = SharedLoop().ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    loop.held(1.0)
    assert loop.plant.frontseat.arm(False)
    for _ in range(220):
        _, outputs = loop.tick()
    assert outputs.health.code == Reason.DISARMED
    loop.others.append(another_boat(loop.config, boots_after_s=3.0))
    loop.others[0].advance(loop.t_ns)
    for _ in range(120):
        _, outputs = loop.tick()
    assert outputs.health.code == Reason.DISARMED
    assert "autopilot" in {note.subject for note in outputs.health.notes}


def test_two_boats_on_one_line_without_peers() -> None:
    loop = SharedLoop()
    loop.peers = ("", "")
    loop.ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    second = another_boat(loop.config, boots_after_s=-4.0)
    second.advance(loop.t_ns)
    assert second.frontseat.arm(True)
    loop.others.append(second)
    while loop.tick()[1].phase is Phase.HOLD:
        assert loop.ticks < 800
    _, outputs = loop.tick()
    assert outputs.health.code == Reason.TWO_VEHICLES


class SecondWay:
    """The same boat once more: the same frames by another peer, later, some of them lost or the link stalled."""

    def __init__(self, delay_s: float, lost: int = 0, stalls: tuple[tuple[float, float], ...] = ()) -> None:
        self.delay_ns = round(delay_s * S)
        self._lost, self._stalls = lost, stalls
        self._late: list[Frame] = []
        self._count = 0
        self._start_ns: int | None = None

    def keep(self, frame: Frame) -> Iterable[Frame]:
        self._start_ns = frame.t_ns if self._start_ns is None else self._start_ns
        self._count += 1
        if not self._lost or self._count % self._lost:
            self._late.append(frame)
        yield frame

    def __call__(self, tick: int, t_ns: int) -> Iterable[Frame]:
        since_s = 0.0 if self._start_ns is None else (t_ns - self._start_ns) / S
        if any(begin <= since_s < end for begin, end in self._stalls):
            return
        while self._late and self._late[0].t_ns + self.delay_ns <= t_ns:
            yield dataclasses.replace(self._late.pop(0), t_ns=t_ns, peer=OTHER_BOAT)


@pytest.mark.parametrize(
    "way",
    [
        SecondWay(0.0),
        SecondWay(0.3),
        SecondWay(1.4, lost=5),
        SecondWay(3.0),
        SecondWay(0.1, stalls=((12.0, 15.0), (18.0, 24.0))),
    ],
    ids=["at once", "0.3 s", "1.4 s and lossy", "3 s", "stalled"],
)
def test_one_boat_by_two_ways_is_one_boat(way: SecondWay) -> None:
    loop = SharedLoop()
    loop.way, loop.talk = way.keep, way
    loop.ready()
    for _ in range(20):
        _, outputs = loop.tick()
    assert not [n for n in outputs.health.notes if n.subject == "autopilot"]
    assert dict(outputs.health.counters)["autopilot.reboots"] == 0
    if way.delay_ns < S:  # what is later is no good to steer by, but no second boat either
        assert loop.ask_to_hold().phase is Phase.HOLD
        outputs = loop.held(15.0)
    else:
        for _ in range(300):
            _, outputs = loop.tick()
    assert not [n for n in outputs.health.notes if n.subject == "autopilot"]
    assert dict(outputs.health.counters)["autopilot.reboots"] == 0


def test_one_boat_by_two_ports_of_its_autopilot_is_one_boat() -> None:
    """Each port has streams of its own: other times, other numbers, the same clock."""
    loop = SharedLoop().ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    mav = dialect.MAVLink(None, srcSystem=1, srcComponent=1)

    def other_port(frame: Frame) -> Iterable[Frame]:
        yield frame
        message = decode(frame.data)
        if message is None or message.get_type() not in ("ATTITUDE", "GLOBAL_POSITION_INT", "HEARTBEAT"):
            return
        if hasattr(message, "time_boot_ms"):
            message.time_boot_ms += 7
        data = bytes(message.pack(mav))
        mav.seq = (mav.seq + 1) % 256
        yield dataclasses.replace(frame, data=data, peer=OTHER_BOAT)

    loop.way = other_port
    outputs = loop.held(15.0)
    assert [n for n in outputs.health.notes if n.subject == "autopilot"] == []


# --- life, and the age of the mode ------------------------------------------------------------------------------


@pytest.mark.parametrize("lost_s", [0.9, 2.0, 3.0, 3.9])
def test_lost_heartbeats_end_no_hold_while_other_messages_come(lost_s: float) -> None:
    loop = SharedLoop("links.autopilot.streams_hz={HEARTBEAT: 1}").ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    loop.held(2.0)
    loop.way = losing_messages(["HEARTBEAT"])
    outputs = loop.held(lost_s)
    if lost_s < 1.0 or lost_s >= 3.0:  # the last heartbeat came up to a second before
        assert bool([n for n in outputs.health.notes if n.subject == "autopilot's mode"]) == (lost_s >= 3.0)
    loop.way = whole
    loop.held(3.0)


def test_without_a_heartbeat_the_motors_are_neutral_once_the_mode_is_too_old() -> None:
    loop = SharedLoop().ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    loop.held(2.0)
    loop.way = losing_messages(["HEARTBEAT"])
    assert loop.plant.frontseat.set_mode(4)  # the pilot's word, which the link loses
    start_ns, phases, asked = loop.t_ns, {}, 0
    while loop.t_ns - start_ns < 9 * S:
        _, outputs = loop.tick()
        phases.setdefault(outputs.phase, (loop.t_ns - start_ns) / S)
        asked += sum(
            m is not None and m.get_type() == "COMMAND_LONG" and (m.command, m.param1) == (512, 0.0)
            for m in map(decode, loop.sent)
        )
    # Whatever comes first: outputs that do not follow, or a mode that is too old.
    first = min(at for phase, at in phases.items() if phase is not Phase.HOLD)
    assert first <= 5.3 and outputs.phase is Phase.STANDBY
    assert asked > 5


def test_a_mode_that_is_asked_for_comes_back() -> None:
    """Only the heartbeats that stream are lost: those that were asked for come."""
    loop = SharedLoop("links.autopilot.streams_hz={HEARTBEAT: 0.05}").ready()
    outputs = loop.ask_to_hold()
    assert outputs.phase is Phase.HOLD, outputs.health.reason
    loop.held(25.0)


def test_of_frames_that_are_cut_none_is_lost() -> None:
    for size in (1, 64, 256):
        loop = SharedLoop()
        rest, sent = bytearray(), [0]

        def cut(frame: Frame, size: int = size, rest: bytearray = rest, sent: list[int] = sent) -> Iterable[Frame]:
            rest += frame.data
            sent[0] += 1
            while len(rest) >= size:
                yield dataclasses.replace(frame, data=bytes(rest[:size]))
                del rest[:size]

        loop.way = cut
        loop.ready()
        assert loop.ask_to_hold().phase is Phase.HOLD
        outputs = loop.held(5.0)
        counters = dict(outputs.health.counters)
        assert [counters[f"autopilot.{name}"] for name in ("bad_crc", "garbage_bytes", "lost")] == [0, 0, 0]
        waiting = 1 + size // 12  # at most: frames that end in what is not yet a whole piece
        assert sent[0] - waiting <= counters["autopilot.frames"] <= sent[0]


def test_the_autopilot_may_be_another_component_where_the_config_says_so() -> None:
    loop = SharedLoop("links.autopilot.autopilot_component_id=2")
    loop.ready()
    outputs = loop.ask_to_hold()
    assert outputs.phase is Phase.STANDBY and outputs.health.code == Reason.WAITING_FOR_HOLD
    (note,) = [n for n in outputs.health.notes if n.subject == "neighbours"]
    assert note.text.startswith("surface boat 1/1 is heard, 1/2 is not") and not note.ok
    assert all(source(data)[0] == 1 for data in loop.sent)
