"""The choice among models trained from different seeds. No torch."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from asvhil.dynamics.weights import TrainedModel
from asvhil.train.at_rest import AtRest, at_rest

TOLERANCE_MPS2 = 1e-4


def best_of(models: Sequence[TrainedModel]) -> TrainedModel:
    """The best model by one rule for all kinds, with the figures of all seeds in its own.

    Three questions, each asked among the models that are equal by those before it:

    1. Does its thrust never fall as the command rises? No motor's does, and an optimiser that follows the gradient
       would stop in such a dip with the motors off.
    2. Is it right at rest: does a boat with its motors off stay at rest in still air, and is more wind nowhere less
       load? A station is kept in this state, which the rollouts hardly see.
    3. Which has the lowest error on the validation rollouts?
    """
    checks = {str(model.seed): check_at_rest(model) for model in models}

    def rank(model: TrainedModel) -> tuple[bool, bool, float]:
        check = checks[str(model.seed)]
        right = check.stays and check.rising
        return check.thrust_dip_mps2 > TOLERANCE_MPS2, not right, float(model.figures["best_validation"])

    best = min(models, key=rank)
    of_seeds = {
        "validation_of_seeds": {str(model.seed): model.figures["best_validation"] for model in models},
        "thrust_dip_mps2": {seed: check.thrust_dip_mps2 for seed, check in checks.items()},
        "right_at_rest": {seed: check.stays and check.rising for seed, check in checks.items()},
    }
    return dataclasses.replace(best, figures={**best.figures, **of_seeds})


def check_at_rest(model: TrainedModel) -> AtRest:
    """The check at rest of a model by itself, without a reference."""
    return at_rest(model.dynamics(), model.scaling.half[5:])
