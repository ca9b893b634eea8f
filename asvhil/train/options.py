"""How each kind of model is trained, and what is told while it is. No torch."""

from __future__ import annotations

from collections.abc import Callable

from asvhil.dynamics.weights import TrainedModel
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
    members: int = 1  # networks that are averaged in one model
    frozen: tuple[str, ...] = ()  # parts that stay as they start (no skip, a straight map), to see what they bring
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
