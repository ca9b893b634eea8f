"""The most dangerous rows of the fault matrix again: two processes, real sockets, a real serial line, the wall clock.

The others of these are the daemon's deaths (test_guardian_in_the_loop.py), its terminal (test_displays.py), and its
computer (test_harsh_host.py). Those that can be mended come one after the other to one boat, which is held anew after
each: the log of all of them is replayed.
"""

from __future__ import annotations

import itertools
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.io.mavlink.frames import dialect, message_id, renumbered
from asvhil.logs.replay import replay
from asvhil.operator.encoding import encode_hold
from asvhil.supervisor.fault_table import ROWS
from tests.support.processes import Bench, Process, bench
from tests.support.relay import Relay

pytestmark = pytest.mark.real_time

START = ("plant.start_n_m=0", "plant.start_e_m=-3", "controller.name=sd-mpc")
MANUAL_MODE, HOLD_MODE = 0, 4
LINK = load_config("sitl").links.autopilot
CLOSE_S = 0.7  # statuses come twice a second
POSE = {
    getattr(dialect, f"MAVLINK_MSG_ID_{name}")
    for name in ("GPS_RAW_INT", "GLOBAL_POSITION_INT", "ATTITUDE", "ATTITUDE_QUATERNION", "LOCAL_POSITION_NED")
}


@dataclass(frozen=True)
class Danger:
    """The row of the table of faults that it is, how it begins and is mended; reasons if fewer than in the row."""

    row: str
    act: Callable[[Relay, Process], None]
    mend: Callable[[Relay], None] | None
    fewer: set[str] | None = None
    goes_on: bool = False  # to be said again and again

    @property
    def within_s(self) -> float:
        return max(ROWS[self.row].within_s, 1.0)

    @property
    def codes(self) -> set[str]:
        return self.fewer or {reason.value for reason in ROWS[self.row].reasons}


@contextmanager
def held(folder: Path, *keys: str) -> Iterator[tuple[Bench, Process, Process, Relay]]:
    """A boat that has been held for some seconds: the bench, the plant, the daemon and the relay between them."""
    with bench(folder, *START, *keys) as at:
        relay = Relay(at.autopilot_port)
        at.sets += ["--set", f"plant.links.autopilot=udpout:127.0.0.1:{relay.port}"]
        try:
            with at.plant() as plant, at.daemon() as daemon:
                daemon.wait_for(lambda s: s["phase"] == "hold", 25.0)
                yield at, plant, daemon, relay
        finally:
            relay.close()


# --- the link ---


def cut(relay: Relay, _: Process) -> None:
    relay.passes = lambda data, inward: False


def cut_toward_the_boat(relay: Relay, _: Process) -> None:
    relay.passes = lambda data, inward: inward


def without_pose(relay: Relay, _: Process) -> None:
    relay.passes = lambda data, inward: not inward or message_id(data) not in POSE


def whole(relay: Relay) -> None:
    """And the autopilot's own fail-safe is undone, which a cut link sets off."""
    relay.passes = lambda data, inward: True
    mode(MANUAL_MODE)(relay)
    arm(relay)


def autopilot_dies(_: Relay, plant: Process) -> None:
    plant.child.kill()


# --- the pilot ---


def mode(number: int) -> Callable[..., None]:
    def tell(relay: Relay, *_: Process) -> None:
        relay.tell_autopilot(dialect.MAVLink_set_mode_message(1, 1, number))

    return tell


def command(number: int, first: float) -> Callable[..., None]:
    def tell(relay: Relay, *_: Process) -> None:
        relay.tell_autopilot(dialect.MAVLink_command_long_message(1, 1, number, 0, first, 0, 0, 0, 0, 0, 0))

    return tell


def pilots_station(relay: Relay, _: Process) -> None:
    relay.tell_daemon(
        dialect.MAVLink_manual_control_message(1, 32767, 700, 800, 32767, 0), LINK.override_system_id, 190
    )


def nothing(*_: object) -> None:
    """It is in the boat from the start, or has mended itself."""


# --- the autopilot ---


def parameters(**values: float) -> Callable[..., None]:
    def tell(relay: Relay, *_: Process) -> None:
        for name, value in values.items():
            relay.tell_autopilot(dialect.MAVLink_param_set_message(1, 1, name.encode(), value, 9))

    return tell


def becomes_a_copter(relay: Relay, _: Process) -> None:
    kind, autopilot = dialect.MAV_TYPE_QUADROTOR, dialect.MAV_AUTOPILOT_ARDUPILOTMEGA
    relay.tell_daemon(dialect.MAVLink_heartbeat_message(kind, autopilot, 81, 0, dialect.MAV_STATE_ACTIVE, 3), 1, 1)


