"""`asvhil study waves`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

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

SIX = ("1", "2", "3", "4", "5", "6")


@study_command
def waves(
    output: OutOption = RUNS,
    seeds: SeedsOption = 5,
    row: RowOption = [],  # noqa: B006
    models: ModelsOption = None,
    config: ConfigOption = "sitl",
    workers: WorkersOption = None,
    confirm: ConfirmOption = 0,
    quick: QuickOption = False,
    set_: SetOption = [],  # noqa: B006
) -> Study:
    """The default controller in waves along the wind and in calm water, with and without the wave filter."""
    from asvhil.study.made_of import made_of, run_files
    from asvhil.study.rows import FROM_S, QUICK_S, ROWS, TO_S, checked
    from asvhil.study.runner import run_into
    from asvhil.study.six_tests import MAIN, controller_overrides
    from asvhil.study.waves import markdown, study_waves

    rows = checked(row or list(SIX), ROWS, "--row")
    controller = controller_overrides(MAIN, models, config, tuple(set_))

    def figures(tell: Tell) -> dict[str, Any]:
        return study_waves(
            run_into(output / "trials.jsonl", workers=workers, tell=tell, confirm=confirm),
            controller=controller,
            rows=rows,
            seeds=range(1, 2 if quick else seeds + 1),
            window_s=QUICK_S if quick else (FROM_S, TO_S),
            base=config,
        )

    return Study(
        title="waves",
        stem=stem_of("waves", quick),
        figures=figures,
        store=output / "trials.jsonl",
        text=markdown,
        made_of=made_of(("study/waves.py",), run_files(config, controller)),
    )
