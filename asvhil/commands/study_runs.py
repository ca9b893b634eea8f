"""The studies that consist of many runs in lockstep: their options, and where their figures go."""

from __future__ import annotations

import dataclasses
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
from asvhil.commands.study_views import BOUNDS, bounds_at_hand, stem_of
from asvhil.errors import ConfigError

if TYPE_CHECKING:
    from asvhil.study.runner import Tell
    from asvhil.study.trials.approach import Outcome


@study_command
def six_tests(
    output: OutOption = RUNS,
    seeds: SeedsOption = 5,
    controller: Annotated[list[str], typer.Option(help="One controller by its name in the table; repeatable.")] = [],  # noqa: B006
    solver: Annotated[
        list[str], typer.Option(help="Each controller, an MPC, with this solver; repeatable. A table apart.")
    ] = [],  # noqa: B006
    row: RowOption = [],  # noqa: B006
    noise: Annotated[
        bool, typer.Option(help="Sensor noise and gusts; without them one seed, in a table apart.")
    ] = True,
    receiver_error: Annotated[bool, typer.Option(help="The slow error of the receiver, as the config has it.")] = True,
    models: ModelsOption = None,
    bounds: Annotated[
        Path | None, typer.Option(help="bound.json of `study bound`; the shipped one by default.")
    ] = None,
    config: ConfigOption = "sitl",
    workers: WorkersOption = None,
    confirm: ConfirmOption = 0,
    quick: QuickOption = False,
    set_: SetOption = [],  # noqa: B006
) -> Study:
    """All controllers over the paper's six tests, their mirrors and diagonals."""
    from asvhil.config import load_config
    from asvhil.config.registry import CONTROLLERS, SOLVERS
    from asvhil.study.boat_bounds import STARTS
    from asvhil.study.made_of import made_of, run_files
    from asvhil.study.rows import FROM_S, QUICK_S, ROWS, TO_S, checked
    from asvhil.study.runner import run_into
    from asvhil.study.six_tests import available, labelled, study_six_tests, with_solvers
    from asvhil.study.six_tests_report import draw_bars, report

    load_config(config, tuple(set_))  # and the plug-ins that it names
    for name in controller:
        CONTROLLERS.get(name)  # one of an installed package
    labels, rows = checked(controller, labelled(), "--controller"), checked(row, ROWS, "--row")
    chosen, left_out = available(labels, models, config, tuple(set_))
    if not chosen:
        raise ConfigError("; ".join([*left_out, "no controller is left to run"]))
    page = "six-tests-solvers" if solver else "six-tests" if noise else "six-tests-no-noise"
    if solver:
        chosen = with_solvers(chosen, checked(solver, [kind.name for kind in SOLVERS], "--solver"), config)
    limits, note = bounds_at_hand(bounds, config, tuple(set_))

    def figures(tell: Tell) -> dict[str, Any]:
        found = study_six_tests(
            run_into(output / "trials.jsonl", workers=workers, tell=tell, confirm=confirm),
            controllers=chosen,
            rows=rows,
            seeds=range(1, 2 if quick or not noise else seeds + 1),
            noise=noise,
            window_s=QUICK_S if quick else (FROM_S, TO_S),
            base=config,
            bounds=limits,
            slow_error=receiver_error,
            own_starts=0 if not noise else 2 if quick else STARTS,
        )
        return found | {"left_out": left_out}

    return Study(
        title="six tests",
        stem=stem_of(page, quick),
        figures=figures,
        store=output / "trials.jsonl",
        text=report,
        draw=draw_bars,
        notes=(*left_out, *filter(None, [note])),
        keeps=(("the file of --bounds", bounds),),
        made_of=made_of(
            ("study/six_tests.py", "study/six_tests_report.py"),
            [*run_files(config, *chosen.values()), *([bounds or BOUNDS] if limits else [])],
        ),
    )


