"""A station that moves, in the loop: followed, told of, replayed; no runaway is seen in it, and a leader leads."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.io.mavlink.frames import dialect
from asvhil.logs.metrics import docking_windows
from asvhil.logs.opening import open_recorder
from asvhil.logs.replay import replay
from asvhil.logs.run import read_run
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Outputs, Phase
from tests.support.loop import GroundStationLoop

CALM = (
    "controller.name=sd-mpc",
    "plant.weather.wind.speed_mps=0",
    "plant.start_n_m=0",
    "plant.start_e_m=0",
    "plant.sensors.gnss.slow_bias_m=0",
)
ON_COURSE = ("supervisor.station.speed_mps=0.3", "supervisor.station.course_deg=0")


def off_m(outputs: Outputs) -> float:
    at, station = outputs.estimate, outputs.station
    assert at is not None and station is not None
    return math.hypot(at.n_m - station.n_m, at.e_m - station.e_m)


def told(outputs: Outputs) -> dict[str, str]:
    return {note.subject: note.text for note in outputs.health.notes}


def test_a_course_is_followed_and_replayed(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    config = load_config("sitl", (*CALM, *ON_COURSE))
    recorder = open_recorder(config, log, "lockstep", threaded=False)
    loop, last = Lockstep(config, recorder), None
    for _ in range(45 * 20):
        _, last = loop.tick()
        assert "motion" not in told(last)
    recorder.close()
    assert last is not None and last.phase is Phase.HOLD and off_m(last) < 0.4
    assert told(last)["moving station"] == "0.3 m/s toward 0"
    assert replay(log).mismatch is None
    run = read_run(log)
    assert run.station is not None and run.station.n_m > 8.0 and run.truth is not None
    (window,) = docking_windows(run.truth.where(run.truth.t_s > 25.0))
    assert window["length_s"] > 15.0, "whoever docks goes along"


def test_a_leader_is_followed_and_its_silence_ends_it() -> None:
    loop = GroundStationLoop(load_config("sitl", CALM))
    assert loop.wait(60.0, lambda o: o.phase is Phase.HOLD).phase is Phase.HOLD
    frame = loop.backseat.frame
    assert frame is not None
    loop.say(dialect.MAVLink_param_set_message(1, 191, b"ST_FOLLOW", 255.0, 9))
    outputs = loop.wait(0.2)
    station = outputs.station
    assert station is not None
    for second in range(20):
        lat_deg, lon_deg = frame.to_geodetic(station.n_m + 0.3 * second, station.e_m)
        place = round(lat_deg * 1e7), round(lon_deg * 1e7)
        rest = [[0.3, 0.0, 0.0], [0.0] * 3, [1.0, 0.0, 0.0, 0.0], [0.0] * 3, [0.0] * 3, 0]
        loop.say(dialect.MAVLink_follow_target_message(0, 3, *place, 0.0, *rest))
        outputs = loop.wait(1.0)
    assert told(outputs)["moving station"] == "0.3 m/s toward 0, after system 255"
    assert outputs.station is not None and outputs.station.n_m - station.n_m == pytest.approx(6.0, abs=0.2)
    assert off_m(outputs) < 0.5
    outputs = loop.wait(5.0)
    assert outputs.phase is Phase.HOLD and outputs.station is not None and not outputs.station.moves
    assert told(outputs)["moving station"] == "system 255 is silent: it stays"
