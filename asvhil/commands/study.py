"""`asvhil study ...`: the long studies, each resumable, with its table, figure and JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from asvhil.commands import study_runs, study_tune
from asvhil.commands.options import JsonOption
from asvhil.commands.study_views import check_output
from asvhil.commands.views import progress, write_json

app = typer.Typer(no_args_is_help=True, help="Studies behind the tables under docs/results.")

OutOption = Annotated[Path, typer.Option("-o", "--output", help="Folder of logs, models and tables; taken up again.")]


@app.command()
def models(
    output: OutOption = Path("runs/study-models"),
    only: Annotated[list[str], typer.Option(help="Name of one job; repeatable.")] = [],  # noqa: B006
    ode_iterations: Annotated[int, typer.Option(min=1, help="Iterations of NODE and KNODE.")] = 20000,
    json_: JsonOption = None,
) -> None:
    """The paper's model table: open-loop errors and MPC time of SD, NNSEM, NODE, KNODE and LagNet; rows in waves."""
    from rich.console import Console

    from asvhil.collect import collect
    from asvhil.config.mean_wind import parse_wind
    from asvhil.errors import LogError
    from asvhil.study.model_jobs import chosen_jobs
    from asvhil.study.model_logs import collect_logs
    from asvhil.study.models import markdown, study_models

    def drive(config: Any, duration_s: float, winds: list[str], path: Path) -> list[Path]:
        runs = collect(config, "lockstep", duration_s, [parse_wind(w) for w in winds], path)
        for run in runs:
            if not run.complete:
                raise LogError(f"{run.log}: the manoeuvres ended after {run.held_s:.0f} s: {run.reason}")
        return [run.log for run in runs]

    check_output(output, "models", json_)
    rough = any(job.waves for job in chosen_jobs(only, ode_iterations))
    console = Console()
    with progress(console) as bar:
        task = bar.add_task("models", total=1.0)

        def tell(what: str, share: float) -> None:
            bar.update(task, description=what, completed=share)

        calm = collect_logs(output / "logs", drive, tell=tell)
        waves = collect_logs(output / "logs", drive, tell=tell, waves=True) if rough else None
        figures = study_models(
            calm.train, calm.test, output, waves=waves, only=only, ode_iterations=ode_iterations, tell=tell
        )
    write_json(json_, figures)
    console.print(markdown(figures["rows"]), markup=False, highlight=False, soft_wrap=True)


for name, command in study_runs.COMMANDS.items():
    app.command(name=name)(command)
app.command()(study_tune.tune)
