"""The studies that are many runs in lockstep, the bound that they are held against, and the solvers side by side."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from asvhil.commands.options import JsonOption, SetOption
from asvhil.commands.study_views import bounds_at_hand, check_output, finish, say, stem_of, watching
from asvhil.commands.views import progress
from asvhil.errors import AsvhilError, ConfigError

RUNS = Path("runs/study")

OutOption = Annotated[Path, typer.Option("-o", "--output", help="Folder of runs, tables and figures; taken up again.")]
ConfigOption = Annotated[str, typer.Option(help="Whose vessel, plant and controllers.")]
SeedsOption = Annotated[int, typer.Option(min=1, help="Number of seeds, from 1 on.")]
RowOption = Annotated[list[str], typer.Option(help="One row by its name; repeatable.")]
ModelsOption = Annotated[Path | None, typer.Option(help="Folder of model files, KIND.npz; the shipped ones beside.")]
WorkersOption = Annotated[int | None, typer.Option(min=1, help="Processes; as many as cores by default.")]
QuickOption = Annotated[bool, typer.Option("--quick", help="Little of everything: to see that it works.")]


def bound(
    wind: Annotated[list[str], typer.Option(metavar="SPEED@DEG", help="Repeatable.")] = ["3@90", "6@90", "6@45"],  # noqa: B006
    config: ConfigOption = "sitl",
    starts: Annotated[int, typer.Option(min=1, help="Searches in each wind, each from another start.")] = 40,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder for bound.json and bound.md, for the other studies.")
    ] = None,
    set_: SetOption = [],  # noqa: B006
    json_: JsonOption = None,
) -> None:
    """The physical bound of the penalty score in a steady wind, by periodic optimal control."""
    from rich.console import Console

    from asvhil.config import load_config
    from asvhil.config.mean_wind import parse_wind
    from asvhil.dynamics.rigid_body import SimplifiedDynamics
    from asvhil.study.bound import bound as best_orbit
    from asvhil.study.bound import bounds_tree, markdown
    from asvhil.study.bound import figures as figures_of

    settings = load_config(config, tuple(set_))
    sectors = [parse_wind(text) for text in wind]
    check_output(output, "bound", json_)
    model = SimplifiedDynamics(settings.plant_vessel)
    winds: dict[str, Any] = {}
    console = Console()
    with progress(console) as bar:
        task = bar.add_task("bound", total=starts * len(wind))
        for number, (text, sector) in enumerate(zip(wind, sectors, strict=True)):

            def show(done: int, of: int, before: int = number * starts, name: str = text) -> None:
                bar.update(task, completed=before + done, description=name)

            try:
                orbit = best_orbit(model, sector.speed_mps, math.radians(sector.toward_deg), starts, show)
            except RuntimeError as error:
                raise AsvhilError(f"--wind {text}: {error}; give less wind, or more --starts than {starts}") from None
            winds[f"{sector.speed_mps:g}@{sector.toward_deg:g}"] = figures_of(orbit)
    finish(console, output, "bound", bounds_tree(settings, winds), markdown, json_)


def six_tests(
    output: OutOption = RUNS,
    seeds: SeedsOption = 5,
    controller: Annotated[list[str], typer.Option(help="One controller by its name in the table; repeatable.")] = [],  # noqa: B006
    row: RowOption = [],  # noqa: B006
    noise: Annotated[
        bool, typer.Option(help="Sensor noise and gusts; without them one seed, in a table apart.")
    ] = True,
    models: ModelsOption = None,
    bounds: Annotated[
        Path | None, typer.Option(help="bound.json of `study bound`; the shipped one by default.")
    ] = None,
    config: ConfigOption = "sitl",
    workers: WorkersOption = None,
    quick: QuickOption = False,
    set_: SetOption = [],  # noqa: B006
    json_: JsonOption = None,
) -> None:
    """All controllers over the paper's six tests, their mirrors and diagonals."""
    from rich.console import Console

    from asvhil.study.rows import FROM_S, QUICK_S, ROWS, TO_S, checked
    from asvhil.study.six_tests import CONTROLLERS, available, study_six_tests
    from asvhil.study.six_tests_report import draw_bars, report

    console = Console()
    labels, rows = checked(controller, CONTROLLERS, "--controller"), checked(row, ROWS, "--row")
    chosen, left_out = available(labels, models, config, tuple(set_))
    for line in left_out:
        say(console, line)
    if not chosen:
        raise ConfigError("no controller is left to run")
    limits = bounds_at_hand(console, bounds, config, tuple(set_))
    stem = stem_of("six-tests" if noise else "six-tests-no-noise", quick)
    check_output(output, stem, json_)
    with watching(console, "six tests") as tell:
        figures = study_six_tests(
            output / "trials.jsonl",
            controllers=chosen,
            rows=rows,
            seeds=range(1, 2 if quick or not noise else seeds + 1),
            noise=noise,
            window_s=QUICK_S if quick else (FROM_S, TO_S),
            workers=workers,
            base=config,
            bounds=limits,
            tell=tell,
        )
    figures["left_out"] = left_out
    finish(console, output, stem, figures, report, json_, lambda path: draw_bars(figures, path))


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
    json_: JsonOption = None,
) -> None:
    """All solvers side by side on one core: time of a step, gap to the optimum, and what the boat makes of it."""
    from rich.console import Console

    from asvhil.backseat.build import build_model, model_file
    from asvhil.config import load_config
    from asvhil.study.solver_report import draw_solvers, solver_table
    from asvhil.study.solvers import SOLVERS, checked_study, study_solvers

    for name in solver:
        if name not in SOLVERS:
            raise ConfigError(f"--solver {name}: unknown (known: {', '.join(SOLVERS)})")
    if peer and solver and "torch-lqr" not in solver:
        raise ConfigError("--peer solves the problems of the torch-lqr run: name that --solver too")
    settings = load_config(config, tuple(set_))
    if not settings.controller.name.endswith("-mpc"):
        raise ConfigError(f"key controller.name: {settings.controller.name} has no solver; an MPC is needed")
    command = _peer_command(peer)
    checked_study(settings, solver or SOLVERS, horizon)
    file = model_file(settings)
    stem = stem_of("solvers", quick)
    check_output(output, stem, json_)
    console = Console()
    with progress(console) as bar:
        task = bar.add_task("solvers", total=None)
        figures = study_solvers(
            settings,
            build_model(settings),
            steps=min(ticks, 20) if quick else ticks,
            problems=min(problems, 8) if quick else problems,
            solvers=solver or SOLVERS,
            limit_problems=min(problems, 4) if quick else problems,
            horizon_s=horizon,
            peer=command,
            peer_model_file="" if file is None else str(file),
            progress=lambda what, done, of: bar.update(task, description=what, completed=done, total=of),
        )
    finish(console, output, stem, figures, solver_table, json_, lambda path: draw_solvers(figures, path))
    if "peer_failed" in figures:
        raise AsvhilError(f"--peer {figures['peer_failed']}; the other solvers' figures are written")


