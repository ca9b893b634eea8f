"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from asvhil.commands.outputs import STDOUT, words_to_stderr
from asvhil.commands.typer_parts import config_names

ConfigArgument = Annotated[
    str, typer.Argument(help="A YAML config file, or the name of a shipped one.", autocompletion=config_names)
]
SetOption = Annotated[list[str], typer.Option("--set", metavar="KEY=VALUE", help="Override a config key; repeatable.")]
PluginOption = Annotated[
    list[Path], typer.Option("--plugin", metavar="FILE", help="A plug-in that the run was made with; repeatable.")
]
RecordedPluginsOption = Annotated[
    bool, typer.Option("--allow-recorded-plugins", help="Run the code of plug-ins that the log holds.")
]
LearnedOption = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Begin with what an earlier run has learned of the model, and go on learning."),
]
FaultOption = Annotated[
    list[str],
    typer.Option(
        "--fault",
        metavar="KIND@FROM[:DURATION][:SIZE]",
        help="Something that fails, e.g. gnss-jump@60:5s:20m; repeatable.",
    ),
]


def json_option(what: str) -> Any:
    """The option --json of a command; `what` it writes."""
    return typer.Option(
        "--json", metavar="FILE", callback=_alone_on_stdout, help=f"Write {what} as JSON; -: to standard output."
    )


def _alone_on_stdout(context: typer.Context, file: Path | None) -> Path | None:
    """With `--json -` all that the command says goes to standard error."""
    if file == STDOUT and not context.resilient_parsing:
        context.with_resource(words_to_stderr())
    return file


JsonOption = Annotated[Path | None, json_option("the figures")]
ColumnsOption = Annotated[
    str | None, typer.Option(help="Column map of CSV files: a path, or the name of a shipped one.")
]
