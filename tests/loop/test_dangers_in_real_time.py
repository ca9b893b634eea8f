"""The most dangerous rows of the fault matrix again: two processes, real sockets, a real serial line, the wall clock.

The others of these are the daemon's deaths (test_guardian_in_the_loop.py), its terminal (test_displays.py), and its
computer (test_harsh_host.py).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from asvhil.io.mavlink.frames import dialect, message_id
from asvhil.logs.replay import replay
from tests.support.processes import Bench, Process, bench
from tests.support.relay import Relay

pytestmark = pytest.mark.real_time

START = ("plant.start_n_m=0", "plant.start_e_m=-3", "controller.name=sd-mpc")
HOLD_MODE = 4
POSE = {
    getattr(dialect, f"MAVLINK_MSG_ID_{name}")
    for name in ("GPS_RAW_INT", "GLOBAL_POSITION_INT", "ATTITUDE", "ATTITUDE_QUATERNION", "LOCAL_POSITION_NED")
}


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


def cut(relay: Relay, _: Process) -> None:
    relay.passes = lambda data, inward: False


def cut_toward_the_boat(relay: Relay, _: Process) -> None:
    relay.passes = lambda data, inward: inward


def without_pose(relay: Relay, _: Process) -> None:
    relay.passes = lambda data, inward: not inward or message_id(data) not in POSE


def pilots_mode(relay: Relay, _: Process) -> None:
    relay.tell_autopilot(dialect.MAVLink_set_mode_message(1, 1, HOLD_MODE))


def pilot_disarms(relay: Relay, _: Process) -> None:
    command = dialect.MAV_CMD_COMPONENT_ARM_DISARM
    relay.tell_autopilot(dialect.MAVLink_command_long_message(1, 1, command, 0, 0, 0, 0, 0, 0, 0, 0))


def autopilot_dies(_: Relay, plant: Process) -> None:
    plant.child.kill()


def nothing(_: Relay, __: Process) -> None:
    """It is in the boat from the start."""


REVERSED = "plant.faults=[{kind: port-motor-reversed}, {kind: starboard-motor-reversed}]"
TURNED = "plant.faults=[{kind: compass-turned, size: 180}]"
DANGERS: dict[str, tuple[tuple[str, ...], Callable[[Relay, Process], None], float, set[str]]] = {
    "link cut": ((), cut, 4.0, {"heartbeat-lost", "estimate-stale"}),
    "commands do not arrive": (
        (),
        cut_toward_the_boat,
        6.0,
        {"override-not-followed", "outputs-unchanged", "output-stuck", "overrides-ignored"},
    ),
    "position and heading gone": ((), without_pose, 4.5, {"estimate-stale"}),
    "pilot's mode": ((), pilots_mode, 1.0, {"mode-changed"}),
    "pilot disarms": ((), pilot_disarms, 1.0, {"disarmed"}),
    "autopilot's power cut": ((), autopilot_dies, 4.0, {"heartbeat-lost", "estimate-stale"}),
    "both motors reversed": ((REVERSED,), nothing, 25.0, {"motors-reversed", "heading-off", "drifted-off"}),
    "compass turned by 180 degrees": ((TURNED,), nothing, 25.0, {"motors-reversed", "heading-off", "drifted-off"}),
}


@pytest.mark.parametrize("name", DANGERS)
def test_a_danger_ends_the_hold_in_its_time_with_the_motors_neutral(name: str, tmp_path: Path) -> None:
    keys, act, within_s, codes = DANGERS[name]
    with held(tmp_path, *keys) as (at, plant, daemon, relay):
        if act is not nothing:
            time.sleep(2.0)
        start_s = time.monotonic()
        act(relay, plant)
        status = daemon.wait_for(lambda s: s["phase"] != "hold", within_s + 1.5)
        ended_s = time.monotonic()
        assert ended_s - start_s <= within_s + 0.7  # statuses come twice a second
        assert status["code"] in codes, status
        if plant.child.poll() is None:
            # The autopilot's own time-out (3 s) stops motors that nobody reaches.
            assert relay.wait_for_neutral(ended_s, 4.0) <= 3.2
        later = daemon.wait_for(lambda s: s["phase"] == "standby", 5.0)
        assert later["pwm_us"] is None
        code, words = daemon.end()
    assert (code, words) == (0, "")
    result = replay(at.log)
    assert result.mismatch is None and result.compared > 60
