"""A real ArduRover's LOITER in the six tests' winds, on the plant of the other controllers.

    python -m bench.real_loiter ARDUROVER --defaults rover.parm,motorboat.parm,rover-skid.parm [--json FILE]
        [--set LOIT_RADIUS=0.5] [--speedup 4] [--seeds 1] [--row NAME]

ARDUROVER is a build of software in the loop (`./waf configure --board sitl && ./waf rover`), `--defaults` its parameter
files for a boat with skid steering. Each run starts both programs anew: `asvhil plant --ardupilot-json` in a row's
wind, and the autopilot, which is armed in MANUAL and put into LOITER. The true place and heading (SIM_STATE) are
recorded for 360 s of the simulation's time from then on, and scored from 60 s on as the six tests are: distances to
where the mode was entered, headings to the one that the row asks for, of which LOITER knows nothing.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink import mavutil

from asvhil.config import load_config
from asvhil.errors import AsvhilError
from asvhil.geo import LocalFrame
from asvhil.logs.metrics import MotionTrack, score
from asvhil.study.rows import FROM_S, ROWS, TO_S, row_overrides
from bench.ending import end_in_words

SIM_STATE, ATTITUDE, SET_INTERVAL, ARM = 108, 30, 511, 400
HZ = 5.0
PORT = 5760  # of the autopilot's first serial port, on which it waits for a ground station
READY_S, ARM_S = 60.0, 60.0  # of the simulation: what the autopilot may take
MANUAL, LOITER = "MANUAL", "LOITER"
ARMED = 128  # of the heartbeat's base mode
Sample = tuple[float, float, float, float]  # time (s), latitude, longitude (deg), heading (rad)


@contextmanager
def started(command: Sequence[str], folder: Path, name: str) -> Iterator[subprocess.Popen[bytes]]:
    """A program in a folder, with its output in a file there; ended with its children."""
    with (folder / f"{name}.txt").open("wb") as output:
        process = subprocess.Popen(command, cwd=folder, stdout=output, stderr=output, start_new_session=True)
    try:
        yield process
    finally:
        for number in (signal.SIGTERM, signal.SIGKILL):
            if process.poll() is None:
                os.killpg(process.pid, number)
                try:
                    process.wait(5.0)
                except subprocess.TimeoutExpired:
                    continue


class Autopilot:
    """The autopilot's ground station, with the truth that its simulation tells."""

    def __init__(self, speedup: float) -> None:
        self._patience_s = 3.0 * (READY_S + ARM_S) / speedup + 20.0
        with redirect_stdout(StringIO()):  # it tells of each attempt
            self._link = mavutil.mavlink_connection(f"tcp:127.0.0.1:{PORT}", source_system=255, retries=20)
        self._link.wait_heartbeat(timeout=self._patience_s)
        self._boot_s = 0.0
        for number in (SIM_STATE, ATTITUDE):
            self._command(SET_INTERVAL, number, 1e6 / HZ)

    def _command(self, number: int, *values: float) -> None:
        given = [*values, *[0.0] * (7 - len(values))]
        self._link.mav.command_long_send(self._link.target_system, self._link.target_component, number, 0, *given)

    def set(self, name: str, value: float) -> None:
        link = self._link
        link.mav.param_set_send(link.target_system, link.target_component, name.encode(), value, 9)
        for message in self._heard():
            if message.get_type() == "PARAM_VALUE" and message.param_id == name:
                return

    def arm(self) -> None:
        """Armed in MANUAL, as soon as the autopilot lets it. AsvhilError where it does not."""
        asked_s = 0.0
        for message in self._heard():
            if message.get_type() == "HEARTBEAT" and message.base_mode & ARMED:
                return
            if time.monotonic() - asked_s > 0.5:
                asked_s = time.monotonic()
                self._link.set_mode(MANUAL)
                self._command(ARM, 1.0)
        raise AsvhilError("the autopilot does not arm")

    def loiter(self, seconds: float) -> list[Sample]:
        """The truth for a time of the simulation's from LOITER on."""
        loiter, samples, asked_s = self._link.mode_mapping()[LOITER], list[Sample](), 0.0
        entered = False
        for message in self._heard(several=True):
            match message.get_type():
                case "HEARTBEAT" if message.get_srcComponent() == 1:
                    entered = entered or message.custom_mode == loiter
                    if samples and not message.base_mode & ARMED:
                        raise AsvhilError("the autopilot has disarmed")
                case "SIM_STATE" if entered:
                    samples.append((self._boot_s, message.lat_int * 1e-7, message.lon_int * 1e-7, message.yaw))
                    if samples[-1][0] - samples[0][0] >= seconds:
                        return samples
            if not entered and time.monotonic() - asked_s > 0.5:
                asked_s = time.monotonic()
                self._link.set_mode(LOITER)
        raise AsvhilError("the autopilot is silent, or does not enter LOITER")

    def _heard(self, *, several: bool = False) -> Iterator[Any]:
        """What it says, until it has been silent, or has said it for too long."""
        begun_s = time.monotonic()
        while several or time.monotonic() - begun_s < self._patience_s:
            message = self._link.recv_match(blocking=True, timeout=10.0)
            if message is None:
                return
            if message.get_type() == "ATTITUDE":
                self._boot_s = message.time_boot_ms * 1e-3
            yield message


