"""The studies of learned models in the loop: beside right and wrong physics, and on boats that have changed."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.options import SetOption
from asvhil.commands.study_command import (
    RUNS,
    ConfigOption,
    ConfirmOption,
    ModelsOption,
    OutOption,
    QuickOption,
    RowOption,
    SeedsOption,
    Study,
    WorkersOption,
    study_command,
)
from asvhil.commands.study_views import stem_of

if TYPE_CHECKING:
    from asvhil.study.runner import Tell

BASE = "sitl"  # the vehicle that the changed boats are made from
BoatOption = Annotated[list[str], typer.Option(help="One boat by its name in the tables; repeatable.")]
BoatModelsOption = Annotated[Path, typer.Option(help="Folder of the models that `study boat-models` trained.")]
BOAT_MODELS = Path("runs/boat-models")


@study_command
def learned_loop(
    output: OutOption = RUNS,
    seeds: SeedsOption = 5,
    row: RowOption = [],  # noqa: B006
    under: Annotated[
        list[str],
        typer.Option(help="One circumstance by its name in the tables; repeatable. As shipped by default."),
    ] = [],  # noqa: B006
    patterns: Annotated[int, typer.Option(min=1, help="Patterns of wrong parameters.")] = 4,
    models: ModelsOption = None,
    config: ConfigOption = "sitl",
    workers: WorkersOption = None,
    confirm: ConfirmOption = 0,
    quick: QuickOption = False,
    set_: SetOption = [],  # noqa: B006
) -> Study:
    """Learned models in the loop beside SD-MPC with true, guessed and wrong parameters; on changed boats as well."""
    from asvhil.study.boat_bounds import STARTS
    from asvhil.study.circumstances import AS_SHIPPED, circumstances
    from asvhil.study.learned_loop import LEARNED, markdown, study_learned_loop
    from asvhil.study.made_of import made_of, run_files
    from asvhil.study.rows import FROM_S, QUICK_S, ROWS, TO_S, checked
    from asvhil.study.runner import run_into
    from asvhil.study.six_tests import controller_overrides

    overrides = tuple(set_)
    names = checked(under or [AS_SHIPPED], circumstances(config, overrides), "--under")
    rows = checked(row, ROWS, "--row")
    learned = {name: controller_overrides(name, models, config, overrides) for name in LEARNED}

    def figures(tell: Tell) -> dict[str, Any]:
        return study_learned_loop(
            run_into(output / "trials.jsonl", workers=workers, tell=tell, confirm=confirm),
            learned=learned,
            under=names,
            rows=rows,
            seeds=range(1, 2 if quick else seeds + 1),
            patterns=min(patterns, 2) if quick else patterns,
            starts=2 if quick else STARTS,
            window_s=QUICK_S if quick else (FROM_S, TO_S),
            base=config,
            overrides=overrides,
        )

    return Study(
        title="learned models",
        stem=stem_of("learned-loop", quick),
        figures=figures,
        store=output / "trials.jsonl",
        text=markdown,
        made_of=made_of(
            ("study/learned_loop.py", "study/circumstances.py"),
            run_files(config, *learned.values()),
        ),
    )


@study_command
def boat_models(
    output: OutOption = BOAT_MODELS,
    boat: BoatOption = [],  # noqa: B006
    workers: WorkersOption = None,
    quick: QuickOption = False,
    set_: SetOption = [],  # noqa: B006
) -> Study:
    """Train the default controller's model on each boat that has changed; models in the folder are kept."""
    from asvhil.config import load_config
    from asvhil.study.boat_model import BOATS, markdown, train_boats
    from asvhil.study.rows import checked
    from asvhil.study.runner import run_into

    load_config(BASE, tuple(set_))
    boats = checked(boat, BOATS, "--boat")

    def figures(tell: Tell) -> dict[str, Any]:
        with tempfile.TemporaryDirectory() as scratch:  # what is stored of a training is its model
            run = run_into(Path(scratch) / "models.jsonl", workers=workers, tell=tell)
            return train_boats(run, boats, output, BASE, tuple(set_), quick=quick)

    return Study(
        title="boat models",
        stem=stem_of("boat-models", quick),
        figures=figures,
        text=markdown,
        made_of=None,
    )


@study_command
def changed_boats(
    output: OutOption = RUNS,
    seeds: SeedsOption = 3,
    row: RowOption = [],  # noqa: B006
    boat: BoatOption = [],  # noqa: B006
    boat_models: BoatModelsOption = BOAT_MODELS,
    models: ModelsOption = None,
    workers: WorkersOption = None,
    confirm: ConfirmOption = 0,
    quick: QuickOption = False,
    set_: SetOption = [],  # noqa: B006
) -> Study:
    """The default controller on boats that have changed, by the unchanged boat's model and by one trained on each."""
    from asvhil.config import load_config
    from asvhil.study.boat_bounds import STARTS
    from asvhil.study.boat_model import BOATS, model_of_boat
    from asvhil.study.changed_boats import markdown, study_changed_boats
    from asvhil.study.made_of import made_of, run_files
    from asvhil.study.rows import FROM_S, QUICK_S, ROWS, TO_S, checked
    from asvhil.study.runner import run_into
    from asvhil.study.six_tests import MAIN, controller_overrides

    overrides = tuple(set_)
    load_config(BASE, overrides)
    rows, boats = checked(row, ROWS, "--row"), checked(boat, BOATS, "--boat")
    unchanged = controller_overrides(MAIN, models, BASE, overrides)
    own = {name: model_of_boat(boat_models, name, BASE, overrides, quick=quick) for name in boats}

    def figures(tell: Tell) -> dict[str, Any]:
        return study_changed_boats(
            run_into(output / "trials.jsonl", workers=workers, tell=tell, confirm=confirm),
            unchanged=unchanged,
            own=own,
            rows=rows,
            seeds=range(1, 2 if quick else seeds + 1),
            starts=2 if quick else STARTS,
            window_s=QUICK_S if quick else (FROM_S, TO_S),
            base=BASE,
            overrides=overrides,
        )

    return Study(
        title="changed boats",
        stem=stem_of("changed-boats", quick),
        figures=figures,
        store=output / "trials.jsonl",
        text=markdown,
        made_of=made_of(("study/changed_boats.py",), [*run_files(BASE, unchanged), *own.values()]),
    )
