"""The training of `asvhil learn`: a network, and the physics fitted beside it, or what an earlier training has left."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from asvhil.commands.learn_drives import LearnFiles, LearnSteps, put_aside
from asvhil.commands.outputs import writing
from asvhil.commands.train import tell_notes, train_with_bar
from asvhil.commands.views import say
from asvhil.errors import ConfigError, OtherTrainingError
from asvhil.files import is_there

if TYPE_CHECKING:
    from asvhil.config import Config

KINDS = {"nnsem": "nnsem-mpc", "lagnet": "lagnet-mpc"}
OPTIONS: dict[str, dict[str, Any]] = {
    "nnsem": {"paired": True, "still": True, "rate": 0.005, "last_rate": 3e-5},
    "lagnet": {},
}
TRIES = {"nnsem": 2, "lagnet": 1}


def train_models(
    settings: Config,
    config: str | Path,
    kind: str,
    data: list[Path],
    files: LearnFiles,
    iterations: int | None,
    seed: int,
    steps: LearnSteps,
    test: Sequence[Path],
    *,
    resume: bool,
) -> dict[str, Any]:
    """Both models, and the figures of the network's training. With `resume` nothing that is there is overwritten.

    ConfigError for logs of another boat, and for a test that could not be judged by: before the training, not after.
    """
    from asvhil.dynamics.hull import differences
    from asvhil.train.jobs import DT_S, check_test, checkpoint_of, left_out_words, trained_before
    from asvhil.train.options import chosen_options
    from asvhil.train.origin import boat, of_simulation, once, origin_of, refuse_shared
    from asvhil.train.verdict import EVERY_S, HORIZON_S, LEAST_WINDOWS

    (data, more), (test, further) = once(data), once(test)
    for path in (*more, *further):
        say(steps.console, left_out_words(path))
    refuse_shared(data, test)
    origin = origin_of([*data, *test])
    apart = differences(origin.hull, settings.vehicle.vessel)
    if origin.vehicle != settings.vehicle.name or apart:
        words = f"of the boat {origin.vehicle!r}" + (f", of another hull ({apart})" if apart else "")
        raise ConfigError(f"learn: {data[0]}: {words}, and the config is of {settings.vehicle.name!r}")
    if origin.simulated != of_simulation(settings):
        raise ConfigError(
            f"learn: {data[0]}: of {boat(origin.simulated)}, and {config} is of {boat(not origin.simulated)}"
        )
    check_test(test, horizon_s=HORIZON_S, every_s=EVERY_S, least=LEAST_WINDOWS)
    chosen = chosen_options(kind, DT_S, **OPTIONS[kind], **({} if iterations is None else {"iterations": iterations}))
    steps.begin(f"training of {kind} on {len(data)} logs, and the physics fitted to the same")
    with writing(files.folder):
        files.folder.mkdir(parents=True, exist_ok=True)
    seeds = range(seed, seed + TRIES[kind])
    figures = trained_before(files.model, kind, data, seeds, chosen) if resume else None
    if figures is not None:
        say(steps.console, f"   {files.model}: is there already, of the same data, options and seed")
    else:
        if resume:
            _make_room(files, steps)

        def train(*, resumed: bool) -> dict[str, Any]:
            return train_with_bar(
                steps.console, kind, data, files.model, options=chosen, seed=seed, tries=len(seeds), resume=resumed
            )

        checkpoint = checkpoint_of(files.model)
        try:
            figures = train(resumed=resume and is_there(checkpoint))
        except OtherTrainingError:  # such as after a drive that was made again
            with writing(files.folder):
                put_aside(files.folder, [checkpoint], steps.console, "of a training of other data, options or seeds")
            figures = train(resumed=False)
        say(
            steps.console, f"   {files.model}: {figures['data_s']:.0f} s of data, {figures['wall_s']:.0f} s of training"
        )
    fitted = train_with_bar(steps.console, "sd", data, files.fitted)
    tell_notes(fitted)  # the network's are the same: they are of the data
    for made in (figures, fitted):
        if made.get("picture_fault"):
            typer.echo(f"asvhil: warning: {made['picture_fault']}; the model {made['model']} is whole", err=True)
    return figures


def _make_room(files: LearnFiles, steps: LearnSteps) -> None:
    """Put aside the models that another training has left, with their pictures."""
    from asvhil.train.jobs import picture_of

    made = [path for model in (files.model, files.fitted) for path in (model, picture_of(model))]
    there = [path for path in (*made, files.picture) if is_there(path)]
    with writing(files.folder):
        put_aside(files.folder, there, steps.console, "of another training")
