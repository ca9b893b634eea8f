"""Training options of each kind of model, and those that the command line offers."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Annotated, Any, get_type_hints

from asvhil.errors import ConfigError, ModelError, meant
from asvhil.types import record

NETWORKS = ("nnsem", "node", "knode", "lagnet")


@record
class TrainOption:
    """An option of `asvhil train`: what it means, its range, the kinds of models it applies to, its name there.

    A window is chosen in seconds and kept in steps (`seconds`). `off` is a value without effect, which every kind
    accepts. `default` describes the default of the kinds where it is not a number of their options.
    """

    help: str
    low: float | None = None
    high: float | None = None
    kinds: tuple[str, ...] = NETWORKS
    name: str = ""  # that of the field where it is empty
    seconds: bool = False
    off: Any = None
    default: str = ""


@record
class FitOptions:
    """How a model is trained. The defaults are the paper's."""

    iterations: Annotated[int, TrainOption(help="Iterations of Adam, at most.", low=1)] = 20000
    window: Annotated[  # m
        int,
        TrainOption(
            help="Seconds that are simulated in each training window.",
            low=0.04,
            kinds=("sd", *NETWORKS),
            name="horizon",
            seconds=True,
            default="20 steps",
        ),
    ] = 20
    batch: Annotated[int, TrainOption(help="Windows of each training step.", low=1, high=4096)] = 64  # q
    rate: Annotated[float, TrainOption(help="Learning rate of Adam.", low=1e-6, high=1.0)] = 1e-3
    last_rate: Annotated[
        float,
        TrainOption(
            help="Learning rate at the end; it falls from --rate along a cosine.",
            low=0.0,
            high=1.0,
            default="that of --rate; lagnet 3e-05 where neither is given",
        ),
    ] = 1e-3
    hidden: Annotated[int, TrainOption(help="Hidden neurons of each network.", low=1, high=200, name="width")] = 12
    history_s: float = 0.0  # of commands before a window, from which the motor states start
    mirror: Annotated[bool, TrainOption(help="Train on the mirrored data as well.")] = False
    symmetric: bool = False  # scaling about zero, the same for both motors
    paired: Annotated[
        bool,
        TrainOption(
            help="Give every neuron a twin, its mirror image: the boat is symmetric.", kinds=("nnsem",), off=False
        ),
    ] = False
    moving_share: Annotated[
        float,
        TrainOption(
            help="At least this share of each batch is drawn from windows in motion, for records with idle parts.",
            low=0.0,
            high=1.0,
        ),
    ] = 0.0
    resting_share: Annotated[
        float,
        TrainOption(
            help="At least this share of each batch is drawn from windows with the motors off throughout: a boat that"
            " comes to rest, or lies in the wind.",
            low=0.0,
            high=1.0,
        ),
    ] = 0.0
    rest_weight: Annotated[
        float,
        TrainOption(
            help="Weight in the loss of the rates at rest, in winds of all trained speeds and directions, beside the"
            " wind load that drifts and manoeuvres of the data show.",
            low=0.0,
            high=100.0,
        ),
    ] = 0.0
    still: Annotated[
        bool,
        TrainOption(
            help="A boat at rest in still air with its motors off stays at rest: the output bias follows from the"
            " other weights.",
            off=False,
        ),
    ] = False
    grow: Annotated[
        str,
        TrainOption(
            help="A model file to whose neurons, kept as they are, --width new ones are added that do not see the motor"
            " commands: other drag and wind loads, the same response to the motors. With --still.",
            kinds=("nnsem",),
            off="",
            default="none",
        ),
    ] = ""
    members: Annotated[
        int,
        TrainOption(help="Networks that are averaged in one model.", low=1, high=20, kinds=("lagnet",), off=1),
    ] = 1
    frozen: tuple[str, ...] = ()  # parts that stay as they start (no skip, a straight map), to see what they bring
    from_sd: Annotated[
        bool, TrainOption(help="Start the skip terms from SD fitted to the same data.", kinds=("lagnet",), off=False)
    ] = False
    weight_decay: Annotated[
        float,
        TrainOption(
            help="Weight in the loss of squared weights, and of squared change of skip terms.", low=0.0, high=1.0
        ),
    ] = 0.0
    monotone: Annotated[
        float,
        TrainOption(
            help="Weight in the loss of slopes against the sign that every motor has: less motion for more command.",
            low=0.0,
            high=100.0,
            kinds=("nnsem",),
            off=0.0,
        ),
    ] = 0.0
    robust: Annotated[  # 0: every window counts by its square
        float,
        TrainOption(
            help="Error, as a share of half the range, beyond which a window counts by its logarithm, not its square.",
            low=0.001,
            high=1.0,
            default="off",
        ),
    ] = 0.0
    block: int = 500  # iterations between validations and checkpoints; the random windows are drawn by the block
    validation_fraction: Annotated[
        float,
        TrainOption(
            help="Share held back to choose the best weights by. With 0 those of the last iteration are kept.",
            low=0.0,
            high=0.9,
            kinds=("sd", *NETWORKS),
            name="validation_share",
        ),
    ] = 0.1
    patience: int = 10000  # iterations without a better validation that end the training


