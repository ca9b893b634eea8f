"""The `asvhil` command. Heavy parts are imported by the subcommand that needs them."""

from __future__ import annotations

import asyncio
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil import __version__
from asvhil.errors import AsvhilError, ConfigError

if TYPE_CHECKING:
    from asvhil.config import Config

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Station keeping of small autonomous surface vehicles over MAVLink.",
)

ConfigArgument = Annotated[str, typer.Argument(help="A YAML config file, or the name of a shipped one.")]
SetOption = Annotated[list[str], typer.Option("--set", metavar="KEY=VALUE", help="Override a config key; repeatable.")]
JsonOption = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the figures as JSON.")]


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
    from asvhil.clock import Clock
    from asvhil.config import load_config
    from asvhil.daemon import Daemon
    from asvhil.sitl import make_run_folder, open_recorder

    settings = load_config(config, tuple(set_))
    path = log or make_run_folder(settings, "run") / "log.mcap"
    clock = Clock()
    recorder = open_recorder(settings, path, "live")
    try:
        view = _LiveView(settings, f"asvhil {settings.vehicle.name}, log {path}", as_json=status_json)
        with view:
            daemon = Daemon(settings, recorder, clock, on_tick=lambda o, links: view.show(o, links, daemon.overruns))
            asyncio.run(daemon.run(duration))
    finally:
        recorder.close()
    if recorder.error is not None:
        raise recorder.error


@app.command()
def plant(
    config: ConfigArgument = "sitl",
    set_: SetOption = [],  # noqa: B006
    duration: Annotated[
        float | None, typer.Option(min=0.1, help="Seconds to run; until interrupted by default.")
    ] = None,
    quiet: Annotated[bool, typer.Option(help="No status line.")] = False,
) -> None:
    """Run the simulated boat as a vehicle on the network."""
    from rich.console import Console

    from asvhil.clock import Clock
    from asvhil.config import load_config
    from asvhil.simplant.plant import Truth
    from asvhil.simplant.server import PlantServer

    settings = load_config(config, tuple(set_))
    clock = Clock()
    console = Console()
    title = f"{settings.vehicle.name} on {settings.plant.links.autopilot}"
    if quiet or not console.is_terminal:
        if not quiet:
            console.print(title, markup=False)
        asyncio.run(PlantServer(settings, clock).run(duration))
        return
    with console.status(title) as status:
        last_ns = 0

        def show(truth: Truth) -> None:
            nonlocal last_ns
            if truth.t_ns - last_ns >= 200_000_000:
                last_ns = truth.t_ns
                degrees = math.degrees(truth.psi_rad) % 360.0
                status.update(f"{title}: {truth.n_m:.2f} m N, {truth.e_m:.2f} m E, {degrees:.1f} deg")

        asyncio.run(PlantServer(settings, clock, show).run(duration))


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
) -> None:
    """Keep a station with the simulated boat; leaves a log, a summary and a picture."""
    from rich.console import Console

    from asvhil.config import load_config
    from asvhil.sitl import make_run_folder, run_lockstep, run_realtime

    overrides = list(set_)
    if seed is not None:
        overrides.append(f"plant.seed={seed}")
    if controller is not None:
        overrides.append(f"controller.name={controller}")
    if wind is not None:
        overrides += _wind_overrides(wind, load_config(config, tuple(overrides)))
    settings = load_config(config, tuple(overrides))
    if settings.supervisor.engage != "auto":
        raise ConfigError(f"{config}: key supervisor.engage: sitl needs auto (nobody is there to say hold)")
    folder = make_run_folder(settings, "lockstep" if lockstep else "sitl")
    path = log or folder / "log.mcap"
    console = Console()
    if lockstep:
        with _progress(console) as bar:
            task = bar.add_task("lockstep", total=round(duration * settings.daemon.tick_hz))
            wall_s = run_lockstep(settings, path, duration, lambda _: bar.advance(task))
    else:
        title = f"asvhil sitl: {settings.vehicle.name}, {settings.controller.name}, {duration:.0f} s"
        view = _LiveView(settings, title)
        with view:
            wall_s = run_realtime(settings, folder, path, duration, view.show_status)
    _report(path, json_, path.with_suffix(".png") if picture else None, console, wall_s)


