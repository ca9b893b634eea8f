"""Progress reports of a training."""

from __future__ import annotations

from collections.abc import Callable

from asvhil.dynamics.weights import TrainedModel
from asvhil.types import record


@record
class TrainingProgress:
    """Progress of a training. `validation` is the best so far (mean error over half the range), averaged over seeds.

    `models()` are the best models so far.
    """

    iteration: int
    iterations: int
    loss: float
    validation: float
    models: Callable[[], list[TrainedModel]]
