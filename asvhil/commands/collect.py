"""`asvhil collect`: drives the manoeuvres that models are trained from."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.options import ConfigArgument, JsonOption, SetOption
from asvhil.commands.outputs import check_figures, config_and_bases, write_json
from asvhil.commands.termination import logs_told
from asvhil.commands.views import NEEDS_AUTO, LiveView, progress, say, tell_borrowed_hull, twin_hint
from asvhil.errors import AsvhilError, ConfigError

if TYPE_CHECKING:
    from asvhil.collect import Collected, Mode
    from asvhil.config import Config
    from asvhil.config.mean_wind import WindSector


def collect(
    config: ConfigArgument = "sitl",
    set_: SetOption = [],  # noqa: B006 - typer copies its defaults
    duration: Annotated[float, typer.Option(min=10.0, help="Seconds of manoeuvres in each wind.")] = 600.0,
    wind: Annotated[
        list[str], typer.Option(metavar="SPEED@DEG", help="Mean wind of the simulated weather; repeatable: a log each.")
    ] = [],  # noqa: B006
    realtime: Annotated[bool, typer.Option("--realtime", help="Simulated boat as two processes in real time.")] = False,
    vehicle: Annotated[bool, typer.Option("--vehicle", help="The real vehicle: waits for `asvhil hold`.")] = False,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="The MCAP log; in a new run folder by default.")
    ] = None,
    note: Annotated[str, typer.Option(help="Weather and place in your words, kept in the log.")] = "",
    json_: JsonOption = None,
) -> None:
    """Drive the predefined manoeuvres and log them: the data that models are trained from."""
    from rich.console import Console

    from asvhil.config import load_config
    from asvhil.config.mean_wind import parse_wind

    if realtime and vehicle:
        raise ConfigError("collect: --realtime is the simulated boat, --vehicle the real one: give one of them")
    check_figures(json_, *config_and_bases(config), ("--output", output))
    mode: Mode = "vehicle" if vehicle else "realtime" if realtime else "lockstep"
    console = Console()
    settings = load_config(config, tuple(set_))
    winds = [parse_wind(text) for text in wind]
    if not vehicle and settings.supervisor.engage != "auto":
        raise ConfigError(f"{config}: {NEEDS_AUTO}{twin_hint(config)}; for the real boat: --vehicle")
    if vehicle:
        tell_borrowed_hull(settings, config, set_)
    runs = drive_with_display(settings, mode, duration, winds, output, note, console)
    write_json(json_, {"runs": [{**dataclasses.asdict(run), "log": str(run.log)} for run in runs]})
    refuse_incomplete(runs, console)


def drive_with_display(
    settings: Config,
    mode: Mode,
    duration: float,
    winds: Sequence[WindSector],
    output: Path | None,
    note: str,
    console: Any,
    skip: Collection[Path] = (),
    go_on: str = "",
) -> list[Collected]:
    """`collect.collect`, shown as it goes: a real boat in the live table, a simulated one as a bar for each run.

    `go_on`: what to say behind where the logs are, of a simulated drive that is interrupted.
    """
    from asvhil.collect import collect as drive

    if mode == "vehicle":
        view = LiveView(settings, f"asvhil collect: {settings.vehicle.name}, waits for `asvhil hold`")
        with view:
            return drive(
                settings,
                mode,
                duration,
                winds,
                output,
                note,
                on_status=lambda run, status: view.show_status(status),
                watches={"display": lambda: view.trouble},
                skip=skip,
            )
    logs: list[Path] = []
    with logs_told(logs, go_on), progress(console) as bar:
        tasks: dict[int, Any] = {}

        def start(run: int, log: Path, words: str) -> None:
            logs.append(log)
            tasks[run] = bar.add_task(words or log.name, total=duration)

        def show(run: int, status: dict[str, Any]) -> None:
            bar.update(tasks[run], completed=round(status["held_s"], 1))

        return drive(settings, mode, duration, winds, output, note, on_status=show, on_start=start, skip=skip)


def refuse_incomplete(runs: Sequence[Collected], console: Any, go_on: str = "") -> None:
    """Tell each run; AsvhilError where the last one has not come to its end, with how to go on."""
    for run in runs:
        note = f", {run.note}" if run.note else ""
        say(console, f"{run.log}: {run.held_s:.0f} s{note}" if run.complete else f"{run.log}: {run.reason}")
    if not runs[-1].complete:
        raise AsvhilError(f"{runs[-1].log}: not complete after {runs[-1].held_s:.0f} s: {runs[-1].reason}{go_on}")