@study_command
def approach(
    output: OutOption = RUNS,
    runs: Annotated[int, typer.Option(min=1, max=100_000, help="Random starts.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the starts.")] = 1,
    workers: WorkersOption = None,
    confirm: ConfirmOption = 0,
    quick: QuickOption = False,
    set_: SetOption = [],  # noqa: B006
) -> Study:
    """Approach from 60 m off, at any heading, in 6 m/s of wind: random starts."""
    from asvhil.study.approach import markdown, study_approach
    from asvhil.study.approach_figure import draw_tracks
    from asvhil.study.made_of import made_of, run_files
    from asvhil.study.runner import run_into
    from asvhil.study.trials.approach import DURATION_S

    outcomes: list[Outcome] = []

    def figures(tell: Tell) -> dict[str, Any]:
        found, outcomes[:] = study_approach(
            run_into(output / "approach.jsonl", workers=workers, tell=tell, confirm=confirm),
            min(runs, 4) if quick else runs,
            seed,
            overrides=tuple(set_),
            duration_s=130.0 if quick else DURATION_S,
        )
        return found

    return Study(
        title="approach",
        stem=stem_of("approach", quick),
        figures=figures,
        store=output / "approach.jsonl",
        text=markdown,
        draw=lambda _, path: draw_tracks(outcomes, path),
        made_of=made_of(("study/approach.py",), run_files("sitl", tuple(set_))),
    )


