"""`asvhil learn`: from manoeuvres to a model with a verdict, as one command with stops to confirm."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.learn_drives import LearnDrives, LearnFiles, LearnSteps
from asvhil.commands.learn_training import KINDS, train_models
from asvhil.commands.options import ConfigArgument, JsonOption, SetOption
from asvhil.commands.outputs import check_figures, config_and_bases, write_json
from asvhil.commands.views import progress, say, tell_borrowed_hull
from asvhil.errors import ConfigError

if TYPE_CHECKING:
    from asvhil.config import Config
    from asvhil.train.at_rest import AtRest
    from asvhil.train.verdict import ModelVerdict

HOLD_S = 90.0
HOLD_WIND = "4@60"
AS_GOOD = 1.2  # times the physics' penalty score
PHYSICS = "physics as configured"


def learn(
    config: ConfigArgument,
    set_: SetOption = [],  # noqa: B006 - typer copies its defaults
    data: Annotated[
        list[Path],
        typer.Option("--data", help="A log, or a run's folder, that is there already, instead of driving; repeatable."),
    ] = [],  # noqa: B006
    test: Annotated[
        list[Path], typer.Option("--test", help="A log to test on, or a run's folder, with --data; repeatable.")
    ] = [],  # noqa: B006
    duration: Annotated[
        float | None,
        typer.Option(min=80.0, help="Seconds of manoeuvres in each drive; 600, or with --resume as before."),
    ] = None,
    wind: Annotated[
        list[str], typer.Option(metavar="SPEED@DEG", help="Mean wind of a drive of the simulated boat; repeatable.")
    ] = [],  # noqa: B006
    kind: Annotated[str, typer.Option(help="nnsem or lagnet.")] = "nnsem",
    iterations: Annotated[int | None, typer.Option(min=50, help="Steps of the training.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the training.")] = 1,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="DIR",
            help="Folder; NAME-learned or, of a simulated boat, NAME-sim-learned beside the config.",
        ),
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not stop to ask.")] = False,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume",
            help="Go on where it stopped: keep the drives that are there, make those missing, continue the training.",
        ),
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Overwrite what is in the folder, but for logs, which are put aside.")
    ] = False,
    json_: JsonOption = None,
) -> None:
    """Drive, train, test and judge a model of your boat, and say what to put into its config.

    A config with `supervisor.engage: auto` is of a simulated boat, which drives in virtual time; with `command` it is
    the real one, which waits for `asvhil hold`.
    """
    from rich.console import Console

    from asvhil.config import find_config, load_config
    from asvhil.logs.segments import first_in

    if kind not in KINDS:
        raise ConfigError(f"learn: --kind {kind}: {' or '.join(KINDS)} is expected")
    if bool(data) != bool(test):
        raise ConfigError("learn: --data and --test go together: a model is not tested on what it was trained on")
    if data and wind:
        raise ConfigError("learn: --wind is of drives, and with --data there are none")
    if data and duration is not None:
        raise ConfigError("learn: --duration is of drives, and with --data there are none")
    if resume and force:
        raise ConfigError("learn: --resume goes on, --force begins anew: give one of them")
    _need_terminal(yes)
    data, test = [first_in(path) for path in data], [first_in(path) for path in test]
    from asvhil.train.origin import TRUTH, of_simulation

    settings = load_config(config, tuple(set_))
    name = settings.vehicle.name
    simulated = of_simulation(settings)
    if simulated and settings.supervisor.engage != "auto":
        raise ConfigError(
            f"learn: {config}: links.autopilot.streams_hz has {TRUTH}, as of the simulated boat, and supervisor.engage"
            f" is command, as of a real one: set engage to auto, or for the real boat take {TRUTH} out"
        )
    # Rehearsal and boat have a folder each: the one's drives say nothing of the other.
    folder = f"{name}-sim-learned" if simulated else f"{name}-learned"
    files = LearnFiles.of(output or find_config(config).parent / folder, name, kind)
    check_figures(json_, *config_and_bases(config), *(("a log", log) for log in (*data, *test)), *files.named())
    tell_borrowed_hull(settings, config, set_)
    if files.there() and not (force or resume):
        words = "another folder by -o, --resume to go on with its drives, or --force for new ones"
        raise ConfigError(f"learn: {files.folder} is not empty: {words}")
    console = Console()
    steps = LearnSteps(console, yes)
    if resume and not data and not files.there():
        raise ConfigError(f"learn: --resume: {files.folder} holds no drives to go on with; leave it out")
    if not data:
        data, test = LearnDrives(settings, files, duration, wind, steps).make(force=force, resume=resume)
    figures = train_models(settings, config, kind, [*data], files, iterations, seed, steps, test, resume=resume)
    verdict, scores, check = _judge(settings, kind, files, test, steps)
    held = _hold(settings, kind, files, steps) if simulated else {}
    _advise(console, settings, kind, files, find_config(config), verdict, check, held)
    write_json(
        json_,
        {
            "vehicle": name,
            "data": [str(path) for path in data],
            "test": [str(path) for path in test],
            "training": figures,
            "rows": scores["rows"],
            "at_rest": scores["at_rest"][kind],
            "good": verdict.good,
            "faults": list(verdict.faults),
            "hold": held,
            "picture": str(files.picture),
        },
    )
    if not verdict.good:
        raise typer.Exit(1)


def _need_terminal(yes: bool) -> None:
    from asvhil.commands.train import need_torch

    need_torch()
    if not yes and not sys.stdin.isatty():
        raise ConfigError("learn: it stops to ask, and there is no terminal: use --yes")


def _judge(
    settings: Config, kind: str, files: LearnFiles, test: Sequence[Path], steps: LearnSteps
) -> tuple[ModelVerdict, dict[str, Any], AtRest]:
    """The verdict, and the scores and the check at rest that it comes from."""
    from asvhil.dynamics.rigid_body import SimplifiedDynamics
    from asvhil.dynamics.weights import read_model
    from asvhil.train.at_rest import at_rest
    from asvhil.train.jobs import evaluate_command, simulated_vessel
    from asvhil.train.verdict import EVERY_S, HORIZON_S, judge

    console = steps.console
    steps.begin("the test")
    with console.status("rolling out"):
        scores = evaluate_command(
            [files.model, files.fitted],
            test,
            horizon_s=HORIZON_S,
            every_s=EVERY_S,
            figure=files.picture,
            beside={PHYSICS: SimplifiedDynamics(settings.believed_vessel)},
        )
        model = read_model(files.model)
        check = at_rest(model.dynamics(), model.scaling.half[5:], simulated_vessel(test))
    for name, parts in scores["rows"].items():
        row = parts["moving"]
        if row["windows"]:
            errors = ", ".join(f"{axis} {row[f'mae_{axis}']:.3f}" for axis in "uvr")
            say(console, f"   {name}: {errors} (m/s, m/s, rad/s; {row['windows']} stretches of {HORIZON_S:g} s)")
    say(console, f"   {check.verdict()}")
    say(console, f"   picture {files.picture}")
    return judge(kind, scores["rows"], check), scores, check


def _hold(settings: Config, kind: str, files: LearnFiles, steps: LearnSteps) -> dict[str, float]:
    """Penalty scores of the simulated boat that holds a station by the physics as configured, and by the new model."""
    import json

    from asvhil.config import config_from_json
    from asvhil.config.mean_wind import parse_wind, wind_keys
    from asvhil.logs.run import read_run
    from asvhil.logs.summary import summarise
    from asvhil.sitl import run_lockstep

    steps.begin(f"{HOLD_S:.0f} s of station keeping of the simulated boat, by the physics and by the model")
    scores: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder, progress(steps.console) as bar:
        for name, model in (("sd-mpc", None), (KINDS[kind], str(files.model))):
            tree = settings.model_dump(mode="json")
            tree["controller"] |= {"name": name, "model": model}
            tree["plant"]["weather"]["wind"] |= wind_keys(parse_wind(HOLD_WIND), settings)
            log = Path(folder) / f"{name}.mcap"
            task = bar.add_task(name, total=round(HOLD_S * settings.daemon.tick_hz))
            config = config_from_json(json.dumps(tree), "learn")
            run_lockstep(config, log, HOLD_S, lambda _, task=task: bar.advance(task))  # type: ignore[misc]
            part = summarise(read_run(log), None)["truth"]
            scores[name] = (
                round(float(part["penalty_score"]), 2) if part and part["penalty_score"] is not None else -1.0
            )
    for name, score in scores.items():
        say(steps.console, f"   {name}: penalty score {score:.2f}")
    return scores


def _advise(
    console: Any,
    settings: Config,
    kind: str,
    files: LearnFiles,
    config: Path,
    verdict: ModelVerdict,
    check: AtRest,
    held: dict[str, float],
) -> None:
    """The verdict in words, and the lines to put into the config."""
    from asvhil.config.yaml_text import read_yaml
    from asvhil.train.origin import of_simulation

    for words in verdict.passed:
        say(console, f"   right: {words}")
    for words in verdict.faults:
        say(console, f"   WRONG: {words}")
    if held and held[KINDS[kind]] > AS_GOOD * held["sd-mpc"]:
        times = held[KINDS[kind]] / held["sd-mpc"]
        say(console, f"   note: its penalty score is {times:.2f} times that of the physics of this config")
    try:
        path = files.model.relative_to(config.parent)
    except ValueError:
        path = files.model.resolve()
    worst = check.worst
    if worst is not None and (worst.error or 0.0) > 1.0:
        wind = f"{worst.speed_mps:g} m/s of wind on the {worst.side}"
        say(console, f"   note: the wind's load on the boat at rest is not learned well, least in {wind}: while it is")
        say(console, "         held, the disturbance that the estimator finds makes up for that")
    if verdict.good:
        if of_simulation(settings):
            say(console, "This was the simulated boat: a rehearsal. Of your real boat this model knows nothing.")
        given = read_yaml(config).tree
        there = isinstance(given, dict) and "controller" in given
        instead = ", in place of the `name` under the `controller` that is there" if there else ""
        say(console, f"Good enough to hold with. Into {config}{instead}:")
        say(console, f"controller:\n  name: {KINDS[kind]}\n  model: {path}")
        return
    say(console, "Not good enough to hold with: stay with sd-mpc, and drive more, in other winds, on quieter water.")
