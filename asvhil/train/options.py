"""How each kind of model is trained, and what is told while it is. No torch."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

from asvhil.dynamics.weights import TrainedModel
from asvhil.errors import ConfigError, ModelError
from asvhil.types import record


@record
class FitOptions:
    """How a model is trained. The defaults are the paper's."""

    iterations: int = 20000
    window: int = 20  # m
    batch: int = 64  # q
    rate: float = 1e-3
    last_rate: float = 1e-3  # a cosine leads from rate to it
    hidden: int = 12
    history_s: float = 0.0  # of commands before a window, from which the motor states start
    mirror: bool = False
    symmetric: bool = False  # scaling about zero, the same for both motors
    paired: bool = False  # every hidden neuron has a twin, its mirror image (NNSEM); half of them are learned
    moving_share: float = 0.0  # at least this part of each batch is drawn from windows in motion
    members: int = 1  # networks that are averaged in one model
    frozen: tuple[str, ...] = ()  # parts that stay as they start (no skip, a straight map), to see what they bring
    from_sd: bool = False  # the skip terms start as the fitted SD has them, the map nearly straight
    weight_decay: float = 0.0  # of the loss for each unit of squared weight, and of squared distance of a skip term
    monotone: float = 0.0  # of the loss for each unit of slope by a command that no motor has (NNSEM)
    robust: float = 0.0  # error (of half a range) beyond which a window counts by its logarithm; 0: by its square
    block: int = 500  # iterations between validations and checkpoints; the random windows are drawn by the block
    validation_fraction: float = 0.1
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


def chosen_options(
    kind: str,
    dt_s: float,
    *,
    iterations: int | None = None,
    members: int | None = None,
    rate: float | None = None,
    last_rate: float | None = None,
    width: int | None = None,
    horizon_s: float | None = None,
    batch: int | None = None,
    moving_share: float | None = None,
    mirror: bool | None = None,
    paired: bool | None = None,
    from_sd: bool | None = None,
    weight_decay: float | None = None,
    monotone: float | None = None,
    robust: float | None = None,
    validation_share: float | None = None,
) -> FitOptions:
    """The options of a kind, with what is not None in their place; horizon_s is the length of a training window.

    A rate alone is held to the end. With mirrored data and with paired neurons the scaling is about zero.
    Without a validation share nothing is held back, and the weights are those of the last iteration. ModelError for an
    unknown kind; ConfigError for an option that the kind has no use for.
    """
    if kind not in OPTIONS:
        raise ModelError(f"unknown model kind {kind!r} (known: {', '.join(OPTIONS)})")
    if kind == "sd":
        given = {
            "--iterations": iterations,
            "--width": width,
            "--batch": batch,
            "--moving-share": moving_share,
            "--mirror": mirror,
            "--rate": rate,
            "--last-rate": last_rate,
            "--weight-decay": weight_decay,
            "--robust": robust,
        }
        for name, value in given.items():
            if value is not None:
                raise ConfigError(f"train: {name} is of no use to sd, which is no network")
    if kind != "lagnet" and members not in (None, 1):
        raise ConfigError(f"train: --members is for lagnet: {kind} is a single network")
    if kind != "lagnet" and from_sd:
        raise ConfigError(f"train: --from-sd is for lagnet: {kind} has no skip terms")
    if paired and kind != "nnsem":
        raise ConfigError(f"train: --paired is for nnsem, not {kind}")
    if monotone and kind != "nnsem":
        raise ConfigError(f"train: --monotone is for nnsem, not {kind}")
    hidden = OPTIONS[kind].hidden if width is None else width
    if paired and hidden % 2:
        raise ConfigError(f"train: --paired needs an even --width, not {hidden}")
    window = None if horizon_s is None else round(horizon_s / dt_s)
    if window is not None and window < 2:
        raise ConfigError(f"train: --horizon {horizon_s:g} is less than two steps of {dt_s:g} s")
    if last_rate is None:
        last_rate = rate
    changes: dict[str, Any] = {
        "iterations": iterations,
        "members": members,
        "rate": rate,
        "last_rate": last_rate,
        "hidden": width,
        "window": window,
        "batch": batch,
        "moving_share": moving_share,
        "mirror": mirror,
        "symmetric": mirror or paired or None,
        "paired": paired or None,
        "from_sd": from_sd or None,
        "weight_decay": weight_decay,
        "monotone": monotone or None,
        "robust": robust,
        "validation_fraction": validation_share,
    }
    return dataclasses.replace(OPTIONS[kind], **{name: value for name, value in changes.items() if value is not None})


@record
class Progress:
    """Where a training stands. `validation` is the best so far (mean error over half the range), averaged over seeds.

    `models()` are the best models so far.
    """

    iteration: int
    iterations: int
    loss: float
    validation: float
    models: Callable[[], list[TrainedModel]]


ProgressCallback = Callable[[Progress], None]
