"""`asvhil log ...`: what a log holds, what can be saved of a damaged one, and logs for other tools."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from asvhil.commands.options import JsonOption
from asvhil.commands.outputs import check_figures, check_json, write_json
from asvhil.commands.views import byte_bar, say

app = typer.Typer(no_args_is_help=True, help="What a log holds; recover a damaged one; export it for other tools.")

LOST = 3  # exit status: a log was recovered, and something was lost

LogArgument = Annotated[Path, typer.Argument(help="A log of asvhil, the first of its segments, or a run's folder.")]


@app.command()
def info(log: LogArgument, json_: JsonOption = None) -> None:
    """Show what a log holds: run, holds, channels with their rates, and whether it is whole."""
    from rich.console import Console

    from asvhil.logs.info import log_info

    check_json(json_)
    console = Console()
    with _reading(console, log) as on_bytes:
        figures = log_info(log, on_bytes)
    write_json(json_, figures)
    _print_info(console, figures)


@app.command()
def recover(
    log: LogArgument,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="The new log; default: LOG-recovered.mcap.")
    ] = None,
    behind_damage: Annotated[
        bool, typer.Option("--behind-damage", help="Keep what is intact behind damage too; a replay ends at the gap.")
    ] = False,
    json_: JsonOption = None,
) -> None:
    """Write what is intact of a log to a new one and verify it; exit 3 where something was lost."""
    from rich.console import Console

    from asvhil.logs.recover import recover as recover_log
    from asvhil.logs.segments import first_in

    console = Console()
    log = first_in(log)
    target = output or log.with_name(f"{log.stem}-recovered.mcap")
    check_figures(json_, ("the log", log), ("the new log", target))
    with _reading(console, log) as on_bytes:
        result = recover_log(log, target, behind_damage=behind_damage, on_bytes=on_bytes)
    write_json(
        json_,
        {
            "recovered": str(result.path),
            "ticks": result.ticks,
            "span_s": result.span_s,
            "messages": result.messages,
            "lost": list(result.lost),
            "left_out": result.left_out,
        },
    )
    say(console, f"{result.path}: {result.ticks} ticks, {result.span_s:.1f} s, read again and compared")
    for what in result.lost:
        say(console, f"lost: {what}")
    if result.left_out:
        say(console, f"left out: {result.left_out} intact chunks behind the damage; --behind-damage keeps them")
    if result.lost:
        raise typer.Exit(LOST)


@app.command()
def export(
    log: LogArgument,
    output: Annotated[
        Path,
        typer.Argument(
            metavar="OUTPUT",
            help="What to make, by its ending: .tlog (the autopilot's MAVLink), .csv or .parquet (a row a tick).",
        ),
    ],
) -> None:
    """Export a log: MAVLink for ground stations, or a table."""
    from rich.console import Console

    from asvhil.logs.export import export_log
    from asvhil.logs.reader import LogFile

    console = Console()
    with _reading(console, log) as on_bytes:
        exported = export_log(log, output, on_bytes)
    for line in (*LogFile(log).damaged.values(), *exported.warnings):
        say(console, f"{log}: {line}")
    say(console, f"{output}: {exported.count} {'frames' if output.suffix.lower() == '.tlog' else 'ticks'}")
    if exported.damage is not None:
        say(console, f"{exported.damage}; what is before that is exported")


@contextmanager
def _reading(console: Any, log: Path) -> Iterator[Callable[[int], None]]:
    """A bar over the bytes of a log."""
    from asvhil.logs.reader import LogFile

    size = LogFile(log).size
    with byte_bar(console) as bar:
        task = bar.add_task(log.name, total=size)
        yield lambda done: bar.update(task, completed=done)


def _print_info(console: Any, figures: dict[str, Any]) -> None:
    from rich.table import Table

    segments = f" in {figures['segments']} segments" if figures["segments"] > 1 else ""
    # Each command reads a log up to there, so that nothing has to be done about it.
    endless = [text.startswith("no end") for text in figures["damage"]] == [True]
    whole = "whole" if figures["whole"] else "without its end" if endless else "damaged"
    say(console, f"{figures['log']}: {figures['bytes'] / 1e6:.1f} MB{segments}, {whole}")
    for text in figures["damage"]:
        say(console, f"  {text}")
    if endless:
        say(console, "  it is still being written, or was cut off; all commands read it up to there")
    elif figures["damage"]:
        say(console, "  `asvhil log recover` keeps what is intact")
    for text in figures["warnings"]:
        say(console, f"  {text}")
    if figures["recovered_from"]:
        say(console, f"  recovered from {figures['recovered_from']}")
    started = f"started {figures['started']}, " if figures["started"] else ""
    say(console, f"{started}{figures['duration_s']:.1f} s")
    for line in (_run_line(figures), _versions_line(figures["versions"])):
        if line:
            say(console, line)
    dropped = f", {figures['ticks_dropped']} dropped" if figures["ticks_dropped"] else ""
    phases = ", ".join(f"{phase} {count}" for phase, count in figures["phases"].items())
    say(console, f"{figures['ticks']} ticks{dropped}, {figures['overruns']} overruns; {phases}")
    for span in figures["holds"]:
        ended = f"ended by {span['ended']}" if span["ended"] else "until the end of the log"
        say(console, f"hold from {span['from_s']:.1f} to {span['to_s']:.1f} s, {ended}")
    table = Table()
    for heading in ("channel", "messages", "Hz", "kB"):
        table.add_column(heading, justify="left" if heading == "channel" else "right")
    for channel in figures["channels"]:
        name = " ".join(part for part in (channel["topic"], channel["peer"], channel["via"]) if part)
        rate = channel["rate_hz"]
        table.add_row(
            name, str(channel["messages"]), "" if rate is None else f"{rate:.1f}", f"{channel['bytes'] / 1e3:.1f}"
        )
    console.print(table)


def _run_line(figures: dict[str, Any]) -> str:
    """What ran; of a damaged log that was recovered not all is known, and what is not is left out."""
    controller, model = figures["controller"], figures["model"]
    if controller and model:
        controller, model = f"{controller} ({model})", None
    seed = f"seed {figures['seed']}" if figures["seed"] else None
    parts = (figures["mode"], figures["vehicle"], controller, model and f"model {model}", seed)
    return ", ".join(part for part in parts if part)


def _versions_line(versions: dict[str, str]) -> str:
    """What it ran with, as far as it is known."""
    named = ((name, versions.get(key)) for name, key in (("asvhil ", "asvhil"), ("Python ", "python"), ("", "machine")))
    return ", ".join(f"{name}{version}" for name, version in named if version)
