"""`asvhil report`: a log summarised, drawn, and compared with another."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from asvhil.commands.options import JsonOption
from asvhil.commands.outputs import check_apart, check_json, check_picture, check_writable, write_json, writing
from asvhil.commands.views import print_summary, progress, report_run, say, stage_bar, ticks_to, title_of
from asvhil.errors import ConfigError
from asvhil.files import replacement, shown, write_text


def report(
    log: Annotated[Path, typer.Argument(help="A log of asvhil, the first of its segments, or a run's folder.")],
    compare: Annotated[
        Path | None, typer.Option(metavar="LOG", help="Another log, whose figures are set beside these.")
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write one self-contained page, and its figures as PNGs beside it."),
    ] = None,
    json_: JsonOption = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the run into this file: PNG, SVG or PDF.")
    ] = None,
) -> None:
    """Summarise a log: errors to the station, docking windows, wind, timing; draw it, and compare it."""
    from rich.console import Console

    read = (("the log", log), ("the log", compare))
    check_apart(*read, ("--html", html), ("--picture", picture), ("--json", json_))
    if html is not None and picture is not None and picture.resolve().match(f"{html.resolve().with_suffix('')}-*.png"):
        raise ConfigError(f"--picture {picture}: is a name of the page's own figures; give another")
    check_json(json_)
    check_picture(picture)
    if html is not None and html.suffix.lower() not in (".html", ".htm"):
        raise ConfigError(f"--html {html}: a file that ends in .html is expected")
    check_writable(html, "--html ")
    console = Console()
    if compare is None and html is None:
        report_run(log, json_, picture, console, None)
        return
    logs = [log] if compare is None else [log, compare]
    _report_page(logs, html, json_, picture, console)


def _report_page(logs: list[Path], html: Path | None, json_: Path | None, picture: Path | None, console: Any) -> None:
    from asvhil.logs.comparison import comparison_notes, comparison_rows
    from asvhil.logs.picture import draw_run
    from asvhil.logs.report import Reported, report_page
    from asvhil.logs.run import read_run
    from asvhil.logs.summary import summarise

    names = [log.name if len({other.name for other in logs}) == len(logs) else str(log) for log in logs]
    reported = []
    with progress(console, spinner=True) as bar:
        for log, name in zip(logs, names, strict=True):
            task = bar.add_task(f"report: reading {name}", total=None)
            run = read_run(log, on_tick=ticks_to(bar, task))
            figures = summarise(run)
            reported.append(Reported(name=name, title=title_of(figures), run=run, figures=figures))
    if html is not None:
        with stage_bar(console) as bar:
            task = bar.add_task("report: drawing", total=None)
            page = report_page(
                *reported, on_figure=lambda name: bar.update(task, description=f"report: drawing {name}")
            )
        with writing(html, "--html "):
            write_text(html, shown(page.html))
        for name, png in page.pictures:
            with writing(file := html.with_name(f"{html.stem}-{name}.png")), replacement(file) as part:
                part.write_bytes(png)
    if picture is not None:
        draw_run(reported[0].run, picture, reported[0].title)
    first, *others = reported
    write_json(json_, dict(first.figures) | ({"compared": dict(others[0].figures)} if others else {}))
    if others:
        named = [(one.name, one.figures) for one in reported]
        for note in comparison_notes(*named):
            say(console, note)
        _print_comparison(console, comparison_rows(*named))
    else:
        print_summary(console, dict(first.figures))
    if picture is not None:
        say(console, f"picture {picture}")
    if html is not None:
        say(console, f"page    {html}")
    for log in logs:
        say(console, f"log     {log}")


def _print_comparison(console: Any, rows: list[list[str]]) -> None:
    from rich.table import Table

    table = Table()
    for number, heading in enumerate(rows[0]):
        table.add_column(heading, justify="right" if number else "left")
    for row in rows[1:]:
        table.add_row(*row)
    console.print(table)