@study_command
def robustness(
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
    """Cost of no wind sensor, of a crude model with a turned vane, and of a current."""
    from asvhil.study.made_of import made_of, run_files
    from asvhil.study.robustness import markdown, study_robustness
    from asvhil.study.rows import FROM_S, QUICK_S, ROWS, TO_S, checked
    from asvhil.study.runner import run_into
    from asvhil.study.six_tests import MAIN, controller_overrides

    rows = checked(row, ROWS, "--row")
    controller = controller_overrides(MAIN, models, config, tuple(set_))

    def figures(tell: Tell) -> dict[str, Any]:
        return study_robustness(
            run_into(output / "trials.jsonl", workers=workers, tell=tell, confirm=confirm),
            controller=controller,
            rows=rows,
            seeds=range(1, 2 if quick else seeds + 1),
            window_s=QUICK_S if quick else (FROM_S, TO_S),
            base=config,
            overrides=tuple(set_),
        )

    return Study(
        title="robustness",
        stem=stem_of("robustness", quick),
        figures=figures,
        store=output / "trials.jsonl",
        text=markdown,
        made_of=made_of(("study/robustness.py",), run_files(config, (*set_, *controller))),
    )


@study_command
def estimator(
    output: OutOption = RUNS,
    seeds: SeedsOption = 5,
    sensors: Annotated[list[str], typer.Option(help="One set of sensors by name; repeatable.")] = [],  # noqa: B006
    workers: WorkersOption = None,
    confirm: ConfirmOption = 0,
    quick: QuickOption = False,
    set_: SetOption = [],  # noqa: B006
) -> Study:
    """The EKF beside the paper's FIR fusion and raw readings: errors, abrupt faults, station keeping in glitches."""
    from asvhil.study.estimators import FULL, QUICK, SETS, study_estimators
    from asvhil.study.estimators_report import draw_estimators, report
    from asvhil.study.made_of import made_of, run_files
    from asvhil.study.rows import checked
    from asvhil.study.runner import run_into

    sets = checked(sensors, SETS, "--sensors")
    plan = QUICK if quick else dataclasses.replace(FULL, seeds=range(1, seeds + 1))
    traces: dict[str, Any] = {}  # for the picture alone

    def figures(tell: Tell) -> dict[str, Any]:
        run = run_into(output / "estimator.jsonl", workers=workers, tell=tell, confirm=confirm)
        found = study_estimators(run, plan=plan, sets=sets, overrides=tuple(set_))
        traces["traces"] = found.pop("traces")
        return found

    return Study(
        title="estimators",
        stem=stem_of("estimator", quick),
        figures=figures,
        store=output / "estimator.jsonl",
        text=report,
        draw=lambda found, path: draw_estimators(found | traces, path),
        made_of=made_of(
            ("study/estimators.py", "study/estimators_report.py"),
            [file for name in sets for file in run_files(SETS[name], tuple(set_))],
        ),
    )


@study_command
def safety(
    output: OutOption = RUNS,
    holds: Annotated[
        str,
        typer.Option(
            help="Which winds and seeds: confirming, or tuning, judging, revising or reporting, which chose the limits."
        ),
    ] = "confirming",
    fault: Annotated[list[str], typer.Option(help="One fault by its name in the table; repeatable.")] = [],  # noqa: B006
    healthy: Annotated[bool, typer.Option(help="Healthy boats too.")] = True,
    every: Annotated[int, typer.Option(min=1, help="One in so many of the holds alone.")] = 1,
    seconds: Annotated[float, typer.Option(min=1.0, help="Length of the healthy boats' holds (s).")] = 120.0,
    workers: WorkersOption = None,
    confirm: ConfirmOption = 0,
    quick: QuickOption = False,
    set_: SetOption = [],  # noqa: B006
) -> Study:
    """Boats that would run away (motors, compass, current): when a hold ends; and false alarms on healthy ones."""
    from asvhil.study.made_of import made_of, run_files
    from asvhil.study.rows import checked
    from asvhil.study.runner import run_into
    from asvhil.study.safety import markdown, study_safety
    from asvhil.study.safety_cases import CONFIGS, FAULTS, WINDS

    part = checked([holds], WINDS, "--holds")[0]
    faults = checked(fault, FAULTS, "--fault")

    def figures(tell: Tell) -> dict[str, Any]:
        return study_safety(
            run_into(output / "safety.jsonl", workers=workers, tell=tell, confirm=confirm),
            part,
            faults=faults,
            with_healthy=healthy,
            every=40 if quick else every,
            healthy_s=seconds,
            overrides=tuple(set_),
        )

    return Study(
        title="safety",
        stem=stem_of("safety", quick),
        figures=figures,
        store=output / "safety.jsonl",
        text=markdown,
        made_of=made_of(("study/safety.py",), [file for name in CONFIGS for file in run_files(name, tuple(set_))]),
    )


@study_command
def field_tests(
    output: OutOption = RUNS,
    seeds: SeedsOption = 10,
    test: Annotated[list[str], typer.Option(help="One test by its name in the table; repeatable.")] = [],  # noqa: B006
    workers: WorkersOption = None,
    confirm: ConfirmOption = 0,
    quick: QuickOption = False,
    set_: SetOption = [],  # noqa: B006
) -> Study:
    """The paper's field tests in simulation: BREAM's five and the WAM-V's four, with docking windows."""
    from asvhil.study.field_tests import BASES, DURATION_S, QUICK_S, TESTS, study_field_tests
    from asvhil.study.field_tests_report import draw_field_tests, markdown
    from asvhil.study.made_of import made_of, run_files
    from asvhil.study.rows import checked
    from asvhil.study.runner import run_into

    names = checked(test, TESTS, "--test")
    traces: dict[str, Any] = {}  # for the picture alone

    def figures(tell: Tell) -> dict[str, Any]:
        found = study_field_tests(
            run_into(output / "field-tests.jsonl", workers=workers, tell=tell, confirm=confirm),
            names=names,
            seeds=range(1, 2 if quick else seeds + 1),
            duration_s=QUICK_S if quick else DURATION_S,
            overrides=tuple(set_),
        )
        traces.update({name: part.pop("trace") for name, part in found["tests"].items()})
        return found

    return Study(
        title="field tests",
        stem=stem_of("field-tests", quick),
        figures=figures,
        store=output / "field-tests.jsonl",
        text=markdown,
        draw=lambda found, path: draw_field_tests(found, traces, path),
        made_of=made_of(
            ("study/field_tests.py", "study/field_tests_report.py"),
            [file for name in BASES.values() for file in run_files(name, tuple(set_))],
        ),
    )
