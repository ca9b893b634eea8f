"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

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
JsonOption = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the figures as JSON.")]
ColumnsOption = Annotated[
    str | None, typer.Option(help="Column map of CSV files: a path, or the name of a shipped one.")
]
