"""The choice among models trained from different seeds. No torch."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from asvhil.dynamics.weights import TrainedModel

COMMANDS = np.linspace(-1.0, 1.0, 41)
TOLERANCE_MPS2 = 1e-4


def best_of(models: Sequence[TrainedModel]) -> TrainedModel:
    """The model with the lowest error on the validation rollouts, with the errors of all seeds in its figures.

    Models whose thrust decreases with the command somewhere are ranked last: no motor does that, and an optimiser that
    follows the gradient would stop there with the motors off.
    """
    errors = {str(model.seed): model.figures["best_validation"] for model in models}
    dips = {str(model.seed): thrust_dip(model) for model in models}

    def rank(model: TrainedModel) -> tuple[bool, float]:
        return dips[str(model.seed)] > TOLERANCE_MPS2, float(model.figures["best_validation"])

    best = min(models, key=rank)
    return dataclasses.replace(best, figures={**best.figures, "validation_of_seeds": errors, "thrust_dip_mps2": dips})


def thrust_dip(model: TrainedModel) -> float:
    """The largest decrease (m/s^2) of the surge acceleration of a boat at rest, as both commands rise from -1 to 1.

    The worst of still air and of half the trained range of wind from four sides.
    """
    dynamics = model.dynamics()
    wind_u, wind_v = (0.5 * model.scaling.half[5:]).tolist()
    worst = 0.0
    for wind in ((0.0, 0.0), (wind_u, 0.0), (-wind_u, 0.0), (0.0, wind_v), (0.0, -wind_v)):
        inputs = [dynamics.input_of_command((command, command)) for command in COMMANDS.tolist()]
        rates = [
            float(
                dynamics.derivative(np.array([0.0, 0.0, 0.0, *a[: dynamics.n_motor]]), np.array(a), np.array(wind))[0]
            )
            for a in inputs
        ]
        worst = max(worst, float((np.maximum.accumulate(rates) - rates).max()))
    return worst
