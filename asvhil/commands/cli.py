"""The `asvhil` command. Heavy parts are imported by the subcommand that needs them."""

from __future__ import annotations

import asyncio
import contextlib
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil import __version__
from asvhil.commands import calibrate, check, learn, plant, study
from asvhil.commands.options import ConfigArgument, JsonOption, SetOption
from asvhil.commands.views import LiveView, progress, report_run, write_json
from asvhil.errors import AsvhilError, ConfigError

if TYPE_CHECKING:
    from asvhil.config import Config
    from asvhil.simplant.boat.arduino import SimulatedArduino

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Station keeping of small autonomous surface vehicles over MAVLink.",
)

for command in learn.COMMANDS:
    app.command()(command)
app.command()(plant.plant)
app.command()(check.check)
app.command()(calibrate.calibrate)
app.add_typer(study.app, name="study")


def _version(value: bool) -> None:
    if value:
        typer.echo(f"asvhil {__version__}")
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass


@app.command()
def run(
    config: ConfigArgument,
    set_: SetOption = [],  # noqa: B006 - typer copies its defaults
    log: Annotated[Path | None, typer.Option(help="The MCAP log to write; a new run folder by default.")] = None,
    duration: Annotated[
        float | None, typer.Option(min=0.1, help="Seconds to run; until interrupted by default.")
    ] = None,
    status_json: Annotated[bool, typer.Option(help="Print a JSON status line twice a second, no table.")] = False,
) -> None:
    """Run the daemon on the vehicle's companion computer. It holds only after `asvhil hold`."""
    from asvhil.config import load_config
    from asvhil.daemon.daemon import Daemon
    from asvhil.links.clock import Clock
    from asvhil.logs.opening import make_run_folder, open_recorder

    settings = load_config(config, tuple(set_))
    path = log or make_run_folder(settings, "run") / "log.mcap"
    clock = Clock()
    recorder = open_recorder(settings, path, "live")
    try:
        view = LiveView(settings, f"asvhil {settings.vehicle.name}, log {path}", as_json=status_json)
        with view:
            daemon = Daemon(settings, recorder, clock, on_tick=lambda o, links: view.show(o, links, daemon.overruns))
            asyncio.run(daemon.run(duration))
    finally:
        recorder.close()
    if recorder.error is not None:
        raise recorder.error


