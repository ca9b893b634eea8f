"""`asvhil study tune`: the search for a baseline's gains, one file for each controller."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from asvhil.commands.options import JsonOption
from asvhil.commands.study_runs import RUNS, ConfigOption, OutOption
from asvhil.commands.study_views import check_output, say
from asvhil.commands.views import progress, write_json
from asvhil.errors import AsvhilError

BUDGET = 40  # of the searches on record


def tune(
    name: Annotated[list[str], typer.Argument(help="A baseline, as controller.name; all three by default.")] = [],  # noqa: B006
    output: OutOption = RUNS,
    budget: Annotated[int, typer.Option(min=1, help="Candidates, the same for each controller.")] = BUDGET,
    seed: Annotated[int, typer.Option(min=0, help="Of the candidates.")] = 1,
    config: ConfigOption = "sitl",
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    json_: JsonOption = None,
) -> None:
    """Search the gains of a baseline on winds that are not in the six tests; NAME.json each, taken up again."""
    from rich.console import Console

    from asvhil.study.rows import checked
    from asvhil.study.tuning import SPACES
    from asvhil.study.tuning import tune as search

    names = checked(name, SPACES, "NAME")
    for one in names:
        check_output(output, one, json_)
    console = Console()
    found: dict[str, Any] = {}
    with progress(console) as bar:
        task = bar.add_task("tuning", total=budget * len(names))
        for number, one in enumerate(names):

            def tell(done: int, best: float, before: int = number * budget, name: str = one) -> None:
                bar.update(task, completed=before + done, description=f"{name}, best typical ps {best:.2f}")
                if not console.is_terminal:
                    say(bar.console, f"{name}: {done} of {budget}, best typical ps {best:.2f}")

            try:
                path = output / f"{one}.json"
                found[one] = search(one, budget, seed, tell, path=path, workers=workers, base=config)["best"]
            except KeyboardInterrupt:
                words = "interrupted; the same command goes on where it was"
                raise AsvhilError(f"tuning of {one}: {words}") from None
    write_json(json_, found)
    for one, best in found.items():
        say(console, f"{one}: typical ps {best['typical_ps']:.2f}")
        for key, value in best["values"].items():
            say(console, f"  {key} = {value:g}")
