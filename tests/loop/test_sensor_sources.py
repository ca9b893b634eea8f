"""The loop on sensors with lines of their own: a VN-300 alone, fail-over, NMEA, replay, and the shell on real ptys."""

import asyncio
import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from asvhil.config import Config, load_config
from asvhil.daemon.daemon import Daemon
from asvhil.geo import LocalFrame, wrap_rad
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect, message_id
from asvhil.links.clock import Clock
from asvhil.links.endpoint import open_endpoint
from asvhil.logs.opening import open_recorder
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import replay
from asvhil.operator.encoding import encode_hold
from asvhil.simplant.lockstep import Lockstep
from asvhil.simplant.plant import Plant
from asvhil.sitl import run_lockstep
from asvhil.types import Frame, Outputs, Phase
from tests.support.shared_loop import SharedLoop

NO_BIAS = "plant.sensors.gnss.slow_bias_m=0"


def config(*overrides: str) -> Config:
    return load_config("sitl-vn300", (NO_BIAS, *overrides))


def settled(loop: Lockstep, seconds: float, from_s: float) -> tuple[float, float]:
    """Mean distance (m) and mean absolute heading error (deg) of the truth against the configured station."""
    station = loop.config.supervisor.station
    assert station is not None
    origin = LocalFrame(lat_deg=loop.config.plant.origin_lat_deg, lon_deg=loop.config.plant.origin_lon_deg)
    n_m, e_m = origin.to_ned(station.lat_deg, station.lon_deg)
    rows = []
    for tick in range(round(seconds * 20)):
        _, outputs = loop.tick()
        if tick / 20 >= from_s:
            assert outputs.phase is Phase.HOLD, outputs.health.reason
            truth = loop.plant.truth
            off = math.degrees(abs(wrap_rad(truth.psi_rad - math.radians(station.heading_deg))))
            rows.append((math.hypot(truth.n_m - n_m, truth.e_m - e_m), off))
    distance, heading = np.mean(rows, axis=0)
    return float(distance), float(heading)


def told(outputs: Outputs) -> list[str]:
    """What is said to the operators in one tick."""
    splitter = FrameSplitter()
    messages = [decode(data) for frame in outputs.frames for data in splitter.receive(frame.data)]
    return [m.text for m in messages if m is not None and m.get_type() == "STATUSTEXT"]


@pytest.mark.thorough
def test_a_station_is_kept_by_the_vn300_with_the_autopilots_position_switched_off() -> None:
    """The autopilot never gets a position: it says so, streams zeros, and is armed by force, as a pilot would do."""
    loop = Lockstep(config("plant.frontseat.ready_after_s=100000", "supervisor.engage=command"))
    for _ in range(60):
        _, outputs = loop.tick()
    assert outputs.estimate is not None and outputs.estimate.valid
    assert loop.plant.frontseat.rover.arm(force=True)
    for _ in range(20):
        loop.tick()
    station = loop.config.supervisor.station
    assert station is not None
    data = encode_hold(loop.config.links.autopilot, station.lat_deg, station.lon_deg, math.radians(station.heading_deg))
    loop.inject("operator", data, peer="test")
    distance_m, heading_deg = settled(loop, 60.0, 45.0)
    assert distance_m < 0.6 and heading_deg < 2.0
    _, outputs = loop.tick()
    sources = dict(outputs.health.sources)
    assert {sources[q] for q in ("position", "velocity", "heading", "yaw_rate", "acceleration")} == {"ins.BINARY"}


def test_a_lost_ins_is_replaced_at_once_and_comes_back_calmly() -> None:
    loop = Lockstep(config("plant.faults=[{kind: ins, from_s: 14, until_s: 20}]", "plant.sensors.gnss.white_m=0.02"))
    changes: list[tuple[float, str]] = []
    texts: list[tuple[float, str]] = []
    jump_m = 0.0
    last = None
    for tick in range(1, 30 * 20 + 1):
        _, outputs = loop.tick()
        t_s = tick / 20
        name = dict(outputs.health.sources)["position"]
        if not changes or changes[-1][1] != name:
            changes.append((t_s, name))
        texts += [(t_s, text) for text in told(outputs) if text.startswith("position")]
        estimate = outputs.estimate
        if estimate is not None and last is not None:
            jump_m = max(jump_m, math.hypot(estimate.n_m - last.n_m, estimate.e_m - last.e_m))
        last = estimate
        if t_s > 10.0:
            assert outputs.phase is Phase.HOLD and outputs.health.estimate_ok
    # The last message comes before 14 s, the time-out is 0.3 s; at 20 s it is heard again, 5 s later it is used.
    assert [name for _, name in changes] == ["", "ins.BINARY", "autopilot.GLOBAL_POSITION_INT", "ins.BINARY"]
    assert changes[2][0] == pytest.approx(14.3, abs=0.1) and changes[3][0] == pytest.approx(25.0, abs=0.1)
    assert [text for _, text in texts] == [f"position from {name}" for _, name in changes[1:]]
    assert [t_s for t_s, _ in texts] == [t_s for t_s, _ in changes[1:]]
    assert jump_m < 0.3