arm, disarm = (command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, first) for first in (1.0, 0.0))
UNHEARD = {"override-not-followed", "outputs-unchanged", "output-stuck", "overrides-ignored"}
SILENT = {"heartbeat-lost", "estimate-stale"}
SWAPPED, RIGHT = {"SERVO1_FUNCTION": 74, "SERVO3_FUNCTION": 73}, {"SERVO1_FUNCTION": 73, "SERVO3_FUNCTION": 74}
DANGERS: dict[str, tuple[Danger, ...]] = {
    "of the pilot": (
        Danger("pilot's ground station moves a stick", pilots_station, nothing),
        Danger("pilot changes the mode", mode(HOLD_MODE), mode(MANUAL_MODE)),
        Danger("pilot disarms", disarm, arm),
    ),
    "of the link": (
        Danger("nothing reaches the autopilot", cut_toward_the_boat, whole, UNHEARD),
        Danger("GNSS and heading lost", without_pose, whole),
        Danger("link down both ways", cut, whole, SILENT),
        Danger("nothing comes from the autopilot", autopilot_dies, None, SILENT),
    ),
    "of the autopilot": (
        Danger("an output reversed", parameters(SERVO1_REVERSED=1), parameters(SERVO1_REVERSED=0)),
        Danger("outputs swapped", parameters(**SWAPPED), parameters(**RIGHT)),
        Danger("overrides switched off", parameters(RC_OPTIONS=2), parameters(RC_OPTIONS=32)),
        Danger("the autopilot becomes a copter", becomes_a_copter, None, goes_on=True),
    ),
}


def strikes(danger: Danger, plant: Process, daemon: Process, relay: Relay, later_s: float = 0.0) -> None:
    """The danger comes to a boat that is held: it is let go, in time, with the motors neutral."""
    start_s = time.monotonic()
    danger.act(relay, plant)
    within_s = danger.within_s + later_s

    def over(status: dict[str, object]) -> bool:
        if danger.goes_on:
            danger.act(relay, plant)
        return status["phase"] != "hold"

    status = daemon.wait_for(over, within_s + 1.5)
    ended_s = time.monotonic()
    assert ended_s - start_s <= within_s + CLOSE_S
    assert status["code"] in danger.codes, status
    if plant.child.poll() is None:
        # The autopilot's own time-out (3 s) stops motors that nobody reaches.
        assert relay.wait_for_neutral(ended_s, 4.0) <= 3.2
    later = daemon.wait_for(lambda s: s["phase"] == "standby", 5.0)
    assert later["pwm_us"] is None


def hold_again(at: Bench, daemon: Process, mend: Callable[[], None], seconds: float) -> None:
    """All is as it was: the operator asks until a hold is granted, and the boat is held for a time."""
    data = encode_hold(LINK, None, None, None)
    end_s = time.monotonic() + 25.0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as operator:
        status: dict[str, object] = {}
        numbers = itertools.count()  # a frame of the same number would be taken for the same request again
        while status.get("phase") != "hold":
            assert time.monotonic() < end_s, status
            mend()
            operator.sendto(renumbered(data, next(numbers) % 256), ("127.0.0.1", at.operator_port))
            status = daemon.wait_for(lambda s: True, 5.0)
    time.sleep(seconds)


@pytest.mark.parametrize("group", DANGERS)
def test_a_danger_ends_the_hold_in_its_time_with_the_motors_neutral(group: str, tmp_path: Path) -> None:
    with held(tmp_path) as (at, plant, daemon, relay):
        time.sleep(2.0)
        for danger in DANGERS[group]:
            print(danger.row)  # shown where it fails
            strikes(danger, plant, daemon, relay)
            if danger.mend is not None:
                hold_again(at, daemon, partial(danger.mend, relay), 2.0)
        code, words = daemon.end()
    assert (code, words) == (0, "")
    result = replay(at.log)
    assert result.mismatch is None and result.compared > 60 * len(DANGERS[group])


@pytest.mark.parametrize(
    ("row", "faults"),
    [
        pytest.param(
            "both motors reversed",
            "{kind: port-motor-reversed}, {kind: starboard-motor-reversed}",
            marks=pytest.mark.thorough,
        ),
        ("compass off by 45 degrees or more", "{kind: compass-turned, size: 180}"),
    ],
)
def test_a_boat_that_does_not_move_as_it_should_is_let_go(row: str, faults: str, tmp_path: Path) -> None:
    with held(tmp_path, f"plant.faults=[{faults}]") as (at, plant, daemon, relay):
        # Its time is that of thrust.
        strikes(
            Danger(row, nothing, None, {"motors-reversed", "heading-off", "drifted-off"}), plant, daemon, relay, 10.0
        )
        code, words = daemon.end()
    assert (code, words) == (0, "")
    result = replay(at.log)
    assert result.mismatch is None and result.compared > 60
