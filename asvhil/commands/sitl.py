"""`asvhil sitl`: station keeping with the simulated boat."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from asvhil.commands.learned import check_kept, tell_kept, with_learned
from asvhil.commands.options import ConfigArgument, FaultOption, JsonOption, LearnedOption, SetOption
from asvhil.commands.outputs import check_figures, check_writable, config_and_bases
from asvhil.commands.termination import logs_told
from asvhil.commands.views import NEEDS_AUTO, LiveView, progress, report_run, twin_hint
from asvhil.errors import ConfigError
from asvhil.files import is_folder

if TYPE_CHECKING:
    from asvhil.config import Config
    from asvhil.simplant.boat.arduino import SimulatedArduino
    from asvhil.types import Outputs


def sitl(
    config: ConfigArgument = "sitl",
    set_: SetOption = [],  # noqa: B006
    lockstep: Annotated[bool, typer.Option("--lockstep", help="Virtual time, one process, no sockets.")] = False,
    duration: Annotated[float, typer.Option(min=1.0, help="Seconds of boat time.")] = 60.0,
    wind: Annotated[
        str | None, typer.Option(metavar="SPEED@DEG", help="Mean wind, blowing toward DEG from the station's heading.")
    ] = None,
    drift: Annotated[
        str | None,
        typer.Option(metavar="SPEED@DEG", help="The station moves over ground, in m/s toward DEG from north."),
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of weather and sensor noise.")] = None,
    controller: Annotated[str | None, typer.Option(help="The controller's name.")] = None,
    fault: FaultOption = [],  # noqa: B006
    learned: LearnedOption = None,
    log: Annotated[Path | None, typer.Option(help="The MCAP log to write; in a new run folder by default.")] = None,
    json_: JsonOption = None,
    picture: Annotated[bool, typer.Option(help="Draw the run beside its log.")] = True,
    anemometer: Annotated[
        str, typer.Option(metavar="KIND", help="simulated, or firmware: the real one on a simulated Arduino.")
    ] = "simulated",
    arduino: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where `make firmware-sim` has put the simulated Arduino.")
    ] = None,
) -> None:
    """Keep a station with the simulated boat; leaves a log, a summary and a picture."""
    from rich.console import Console

    from asvhil.config import load_config
    from asvhil.config.fault_text import with_faults
    from asvhil.config.mean_wind import parse_course, parse_wind, wind_keys
    from asvhil.logs.learned_file import LearnedKeeper, learned_path
    from asvhil.logs.opening import make_run_folder
    from asvhil.sitl import check_buildable, run_lockstep, run_realtime

    overrides = list(set_)
    if seed is not None:
        overrides.append(f"plant.seed={seed}")
    if controller is not None:
        overrides.append(f"controller.name={controller}")
    if wind is not None:
        keys = wind_keys(parse_wind(wind), load_config(config, tuple(overrides)))
        overrides += [f"plant.weather.wind.{key}={value}" for key, value in keys.items()]
    if drift is not None:
        speed_mps, course_deg = parse_course(drift)
        overrides += [f"supervisor.station.speed_mps={speed_mps}", f"supervisor.station.course_deg={course_deg}"]
    settings = with_learned(load_config(config, tuple(overrides)), config, tuple(overrides), learned)
    settings = with_faults(settings, fault, duration)
    if settings.supervisor.engage != "auto":
        raise ConfigError(f"{config}: {NEEDS_AUTO}{twin_hint(config)}")
    _check_course(settings)
    if log is not None and picture and log.suffix == ".png":
        raise ConfigError(f"--log {log}: the picture goes there; name the log .mcap, or give --no-picture")
    drawn = log.with_suffix(".png") if log is not None and picture else None
    kept = (("what was learned", file) for file in (learned, learned_path(settings)))
    check_figures(json_, *config_and_bases(config), *kept, ("--log", log), ("the picture of --log", drawn))
    check_kept(settings)
    if log is not None and picture and is_folder(log.parent):
        check_writable(log.with_suffix(".png"))
    board = _simulated_arduino(settings, anemometer, arduino, lockstep)
    check_buildable(settings)
    console = Console()
    if lockstep:
        path = log or make_run_folder(settings, "lockstep") / "log.mcap"
        with logs_told([path]), progress(console) as bar:
            task = bar.add_task("lockstep", total=round(duration * settings.daemon.tick_hz))
            keeper = LearnedKeeper(settings)

            def on_tick(outputs: Outputs) -> None:
                keeper.see(outputs)
                bar.advance(task)

            wall_s = run_lockstep(settings, path, duration, on_tick)
    else:
        keeper = None
        folder = make_run_folder(settings, "sitl")  # which also has the serial lines of the sensors
        path = log or folder / "log.mcap"
        title = f"asvhil sitl: {settings.vehicle.name}, {settings.controller.name}, {duration:.0f} s"
        view = LiveView(settings, title)
        with logs_told([path]), board or contextlib.nullcontext(), view:
            wall_s = run_realtime(settings, folder, path, duration, view.show_status, board)
    report_run(path, json_, path.with_suffix(".png") if picture else None, console, wall_s)
    if keeper is not None:
        tell_kept(keeper)


def _simulated_arduino(
    settings: Config, anemometer: str, folder: Path | None, lockstep: bool
) -> SimulatedArduino | None:
    """The board for `sitl --anemometer firmware`, None for the simulated sensor. ConfigError where options conflict."""
    if anemometer not in ("simulated", "firmware"):
        raise ConfigError(f"--anemometer {anemometer}: simulated or firmware is expected")
    if anemometer == "simulated":
        if folder is not None:
            raise ConfigError("--arduino: goes with --anemometer firmware only")
        return None
    if lockstep:
        raise ConfigError("--anemometer firmware: runs in real time only; leave out --lockstep")
    if settings.links.anemometer is None:
        raise ConfigError("--anemometer firmware: key links.anemometer: is null, so nobody would read it")
    from asvhil.simplant.boat.arduino import SimulatedArduino

    board = SimulatedArduino(folder)
    board.check()
    return board


def _check_course(config: Config) -> None:
    """ConfigError where the station is to move faster than this boat's may."""
    from asvhil.config.single import told
    from asvhil.supervisor.station_motion import fastest_mps

    at, most_mps = config.supervisor.station, fastest_mps(config.believed_vessel, config.supervisor.moving)
    if at is not None and at.speed_mps > most_mps:
        raise ConfigError(
            f"key supervisor.station.speed_mps: {at.speed_mps:g} m/s, and a station of this boat moves at "
            f"{told(most_mps):.2f} m/s at most (supervisor.moving.max_speed_mps, and half of the thrust)"
        )