def figures(samples: Sequence[Sample]) -> dict[str, Any]:
    """The scores of a run, as the six tests have them."""
    t_s, lat_deg, lon_deg, psi_rad = np.array(samples).T
    at = LocalFrame(lat_deg=float(lat_deg[0]), lon_deg=float(lon_deg[0]))
    place = np.array([at.to_ned(*where) for where in zip(lat_deg, lon_deg, strict=True)])
    track = MotionTrack(
        t_s=t_s - t_s[0],
        pose=np.column_stack([place, psi_rad]),
        speed_mps=np.zeros_like(t_s),
        yaw_rate_radps=np.zeros_like(t_s),
        station=np.zeros((len(t_s), 3)),
        moves=np.zeros(len(t_s), dtype=bool),
        hold=np.ones(len(t_s), dtype=int),
    )
    return score(track.errors, FROM_S)


def run(asked: argparse.Namespace, row: str, seed: int) -> dict[str, Any]:
    """One run, with both programs started and ended."""
    keys = row_overrides(row, seed, slow_error=True)
    plant = load_config("sitl", keys).plant
    home = f"{plant.origin_lat_deg},{plant.origin_lon_deg},0,0"
    sets = [part for key in keys for part in ("--set", key)]
    rover = [str(asked.ardurover.resolve()), "--model", "JSON:127.0.0.1", "--home", home, "-w"]
    rover += ["--defaults", ",".join(str(Path(file).resolve()) for file in asked.defaults.split(","))]
    rover += ["--speedup", f"{asked.speedup:g}", "-I0"]
    boat = [sys.executable, "-m", "asvhil", "plant", "sitl", "--ardupilot-json", "--quiet", *sets]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with started(boat, folder, "plant"):
            time.sleep(3.0)
            with started(rover, folder, "rover"):
                autopilot = Autopilot(asked.speedup)
                for text in asked.set:
                    key, _, value = text.partition("=")
                    autopilot.set(key, float(value))
                autopilot.arm()
                samples = autopilot.loiter(TO_S)
    return {"row": row, "seed": seed, **figures(samples)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ardurover", type=Path)
    parser.add_argument("--defaults", required=True)
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--speedup", type=float, default=4.0)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--row", action="append", choices=tuple(ROWS))
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    for file in (asked.ardurover, *map(Path, asked.defaults.split(","))):
        if not file.is_file():
            raise AsvhilError(f"{file}: no such file")
    runs: list[dict[str, Any]] = []
    for row in asked.row or ROWS:
        for seed in range(1, asked.seeds + 1):
            begun_s = time.monotonic()
            runs.append(run(asked, row, seed))
            distance, heading = runs[-1]["distance_m"], runs[-1]["heading_deg"]
            print(
                f"{row}, seed {seed}: ps {runs[-1]['penalty_score']:.2f}, distance {distance['mean']:.2f} m (most "
                f"{distance['max_settled']:.2f}), heading error {heading['abs_mean']:.1f} deg; "
                f"{TO_S / (time.monotonic() - begun_s):.1f} times real time with the start",
                flush=True,
            )
            if asked.json is not None:
                asked.json.write_text(json.dumps({"set": asked.set, "runs": runs}, indent=1) + "\n")


if __name__ == "__main__":
    end_in_words(main)