def _peer_command(text: str) -> list[str]:
    """The words of --peer. ConfigError where they are no command, or there is no such program."""
    import shlex
    import shutil

    try:
        words = shlex.split(text)
    except ValueError as error:
        raise ConfigError(f"--peer {text}: no command ({error}); PROGRAM and its arguments are expected") from None
    if words and shutil.which(words[0]) is None:
        raise ConfigError(f"--peer {words[0]}: no such program, or not one that may be run")
    return words


def approach(
    output: OutOption = RUNS,
    runs: Annotated[int, typer.Option(min=1, help="Random starts.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Of the starts.")] = 1,
    workers: WorkersOption = None,
    quick: QuickOption = False,
    set_: SetOption = [],  # noqa: B006
    json_: JsonOption = None,
) -> None:
    """From 60 m off, at any heading, in 6 m/s of wind: random starts brought to the station and kept there."""
    from rich.console import Console

    from asvhil.study.approach import markdown, study_approach
    from asvhil.study.approach_figure import draw_tracks
    from asvhil.study.trials.approach import DURATION_S

    stem = stem_of("approach", quick)
    check_output(output, stem, json_)
    console = Console()
    with watching(console, "approach") as tell:
        figures, outcomes = study_approach(
            output / "approach.jsonl",
            min(runs, 4) if quick else runs,
            seed,
            overrides=tuple(set_),
            duration_s=130.0 if quick else DURATION_S,
            workers=workers,
            tell=tell,
        )
    finish(console, output, stem, figures, markdown, json_, lambda path: draw_tracks(outcomes, path))


