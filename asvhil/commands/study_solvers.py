"""`asvhil study solvers`: comparison of the solvers, with mpc.torch in an environment of its own."""

from __future__ import annotations

import shlex
import shutil
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.options import SetOption
from asvhil.commands.study_command import RUNS, ConfigOption, OutOption, QuickOption, Study, study_command
from asvhil.commands.study_views import stem_of
from asvhil.errors import AsvhilError, ConfigError

if TYPE_CHECKING:
    from asvhil.study.runner import Tell


@study_command
def solvers(
    output: OutOption = RUNS,
    ticks: Annotated[int, typer.Option(min=2, help="Control ticks of each solver's closed loop.")] = 250,
    problems: Annotated[int, typer.Option(min=1, help="Recorded problems that are held against their optimum.")] = 200,
    solver: Annotated[list[str], typer.Option(help="One solver; repeatable. The first is the one compared to.")] = [],  # noqa: B006
    horizon: Annotated[float, typer.Option(help="Seconds: 2 to 200 steps of mpc.first_step_s, all alike.")] = 4.0,
    peer: Annotated[str, typer.Option(help="Command of a peer that takes a problem file, as in tests/peers.")] = "",
    config: ConfigOption = "sitl",
    quick: QuickOption = False,
    set_: SetOption = [],  # noqa: B006
) -> Study:
    """Compare all solvers on one core: time of a step, gap to the optimum, and scores in closed loop."""
    from asvhil.backseat.build import build_model, model_file
    from asvhil.config import load_config
    from asvhil.config.registry import CONTROLLERS
    from asvhil.study.made_of import made_of, run_files
    from asvhil.study.rows import checked
    from asvhil.study.runner import StudyProgress
    from asvhil.study.solver_report import draw_solvers, solver_table
    from asvhil.study.solvers import SOLVERS, checked_study, study_solvers

    checked(solver, SOLVERS, "--solver")
    if peer and solver and "torch-lqr" not in solver:
        raise ConfigError("--peer solves the problems of the torch-lqr run: name that --solver too")
    settings = load_config(config, tuple(set_))
    if not CONTROLLERS.find(settings.controller.name).solves:
        raise ConfigError(f"key controller.name: {settings.controller.name} has no solver; an MPC is needed")
    command = _peer_command(peer)
    checked_study(settings, solver or SOLVERS, horizon)
    file = model_file(settings)

    def figures(tell: Tell) -> dict[str, Any]:
        return study_solvers(
            settings,
            build_model(settings),
            steps=min(ticks, 20) if quick else ticks,
            problems=min(problems, 8) if quick else problems,
            solvers=solver or SOLVERS,
            limit_problems=min(problems, 4) if quick else problems,
            horizon_s=horizon,
            peer=command,
            peer_model_file="" if file is None else str(file),
            tell=lambda what, done, of: tell(StudyProgress(done=done, total=of, part=what)),
        )

    def failure(figures: dict[str, Any]) -> AsvhilError | None:
        words = figures.get("peer_failed")
        return None if words is None else AsvhilError(f"--peer {words}; the other solvers' figures are written")

    return Study(
        title="solvers",
        stem=stem_of("solvers", quick),
        figures=figures,
        text=solver_table,
        draw=draw_solvers,
        resumes=False,
        failure=failure,
        made_of=made_of(("study/solvers.py", "study/solver_report.py"), run_files(config, tuple(set_))),
    )


def _peer_command(text: str) -> list[str]:
    """The words of --peer. ConfigError where they are not a command, or there is no such program."""
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise ConfigError(f"--peer {text}: no command ({error}); PROGRAM and its arguments are expected") from None
    if words and shutil.which(words[0]) is None:
        raise ConfigError(f"--peer {words[0]}: no such program, or not one that may be run")
    return words
