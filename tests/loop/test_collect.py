"""Collection as it is used: several winds in virtual time, and a pilot's boat over UDP with `hold` by the operator."""

import contextlib
import socket
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from asvhil.collect import collect, log_paths, with_manoeuvres
from asvhil.config import Config, load_config
from asvhil.config.mean_wind import WindSector, parse_wind
from asvhil.errors import ConfigError, LinkError
from asvhil.io.mavlink.frames import dialect
from asvhil.links.clock import Clock
from asvhil.links.operator_client import send_and_wait
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import config_of, replay
from asvhil.operator.encoding import encode_hold
from asvhil.simplant.plant import Plant
from asvhil.supervisor.reasons import Reason, describe, explain
from asvhil.types import Frame, Phase
from tests.support.ports import free_port

CONFIG = load_config("sitl")


def test_one_log_for_each_wind_replayable_and_no_two_alike(tmp_path: Path) -> None:
    told: list[tuple[int, float]] = []
    runs = collect(
        CONFIG,
        "lockstep",
        12.0,
        [parse_wind("3@0"), parse_wind("6@90")],
        tmp_path / "data.mcap",
        note="lake",
        on_status=lambda run, status: told.append((run, status["held_s"])),
    )
    assert [run.log.name for run in runs] == ["data-3mps-0deg.mcap", "data-6mps-90deg.mcap"]
    assert all(run.complete and run.held_s == 12.0 and run.reason == "" for run in runs)
    assert {run for run, _ in told} == {0, 1} and max(held_s for _, held_s in told) > 11.0
    configs = [config_of(LogFile(run.log), run.log) for run in runs]
    assert [c.plant.weather.wind.speed_mps for c in configs] == [3.0, 6.0]
    assert configs[1].controller.manoeuvres.note == "wind 6 m/s toward 90 deg from the station's heading; lake"
    assert configs[0].controller.manoeuvres.seed != configs[1].controller.manoeuvres.seed
    assert configs[0].plant.seed != configs[1].plant.seed
    for run in runs:
        result = replay(run.log)
        assert result.mismatch is None and result.compared == result.ticks
        outputs = [decode_outputs(recorded) for _, recorded in LogFile(run.log).ticks() if recorded]
        held_s = sum(out.phase is Phase.HOLD for out in outputs) / 20.0
        assert 12.0 <= held_s <= 13.0 and outputs[-1].pwm_us is None
        moved = np.array([out.pwm_us for out in outputs if out.pwm_us])
        assert np.ptp(moved, axis=0).min() > 200


def test_the_way_the_wind_and_the_logs_are_named(tmp_path: Path) -> None:
    assert parse_wind("3.5@-90") == WindSector(speed_mps=3.5, toward_deg=-90.0)
    assert parse_wind("4") == WindSector(speed_mps=4.0, toward_deg=0.0)
    with pytest.raises(ConfigError, match=r"--wind -1@0: a speed of 0 to 100 m/s is expected"):
        parse_wind("-1@0")
    for text in ("3@x", "nan@0", "", "@90"):
        with pytest.raises(ConfigError, match=r"--wind .*SPEED@DEG is expected"):
            parse_wind(text)
    wind = parse_wind("3@0")
    assert log_paths(tmp_path / "a.mcap", tmp_path, [wind]) == [tmp_path / "a.mcap"]
    twice = log_paths(None, tmp_path, [wind, wind])
    assert [path.name for path in twice] == ["log-3mps-0deg-1.mcap", "log-3mps-0deg-2.mcap"]


def test_the_wind_turns_with_the_station(tmp_path: Path) -> None:
    turned = load_config("sitl", ("supervisor.station.heading_deg=300",))
    settings = with_manoeuvres(turned, 60.0, parse_wind("5@90"))
    assert settings.plant.weather.wind.toward_deg == pytest.approx(30.0)
    assert settings.controller.name == "manoeuvres" and settings.controller.manoeuvres.duration_s == 60.0


def test_what_cannot_be_collected_is_refused_before_it_starts(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"supervisor\.engage: a simulated boat needs auto"):
        collect(load_config("sitl", ("supervisor.engage=command",)), "lockstep", 60.0, [], tmp_path / "a.mcap")
    with pytest.raises(ConfigError, match=r"supervisor\.engage: a real vehicle needs command"):
        collect(CONFIG, "vehicle", 60.0, [], tmp_path / "a.mcap")
    with pytest.raises(ConfigError, match="--wind: nobody makes the wind"):
        collect(load_config("field"), "vehicle", 60.0, [parse_wind("3@0")], tmp_path / "a.mcap")
    with pytest.raises(ConfigError, match=r"key controller\.manoeuvres\.duration_s"):
        collect(CONFIG, "lockstep", 0.0, [], tmp_path / "a.mcap")
    assert list(tmp_path.iterdir()) == []


