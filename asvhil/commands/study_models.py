"""`asvhil study models`: the table of learned models."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from asvhil.commands.options import JsonOption
from asvhil.commands.outputs import write_json, writing
from asvhil.commands.study_command import OutOption
from asvhil.commands.study_views import check_output, watching
from asvhil.commands.views import say
from asvhil.study.model_jobs import ODE_ITERATIONS

if TYPE_CHECKING:
    from asvhil.config import Config


def models(
    output: OutOption = Path("runs/study-models"),
    only: Annotated[list[str], typer.Option(help="Name of one job; repeatable.")] = [],  # noqa: B006
    ode_iterations: Annotated[int, typer.Option(min=1, help="Iterations of NODE and KNODE.")] = ODE_ITERATIONS,
    json_: JsonOption = None,
) -> None:
    """The paper's model table: open-loop errors and MPC time of SD, NNSEM, NODE, KNODE and LagNet; rows in waves."""
    from rich.console import Console

    from asvhil.study.made_of import made_of, mark_of, run_files
    from asvhil.study.model_jobs import chosen_jobs, jobs
    from asvhil.study.model_logs import collect_logs
    from asvhil.study.models import markdown, study_models
    from asvhil.study.runner import StudyProgress

    check_output(output, "models", json_)
    known = jobs(ode_iterations)
    rough = any(job.waves for job in chosen_jobs(known, only))
    # Logs and models that are there already are used again, and do not say which code they are of.
    older = [*(output / "logs").glob("*.mcap"), *(output / "models").glob("*.npz")]
    mark = mark_of(made_of(("study/models.py", "study/model_logs.py"), run_files("sitl")), len(older))
    console = Console()
    with watching(console, "models") as tell:

        def show(part: str, share: float) -> None:
            tell(StudyProgress(done=round(100.0 * share), total=100, part=part))

        calm = collect_logs(output / "logs", _drive, tell=show)
        waves = collect_logs(output / "logs", _drive, tell=show, waves=True) if rough else None
        with writing(output, "-o "):
            figures = study_models(
                calm.train, calm.test, output, known=known, only=only, waves=waves, tell=show, mark=mark
            )
    write_json(json_, figures)
    say(console, markdown(figures["rows"]))


def _drive(config: Config, duration_s: float, winds: list[str], path: Path) -> list[Path]:
    from asvhil.collect import collect
    from asvhil.config.mean_wind import parse_wind
    from asvhil.errors import LogError

    runs = collect(config, "lockstep", duration_s, [parse_wind(wind) for wind in winds], path)
    for run in runs:
        if not run.complete:
            raise LogError(f"{run.log}: the manoeuvres ended after {run.held_s:.0f} s: {run.reason}")
    return [run.log for run in runs]
