"""`asvhil study ...`: the long studies, each resumable, with its table, figure and JSON."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Any

import typer

from asvhil.commands.options import JsonOption, SetOption
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
    """The paper's model table: open-loop errors and MPC time of SD, NNSEM, NODE, KNODE and LagNet."""
    from rich.console import Console

    from asvhil.collect import collect, parse_wind
    from asvhil.study.models import collect_logs, study_models

    def drive(config: Any, duration_s: float, winds: list[str], path: Path) -> list[Path]:
        return [run.log for run in collect(config, "lockstep", duration_s, [parse_wind(w) for w in winds], path)]

    console = Console()
    with progress(console) as bar:
        task = bar.add_task("models", total=1.0)

        def tell(what: str, share: float) -> None:
            bar.update(task, description=what, completed=share)

        train, test = collect_logs(output / "logs", drive, tell=tell)
        figures = study_models(train, test, output, only=only, ode_iterations=ode_iterations, tell=tell)
    write_json(json_, figures)
    console.print((output / "models.md").read_text(encoding="utf-8"), markup=False, highlight=False, soft_wrap=True)


@app.command()
def bound(
    wind: Annotated[list[str], typer.Option(metavar="SPEED@DEG", help="Repeatable.")] = ["3@90", "6@90", "6@45"],  # noqa: B006
    config: Annotated[str, typer.Option(help="Whose vessel.")] = "sitl",
    set_: SetOption = [],  # noqa: B006
    json_: JsonOption = None,
) -> None:
    """The physical bound of the penalty score in a steady wind, by periodic optimal control."""
    from rich.console import Console
    from rich.table import Table

    from asvhil.collect import parse_wind
    from asvhil.config import load_config
    from asvhil.dynamics.rigid_body import SimplifiedDynamics
    from asvhil.study.bound import bound as best_orbit

    settings = load_config(config, tuple(set_))
    model = SimplifiedDynamics(settings.controller.vessel or settings.vehicle.vessel)
    console = Console()
    table = Table(title="physical bound", title_justify="left")
    for heading in ("wind", "ps", "period (s)", "e_d (m)", "s_d (m)", "e_h (deg)", "s_h (deg)"):
        table.add_column(heading, justify="right")
    figures = {}
    with progress(console) as bar:
        task = bar.add_task("bound", total=len(wind))
        for text in wind:
            sector = parse_wind(text)
            orbit = best_orbit(model, sector.speed_mps, math.radians(sector.toward_deg))
            bar.advance(task)
            (e_d, s_d), (e_h, s_h) = orbit.distance_m, orbit.heading_deg
            figures[str(sector)] = {
                "penalty_score": orbit.penalty_score,
                "period_s": orbit.period_s,
                "distance_m": {"mean": e_d, "std": s_d},
                "heading_deg": {"mean": e_h, "std": s_h},
            }
            cells = (orbit.penalty_score, orbit.period_s, e_d, s_d, e_h, s_h)
            table.add_row(str(sector), *(f"{value:.3f}" for value in cells))
    write_json(json_, figures)
    console.print(table)


@app.command(name="six-tests")
def six_tests(
    output: OutOption = Path("runs/study-six-tests"),
    seeds: Annotated[int, typer.Option(min=1, max=11, help="Number of seeds, from 1 on.")] = 5,
    controller: Annotated[list[str], typer.Option(help="One controller by its name in the table; repeatable.")] = [],  # noqa: B006
    row: Annotated[list[str], typer.Option(help="One row by its name; repeatable.")] = [],  # noqa: B006
    noise: Annotated[bool, typer.Option(help="Sensor noise and gusts.")] = True,
    quick: Annotated[bool, typer.Option("--quick", help="One seed, 60 s windows: to see that it works.")] = False,
    set_: SetOption = [],  # noqa: B006
    json_: JsonOption = None,
) -> None:
    """All controllers over the paper's six tests, their mirrors and diagonals."""
    from rich.console import Console

    from asvhil.errors import ConfigError
    from asvhil.study.six_tests import CONTROLLERS, FROM_S, ROWS, TO_S, markdown, study_six_tests

    for names, known, what in ((controller, CONTROLLERS, "controller"), (row, ROWS, "row")):
        for name in names:
            if name not in known:
                raise ConfigError(f"--{what} {name}: unknown (known: {', '.join(known)})")
    console = Console()
    with progress(console) as bar:
        task = bar.add_task("six tests", total=None)
        figures = study_six_tests(
            output / "runs.jsonl",
            controllers=controller or tuple(CONTROLLERS),
            rows=row or tuple(ROWS),
            seeds=range(1, 2 if quick else seeds + 1),
            noise=noise,
            window_s=(60.0, 120.0) if quick else (FROM_S, TO_S),
            overrides=tuple(set_),
            on_progress=lambda done, of: bar.update(task, completed=done, total=of),
        )
    write_json(json_, figures)
    table = markdown(figures)
    (output / "six-tests.json").write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    (output / "six-tests.md").write_text(table, encoding="utf-8")
    console.print(table, markup=False, highlight=False, soft_wrap=True)