def test_a_log_that_is_there_is_met_before_the_first_drive(tmp_path: Path) -> None:
    winds = [parse_wind("3@0"), parse_wind("4@90")]
    for name in ("day-4mps-90deg.mcap", "day-4mps-90deg-001.mcap"):
        (tmp_path / name).write_bytes(b"of before")
        with pytest.raises(ConfigError, match=f"{name}: is there already, and no log is overwritten"):
            collect(CONFIG, "lockstep", 60.0, winds, tmp_path / "day.mcap")
        assert [path.name for path in tmp_path.iterdir()] == [name]
        (tmp_path / name).unlink()
    with pytest.raises(ConfigError, match=r"--output .*day\.v2: a log ends in \.mcap, such as day\.v2\.mcap"):
        collect(CONFIG, "lockstep", 60.0, winds, tmp_path / "day.v2")


class Boat:
    """The simulated boat on a UDP socket in a thread of this process, armed by its pilot; ends with `stop`."""

    def __init__(self, config: Config, port: int) -> None:
        clock = Clock()
        self._now_ns = clock.now_ns
        self.plant = Plant(config, self._now_ns())
        self._to = ("127.0.0.1", port)
        self._stop = threading.Event()
        self.stick_at_s: float | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        start_s = time.monotonic()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            link.setblocking(False)
            while not self._stop.is_set():
                now_ns = self._now_ns()
                for frame in self.plant.advance(now_ns):
                    if frame.port == "autopilot":
                        with contextlib.suppress(OSError):
                            link.sendto(frame.data, self._to)
                with contextlib.suppress(OSError):
                    while data := link.recv(4096):
                        self.plant.receive(Frame(t_ns=now_ns, port="autopilot", data=data))
                if self.stick_at_s is not None and time.monotonic() - start_s > self.stick_at_s:
                    self.plant.frontseat.set_sticks({4: 1800})
                self.plant.frontseat.arm(True)
                time.sleep(0.01)

    def stop(self) -> None:
        self._stop.set()
        self._thread.join()


@pytest.mark.real_time
@pytest.mark.parametrize("stick", [False, True])
def test_on_the_vehicle_it_waits_for_hold_and_the_pilot_ends_it(tmp_path: Path, stick: bool) -> None:
    autopilot, operator = free_port(), free_port()
    config = load_config(
        "sitl",
        (
            "supervisor.engage=command",
            f"links.autopilot.endpoint=udpin:127.0.0.1:{autopilot}",
            f"links.operator.endpoint=udpin:127.0.0.1:{operator}",
            "links.anemometer=null",
            "plant.frontseat.boot_s=0.1",
            "plant.frontseat.ready_after_s=0.5",
        ),
    )
    boat = Boat(config, autopilot)
    boat.stick_at_s = 4.0 if stick else None
    answers: list[int] = []

    def hold() -> None:
        end_s = time.monotonic() + 60.0
        while time.monotonic() < end_s and answers[-1:] != [dialect.MAV_RESULT_ACCEPTED]:
            data = encode_hold(config.links.autopilot, None, None, None)
            try:
                result, _ = send_and_wait(data, config.links.operator.endpoint, dialect.MAV_CMD_DO_REPOSITION)
            except LinkError:
                continue  # the daemon is still starting
            answers.append(result)
            time.sleep(0.2)

    asker = threading.Thread(target=hold, daemon=True)
    asker.start()
    try:
        duration_s = 30.0 if stick else 2.0
        [run] = collect(config, "vehicle", duration_s, [], tmp_path / "log.mcap", note="wind 2 m/s from SW")
    finally:
        boat.stop()
        asker.join(5.0)
    assert answers[-1] == dialect.MAV_RESULT_ACCEPTED
    if stick:
        assert not run.complete and run.reason == describe(explain(Reason.STICK_MOVED, channel=4)) and run.held_s < 6.0
    else:
        assert run.complete and run.reason == ""
    log = LogFile(run.log)
    assert config_of(log, run.log).controller.manoeuvres.note == run.note == "wind 2 m/s from SW"
    assert not log.truncated and replay(run.log).mismatch is None
