"""Shared by the commands of studies: common options, running a study, and writing its figures to a folder."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.options import JsonOption
from asvhil.commands.signatures import option, parameters_of, with_parameters
from asvhil.commands.study_views import check_output, finish, watching
from asvhil.commands.views import say
from asvhil.types import record

if TYPE_CHECKING:
    from asvhil.study.runner import StudyProgress, Tell

RUNS = Path("runs/study")

OutOption = Annotated[Path, typer.Option("-o", "--output", help="Folder of runs, tables and figures; taken up again.")]
ConfigOption = Annotated[str, typer.Option(help="Config of the vessel, plant and controllers.")]
SeedsOption = Annotated[int, typer.Option(min=1, max=10_000, help="Number of seeds, from 1 on.")]
RowOption = Annotated[list[str], typer.Option(help="One row by its name; repeatable.")]
ModelsOption = Annotated[
    Path | None, typer.Option(help="Folder of model files KIND.npz; the shipped ones for kinds that it lacks.")
]
WorkersOption = Annotated[int | None, typer.Option(min=1, help="Processes; as many as cores by default.")]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS", help="A Dask scheduler, as tcp://HOST:8786; its workers run in place of processes."
    ),
]
ConfirmOption = Annotated[
    int,
    typer.Option(
        min=0, help="So many of the stored runs that other code made are run again, to see whether they change."
    ),
]
QuickOption = Annotated[bool, typer.Option("--quick", help="A short run of every part, to see that it works.")]

Figures = dict[str, Any]


@record
class Study:
    """A study whose options have been checked.

    `stem` is the name of its files in the output folder: figures (json), `text` (md), and a picture (png) if there is
    one to `draw`. `notes` are printed before it begins. `resumes`: the same command continues an interrupted study.
    `failure` gives the error, if any, that the command ends with after everything is written. `made_of`: the digests of
    the code and files that decide the figures (`asvhil.study.made_of`), for the page to say. `store` has its runs, and
    `keeps` what else it reads or writes, each with what it is: no figures take the place of these.
    """

    title: str
    stem: str
    figures: Callable[[Tell], Figures]
    text: Callable[[Figures], str]
    made_of: Mapping[str, str] | None  # None where what it leaves is no page of this project's results
    draw: Callable[[Figures, Path], None] | None = None
    store: Path | None = None
    keeps: tuple[tuple[str, Path | None], ...] = ()
    notes: tuple[str, ...] = ()
    resumes: bool = True
    failure: Callable[[Figures], Exception | None] = lambda figures: None


def study_command(prepare: Callable[..., Study]) -> Callable[..., None]:
    """The command of a study: its options are the parameters of `prepare`, `--output` among them, and `--json`."""

    @functools.wraps(prepare)
    def command(json_: Path | None, **options: Any) -> None:
        from rich.console import Console

        from asvhil.study.made_of import mark_of

        console = Console()
        study, output = prepare(**options), options["output"]
        for note in study.notes:
            say(console, note)
        check_output(output, study.stem, json_, ("the store of the runs", study.store), *study.keeps)
        outdated = again = changed = 0
        with watching(console, study.title, resumes=study.resumes) as tell:

            def counted(progress: StudyProgress) -> None:
                nonlocal outdated, again, changed
                outdated += progress.outdated
                again += progress.again
                changed += progress.changed
                tell(progress)

            figures = study.figures(counted)
        mark = "" if study.made_of is None else mark_of(study.made_of, outdated, again, changed)
        draw = None if study.draw is None else functools.partial(study.draw, figures)
        finish(console, output, study.stem, figures, study.text, json_, draw, mark)
        if again:
            say(console, f"{again} runs of older code were run again: {changed} came out otherwise")
        failure = study.failure(figures)
        if failure is not None:
            raise failure

    return with_parameters(command, [*parameters_of(prepare), option("json_", JsonOption, None)])
