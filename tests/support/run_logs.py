"""Logs of whole runs, which tests of figures, reports and replays share."""

from __future__ import annotations

from pathlib import Path

from asvhil.collect import collect
from asvhil.config import load_config
from asvhil.config.mean_wind import parse_wind
from asvhil.geo import LocalFrame
from asvhil.logs.opening import open_recorder
from asvhil.operator.encoding import encode_release
from asvhil.sitl import run_lockstep
from asvhil.types import Frame, Phase
from tests.support.loop import PLAIN_CONTROLLER, STATION_DEG, GroundStationLoop


class _Deafened(GroundStationLoop):
    """The autopilot may fall silent."""

    deaf = False

    def receive(self) -> tuple[Frame, ...]:
        frames = super().receive()
        return tuple(f for f in frames if f.port != "autopilot") if self.deaf else frames


def record_bream(log: Path) -> None:
    """The small boat with its poor sensors, without the procedure."""
    run_lockstep(load_config("sitl-bream", ("supervisor.station.heading_deg=170",)), log, 30.0)


def record_programme(log: Path) -> None:
    """Manoeuvres on a flat sea, to train on."""
    config = load_config("sitl", ("plant.seed=7", "controller.manoeuvres.seed=7"))
    (run,) = collect(config, "lockstep", 70.0, [parse_wind("6@90")], log)
    assert run.complete


def record_procedure(log: Path) -> None:
    """From 30 m off by the station keeping procedure, in a wind across the station's heading."""
    wind = "plant.weather.wind={speed_mps: 5, toward_deg: 90}"
    start = ("plant.start_n_m=-18", "plant.start_e_m=24", "controller.procedure.enabled=true")
    run_lockstep(load_config("sitl", (wind, *start)), log, 60.0)


def record_two_holds(log: Path) -> None:
    """A hold that a fail-safe ends and a second one, in which the station is moved, until the operator's release."""
    config = load_config("sitl", (PLAIN_CONTROLLER, "supervisor.engage=command", "plant.weather.wind.toward_deg=60"))
    recorder = open_recorder(config, log, "lockstep", threaded=False)
    loop = _Deafened(config, recorder)
    loop.wait(6.0)
    assert loop.frontseat.set_mode(0) and loop.frontseat.arm(True)
    loop.wait(1.0)
    loop.ask_to_hold(STATION_DEG, 0.3)
    assert loop.wait(25.0).phase is Phase.HOLD, loop.texts
    loop.deaf = True
    assert loop.wait(20.0, until=lambda outputs: outputs.phase is Phase.STANDBY).phase is Phase.STANDBY
    loop.deaf = False
    loop.wait(8.0)  # until the preferred source of the position is back
    loop.ask_to_hold(STATION_DEG, 0.3)
    assert loop.wait(15.0).phase is Phase.HOLD, loop.texts
    origin = LocalFrame(lat_deg=STATION_DEG[0], lon_deg=STATION_DEG[1])
    loop.ask_to_hold(origin.to_geodetic(3.0, -2.0), 0.5)
    assert loop.wait(15.0).phase is Phase.HOLD, loop.texts
    loop.say(encode_release(config.links.autopilot))
    loop.wait(2.0)
    recorder.close()