def test_satellites_lost_leave_the_heading_with_the_ins() -> None:
    loop = Lockstep(config("plant.faults=[{kind: ins-gnss, from_s: 12}]"))
    for _ in range(15 * 20):
        _, outputs = loop.tick()
    sources = dict(outputs.health.sources)
    assert sources["position"] == sources["velocity"] == "autopilot.GLOBAL_POSITION_INT"
    assert sources["heading"] == sources["yaw_rate"] == "ins.BINARY"
    assert outputs.phase is Phase.HOLD


NMEA = (
    "links.gnss.endpoint=serial:gnss:115200",
    "links.ins=null",
    "sources.position=[gnss.RMC]",
    "sources.velocity=[gnss.VTG, gnss.RMC]",
    "sources.heading=[gnss.HDG]",
    "sources.yaw_rate=[autopilot.ATTITUDE]",
    "sources.acceleration=[]",
    "plant.sensors.nmea.declination_deg=-4.5",
)


def test_a_station_is_kept_by_an_nmea_receiver_and_a_magnetic_compass() -> None:
    loop = Lockstep(config(*NMEA))
    distance_m, heading_deg = settled(loop, 65.0, 45.0)
    assert distance_m < 0.8 and heading_deg < 2.5
    _, outputs = loop.tick()
    assert dict(outputs.health.sources)["velocity"] == "gnss.VTG"
    assert dict(outputs.health.counters)["gnss.bad"] == 0


@pytest.mark.parametrize("overrides", [pytest.param((), marks=pytest.mark.thorough), NMEA])
def test_a_run_on_these_sensors_replays_to_the_byte(tmp_path: Path, overrides: tuple[str, ...]) -> None:
    fault = "plant.faults=[{kind: ins, from_s: 8, until_s: 10}, {kind: nmea, from_s: 12, until_s: 12.5}]"
    run_lockstep(config(fault, *overrides), tmp_path / "log.mcap", 20.0)
    result = replay(tmp_path / "log.mcap")
    assert result.mismatch is None and result.compared == 403
    frames = [frame for inputs, _ in LogFile(tmp_path / "log.mcap").ticks() for frame in inputs.frames]
    assert sum(frame.port == ("gnss" if overrides else "ins") for frame in frames) > 150


@pytest.mark.real_time
async def test_the_daemon_reads_the_ins_from_a_serial_line(tmp_path: Path) -> None:
    """Real ptys and the real shell; the plant's bytes are put on the line in its own time."""
    settings = config(
        "links.autopilot.endpoint=udpin:127.0.0.1:0",
        "links.operator.endpoint=udpin:127.0.0.1:0",
        "links.anemometer=null",
        f"links.ins.endpoint=serial:{tmp_path}/ins:115200",
    )
    clock = Clock()
    line = await open_endpoint(f"pty:{tmp_path}/ins", "plug", clock.now_ns)
    sent = [f.data for f in Plant(settings, 0).advance(6_000_000_000) if f.port == "ins"]
    recorder = open_recorder(settings, tmp_path / "log.mcap", "live")
    seen: list[Outputs] = []
    daemon = Daemon(settings, recorder, clock, on_tick=lambda outputs, _: seen.append(outputs))
    running = asyncio.create_task(daemon.run(20.0))
    try:
        for data in sent:
            await line.send(data)
            await asyncio.sleep(0.01)
            if any(outputs.estimate is not None for outputs in seen):
                break
    finally:
        daemon.stop()
        await running
        await line.close()
        recorder.close()
    assert seen[-1].origin_deg is not None and dict(seen[-1].health.sources)["position"] == "ins.BINARY"
    assert replay(tmp_path / "log.mcap").mismatch is None
    frames = [frame for inputs, _ in LogFile(tmp_path / "log.mcap").ticks() for frame in inputs.frames]
    assert b"".join(frame.data for frame in frames if frame.port == "ins") in b"".join(sent)


def test_an_estimator_that_says_no_more_what_it_knows_is_told_and_its_position_is_not_used() -> None:
    """EKF_STATUS_REPORT alone gets lost: its last word does not stand for ever, and a hold goes on by the receiver."""
    loop = SharedLoop("sources.position=[autopilot.GLOBAL_POSITION_INT, autopilot.GPS_RAW_INT]").ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    assert dict(loop.held(5.0).health.sources)["position"] == "autopilot.GLOBAL_POSITION_INT"

    def without(frame: Frame) -> list[Frame]:
        kept = [
            data
            for data in FrameSplitter(datagrams=True).receive(frame.data)
            if message_id(data) != dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT
        ]
        return [dataclasses.replace(frame, data=b"".join(kept))] if kept else []

    loop.way = without
    assert not any("estimator" in note.subject for note in loop.held(9.5).health.notes)
    outputs = loop.held(8.0)
    assert dict(outputs.health.sources)["position"] == "autopilot.GPS_RAW_INT"
    assert any(note.subject == "autopilot's estimator" for note in outputs.health.notes)