@app.command()
def sitl(
    config: ConfigArgument = "sitl",
    set_: SetOption = [],  # noqa: B006
    lockstep: Annotated[bool, typer.Option("--lockstep", help="Virtual time, one process, no sockets.")] = False,
    duration: Annotated[float, typer.Option(min=1.0, help="Seconds of boat time.")] = 60.0,
    wind: Annotated[
        str | None, typer.Option(metavar="SPEED@DEG", help="Mean wind, blowing toward DEG from the station's heading.")
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of weather and sensor noise.")] = None,
    controller: Annotated[str | None, typer.Option(help="The controller's name.")] = None,
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
    from asvhil.config.mean_wind import parse_wind, wind_keys
    from asvhil.logs.opening import make_run_folder
    from asvhil.sitl import run_lockstep, run_realtime

    overrides = list(set_)
    if seed is not None:
        overrides.append(f"plant.seed={seed}")
    if controller is not None:
        overrides.append(f"controller.name={controller}")
    if wind is not None:
        keys = wind_keys(parse_wind(wind), load_config(config, tuple(overrides)))
        overrides += [f"plant.weather.wind.{key}={value}" for key, value in keys.items()]
    settings = load_config(config, tuple(overrides))
    if settings.supervisor.engage != "auto":
        raise ConfigError(f"{config}: key supervisor.engage: sitl needs auto (nobody is there to say hold)")
    board = _simulated_arduino(settings, anemometer, arduino, lockstep)
    folder = make_run_folder(settings, "lockstep" if lockstep else "sitl")
    path = log or folder / "log.mcap"
    console = Console()
    if lockstep:
        with progress(console) as bar:
            task = bar.add_task("lockstep", total=round(duration * settings.daemon.tick_hz))
            wall_s = run_lockstep(settings, path, duration, lambda _: bar.advance(task))
    else:
        title = f"asvhil sitl: {settings.vehicle.name}, {settings.controller.name}, {duration:.0f} s"
        view = LiveView(settings, title)
        with board or contextlib.nullcontext(), view:
            wall_s = run_realtime(settings, folder, path, duration, view.show_status, board)
    report_run(path, json_, path.with_suffix(".png") if picture else None, console, wall_s)


@app.command()
def report(
    log: Annotated[Path, typer.Argument(help="An MCAP log of asvhil.")],
    json_: JsonOption = None,
    picture: Annotated[Path | None, typer.Option(help="Draw the run into this PNG or SVG file.")] = None,
) -> None:
    """Summarise a log: errors to the station, wind, timing; and draw it."""
    from rich.console import Console

    report_run(log, json_, picture, Console(), None)


@app.command()
def replay(
    log: Annotated[Path | None, typer.Argument(help="An MCAP log of asvhil.")] = None,
    tlog: Annotated[
        Path | None, typer.Option("--tlog", metavar="FILE", help="A MAVLink telemetry log: codec and estimator only.")
    ] = None,
    config: Annotated[str, typer.Option(help="With --tlog: the config to estimate with.")] = "field",
    set_: SetOption = [],  # noqa: B006
    json_: JsonOption = None,
) -> None:
    """Run a log through the backseat and compare every tick byte by byte; exit 1 where one differs."""
    from rich.console import Console

    console = Console()
    if (log is None) == (tlog is None):
        raise ConfigError("replay: give either an MCAP log or --tlog FILE")
    if tlog is not None:
        _replay_tlog(console, tlog, config, tuple(set_), json_)
        return
    assert log is not None
    if set_:
        raise ConfigError("replay: --set goes with --tlog only; an MCAP log is replayed with the config it holds")
    from asvhil.logs.replay import replay as replay_log

    with progress(console, spinner=True) as bar:
        task = bar.add_task("replay", total=None)
        result = replay_log(log, lambda ticks: bar.update(task, completed=ticks) if ticks % 50 == 0 else None)
    figures = {
        "ticks": result.ticks,
        "compared": result.compared,
        "exact": result.mismatch is None,
        "mismatch": None
        if result.mismatch is None
        else {"tick": result.mismatch.tick, "t_ns": result.mismatch.t_ns, "field": result.mismatch.field},
        "truncated": result.truncated,
        "span_s": result.span_s,
        "wall_s": result.wall_s,
        "realtime_factor": result.span_s / result.wall_s if result.wall_s else None,
    }
    write_json(json_, figures)
    speed = f"{result.span_s:.1f} s in {result.wall_s:.2f} s, {result.span_s / result.wall_s:.0f} times real time"
    if result.mismatch is not None:
        m = result.mismatch
        console.print(
            f"{log}: tick {m.tick} at {m.t_ns} ns differs: {m.field}", markup=False, highlight=False, soft_wrap=True
        )
        raise typer.Exit(1)
    tail = ", the log's end is cut off" if result.truncated else ""
    console.print(
        f"{log}: {result.compared} ticks bit-exact ({speed}){tail}", markup=False, highlight=False, soft_wrap=True
    )


@app.command()
def hold(
    at: Annotated[str | None, typer.Option(metavar="LAT,LON", help="Station in degrees; here by default.")] = None,
    heading: Annotated[float | None, typer.Option(help="Heading to keep in degrees; as it is now by default.")] = None,
    config: Annotated[str, typer.Option(help="The daemon's config: where its operator link is.")] = "field",
    set_: SetOption = [],  # noqa: B006
) -> None:
    """Ask the running daemon to hold a station."""
    from asvhil.config import load_config
    from asvhil.io.mavlink.frames import dialect
    from asvhil.operator.session import encode_hold

    settings = load_config(config, tuple(set_))
    lat_deg, lon_deg = (None, None) if at is None else _lat_lon(at)
    psi_rad = None if heading is None else math.radians(heading)
    data = encode_hold(settings.links.autopilot, lat_deg, lon_deg, psi_rad)
    _command(settings, data, dialect.MAV_CMD_DO_REPOSITION, "holding")


@app.command()
def release(
    config: Annotated[str, typer.Option(help="The daemon's config: where its operator link is.")] = "field",
    set_: SetOption = [],  # noqa: B006
) -> None:
    """Ask the running daemon to let go of the motors."""
    from asvhil.config import load_config
    from asvhil.io.mavlink.frames import dialect
    from asvhil.operator.session import encode_release

    settings = load_config(config, tuple(set_))
    data = encode_release(settings.links.autopilot)
    _command(settings, data, dialect.MAV_CMD_NAV_GUIDED_ENABLE, "released")


def main() -> None:
    """Entry point: an asvhil error is one line and status 2; an interrupt is status 130."""
    try:
        app(standalone_mode=True)
    except AsvhilError as error:
        typer.echo(f"asvhil: {error}", err=True)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        sys.exit(1)


def _replay_tlog(console: Any, tlog: Path, config: str, overrides: tuple[str, ...], json_file: Path | None) -> None:
    from asvhil.config import load_config
    from asvhil.logs.tlog_check import check_tlog

    with progress(console, spinner=True) as bar:
        task = bar.add_task("replay", total=None)
        settings = load_config(config, overrides)
        figures = check_tlog(settings, tlog, lambda ticks: bar.update(task, completed=ticks))
    write_json(json_file, figures)
    counts = figures["messages"]
    console.print(
        f"{tlog}: {sum(counts.values())} messages of {len(counts)} kinds, {figures['undecoded']} undecoded",
        soft_wrap=True,
    )
    against = figures["against_autopilot"]
    if against is None:
        lasted_s = figures["estimate_s"]
        console.print(
            "the estimator never started: no position with heading in this log"
            if lasted_s is None
            else f"only {lasted_s:.0f} s with an estimate in this log: the first 10 are not compared"
        )
        raise typer.Exit(1)
    console.print(
        f"estimate against the autopilot's own from {against['from_s']:.0f} s on: position max "
        f"{against['position_m']['max']:.3f} m, mean {against['position_m']['mean']:.3f} m; heading max "
        f"{against['heading_deg']['max']:.2f} deg, mean {against['heading_deg']['mean']:.2f} deg",
        soft_wrap=True,
    )


def _command(config: Config, data: bytes, mav_cmd: int, done: str) -> None:
    from asvhil.links.operator_client import send_and_wait

    link = config.links.operator
    result, words = send_and_wait(data, link.endpoint, mav_cmd, signing=link.signing)
    if result != 0:
        raise AsvhilError(f"the daemon refused: {words or f'MAV_RESULT {result}'}")
    typer.echo(done)


def _simulated_arduino(
    settings: Config, anemometer: str, folder: Path | None, lockstep: bool
) -> SimulatedArduino | None:
    """What `sitl --anemometer firmware` needs, None for the simulated sensor. ConfigError where options disagree."""
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


def _lat_lon(text: str) -> tuple[float, float]:
    lat, _, lon = text.partition(",")
    try:
        lat_deg, lon_deg = float(lat), float(lon)
    except ValueError:
        lat_deg = lon_deg = math.nan
    if not (abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0):
        raise ConfigError(f"--at {text}: LAT,LON in degrees is expected, such as 40.4237,-86.9212")
    return lat_deg, lon_deg
