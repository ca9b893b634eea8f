"""The commands of learning: collect data, train models, evaluate them."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from asvhil.commands.options import ConfigArgument, JsonOption, SetOption
from asvhil.commands.signatures import option, parameters_of, with_parameters
from asvhil.commands.views import write_json
from asvhil.errors import AsvhilError, ConfigError
from asvhil.train.options import CHOICES, NETWORKS, OPTIONS, FitOptions, chosen_options

if TYPE_CHECKING:
    from asvhil.train.progress import TrainingProgress

PANEL = "Options of the model's kind"


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

    from asvhil.collect import Mode
    from asvhil.collect import collect as drive
    from asvhil.commands.views import progress
    from asvhil.config import load_config
    from asvhil.config.mean_wind import parse_wind

    if realtime and vehicle:
        raise ConfigError("collect: --realtime is the simulated boat, --vehicle the real one: give one of them")
    mode: Mode = "vehicle" if vehicle else "realtime" if realtime else "lockstep"
    console = Console()
    settings = load_config(config, tuple(set_))
    with progress(console) as bar:
        tasks: dict[int, Any] = {}

        def start(run: int, log: Path, words: str) -> None:
            tasks[run] = bar.add_task(words or log.name, total=duration)

        def show(run: int, status: dict[str, Any]) -> None:
            bar.update(tasks[run], completed=round(status["held_s"], 1))

        winds = [parse_wind(text) for text in wind]
        runs = drive(settings, mode, duration, winds, output, note, on_status=show, on_start=start)
    write_json(json_, {"runs": [{**_plain(run), "log": str(run.log)} for run in runs]})
    for run in runs:
        words = f"{run.log}: {run.held_s:.0f} s, {run.note}" if run.complete else f"{run.log}: {run.reason}"
        console.print(words, markup=False, highlight=False, soft_wrap=True)
    if not runs[-1].complete:
        raise AsvhilError(f"{runs[-1].log}: not complete after {runs[-1].held_s:.0f} s: {runs[-1].reason}")


def train(
    kind: Annotated[str, typer.Argument(help="nnsem, lagnet, sd, node or knode.")],
    data: Annotated[list[Path], typer.Argument(help="MCAP logs, or CSV files with --columns.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The model file (npz) to write.")],
    columns: Annotated[
        str | None, typer.Option(help="Column map of CSV files: a path, or the name of a shipped one.")
    ] = None,
    vehicle: Annotated[str | None, typer.Option(help="The vehicle's name, which CSV files do not hold.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first weights and of the batches.")] = 1,
    tries: Annotated[
        int, typer.Option(min=1, max=50, help="Networks from as many seeds, SEED on; the best on validation is kept.")
    ] = 1,
    smoothing: Annotated[bool, typer.Option(help="Smooth the training data over time.")] = True,
    dt: Annotated[float, typer.Option(min=0.02, max=2.0, help="Step of the model in seconds.")] = 0.2,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with an interrupted training.")] = False,
    json_: JsonOption = None,
    **chosen: Any,
) -> None:
    """Train a vessel model on logs; leaves the model file and a picture of its loss."""
    from rich.console import Console

    from asvhil.commands.views import progress

    _need_torch()
    from asvhil.train.jobs import checkpoint_of, train_command

    console = Console()
    options = chosen_options(kind, dt, **chosen)
    try:
        with progress(console) as bar:
            task = bar.add_task(kind, total=options.iterations)

            def show(state: TrainingProgress) -> None:
                words = f"{kind}, best validation error {state.validation:.4f}"
                bar.update(task, completed=state.iteration, total=state.iterations, description=words)

            figures = train_command(
                kind,
                data,
                output,
                columns=columns,
                vehicle=vehicle,
                seed=seed,
                options=options,
                dt_s=dt,
                smoothed=smoothing,
                tries=tries,
                resume=resume,
                progress=show,
            )
    except KeyboardInterrupt:
        if checkpoint_of(output).exists():
            typer.echo(
                f"asvhil: interrupted; the same command with --resume goes on from {checkpoint_of(output)}", err=True
            )
        raise
    write_json(json_, figures)
    words = f"{output}: {kind} for {figures['vehicle']}, {figures['data_s']:.0f} s of data, {figures['wall_s']:.1f} s"
    if figures["missing_rows"] or figures["outliers"]:
        words += f"; left out: {figures['missing_rows']} rows with a missing value, {figures['outliers']} jumps"
    console.print(words, markup=False, highlight=False, soft_wrap=True)


def evaluate(
    models: Annotated[list[Path], typer.Argument(help="Model files to compare.")],
    data: Annotated[list[Path], typer.Option("--data", help="MCAP logs or CSV files; repeatable.")],
    columns: Annotated[
        str | None, typer.Option(help="Column map of CSV files: a path, or the name of a shipped one.")
    ] = None,
    horizon: Annotated[float, typer.Option(min=0.2, help="Seconds of each open-loop rollout.")] = 50.0,
    every: Annotated[float, typer.Option(min=0.2, help="Seconds from one start to the next.")] = 10.0,
    truth: Annotated[bool, typer.Option("--truth", help="Score against the truth that a simulated log holds.")] = False,
    picture: Annotated[Path | None, typer.Option(help="Draw one rollout into this PNG or SVG file.")] = None,
    json_: JsonOption = None,
) -> None:
    """Roll models out in open loop over data and score u, v, r."""
    from rich.console import Console
    from rich.table import Table

    from asvhil.train.jobs import evaluate_command

    console = Console()
    with console.status("rolling out"):
        figures = evaluate_command(
            models, data, columns=columns, horizon_s=horizon, every_s=every, truth=truth, figure=picture
        )
    write_json(json_, figures)
    table = Table(title=f"mean absolute error over {horizon:g} s, {figures['reference']}", title_justify="left")
    for heading in ("model", "windows", "u (m/s)", "v (m/s)", "r (rad/s)", "count"):
        table.add_column(heading, justify="left" if heading in ("model", "windows") else "right")
    for name, parts in figures["rows"].items():
        for windows, row in parts.items():
            if row["windows"]:
                table.add_row(name, windows, *(f"{row[f'mae_{axis}']:.4f}" for axis in "uvr"), str(row["windows"]))
    console.print(table)


def _need_torch() -> None:
    """One clear line where the training extra is not installed."""
    from importlib.util import find_spec

    if find_spec("torch") is None:
        raise AsvhilError("training needs torch: install the extra, as in pip install 'asvhil[train]'")


def _plain(record: Any) -> dict[str, Any]:
    import dataclasses

    return dataclasses.asdict(record)


def _kind_options() -> Iterator[inspect.Parameter]:
    """An option for each `Choice` among the fields of FitOptions, in their order."""
    types = get_type_hints(FitOptions)
    for field, choice in CHOICES.items():
        defaults = {kind: getattr(OPTIONS[kind], field) for kind in choice.kinds}
        flag = f"--{choice.name.replace('_', '-')}"
        type_ = float if choice.seconds else types[field]
        if type_ is bool and any(defaults.values()):
            flag = f"{flag}/--no-{flag[2:]}"
        only = "" if set(NETWORKS) <= set(choice.kinds) else f" For {' and '.join(choice.kinds)} only."
        info = typer.Option(
            flag,
            min=choice.low,
            max=choice.high,
            help=f"{choice.help}{only} By default {choice.default or _words(defaults)}.",
            rich_help_panel=PANEL,
        )
        yield option(choice.name, Annotated[type_ | None, info], None)


def _words(defaults: dict[str, Any]) -> str:
    """The default of most kinds, and of those that differ."""
    texts = {
        kind: ("on" if value else "off") if isinstance(value, bool) else f"{value:g}"
        for kind, value in defaults.items()
    }
    usual = next(iter(texts.values()))
    return "; ".join([usual, *(f"{kind} {text}" for kind, text in texts.items() if text != usual)])


with_parameters(train, [*parameters_of(train), *_kind_options()])

COMMANDS = (collect, train, evaluate)