OPTIONS: dict[str, FitOptions] = {
    "sd": FitOptions(),
    "nnsem": FitOptions(),
    "node": FitOptions(block=100),
    "knode": FitOptions(block=100),
    "lagnet": FitOptions(
        iterations=10000, rate=3e-3, last_rate=3e-5, history_s=2.0, mirror=True, symmetric=True, members=3
    ),
}


def _choices() -> Mapping[str, TrainOption]:
    """By field, each with its name."""
    found = {}
    for field, hint in get_type_hints(FitOptions, include_extras=True).items():
        for part in getattr(hint, "__metadata__", ()):
            if isinstance(part, TrainOption):
                found[field] = dataclasses.replace(part, name=part.name or field)
    return found


CHOICES = _choices()


def chosen_options(kind: str, dt_s: float, **chosen: Any) -> FitOptions:
    """The options of a kind, with those of `chosen` that are not None in their place, by name of the option.

    A rate alone is held to the end. With mirrored data, with paired neurons and with `still` the scaling is about zero.
    Without a validation share nothing is held back, and the weights are those of the last iteration. ModelError for an
    unknown kind; ConfigError for an option that does not apply to the kind; TypeError for an unknown name.
    """
    if kind not in OPTIONS:
        raise ModelError(f"unknown model kind {kind!r}{meant(kind, OPTIONS)}")
    changes: dict[str, Any] = {}
    for field, choice in CHOICES.items():
        value = chosen.pop(choice.name, None)
        if value is None:
            continue
        if kind in choice.kinds:
            changes[field] = _steps(value, dt_s) if choice.seconds else value
        elif value != choice.off:
            only = "" if choice.kinds == NETWORKS else f", only to {', '.join(choice.kinds)}"
            raise ConfigError(f"train: --{choice.name.replace('_', '-')} does not apply to model {kind}{only}")
    if chosen:
        raise TypeError(f"unknown options: {', '.join(chosen)}")
    if "rate" in changes:
        changes.setdefault("last_rate", changes["rate"])
    if changes.get("mirror") or changes.get("paired") or changes.get("still"):
        changes["symmetric"] = True
    options = dataclasses.replace(OPTIONS[kind], **changes)
    if options.paired and options.hidden % 2:
        raise ConfigError(f"train: --paired needs an even --width, not {options.hidden}")
    if options.grow and not options.still:
        raise ConfigError("train: --grow needs --still")
    if options.moving_share + options.resting_share > 1.0:
        raise ConfigError("train: --moving-share and --resting-share are more than the whole batch together")
    return options


def _steps(horizon_s: float, dt_s: float) -> int:
    """The steps of a training window. ConfigError for less than two."""
    steps = round(horizon_s / dt_s)
    if steps < 2:
        raise ConfigError(f"train: --horizon {horizon_s:g} is less than two steps of {dt_s:g} s")
    return steps
