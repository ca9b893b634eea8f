"""`asvhil study pages`: which pages of results are still what their commands would make."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from asvhil.commands.options import JsonOption
from asvhil.commands.outputs import check_json, write_json
from asvhil.commands.views import say
from asvhil.errors import AsvhilError

SHIPPED = Path(__file__).resolve().parents[2] / "docs" / "results"
MEANINGS = {
    "fresh": "made by the present code, configs and models",
    "confirmed": "of older code, and enough of its runs came out the same when the present code ran them again",
    "older": "than what decides it, which has changed since",
    "unmarked": "made by a command that did not yet say by which code",
    "by people": "as a whole; nothing tells whether it still holds",
}


def pages(
    folder: Annotated[Path, typer.Argument(help="Folder of pages; the project's own by default.")] = SHIPPED,
    json_: JsonOption = None,
) -> None:
    """List pages of results: fresh, confirmed, older than what decides them (what changed), or written by people."""
    from rich.console import Console
    from rich.table import Table

    from asvhil.study.made_of import state_of

    found = sorted(folder.rglob("*.md"))
    if not found:
        raise AsvhilError(f"{folder}: no pages (*.md) in it; give a folder that a study has written to with -o")
    check_json(json_)
    states = [state_of(path, path.relative_to(folder).as_posix()) for path in found]
    states.sort(key=lambda state: list(MEANINGS).index(state.state))
    write_json(json_, {"pages": [state.figures() for state in states]})
    console, table = Console(), Table("page", "", "changed since")
    for state in states:
        table.add_row(state.page, state.state, ", ".join(state.changed))
    console.print(table)
    for name, meaning in MEANINGS.items():
        say(console, f"{sum(state.state == name for state in states)} {name}: {meaning}")