@app.command()
def report(
    log: Annotated[Path, typer.Argument(help="An MCAP log of asvhil.")],
    json_: JsonOption = None,
    picture: Annotated[Path | None, typer.Option(help="Draw the run into this PNG or SVG file.")] = None,
) -> None:
    """Summarise a log: errors to the station, wind, timing; and draw it."""
    from rich.console import Console

    _report(log, json_, picture, Console(), None)


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
    from asvhil.replay import replay as replay_log

    with _progress(console, spinner=True) as bar:
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
    _write_json(json_, figures)
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
    from asvhil.io.mavlink import dialect
    from asvhil.io.operator import encode_hold

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
    from asvhil.io.mavlink import dialect
    from asvhil.io.operator import encode_release

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


# --- helpers -------------------------------------------------------------------------------------------------


class _LiveView:
    """The live table on a terminal; on a pipe a line each 10 s and at each change of phase, or JSON lines."""

    def __init__(self, config: Config, title: str, *, as_json: bool = False) -> None:
        from rich.console import Console
        from rich.live import Live

        self._title = title
        self._as_json = as_json
        self._console = Console()
        self._live = (
            Live(console=self._console, auto_refresh=False) if self._console.is_terminal and not as_json else None
        )
        self._every_ticks = max(1, round(config.daemon.tick_hz / 2.0))
        self._ticks = 0
        self._start_ns: int | None = None
        self._said = ("", -1)

    def __enter__(self) -> _LiveView:
        if self._live is not None:
            self._live.start()
        elif not self._as_json:
            self._console.print(self._title, markup=False, highlight=False, soft_wrap=True)
        return self

    def __exit__(self, *_: object) -> None:
        if self._live is not None:
            self._live.stop()

    def show(self, outputs: Any, links: dict[str, str], overruns: int) -> None:
        """One tick of a daemon in this process."""
        from asvhil.status import status_of

        self._start_ns = outputs.t_ns if self._start_ns is None else self._start_ns
        self._ticks += 1
        if self._ticks % self._every_ticks == 0:
            self.show_status(status_of(outputs, links, self._start_ns, overruns))

    def show_status(self, status: dict[str, Any]) -> None:
        """One status, however it came."""
        from asvhil.status import render

        if self._as_json:
            print(json.dumps(status), flush=True)
        elif self._live is not None:
            self._live.update(render(status, self._title), refresh=True)
        else:
            key = (str(status["phase"]), int(status["t_s"] // 10))
            if key != self._said:
                self._said = key
                distance = status["distance_m"]
                where = "" if distance is None else f", {distance:.2f} m, {status['heading_error_deg']:.1f} deg off"
                text = f"{status['t_s']:6.1f} s  {status['phase']}: {status['reason']}{where}"
                self._console.print(text, markup=False, highlight=False, soft_wrap=True)


def _progress(console: Any, *, spinner: bool = False) -> Any:
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    if spinner:
        columns: list[Any] = [
            SpinnerColumn(),
            TextColumn("{task.description} {task.completed} ticks"),
            TimeElapsedColumn(),
        ]
    else:
        columns = [TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()]
    return Progress(*columns, console=console, transient=True)


def _report(log: Path, json_file: Path | None, picture: Path | None, console: Any, wall_s: float | None) -> None:
    from asvhil.study.runlog import read_run, summarise

    run_log = read_run(log)
    figures = summarise(run_log, wall_s)
    _write_json(json_file, figures)
    _print_summary(console, figures)
    if picture is not None:
        from asvhil.study.figures import draw_run

        wind = figures["wind"]
        title = (
            f"{run_log.config.vehicle.name}, {figures['controller']}, wind {wind['configured_speed_mps']:g} m/s "
            f"toward {wind['configured_toward_deg']:g} deg, seed {figures['seed']}"
        )
        draw_run(run_log, picture, title)
        console.print(f"picture {picture}", markup=False, highlight=False, soft_wrap=True)
    console.print(f"log     {log}", markup=False, highlight=False, soft_wrap=True)


def _print_summary(console: Any, figures: dict[str, Any]) -> None:
    from rich.table import Table

    table = Table(title=f"from {figures['settled_from_s']:.0f} s on", title_justify="left")
    for heading in ("", "mean", "std", "max"):
        table.add_column(heading, justify="left" if not heading else "right")
    for name in ("truth", "measured"):
        part = figures[name]
        if part is None or part["penalty_score"] is None:
            continue
        distance, heading = part["distance_m"], part["heading_deg"]
        table.add_row(
            f"distance, {name} (m)",
            f"{distance['mean']:.3f}",
            f"{distance['std']:.3f}",
            f"{distance['max_settled']:.3f}",
        )
        table.add_row(f"heading error, {name} (deg)", f"{heading['mean']:.2f}", f"{heading['std']:.2f}", "")
        table.add_row(f"penalty score, {name}", f"{part['penalty_score']:.2f}", "", "")
    speed = figures["wind"]["estimated_speed_mps"]
    if speed is not None:
        table.add_row("wind, estimated (m/s)", f"{speed['mean']:.2f}", f"{speed['std']:.2f}", "")
    console.print(table)
    steps = figures["step_ms"]
    phases = ", ".join(f"{phase} {seconds:.1f} s" for phase, seconds in figures["phases"].items())
    timing = f"step p50 {steps['p50']:.2f} ms, p99 {steps['p99']:.2f} ms, max {steps['max']:.1f} ms; " if steps else ""
    factor = figures["realtime_factor"]
    speed_text = f"; {factor:.{0 if factor > 2 else 2}f} times real time" if factor else ""
    console.print(
        f"{figures['ticks']} ticks, {figures['overruns']} overruns; {timing}{phases}{speed_text}", highlight=False
    )


def _replay_tlog(console: Any, tlog: Path, config: str, overrides: tuple[str, ...], json_file: Path | None) -> None:
    from asvhil.config import load_config
    from asvhil.study.tlog_check import check_tlog

    with _progress(console, spinner=True) as bar:
        task = bar.add_task("replay", total=None)
        settings = load_config(config, overrides)
        figures = check_tlog(settings, tlog, lambda ticks: bar.update(task, completed=ticks))
    _write_json(json_file, figures)
    counts = figures["messages"]
    console.print(
        f"{tlog}: {sum(counts.values())} messages of {len(counts)} kinds, {figures['undecoded']} undecoded",
        soft_wrap=True,
    )
    against = figures["against_autopilot"]
    if against is None:
        console.print("the estimator never started: no position with heading in this log")
        raise typer.Exit(1)
    console.print(
        f"estimate against the autopilot's own from {against['from_s']:.0f} s on: position max "
        f"{against['position_m']['max']:.3f} m, mean {against['position_m']['mean']:.3f} m; heading max "
        f"{against['heading_deg']['max']:.2f} deg, mean {against['heading_deg']['mean']:.2f} deg",
        soft_wrap=True,
    )


def _command(config: Config, data: bytes, mav_cmd: int, done: str) -> None:
    from asvhil.operator_client import send_and_wait

    result, words = send_and_wait(data, config.links.operator.endpoint, mav_cmd)
    if result != 0:
        raise AsvhilError(f"the daemon refused: {words or f'MAV_RESULT {result}'}")
    typer.echo(done)


def _wind_overrides(text: str, config: Config) -> list[str]:
    speed, sign, toward = text.partition("@")
    try:
        speed_mps, toward_deg = float(speed), float(toward) if sign else 0.0
    except ValueError:
        speed_mps = toward_deg = math.nan
    if not (math.isfinite(speed_mps) and math.isfinite(toward_deg) and speed_mps >= 0.0):
        raise ConfigError(
            f"--wind {text}: SPEED@DEG is expected, such as 3@90 (m/s, toward, from the station's heading)"
        )
    station = config.supervisor.station
    absolute_deg = (toward_deg + (station.heading_deg if station else 0.0)) % 360.0
    return [f"plant.weather.wind.speed_mps={speed_mps}", f"plant.weather.wind.toward_deg={absolute_deg}"]


def _lat_lon(text: str) -> tuple[float, float]:
    lat, _, lon = text.partition(",")
    try:
        lat_deg, lon_deg = float(lat), float(lon)
    except ValueError:
        lat_deg = lon_deg = math.nan
    if not (abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0):
        raise ConfigError(f"--at {text}: LAT,LON in degrees is expected, such as 40.4237,-86.9212")
    return lat_deg, lon_deg


def _write_json(path: Path | None, figures: dict[str, Any]) -> None:
    if path is None:
        return
    try:
        path.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise AsvhilError(f"--json {path}: cannot be written ({error.strerror})") from None
