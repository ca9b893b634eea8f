"""Trains a model on a dataset by truncated simulation error: seeded, resumable, the best on a validation rollout kept.

The same data, options and seed give the same weights to the last bit on one machine, interrupted or not.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import torch

from asvhil.dynamics.weights import KINDS, TrainedModel
from asvhil.errors import ModelError, meant
from asvhil.train.fit_sd import SD_ITERATIONS, fit_sd
from asvhil.train.options import OPTIONS, FitOptions
from asvhil.train.progress import TrainingProgress
from asvhil.train.records import Dataset
from asvhil.train.training import Training, held_out
from asvhil.train.windows import check, scaling_of


def fit(
    kind: str,
    dataset: Dataset,
    *,
    seed: int = 1,
    iterations: int | None = None,
    options: FitOptions | None = None,
    vehicle: str = "",
    config_hash: str = "",
    progress: Callable[[TrainingProgress], None] | None = None,
    checkpoint: Path | None = None,
) -> TrainedModel:
    """One trained model. With a checkpoint file, an interrupted training goes on from there.

    Who saves the model removes that file, and not before.

    ModelError where the data are not suitable, or where the checkpoint belongs to another training.
    """
    (model,) = fit_many(
        kind,
        dataset,
        seeds=(seed,),
        iterations=iterations,
        options=options,
        vehicle=vehicle,
        config_hash=config_hash,
        progress=progress,
        checkpoint=checkpoint,
    )
    return model


def fit_many(
    kind: str,
    dataset: Dataset,
    *,
    seeds: Sequence[int],
    iterations: int | None = None,
    options: FitOptions | None = None,
    vehicle: str = "",
    config_hash: str = "",
    hull: Mapping[str, float] | None = None,
    progress: Callable[[TrainingProgress], None] | None = None,
    checkpoint: Path | None = None,
) -> list[TrainedModel]:
    """One model a seed, trained side by side, which is much faster than in turn."""
    if kind not in KINDS:
        raise ModelError(f"unknown model kind {kind!r}{meant(kind, KINDS)}")
    chosen = options or OPTIONS[kind]
    if iterations is not None:
        chosen = dataclasses.replace(chosen, iterations=iterations)
    check(dataset)
    origin = {
        "vehicle": vehicle,
        "dt_s": dataset.dt_s,
        "data_hash": dataset.source_hash,
        "config_hash": config_hash,
        "hull": hull or {},
    }
    if kind == "sd":
        return _fitted_sd(dataset, seeds, chosen, origin, progress)
    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # the arrays are small, and several threads would change the last bits
    try:
        training = Training(kind, dataset, tuple(seeds), chosen, origin, checkpoint)
        training.run(progress)
    finally:
        torch.set_num_threads(threads)
    return training.models()


def _fitted_sd(
    dataset: Dataset,
    seeds: Sequence[int],
    options: FitOptions,
    origin: dict[str, Any],
    progress: Callable[[TrainingProgress], None] | None,
) -> list[TrainedModel]:
    """SD has no random start: the same model for every seed."""

    def tell(iteration: int, cost: float) -> None:
        if progress is not None:
            progress(
                TrainingProgress(
                    iteration=iteration, iterations=SD_ITERATIONS, loss=cost, validation=cost, models=lambda: []
                )
            )

    train, _ = held_out(dataset, options.validation_fraction)
    parameters, costs = fit_sd(train, window=options.window, progress=tell)
    figures = {"iterations_run": len(costs) - 1, "curve": [[float(i), cost, cost] for i, cost in enumerate(costs)]}
    scaling = scaling_of(train, symmetric=True)
    weights = {"parameters": parameters}
    return [
        TrainedModel(kind="sd", scaling=scaling, weights=weights, seed=seed, figures=figures, **origin)
        for seed in seeds
    ]
