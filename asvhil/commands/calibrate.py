"""`asvhil calibrate`: compass deviation and vane offset from a log."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from asvhil.commands.options import JsonOption, PluginOption, RecordedPluginsOption
from asvhil.commands.outputs import check_figures, check_writable, write_json, writing
from asvhil.commands.views import progress, say
from asvhil.errors import AsvhilError, ConfigError
from asvhil.files import is_file, is_there, write_text


def calibrate(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="An MCAP log in which the boat turned under way.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Write the config keys to a YAML file.", metavar="FILE")
    ] = None,
    base: Annotated[
        str, typer.Option(help="Config file that the written one stands on, beside it.", metavar="FILE")
    ] = "",
    plugin: PluginOption = [],  # noqa: B006 - typer copies its defaults
    allow_recorded_plugins: RecordedPluginsOption = False,
    json_: JsonOption = None,
) -> None:
    """Find the compass deviation and the offset of the wind vane from a turn, as config keys."""
    from rich.console import Console

    from asvhil.logs.plugins import load_plugins
    from asvhil.preflight.calibration import COEFFICIENTS, calibrate

    below = output.parent / base if output is not None and base else None
    check_figures(json_, ("the log", log), ("--base", below), ("--output", output))
    if output is not None:
        _check_output(output, base)
    _check_boat(log, base, output)
    load_plugins([log], plugin, allow_recorded=allow_recorded_plugins)
    console = Console()
    with progress(console, spinner=True) as bar:
        task = bar.add_task(f"calibrate {log.name}", total=None)
        found = calibrate(log, lambda ticks: bar.update(task, completed=ticks))
    text = (f"base: {base}\n" if base else "") + found.yaml()
    if output is not None:
        with writing(output, "--output "):
            write_text(output, text)
    write_json(json_, dataclasses.asdict(found))
    if found.compass is not None:
        for name, value, std in zip(COEFFICIENTS, found.compass.deviation_deg, found.compass.std_deg, strict=True):
            say(console, f"compass {name:<14} {value:6.2f} deg, standard deviation {std:.2f}")
    if found.vane is not None:
        vane = found.vane
        say(console, f"vane turned by         {vane.offset_deg:6.1f} deg, standard deviation {vane.std_deg:.1f}")
    for words in found.missing:
        say(console, words)
    say(console, text, end="")


def _check_output(output: Path, base: str) -> None:
    """Before the work: AsvhilError where the output exists, or where it could not be loaded with its base."""
    from asvhil.config.loading import find_config, none_shipped

    if is_there(output):
        raise AsvhilError(f"--output {output}: is there already; name a new file, and the old one with --base")
    check_writable(output, "--output ")
    if base and not is_file(output.parent / base):
        try:
            find_config(base)
        except ConfigError:
            words = f"no such config file beside {output}, {none_shipped(base, output)}"
            raise AsvhilError(f"--base {base}: {words}") from None


def _check_boat(log: Path, base: str, output: Path | None) -> None:
    """Before the work: AsvhilError where the base is of another boat than the log, whose compass and vane it tells."""
    from asvhil.config.loading import find_config, vehicle_name
    from asvhil.logs.reader import LogFile

    if not base:
        return
    beside = (Path() if output is None else output.parent) / base
    boat = vehicle_name(beside if is_file(beside) else find_config(base))
    logged = LogFile(log).metadata.get("run", {}).get("vehicle")
    if boat and logged and boat != logged:
        raise AsvhilError(
            f"--base {base}: of the boat {boat}, and {log} of the boat {logged} (vehicle.name): "
            "name the config of the boat that the log is of"
        )
