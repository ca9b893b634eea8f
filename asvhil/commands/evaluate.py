"""`asvhil evaluate`: scores models in open loop."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.options import ColumnsOption, JsonOption, PluginOption, RecordedPluginsOption
from asvhil.commands.outputs import check_figures, check_picture, columns_file, write_json
from asvhil.commands.views import say

if TYPE_CHECKING:
    from rich.table import Table


def evaluate(
    models: Annotated[list[Path], typer.Argument(help="Model files to compare.")],
    data: Annotated[list[Path], typer.Option("--data", help="MCAP logs, folders of runs, or CSV files; repeatable.")],
    columns: ColumnsOption = None,
    horizon: Annotated[float, typer.Option(min=0.2, help="Seconds of each open-loop rollout.")] = 50.0,
    every: Annotated[float, typer.Option(min=0.2, help="Seconds from one start to the next.")] = 10.0,
    truth: Annotated[bool, typer.Option("--truth", help="Score against the truth that a simulated log holds.")] = False,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw one rollout into this file: PNG, SVG or PDF.")
    ] = None,
    plugin: PluginOption = [],  # noqa: B006 - typer copies its defaults
    allow_recorded_plugins: RecordedPluginsOption = False,
    json_: JsonOption = None,
) -> None:
    """Roll models out in open loop over data and score u, v, r; and check them at rest, in still air and in wind."""
    from rich.console import Console
    from rich.table import Table

    from asvhil.logs.plugins import load_plugins
    from asvhil.logs.segments import first_in
    from asvhil.train.jobs import evaluate_command, left_out_words

    data = [first_in(path) for path in data]
    load_plugins(data if columns is None else (), plugin, allow_recorded=allow_recorded_plugins)
    read = [*(("the model", model) for model in models), *(("the data", file) for file in data)]
    check_figures(json_, *read, *columns_file(columns), ("--picture", picture))
    check_picture(picture)
    console = Console()
    with console.status("rolling out"):
        figures = evaluate_command(
            models, data, columns=columns, horizon_s=horizon, every_s=every, truth=truth, figure=picture
        )
    write_json(json_, figures)
    for path in figures["left_out"]:
        say(console, left_out_words(path))
    table = Table(title=f"mean absolute error over {horizon:g} s, {figures['reference']}", title_justify="left")
    for heading in ("model", "windows", "u (m/s)", "v (m/s)", "r (rad/s)", "count"):
        table.add_column(heading, justify="left" if heading in ("model", "windows") else "right")
    for name, parts in figures["rows"].items():
        for windows, row in parts.items():
            if row["windows"]:
                table.add_row(name, windows, *(f"{row[f'mae_{axis}']:.4f}" for axis in "uvr"), str(row["windows"]))
    console.print(table)
    for name, check in figures["at_rest"].items():
        console.print(_at_rest_table(name, check))
        say(console, check["verdict"])


def _at_rest_table(name: str, check: dict[str, Any]) -> Table:
    """Rates of a boat at rest with its motors off: a row a wind, the reference in brackets where there is one."""
    from rich.table import Table

    compared = any(row["reference"] is not None for row in check["winds"])
    beside = " (of the simulated boat in brackets)" if compared else ""
    table = Table(title=f"{name}: rates at rest, motors off{beside}", title_justify="left")
    headings = ("wind from", "m/s", "u' (m/s2)", "v' (m/s2)", "r' (rad/s2)", *(("error / bound",) if compared else ()))
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "wind from" else "right")
    still = {"from": "", "speed_mps": 0.0, "rates": check["still_air"], "reference": None, "error": None}
    for row in [still, *check["winds"]]:
        true = row["reference"]
        cells = [
            f"{rate:.4f}" + ("" if true is None else f" ({true[axis]:.4f})") for axis, rate in enumerate(row["rates"])
        ]
        if compared:
            cells.append("" if row["error"] is None else f"{row['error']:.2f}")
        table.add_row(row["from"], f"{row['speed_mps']:g}", *cells)
    return table
