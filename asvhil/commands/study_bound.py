"""`asvhil study bound`: the physical bound that penalty scores are compared with."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.options import SetOption
from asvhil.commands.study_command import ConfigOption, Study, study_command
from asvhil.errors import AsvhilError

if TYPE_CHECKING:
    from asvhil.study.runner import Tell


@study_command
def bound(
    wind: Annotated[list[str], typer.Option(metavar="SPEED@DEG", help="Mean wind; repeatable.")] = [  # noqa: B006
        "3@90",
        "6@90",
        "6@45",
    ],
    config: ConfigOption = "sitl",
    starts: Annotated[int, typer.Option(min=1, help="Searches in each wind, each from another start.")] = 40,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder for bound.json and bound.md, for the other studies.")
    ] = None,
    set_: SetOption = [],  # noqa: B006
) -> Study:
    """The physical bound of the penalty score in a steady wind, by periodic optimal control."""
    from asvhil.config import load_config
    from asvhil.config.loading import config_files
    from asvhil.config.mean_wind import parse_wind
    from asvhil.study import bound as study
    from asvhil.study.made_of import made_of
    from asvhil.study.runner import StudyProgress

    settings = load_config(config, tuple(set_))
    sectors = [parse_wind(text) for text in wind]
    model = study.plant_dynamics(settings)

    def figures(tell: Tell) -> dict[str, Any]:
        winds: dict[str, Any] = {}
        for number, (text, sector) in enumerate(zip(wind, sectors, strict=True)):

            def show(done: int, of: int, before: int = number * starts, part: str = text) -> None:
                tell(StudyProgress(done=before + done, total=starts * len(wind), part=part))

            try:
                orbit = study.bound(model, sector.speed_mps, math.radians(sector.toward_deg), starts, show)
            except RuntimeError as error:
                raise AsvhilError(f"--wind {text}: {error}; give less wind, or more --starts than {starts}") from None
            winds[str(sector)] = study.figures(orbit)
        return study.bounds_tree(settings, winds)

    return Study(
        title="bound",
        stem="bound",
        figures=figures,
        text=study.markdown,
        resumes=False,
        made_of=made_of(("study/bound.py",), config_files(config)),
    )
