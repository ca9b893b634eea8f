"""`asvhil campaign`: a design over config keys, run on all cores or a cluster, as a table with a summary."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.outputs import check_writable
from asvhil.commands.study_command import (
    RUNS,
    ConfirmOption,
    OutOption,
    SchedulerOption,
    Study,
    WorkersOption,
    study_command,
)
from asvhil.errors import AsvhilError
from asvhil.files import is_folder
from asvhil.types import changed

if TYPE_CHECKING:
    from asvhil.study.campaigns.table import Row
    from asvhil.study.runner import Tell


@study_command
def campaign(
    spec: Annotated[
        Path, typer.Argument(metavar="SPEC", help="YAML file of the campaign, or the name of a shipped one.")
    ],
    output: OutOption = RUNS,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    retry: Annotated[bool, typer.Option("--retry", help="Run those again that failed.")] = False,
    confirm: ConfirmOption = 0,
) -> Study:
    """Many seeded runs over winds, boats, sensors, faults, controllers or any key: Parquet, summary, worst cases.

    docs/campaigns.md describes the file. The same command resumes one that was interrupted.
    """
    from asvhil.study.campaigns.campaign import run_campaign
    from asvhil.study.campaigns.design import check, files_of
    from asvhil.study.campaigns.report import draw, markdown
    from asvhil.study.campaigns.spec import read_spec, runs_of
    from asvhil.study.campaigns.table import check_parts
    from asvhil.study.made_of import made_of
    from asvhil.study.runner import StudyProgress, run_into

    settings, path, lines = read_spec(spec)
    check_parts()
    check(settings, path, lines)
    if is_folder(output):
        check_writable(output / f"{path.stem}.parquet")
    stem, total = path.stem, runs_of(settings)
    rows: list[Row] = []

    def figures(tell: Tell) -> dict[str, Any]:
        run = run_into(
            output / f"{stem}.jsonl",
            workers=workers,
            tell=tell,
            scheduler=scheduler,
            isolate=True,
            retry=retry,
            confirm=confirm,
        )

        def planned(count: int) -> None:
            tell(StudyProgress(done=count, total=total, part="planned"))

        def logged(now: StudyProgress) -> None:
            tell(changed(now, part="logs of the worst runs"))

        with tempfile.TemporaryDirectory() as folder:  # what is stored of the logs is the logs
            again = run_into(Path(folder) / "logs.jsonl", workers=workers, tell=logged)
            found, rows[:] = run_campaign(settings, run, again, output, stem, planned)
        return found

    def failure(found: dict[str, Any]) -> Exception | None:
        if found["failed"] < found["runs"]:
            return None
        return AsvhilError(f"{path}: every run failed: {found['failures'][0]['error']}")

    return Study(
        title="campaign",
        stem=stem,
        figures=figures,
        text=markdown,
        store=output / f"{stem}.jsonl",
        keeps=(("the spec", path), ("the table of the runs", output / f"{stem}.parquet")),
        draw=lambda found, picture: draw(found, rows, picture),
        notes=(f"{path}: {total} runs",),
        failure=failure,
        made_of=made_of(("study/campaigns/campaign.py",), [path, *files_of(settings)]),
    )
