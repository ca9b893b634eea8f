"""The commands of learning: collect data, train models, evaluate them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.options import ConfigArgument, JsonOption, SetOption
from asvhil.commands.views import write_json
from asvhil.errors import AsvhilError, ConfigError

if TYPE_CHECKING:
    from asvhil.train.options import Progress


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
    vehicle: Annotated[str | None, typer.Option(help="The vehicle's name, which CSV files do not say.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first weights and of the batches.")] = 1,
    tries: Annotated[
        int, typer.Option(min=1, max=50, help="Networks from as many seeds, SEED on; the best on validation is kept.")
    ] = 1,
    iterations: Annotated[int | None, typer.Option(min=1, help="As the kind has it by default.")] = None,
    rate: Annotated[
        float | None, typer.Option(min=1e-6, max=1.0, help="Adam's rate; 0.001, lagnet 0.003 falling to 0.00003.")
    ] = None,
    last_rate: Annotated[
        float | None, typer.Option(min=0.0, max=1.0, help="The rate falls to it along a cosine; as --rate.")
    ] = None,
    members: Annotated[int | None, typer.Option(min=1, max=20, help="Networks of an ensemble (lagnet).")] = None,
    width: Annotated[int | None, typer.Option(min=1, max=200, help="Hidden neurons of a network; 12.")] = None,
    horizon: Annotated[
        float | None, typer.Option(min=0.04, help="Seconds that are simulated in each training window; 20 steps.")
    ] = None,
    batch: Annotated[int | None, typer.Option(min=1, max=4096, help="Windows of each training step; 64.")] = None,
    moving_share: Annotated[
        float | None,
        typer.Option(min=0.0, max=1.0, help="Part of each batch from windows in motion only, for idle records; 0."),
    ] = None,
    mirror: Annotated[
        bool | None,
        typer.Option("--mirror/--no-mirror", help="Train on the mirrored data as well (lagnet does by default)."),
    ] = None,
    paired: Annotated[
        bool, typer.Option("--paired", help="Each neuron (nnsem) with a twin, its mirror image: the boat is symmetric.")
    ] = False,
    from_sd: Annotated[
        bool, typer.Option("--from-sd", help="Start the skip terms (lagnet) from SD fitted to the same data.")
    ] = False,
    weight_decay: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=1.0,
            help="Of the loss for each unit of squared weight, and of squared change of skip terms; 0.",
        ),
    ] = None,
    monotone: Annotated[
        float | None,
        typer.Option(
            min=0.0, max=100.0, help="Of the loss for each unit of slope by a command that no motor has (nnsem); 0."
        ),
    ] = None,
    robust: Annotated[
        float | None,
        typer.Option(
            min=0.001,
            max=1.0,
            help="Error (of half the range) beyond which a window counts by its logarithm, not its square; off.",
        ),
    ] = None,
    validation_share: Annotated[
        float | None,
        typer.Option(
            min=0.0, max=0.9, help="Part held back to choose the best weights by; 0.1. With 0 the last ones are kept."
        ),
    ] = None,
    smoothing: Annotated[bool, typer.Option(help="Smooth the training data over time.")] = True,
    dt: Annotated[float, typer.Option(min=0.02, max=2.0, help="Step of the model in seconds.")] = 0.2,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with an interrupted training.")] = False,
    json_: JsonOption = None,
) -> None:
    """Train a vessel model on logs; leaves the model file and a picture of its loss."""
    from rich.console import Console

    from asvhil.commands.views import progress

    _need_torch()
    from asvhil.train.jobs import checkpoint_of, train_command
    from asvhil.train.options import chosen_options

    console = Console()
    options = chosen_options(
        kind,
        dt,
        iterations=iterations,
        members=members,
        rate=rate,
        last_rate=last_rate,
        width=width,
        horizon_s=horizon,
        batch=batch,
        moving_share=moving_share,
        mirror=mirror,
        paired=paired,
        from_sd=from_sd,
        weight_decay=weight_decay,
        monotone=monotone,
        robust=robust,
        validation_share=validation_share,
    )
    try:
        with progress(console) as bar:
            task = bar.add_task(kind, total=options.iterations)

            def show(state: Progress) -> None:
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


COMMANDS = (collect, train, evaluate)
