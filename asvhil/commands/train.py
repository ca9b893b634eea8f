"""`asvhil train`: trains a vessel model on logs or CSV files."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from asvhil.commands.options import ColumnsOption, JsonOption, PluginOption, RecordedPluginsOption
from asvhil.commands.outputs import check_apart, check_json, check_writable, columns_file, write_json
from asvhil.commands.signatures import option, parameters_of, with_parameters
from asvhil.commands.termination import tell_interrupted
from asvhil.commands.views import progress, say
from asvhil.errors import AsvhilError, ConfigError
from asvhil.files import is_folder, is_there
from asvhil.train.options import CHOICES, NETWORKS, OPTIONS, FitOptions, chosen_options

if TYPE_CHECKING:
    from asvhil.train.progress import TrainingProgress

PANEL = "Options of the model's kind"


def train(
    kind: Annotated[str, typer.Argument(help="nnsem, lagnet, sd, node or knode.")],
    data: Annotated[list[Path], typer.Argument(help="MCAP logs or folders of runs, or CSV files with --columns.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The model file (npz) to write.")],
    columns: ColumnsOption = None,
    vehicle: Annotated[str | None, typer.Option(help="The vehicle's name, which CSV files do not hold.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first weights and of the batches.")] = 1,
    tries: Annotated[
        int, typer.Option(min=1, max=50, help="Networks from as many seeds, SEED on; the best on validation is kept.")
    ] = 1,
    smoothing: Annotated[bool, typer.Option(help="Smooth the training data over time.")] = True,
    dt: Annotated[float, typer.Option(min=0.02, max=2.0, help="Step of the model in seconds.")] = 0.2,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with an interrupted training.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite a model file that is there.")] = False,
    plugin: PluginOption = [],  # noqa: B006 - typer copies its defaults
    allow_recorded_plugins: RecordedPluginsOption = False,
    json_: JsonOption = None,
    **chosen: Any,
) -> None:
    """Train a vessel model on logs. Writes the model file and a picture of its loss."""
    from rich.console import Console

    need_torch(kind)
    from asvhil.logs.plugins import load_plugins
    from asvhil.logs.segments import first_in
    from asvhil.train.jobs import left_out_words, picture_of

    data = [first_in(path) for path in data]
    made = (("--output", output), ("the picture of --output", picture_of(output)))
    read = [*(("the data", file) for file in data), *columns_file(columns)]
    check_apart(*read, *made, ("--json", json_))
    load_plugins(data if columns is None else (), plugin, allow_recorded=allow_recorded_plugins)
    check_json(json_)
    _check_output(output, force=force, resume=resume)
    console = Console()
    figures = train_with_bar(
        console,
        kind,
        data,
        output,
        columns=columns,
        vehicle=vehicle,
        seed=seed,
        options=chosen_options(kind, dt, **chosen),
        dt_s=dt,
        smoothed=smoothing,
        tries=tries,
        resume=resume,
    )
    tell_notes(figures)
    words = f"{output}: {kind} for {figures['vehicle']}, {figures['data_s']:.0f} s of data, {figures['wall_s']:.1f} s"
    if figures["missing_rows"] or figures["outliers"]:
        words += f"; left out: {figures['missing_rows']} rows with a missing value, {figures['outliers']} jumps"
    for path in figures["left_out"]:
        say(console, left_out_words(path))
    say(console, words)
    say(console, figures["at_rest"]["verdict"])
    write_json(json_, figures)
    if figures["picture_fault"]:
        raise AsvhilError(f"{figures['picture_fault']}; the model {output} is whole")


def _check_output(output: Path, *, force: bool, resume: bool) -> None:
    """ConfigError or AsvhilError where the files of a training cannot be written, or are there already."""
    from asvhil.train.jobs import checkpoint_of, picture_of

    for file in (output, picture_of(output)):
        if is_there(file) and not force:
            raise ConfigError(f"train: {file} is there already: another name, or --force to overwrite it")
        if is_folder(file.parent):
            check_writable(file, "--output ")
    unfinished = checkpoint_of(output)
    if is_there(unfinished) and not (force or resume):
        raise ConfigError(
            f"train: {unfinished} is of a training that was interrupted: --resume it, or --force to begin anew"
        )


def train_with_bar(console: Any, kind: str, data: list[Path], output: Path, **settings: Any) -> dict[str, Any]:
    """`train.jobs.train_command` with a bar; where it is interrupted, how to go on is told."""
    from asvhil.train.jobs import checkpoint_of, train_command

    options = settings.setdefault("options", chosen_options(kind, settings.get("dt_s", 0.2)))
    try:
        with progress(console) as bar:
            task = bar.add_task(kind, total=options.iterations)

            def show(state: TrainingProgress) -> None:
                # SD is fitted to all that it is given: there is nothing that its error is validated on.
                what = "error" if kind == "sd" else "best validation error"
                words = f"{kind}, {what} {state.validation:.4f}"
                bar.update(task, completed=state.iteration, total=state.iterations, description=words)

            figures = train_command(kind, data, output, **settings, progress=show)
            bar.update(task, completed=bar.tasks[0].total)  # it may end before all iterations
        return figures
    except KeyboardInterrupt:
        if is_there(checkpoint_of(output)):
            tell_interrupted(f"interrupted; the same command with --resume goes on from {checkpoint_of(output)}")
        raise


def tell_notes(figures: dict[str, Any]) -> None:
    """What is odd about the data of a training, a warning each."""
    for line in figures["notes"]:
        typer.echo(f"asvhil: warning: {line}", err=True)


def need_torch(kind: str = "") -> None:
    """One clear line where what trains a kind is not installed, or does not load."""
    packages = ("torch", "torchdiffeq") if kind in ("node", "knode") else ("torch",)
    for package in packages:
        try:
            import_module(package)
        except (ImportError, OSError) as error:  # OSError: of its libraries one is missing, or for another computer
            if getattr(error, "name", None) == package:
                raise AsvhilError(
                    f"training needs {package}: pip install '.[train]' in the clone of asvhil"
                    " (6 GB; less: docs/installation.md)"
                ) from None
            why = (str(error) or type(error).__name__).splitlines()[0]
            raise AsvhilError(
                f"training needs {package}, which is installed and does not load ({why}): install it again"
                " (docs/installation.md)"
            ) from None


def _kind_options() -> Iterator[inspect.Parameter]:
    """An option for each `TrainOption` among the fields of FitOptions, in their order."""
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
    """The default of most kinds, then those of kinds that differ, as text."""
    texts = {
        kind: ("on" if value else "off") if isinstance(value, bool) else f"{value:g}"
        for kind, value in defaults.items()
    }
    usual = next(iter(texts.values()))
    return "; ".join([usual, *(f"{kind} {text}" for kind, text in texts.items() if text != usual)])


with_parameters(train, [*parameters_of(train), *_kind_options()])
