"""`asvhil report`: a log summarised and drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from asvhil.commands.options import JsonOption
from asvhil.commands.views import check_picture, check_writable, report_run


def report(
    log: Annotated[Path, typer.Argument(help="An MCAP log of asvhil.")],
    json_: JsonOption = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the run into this file: PNG, SVG or PDF.")
    ] = None,
) -> None:
    """Summarise a log: errors to the station, wind, timing; and draw it."""
    from rich.console import Console

    check_writable(json_, "--json ")
    check_picture(picture)
    report_run(log, json_, picture, Console(), None)
