"""Faults of a whole loop, each with the reaction that is promised for it: the rows of tests/loop/test_fault_matrix.py.

A fault is broken in for real: the simulated boat's sensors and motors fail by `plant.faults`, links lose or change
bytes on the way, the simulated autopilot reboots, changes mode or loses its parameters, and ground stations send
messages.
"""

from __future__ import annotations

import dataclasses
import math
import random
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

from asvhil.config import Config, load_config
from asvhil.controller.station_mpc import StationMpc
from asvhil.io.mavlink.frames import Parser, dialect, message_id
from asvhil.logs.recorder import Recorder
from asvhil.operator.encoding import encode_hold, encode_release
from asvhil.simplant.lockstep import EPOCH_NS
from asvhil.supervisor.fault_table import ROWS as TABLE
from asvhil.supervisor.fault_table import FaultRow
from asvhil.types import Frame
from tests.support.loop import GroundStationLoop

S = 1_000_000_000
MANUAL, HOLD_MODE, LOITER = 0, 4, 5
NEUTRAL_US = (1500, 1500)
Way = Callable[[Frame], Iterable[Frame]]


@dataclasses.dataclass(frozen=True)
class Fault:
    """A row of the table of faults by its name, and how it is broken in.

    `plant` are faults of the simulated boat, by kind and its further keys; `act` breaks what these cannot, after
    `setup` at the start. `lasts_s` is the time after which `mend` undoes it; None: it stays. `farther_m` bounds how
    much farther off the station the boat gets while the hold goes on.
    """

    name: str
    plant: tuple[str, ...] = ()
    setup: Callable[[FaultLoop], None] | None = None
    act: Callable[[FaultLoop], None] | None = None
    mend: Callable[[FaultLoop], None] | None = None
    lasts_s: float | None = None
    watch_s: float = 6.0
    farther_m: float = 3.0
    config: str = "sitl"
    keys: tuple[str, ...] = ()
    motors_stop: bool = True  # whether the autopilot's outputs are seen to stand still too

    @property
    def promise(self) -> FaultRow:
        """What is promised."""
        return TABLE[self.name]


class FaultLoop(GroundStationLoop):
    """Lockstep whose links are ways: what the boat sends and what it is sent may be lost, late, or other bytes."""

    def __init__(self, settings: Config, recorder: Recorder | None = None) -> None:
        super().__init__(settings, recorder)
        self.from_plant: Way = lambda frame: (frame,)
        self.to_plant: Way = lambda frame: (frame,)
        self.talk: Callable[[FaultLoop], Iterable[Frame]] = lambda loop: ()
        self.chance = random.Random()
        self._late: deque[tuple[int, Frame]] = deque()

    def begin(self, fault: Fault) -> None:
        """Break a fault in now."""
        self.chance.seed(fault.name)
        from_s = (self.t_ns - EPOCH_NS) / S
        until = "" if fault.lasts_s is None else f", until_s: {from_s + fault.lasts_s}"
        parts = ", ".join(f"{{{part}, from_s: {from_s}{until}}}" for part in fault.plant)
        self.plant.break_in(load_config(fault.config, (f"plant.faults=[{parts}]",)).plant.faults)
        if fault.act is not None:
            fault.act(self)

    def receive(self) -> tuple[Frame, ...]:
        found: list[Frame] = []
        for frame in super().receive():
            found += self.from_plant(frame) if frame.port == "autopilot" else (frame,)
        while self._late and self._late[0][0] <= self.t_ns:
            found.append(dataclasses.replace(self._late.popleft()[1], t_ns=self.t_ns))
        return (*found, *self.talk(self))

    def deliver(self, frames: tuple[Frame, ...]) -> None:
        passed: list[Frame] = []
        for frame in frames:
            passed += self.to_plant(frame) if frame.port == "autopilot" else (frame,)
        super().deliver(tuple(passed))

    def delay(self, frame: Frame, delay_s: float) -> Iterable[Frame]:
        """A way that gives each frame later."""
        self._late.append((frame.t_ns + round(delay_s * S), frame))
        return ()

    @property
    def off_m(self) -> float:
        """How far the boat truly is from its station at the origin."""
        truth = self.plant.truth
        return math.hypot(truth.n_m, truth.e_m)

    @property
    def motors_stand_still(self) -> bool:
        outputs_us = self.plant.truth.outputs_us
        return all(pulse_us in (0, 1500) for pulse_us in outputs_us)


# --- what breaks -----------------------------------------------------------------------------------------------


def _links(*, inward: Way | None = None, outward: Way | None = None) -> Callable[[FaultLoop], None]:
    def act(loop: FaultLoop) -> None:
        loop.from_plant = inward or loop.from_plant
        loop.to_plant = outward or loop.to_plant

    return act


