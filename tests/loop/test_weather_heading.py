"""A station whose heading follows the weather: the boat lies still where it would swing, and the log replays."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from asvhil.config import load_config
from asvhil.geo import wrap_rad
from asvhil.io.mavlink.frames import dialect
from asvhil.logs.opening import open_recorder
from asvhil.logs.replay import replay
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Phase
from tests.support.loop import GroundStationLoop

KEYS = (
    *("plant.weather.wind.speed_mps=6", "plant.weather.wind.toward_deg=90", "plant.seed=41"),
    *("plant.sensors.gnss.slow_bias_m=0", "estimator.ekf.position_bias_std_m=0"),
)


def kept(policy: str, log: Path | None = None) -> tuple[float, float, float]:
    """From 60 s on: mean true distance (m), mean squared command; and the station's heading at the end (deg)."""
    config = load_config("sitl", (*KEYS, f"supervisor.heading.policy={policy}"))
    recorder = None if log is None else open_recorder(config, log, "lockstep", threaded=False)
    loop = Lockstep(config, recorder)
    distances, commands = [], []
    for tick in range(120 * 20):
        _, outputs = loop.tick()
        if tick > 60 * 20:
            assert outputs.phase is Phase.HOLD and outputs.station is not None, outputs.health.reason
            distances.append(math.hypot(loop.plant.truth.n_m, loop.plant.truth.e_m))
            if outputs.control is not None:
                commands.append(outputs.control.command)
    if recorder is not None:
        recorder.close()
    assert outputs.station is not None
    return float(np.mean(distances)), float(np.mean(np.square(commands))), math.degrees(outputs.station.psi_rad)


@pytest.mark.thorough
def test_with_the_bow_to_the_weather_the_boat_lies_still(tmp_path: Path) -> None:
    fixed, bow = kept("fixed"), kept("bow", tmp_path / "log.mcap")
    assert fixed[2] == 0.0
    assert abs(math.degrees(wrap_rad(math.radians(bow[2] + 90.0)))) < 20.0
    assert bow[0] < 0.5 < fixed[0]
    assert bow[1] < 0.3 * fixed[1]  # of the command; of the thrust it is far less: docs/results/weather-heading.md
    result = replay(tmp_path / "log.mcap")
    assert result.mismatch is None and result.compared == result.ticks == 2400


def test_a_point_astern_stays_while_the_boat_turns_about_it_into_the_weather() -> None:
    astern_m = -4.0
    keys = (*KEYS, "supervisor.heading.policy=bow", f"supervisor.point_m=[{astern_m},0]")
    loop = Lockstep(load_config("sitl", keys))
    points, origins = [], []
    for tick in range(75 * 20):
        _, outputs = loop.tick()
        truth = loop.plant.truth
        if tick > 60 * 20:
            assert outputs.phase is Phase.HOLD, outputs.health.reason
            ahead = np.array((math.cos(truth.psi_rad), math.sin(truth.psi_rad)))
            origins.append((truth.n_m, truth.e_m))
            points.append(np.array(origins[-1]) + astern_m * ahead)
    assert np.hypot(*np.transpose(points)).mean() < 0.6
    assert np.hypot(*np.transpose(origins)).mean() == pytest.approx(4.0, abs=0.6)


def test_a_course_that_begins_does_not_leave_the_boat_across_its_weather_for_minutes() -> None:
    """At rest the weather comes from 136° to port, on the course from 20°: it was 1.9 m off on average."""
    keys = (*KEYS, "plant.weather.wind.speed_mps=5", "supervisor.heading.policy=bow")
    current = ("plant.weather.current.speed_mps=0.2", "plant.weather.current.toward_deg=0")
    loop = GroundStationLoop(load_config("sitl", (*keys, *current)))
    loop.wait(60.0, lambda o: o.phase is Phase.HOLD)
    loop.wait(60.0)
    loop.say(dialect.MAVLink_param_set_message(1, 191, b"ST_SPEED", 0.5, 9))
    loop.wait(25.0)
    off = []
    for _ in range(60):
        station = loop.wait(0.5).station
        assert station is not None and station.moves and abs(math.degrees(station.psi_rad)) < 40.0
        estimate = loop.outputs.estimate if loop.outputs else None
        assert estimate is not None
        off.append(math.hypot(estimate.n_m - station.n_m, estimate.e_m - station.e_m))
    assert float(np.mean(off)) < 0.8
