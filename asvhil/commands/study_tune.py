"""`asvhil study tune`: the search for a baseline's gains, one file for each controller."""

from __future__ import annotations

import os
from typing import Annotated, Any

import typer

from asvhil.commands.options import JsonOption
from asvhil.commands.study_command import RUNS, ConfigOption, OutOption
from asvhil.commands.study_views import check_output, watching
from asvhil.commands.views import say, write_json

BUDGET = 40  # evaluations, as in the published searches


def tune(
    name: Annotated[list[str], typer.Argument(help="One that has a search, as controller.name; all by default.")] = [],  # noqa: B006
    output: OutOption = RUNS,
    budget: Annotated[int, typer.Option(help="Candidates, the same for each controller.")] = BUDGET,
    seed: Annotated[int, typer.Option(help="Seed of the candidates.")] = 1,
    config: ConfigOption = "sitl",
    workers: Annotated[int | None, typer.Option(help="Processes; as many as cores by default.")] = None,
    json_: JsonOption = None,
) -> None:
    """Search the gains of baselines, on winds that are not in the six tests. One resumable NAME.json each."""
    from rich.console import Console

    from asvhil.config import load_config
    from asvhil.config.registry import CONTROLLERS
    from asvhil.study import tuning
    from asvhil.study.rows import checked
    from asvhil.study.runner import StudyProgress

    load_config(config)  # and the plug-ins that it names
    for one in name:
        CONTROLLERS.get(one)  # one of an installed package
    names = checked(name, tuning.spaces(), "NAME")
    for one in names:
        check_output(output, one, json_)
    processes = (os.cpu_count() or 1) if workers is None else workers
    console = Console()
    found: dict[str, Any] = {}
    with watching(console, "tuning") as tell:
        for number, one in enumerate(names):

            def show(done: int, best: float, before: int = number * budget, name: str = one) -> None:
                note = f"{name}: {done} of {budget}, best typical ps {best:.2f}"
                tell(StudyProgress(done=before + done, total=budget * len(names), note=note))

            path = output / f"{one}.json"
            found[one] = tuning.tune(one, budget, seed, show, path=path, workers=processes, base=config)["best"]
    write_json(json_, found)
    for one, best in found.items():
        say(console, f"{one}: typical ps {best['typical_ps']:.2f}")
        for key, value in best["values"].items():
            say(console, f"  {key} = {value:g}")