def _mended(loop: FaultLoop) -> None:
    loop.from_plant = loop.to_plant = lambda frame: (frame,)
    loop.talk = lambda _: ()


def _nothing(frame: Frame) -> Iterable[Frame]:
    return ()


def _without_sticks(frame: Frame) -> Iterable[Frame]:
    unwanted = dialect.MAVLINK_MSG_ID_RC_CHANNELS
    kept = [one for one in Parser().receive("", frame.data) if message_id(one) != unwanted]
    return (dataclasses.replace(frame, data=b"".join(kept)),) if kept else ()


def _twice(frame: Frame) -> Iterable[Frame]:
    return frame, frame


def _lossy(loop: FaultLoop) -> None:
    def way(frame: Frame) -> Iterable[Frame]:
        return (frame,) if loop.chance.random() > 0.2 else ()

    loop.from_plant = loop.to_plant = way


def _reordered(loop: FaultLoop) -> None:
    kept: list[Frame] = []

    def way(frame: Frame) -> Iterable[Frame]:
        kept.append(frame)
        if len(kept) < 4:
            return ()
        given = kept.copy()
        kept.clear()
        loop.chance.shuffle(given)
        return given

    loop.from_plant = way


def _late(delay_s: float) -> Callable[[FaultLoop], None]:
    def act(loop: FaultLoop) -> None:
        loop.from_plant = lambda frame: loop.delay(frame, delay_s)

    return act


def _corrupt(loop: FaultLoop) -> None:
    def way(frame: Frame) -> Iterable[Frame]:
        if loop.chance.random() > 0.1:
            return (frame,)
        data = bytearray(frame.data)
        data[loop.chance.randrange(len(data))] ^= 1 << loop.chance.randrange(8)
        return (dataclasses.replace(frame, data=bytes(data)),)

    loop.from_plant = loop.to_plant = way


def _cut_anywhere(loop: FaultLoop) -> None:
    def way(frame: Frame) -> Iterable[Frame]:
        at = loop.chance.randrange(len(frame.data))
        return dataclasses.replace(frame, data=frame.data[:at]), dataclasses.replace(frame, data=frame.data[at:])

    loop.from_plant = loop.to_plant = way


def _flood(port: str) -> Callable[[FaultLoop], None]:
    def act(loop: FaultLoop) -> None:
        loop.talk = lambda it: [Frame(t_ns=it.t_ns, port=port, data=it.chance.randbytes(8000), peer="10.0.0.66:1")]

    return act


def _mavlink(message: Any, system: int, component: int, number: int = 0) -> bytes:
    sender = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
    sender.seq = number % 256
    return bytes(message.pack(sender))


