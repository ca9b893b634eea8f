"""RC overrides of an ArduRover, measured as the script is: `python -m bench.overrides`. It arms and moves the motors.

For an autopilot in software in the loop without a receiver (`SIM_RC_FAIL` 1), with `SYSID_MYGCS` 255,
`PILOT_STEER_TYPE` 1, `MOT_SLEWRATE` 0, `RC1_DZ` and `RC3_DZ` 0. A companion (255/191) overrides at 20 Hz; the pilot's
station is 255/190.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import random
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from asvhil.io.mavlink.frames import dialect as mav
from bench.autopilot_script import (
    ARM,
    EVERY_S,
    HELD,
    HOLD,
    INTERVAL,
    MANUAL,
    RC_CHANNELS,
    SERVO_OUTPUT_RAW,
    SET_MODE,
    Rig,
    _times,
    disarmed,
    report,
)
from bench.ending import end_in_words

COMPANION = (255, 191)
IGNORE = 65535
NEUTRAL, RELEASED = (1500, 1500), (0, 0)


def override(rig: Rig, sticks: tuple[int, int]) -> None:
    """Both motors' sticks, as the daemon sends them with `override_system_id: 255`."""
    port, starboard = sticks
    message = mav.MAVLink_rc_channels_override_message(1, 1, port, IGNORE, starboard, *[IGNORE] * 5)
    rig.say(message, COMPANION)


def stream(rig: Rig, seconds: float, sticks: tuple[int, int], until: Callable[[], bool] = lambda: False) -> bool:
    """Overrides at 20 Hz for a time, or until a condition holds."""
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        override(rig, sticks)
        if rig.pump(EVERY_S, until):
            return True
    return False


def begin(rig: Rig) -> None:
    """Armed in MANUAL, with motors that turn."""
    for _ in range(40):
        stream(rig, 1.5, NEUTRAL)
        rig.station_command(SET_MODE, 1, MANUAL)
        stream(rig, 0.2, NEUTRAL)
        if not rig.armed:
            rig.station_command(ARM, 1)
        if stream(rig, 1.0, NEUTRAL, lambda: rig.armed and rig.mode == MANUAL):
            break
    if not stream(rig, 2.0, HELD, lambda: rig.out == HELD):
        raise SystemExit(f"no start: outputs {rig.out}, mode {rig.mode}, armed {rig.armed}")


def stopped(rig: Rig, what: str, runs: int, rng: random.Random, stop: Callable[[], None]) -> dict[str, Any]:
    """While overrides go on: from the pilot's act until the outputs are not ours any more."""
    found = []
    for _ in range(runs):
        begin(rig)
        stream(rig, 0.3 + EVERY_S * rng.random(), HELD)
        at_s = time.monotonic()
        stop()
        if not stream(rig, 2.0, HELD, lambda: rig.out != HELD):
            raise SystemExit(f"{what}: the motors run on")
        found.append(time.monotonic() - at_s)
    return {"what": what, **_times(found, runs)}


def _send_on(rig: Rig) -> None:
    while True:
        override(rig, HELD)
        time.sleep(EVERY_S)


def killed(rig: Rig, runs: int, rng: random.Random) -> dict[str, Any]:
    """kill -9 of the program that sends."""
    found: list[float] = []
    for _ in range(runs):
        begin(rig)
        child = multiprocessing.get_context("fork").Process(target=_send_on, args=(rig,))
        child.start()
        rig.pump(0.4 + EVERY_S * rng.random())
        os.kill(child.pid or 0, signal.SIGKILL)
        at_s = time.monotonic()
        if rig.pump(8.0, lambda: rig.out == NEUTRAL):
            found.append(time.monotonic() - at_s)
        child.join()
    times = _times(found, runs) if found else {"n": runs}
    return {"what": "kill -9 of the sender", "ran on for 8 s": runs - len(found), **times}


def released(rig: Rig, runs: int, alone_s: float) -> dict[str, Any]:
    """Neutral, then a release, this long after it: how often the motors are neutral after a second."""
    right = 0
    for _ in range(runs):
        begin(rig)
        override(rig, NEUTRAL)
        if alone_s:
            rig.pump(alone_s)
        override(rig, RELEASED)
        rig.pump(0.3)
        right += rig.out == NEUTRAL
    return {"what": f"neutral, release {1e3 * alone_s:.0f} ms later", "n": runs, "neutral 0.3 s later": right}


def measure(rig: Rig, runs: int, seed: int) -> list[dict[str, Any]]:
    """All of it; vehicle disarmed at the end."""
    rng = random.Random(seed)
    rig.pump(10.0, lambda: rig.peer is not None and rig.mode >= 0)
    for number, rate_hz in ((SERVO_OUTPUT_RAW, 40.0), (RC_CHANNELS, 10.0)):
        rig.command(INTERVAL, number, 1e6 / rate_hz)
    begin(rig)
    found, exact = [], 0
    for _ in range(20 * runs):
        pulses = rng.randint(1100, 1900), rng.randint(1100, 1900)
        at_s = time.monotonic()
        override(rig, pulses)
        if rig.pump(0.3, lambda pulses=pulses: max(abs(a - b) for a, b in zip(rig.out, pulses, strict=True)) <= 1):  # type: ignore[misc]
            exact += 1
            found.append(time.monotonic() - at_s)
        rig.pump(max(0.0, at_s + EVERY_S + 0.02 * rng.random() - time.monotonic()))
    rows = [{"what": "override to SERVO_OUTPUT_RAW", "within 1 us": exact, **_times(found, 20 * runs)}]
    rows.append(killed(rig, runs, rng))
    rows.append(stopped(rig, "mode HOLD", runs, rng, lambda: rig.station_command(SET_MODE, 1, HOLD)))
    rows.append(stopped(rig, "disarming", runs, rng, lambda: rig.station_command(ARM, 0)))
    stick = lambda: rig.order_of_station(mav.MAVLink_manual_control_message(1, 32767, 300, 0, 32767, 0))  # noqa: E731
    rows.append(stopped(rig, "stick of a ground station, until our next override", runs, rng, stick))
    rows += [released(rig, runs, 0.0), released(rig, runs, 0.05)]
    return [*rows, disarmed(rig)]


def main() -> None:
    """Measure, print, and write JSON where asked to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=14550, help="UDP port that the autopilot sends to")
    parser.add_argument("--station", type=int, help="TCP port of the autopilot for the ground station")
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-o", "--output", type=Path, help="write the figures as JSON")
    given = parser.parse_args()
    report(measure(Rig(given.port, given.station, (1, 3), 1500), given.runs, given.seed), given.output)


if __name__ == "__main__":
    end_in_words(main)
