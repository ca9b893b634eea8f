"""`asvhil study soak`: endurance."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.options import SetOption
from asvhil.commands.study_command import ConfigOption, Study, study_command
from asvhil.errors import ConfigError

if TYPE_CHECKING:
    from asvhil.study.runner import Tell


@study_command
def soak(
    hours: Annotated[float, typer.Option(min=0.1, help="Hours of boat time.")] = 24.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the faults, the winds and the plant.")] = 1,
    config: ConfigOption = "sitl",
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Folder for soak.json and soak.md.")] = None,
    set_: SetOption = [],  # noqa: B006
) -> Study:
    """Hours of station keeping in lockstep with a fault every five minutes: what comes back, memory, time of a tick."""
    from asvhil.config import load_config
    from asvhil.study import soak as study
    from asvhil.study.made_of import made_of, run_files
    from asvhil.study.runner import StudyProgress
    from asvhil.study.trials.soak import run_soak

    settings = load_config(config, (f"plant.seed={seed}", *set_))
    if settings.supervisor.station is None:
        raise ConfigError(f"{config}: key supervisor.station: a soak needs the station to keep")

    def figures(tell: Tell) -> dict[str, Any]:
        total = round(hours * 60.0)

        def on_second(second: int) -> None:
            if second % 60 == 0:
                tell(StudyProgress(done=second // 60, total=total, part="minutes of boat time"))

        run = run_soak(settings, hours, seed, on_second)
        return {"run": run, "verdict": study.judge(run)}

    return Study(
        title="soak",
        stem="soak",
        figures=figures,
        text=study.markdown,
        resumes=False,
        made_of=made_of(("study/soak.py",), run_files(config, tuple(set_))),
    )