def robustness(
    output: OutOption = RUNS,
    seeds: SeedsOption = 5,
    row: RowOption = [],  # noqa: B006
    models: ModelsOption = None,
    config: ConfigOption = "sitl",
    workers: WorkersOption = None,
    quick: QuickOption = False,
    set_: SetOption = [],  # noqa: B006
    json_: JsonOption = None,
) -> None:
    """Without a wind sensor; with a crude model and a turned vane; the same in a current."""
    from rich.console import Console

    from asvhil.study.robustness import markdown, study_robustness
    from asvhil.study.rows import FROM_S, QUICK_S, ROWS, TO_S, checked
    from asvhil.study.six_tests import MAIN, controller_overrides

    rows = checked(row, ROWS, "--row")
    controller = controller_overrides(MAIN, models, config, tuple(set_))
    stem = stem_of("robustness", quick)
    check_output(output, stem, json_)
    console = Console()
    with watching(console, "robustness") as tell:
        figures = study_robustness(
            output / "trials.jsonl",
            controller=controller,
            rows=rows,
            seeds=range(1, 2 if quick else seeds + 1),
            window_s=QUICK_S if quick else (FROM_S, TO_S),
            base=config,
            overrides=tuple(set_),
            workers=workers,
            tell=tell,
        )
    finish(console, output, stem, figures, markdown, json_)


def learned_loop(
    output: OutOption = RUNS,
    seeds: SeedsOption = 5,
    patterns: Annotated[int, typer.Option(min=1, help="Patterns of wrong parameters.")] = 4,
    models: ModelsOption = None,
    config: ConfigOption = "sitl",
    workers: WorkersOption = None,
    quick: QuickOption = False,
    set_: SetOption = [],  # noqa: B006
    json_: JsonOption = None,
) -> None:
    """Learned models in the loop against SD-MPC with the true parameters, and with parameters 30 % off."""
    from rich.console import Console

    from asvhil.study.learned_loop import LEARNED, markdown, study_learned_loop
    from asvhil.study.rows import FROM_S, QUICK_S, TO_S
    from asvhil.study.six_tests import controller_overrides

    overrides = tuple(set_)
    learned = {name: controller_overrides(name, models, config, overrides) for name in LEARNED}
    stem = stem_of("learned-loop", quick)
    check_output(output, stem, json_)
    console = Console()
    with watching(console, "learned models") as tell:
        figures = study_learned_loop(
            output / "trials.jsonl",
            learned=learned,
            seeds=range(1, 2 if quick else seeds + 1),
            patterns=min(patterns, 2) if quick else patterns,
            window_s=QUICK_S if quick else (FROM_S, TO_S),
            base=config,
            overrides=overrides,
            workers=workers,
            tell=tell,
        )
    finish(console, output, stem, figures, markdown, json_)


def estimator(
    output: OutOption = RUNS,
    seeds: SeedsOption = 5,
    set_of: Annotated[list[str], typer.Option("--sensors", help="One set of sensors by name; repeatable.")] = [],  # noqa: B006
    workers: WorkersOption = None,
    quick: QuickOption = False,
    set_: SetOption = [],  # noqa: B006
    json_: JsonOption = None,
) -> None:
    """The EKF beside the paper's FIR fusion and the raw readings: errors, abrupt faults, a station through glitches."""
    import dataclasses

    from rich.console import Console

    from asvhil.study.estimators import FULL, QUICK, SETS, study_estimators
    from asvhil.study.estimators_report import draw_estimators, report
    from asvhil.study.rows import checked

    sets = checked(set_of, SETS, "--sensors")
    plan = QUICK if quick else dataclasses.replace(FULL, seeds=range(1, seeds + 1))
    stem = stem_of("estimator", quick)
    check_output(output, stem, json_)
    console = Console()
    with watching(console, "estimators") as tell:
        figures = study_estimators(
            output / "estimator.jsonl", plan=plan, sets=sets, overrides=tuple(set_), workers=workers, tell=tell
        )
    traces = figures.pop("traces")  # for the picture alone

    def draw(path: Path) -> None:
        draw_estimators(figures | {"traces": traces}, path)

    finish(console, output, stem, figures, report, json_, draw)


COMMANDS: dict[str, Callable[..., None]] = {
    "bound": bound,
    "six-tests": six_tests,
    "solvers": solvers,
    "approach": approach,
    "robustness": robustness,
    "learned-loop": learned_loop,
    "estimator": estimator,
}