def _voice(message: Callable[[int], Any], system: int, component: int, every: int = 20) -> Callable[[FaultLoop], None]:
    """Another voice on the autopilot's link, each second by default."""

    def act(loop: FaultLoop) -> None:
        def talk(it: FaultLoop) -> Iterable[Frame]:
            if it.ticks % every:
                return ()
            data = _mavlink(message(it.ticks), system, component, it.ticks // every)
            return (Frame(t_ns=it.t_ns, port="autopilot", data=data, peer=""),)

        loop.talk = talk

    return act


def _heartbeat(kind: int, autopilot: int, mode: int = 0) -> Callable[[int], Any]:
    return lambda _: dialect.MAVLink_heartbeat_message(kind, autopilot, mode, 0, dialect.MAV_STATE_ACTIVE, 3)


def _time_back(loop: FaultLoop) -> None:
    loop.t_ns -= S


def _reboot(loop: FaultLoop) -> None:
    loop.frontseat.reboot(loop.plant.t_ns)


def _parameter(**values: float) -> Callable[[FaultLoop], None]:
    def act(loop: FaultLoop) -> None:
        for name, value in values.items():
            assert loop.frontseat.rover.parameters.set(name, value)

    return act


def _mode(number: int) -> Callable[[FaultLoop], None]:
    def act(loop: FaultLoop) -> None:
        assert loop.frontseat.set_mode(number)

    return act


def _disarm(loop: FaultLoop) -> None:
    assert loop.frontseat.arm(False)


def _stick(loop: FaultLoop) -> None:
    loop.frontseat.set_sticks({4: 1700})


def _receiver_tells_its_strength(loop: FaultLoop) -> None:
    loop.frontseat.rover.rc.strength = 180


def _transmitter_lost(loop: FaultLoop) -> None:
    loop.frontseat.set_receiver(False)


def _emergency_stop(loop: FaultLoop) -> None:
    loop.frontseat.rover.emergency_stop = True


def _solver(**changes: Any) -> Callable[[FaultLoop], None]:
    """The controller gives something else from now on; in a replay too, since it goes by the time of the estimate."""

    def act(loop: FaultLoop) -> None:
        from_ns, step = loop.t_ns, StationMpc.step

        def broken(self: Any, estimate: Any, *rest: Any) -> Any:
            control = step(self, estimate, *rest)
            return dataclasses.replace(control, **changes) if estimate.t_ns > from_ns else control

        StationMpc.step = broken  # type: ignore[method-assign]

    return act


def _operator(data: Callable[[FaultLoop], bytes], every: int = 1) -> Callable[[FaultLoop], None]:
    def act(loop: FaultLoop) -> None:
        def talk(it: FaultLoop) -> Iterable[Frame]:
            if it.ticks % every:
                return ()
            return (Frame(t_ns=it.t_ns, port="operator", data=data(it), peer="10.0.0.7:1"),)

        loop.talk = talk

    return act


def _release(loop: FaultLoop) -> None:
    loop.say(encode_release(loop.config.links.autopilot))


def _moves_far(loop: FaultLoop) -> None:
    """A hold far away while one is kept: a typing error of the operator."""
    loop.say(encode_hold(loop.config.links.autopilot, 41.5, -86.9212, None))


def _odd_setpoint(it: FaultLoop) -> bytes:
    message = dialect.MAVLink_set_position_target_local_ned_message(
        0, 1, 191, dialect.MAV_FRAME_LOCAL_NED, 0xDF8, math.nan, math.inf, math.nan, 0, 0, 0, 0, 0, 0, math.nan, 0
    )
    return _mavlink(message, 255, 190, it.ticks)


def _wrong_crc(it: FaultLoop) -> bytes:
    data = encode_hold(it.config.links.autopilot, 41.5, -86.9, None)
    return data[:-2] + bytes([data[-2] ^ 1, data[-1]])


def _pilots_station(loop: FaultLoop) -> None:
    body = dialect.MAVLink_manual_control_message(1, 32767, 700, 800, 32767, 0)
    loop.inject("autopilot", _mavlink(body, loop.config.links.autopilot.override_system_id, 190), "10.0.0.5:14550")


BATTERY, RELEASE = ("supervisor.battery.low_v=11.5",), "supervisor.battery.on_low=release"
INS = "sitl-vn300"  # with the autopilot standing by
COMPASS = "sitl-bream"  # whose heading has no other source
GENERIC, COPTER = dialect.MAV_TYPE_CAMERA, dialect.MAV_TYPE_QUADROTOR
INVALID, ARDUPILOT = dialect.MAV_AUTOPILOT_INVALID, dialect.MAV_AUTOPILOT_ARDUPILOTMEGA

SENSORS = (
    Fault("GNSS silent for 5 s", plant=("kind: gnss-silent",), lasts_s=5.0),
    Fault("GNSS lost for good", plant=("kind: gnss-silent",), watch_s=44.0, farther_m=8.0),
    Fault("GNSS jumps by 20 m for 5 s", plant=("kind: gnss-jump, size: 20",), lasts_s=5.0),
    Fault("GNSS jumps by 3 m for 3 s", plant=("kind: gnss-jump, size: 3",), lasts_s=3.0),
    Fault("GNSS frozen for 5 s", plant=("kind: gnss-frozen",), lasts_s=5.0),
    Fault("heading silent for 5 s", plant=("kind: heading-silent",), lasts_s=5.0, config=COMPASS, farther_m=6.0),
    Fault("heading of the INS lost", plant=("kind: heading-silent",), config=INS),
    Fault(
        "the only heading lost",
        plant=("kind: heading-silent",),
        watch_s=44.0,
        farther_m=25.0,
        config=COMPASS,
    ),
    Fault("heading jumps by 60 degrees for 4 s", plant=("kind: heading-jump, size: 60",), lasts_s=4.0),
    Fault(
        "heading slowly wrong, by 2 degrees a second",
        plant=("kind: heading-drift",),
        watch_s=91.0,
        farther_m=16.0,  # of six seeds across the wind: 17 to 80 s, 1 to 13 m; told by name after 20 to 25 s in all
    ),
    Fault(
        "GNSS and heading lost",
        plant=("kind: gnss-silent", "kind: heading-silent"),
        farther_m=6.0,
        config=COMPASS,
    ),
    Fault("gyro and accelerometer silent", plant=("kind: imu-silent",)),
    Fault("anemometer silent", plant=("kind: anemometer",)),
    Fault("anemometer stuck", plant=("kind: anemometer-stuck",)),
    Fault("vane stuck", plant=("kind: vane",)),
    Fault("cups stuck", plant=("kind: cups",)),
    Fault("bytes of noise on the anemometer's line", act=_flood("anemometer")),
    Fault("time runs back by a second", act=_time_back, farther_m=4.0),
)
LINKS = (
    Fault("link down both ways", act=_links(inward=_nothing, outward=_nothing)),
    Fault("nothing comes from the autopilot", act=_links(inward=_nothing)),
    Fault("nothing reaches the autopilot", act=_links(outward=_nothing)),
    Fault("link down for 1 s", act=_links(inward=_nothing, outward=_nothing), mend=_mended, lasts_s=1.0),
    Fault("20 % of the frames lost each way", act=_lossy),
    Fault("frames reordered", act=_reordered),
    Fault("frames doubled", act=_links(inward=_twice, outward=_twice)),
    Fault("frames 0.3 s late", act=_late(0.3)),
    Fault("frames 6 s late", act=_late(6.0)),
    Fault("a tenth of the frames damaged", act=_corrupt),
    Fault("frames cut anywhere", act=_cut_anywhere),
    Fault("noise on the autopilot's link", act=_flood("autopilot")),
)
NEIGHBOURS = (
    Fault("a camera on the autopilot's system", act=_voice(_heartbeat(GENERIC, INVALID), 1, 100)),
    Fault("a second ground station", act=_voice(_heartbeat(dialect.MAV_TYPE_GCS, INVALID, 4), 253, 190)),
    Fault(
        "the autopilot becomes a copter",
        act=_voice(_heartbeat(COPTER, ARDUPILOT, 81), 1, 1),
    ),
    Fault(
        "acknowledgements that nobody asked for",
        act=_voice(lambda n: dialect.MAVLink_command_ack_message(n % 600, n % 6, 0, 0, 255, 190), 1, 1, every=2),
    ),
)
AUTOPILOT = (
    Fault("autopilot reboots", act=_reboot),
    Fault("its fail-safe changes the mode", act=_mode(HOLD_MODE)),
    Fault("battery low", plant=("kind: battery",), keys=BATTERY, watch_s=12.0, farther_m=8.0),
    Fault(
        "battery low, where that ends a hold",
        plant=("kind: battery",),
        keys=(*BATTERY, RELEASE),
        watch_s=14.0,
        farther_m=8.0,
    ),
    Fault("emergency stop of the motors", act=_emergency_stop),
    Fault("an output loses its function", act=_parameter(SERVO1_FUNCTION=0), watch_s=7.0, motors_stop=False),
    Fault("outputs swapped", act=_parameter(SERVO1_FUNCTION=74, SERVO3_FUNCTION=73)),
    Fault("an output reversed", act=_parameter(SERVO1_REVERSED=1)),
    Fault("sticks mixed as steering and throttle", act=_parameter(PILOT_STEER_TYPE=0)),
    Fault("overrides switched off", act=_parameter(RC_OPTIONS=2)),
    Fault("another system id is obeyed", act=_parameter(SYSID_MYGCS=77)),
)
PILOT = (
    Fault("pilot changes the mode", act=_mode(LOITER)),
    Fault("pilot moves a stick", act=_stick),
    Fault("the autopilot stops telling the pilot's sticks", act=_links(inward=_without_sticks), watch_s=9.0),
    Fault("pilot disarms", act=_disarm),
    Fault("pilot's ground station moves a stick", act=_pilots_station),
    # An ArduRover takes overrides for its radio: only a receiver that tells its signal strength can be seen to be lost.
    Fault("pilot's transmitter lost, no signal strength", plant=("kind: transmitter",)),
    Fault(
        "pilot's transmitter lost, signal strength told",
        setup=_receiver_tells_its_strength,
        act=_transmitter_lost,
    ),
    Fault("operator releases", act=_release),
    Fault("operator's link silent"),
)
CONTROLLER = (
    Fault("controller finds no solution", act=_solver(ok=False)),
    Fault(
        "controller gives no numbers",
        act=_solver(command=(math.nan, math.nan)),
    ),
    Fault(
        "controller asks for ten times full thrust",
        act=_solver(command=(10.0, 10.0)),
        watch_s=26.0,
        farther_m=30.0,
    ),
)
OPERATOR = (
    Fault("a hold 120 km away", act=_moves_far),
    Fault("set-points that are no numbers", act=_operator(_odd_setpoint)),
    Fault("commands with a wrong checksum", act=_operator(_wrong_crc)),
    Fault("noise on the operator's link", act=_flood("operator")),
)

ROWS = (*SENSORS, *LINKS, *NEIGHBOURS, *AUTOPILOT, *PILOT, *CONTROLLER, *OPERATOR)

# The boat's start and weather, and when the fault comes (s after power-on).
PHASES: dict[str, tuple[tuple[str, ...], float]] = {
    "approach": (("plant.start_n_m=-14", "plant.start_e_m=-3"), 7.0),
    "settled": (("plant.start_n_m=0", "plant.start_e_m=0"), 14.0),
    "across": (
        (
            *("plant.start_n_m=0", "plant.start_e_m=0"),
            *("plant.weather.wind.speed_mps=6", "plant.weather.wind.toward_deg=90"),
        ),
        14.0,
    ),
}
