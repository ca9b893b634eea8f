"""The training of networks: blocks of iterations, validation, checkpoints, and the best models so far."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from asvhil.dynamics.arrays import Array
from asvhil.dynamics.fitted_sd import FittedSd
from asvhil.dynamics.nnsem import Scaling
from asvhil.dynamics.weights import TrainedModel, read_model
from asvhil.errors import ModelError
from asvhil.files import is_there
from asvhil.train.adam import Adam
from asvhil.train.at_rest import LEAST, SHARE
from asvhil.train.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from asvhil.train.fit_sd import LOAD_S, fit_sd, load_rates, skip_of_sd, wind_loads
from asvhil.train.models import Batch, LagNetTrainee, NnsemTrainee, Trainee
from asvhil.train.openloop import measured, open_loop, spaced_starts
from asvhil.train.options import FitOptions
from asvhil.train.progress import TrainingProgress
from asvhil.train.records import Dataset, Segment, split
from asvhil.train.windows import Windows, mirrored, scaling_of

VALIDATION_S = 15.0
VALIDATION_EVERY_S = 2.5
REST_STREAM = 7  # sets the random winds of the penalty at rest apart from the random windows


class Training:
    """The state of a training between blocks of iterations."""

    def __init__(
        self,
        kind: str,
        dataset: Dataset,
        seeds: tuple[int, ...],
        options: FitOptions,
        origin: dict[str, Any],
        checkpoint: Path | None,
    ) -> None:
        self._kind, self._seeds, self._options, self._path = kind, seeds, options, checkpoint
        self._origin = origin
        self._dt_s = dataset.dt_s
        train, self._validation = held_out(dataset, options.validation_fraction)
        self.scaling = scaling_of(train, symmetric=options.symmetric)
        self._key = _key(kind, dataset, seeds, options)
        segments = train.segments
        if options.mirror:
            segments += tuple(mirrored(segment) for segment in segments)
            self._validation += tuple(mirrored(segment) for segment in self._validation)
        history = round(options.history_s / dataset.dt_s)
        self.windows = Windows(segments, self.scaling, options.window, history)
        self.trainee = _trainee(kind, train, seeds, options, history, self.scaling)
        self._learned = {
            name: value
            for name, value in self.trainee.parameters.items()
            if not any(name.startswith(part) for part in options.frozen)
        }
        self._anchors = _anchors(self._learned) if options.weight_decay > 0.0 else {}
        self._loads = _loads(train) if options.rest_weight > 0.0 else None
        self._adam = Adam(self._learned)
        self._iteration = 0
        self._curve: list[list[float]] = []  # rows of (iteration, training loss, validation), means over the seeds
        self._best = [(math.inf, 0, self.trainee.export(i)) for i in range(len(seeds))]
        if checkpoint is not None and is_there(checkpoint):
            saved = read_checkpoint(checkpoint, self._key)
            try:
                self._restore(saved)
            except (KeyError, RuntimeError, ValueError, TypeError):
                raise ModelError(f"{checkpoint}: damaged: its arrays do not fit; remove it to start anew") from None

    def run(self, progress: Callable[[TrainingProgress], None] | None) -> None:
        """Train to the end, or until the validation has not improved for `patience` iterations."""
        options = self._options
        arrays = [torch.from_numpy(part) for part in (self.windows.nu, self.windows.command, self.windows.wind)]
        while self._iteration < options.iterations:
            if self._iteration - max(at for _, at, _ in self._best) >= options.patience:
                break
            count = min(options.block, options.iterations - self._iteration)
            loss = self._block(count, arrays)
            self._iteration += count
            validation = self._validate()
            self._curve.append([float(self._iteration), loss, validation])
            if not math.isfinite(loss):
                raise ModelError(f"training of {self._kind} ran away at iteration {self._iteration}: lower the rate")
            if self._path is not None:
                write_checkpoint(self._path, self._snapshot())
            if progress is not None:
                best = float(np.mean([value for value, _, _ in self._best]))
                progress(
                    TrainingProgress(
                        iteration=self._iteration,
                        iterations=options.iterations,
                        loss=loss,
                        validation=best,
                        models=self.models,
                    )
                )

    def models(self) -> list[TrainedModel]:
        """The best model of each seed so far."""
        common = {
            "options": dataclasses.asdict(self._options),
            "iterations_run": self._iteration,
            "curve": [list(row) for row in self._curve],
        }
        return [
            self._model(weights, seed, common | {"best_iteration": at, "best_validation": value})
            for seed, (value, at, weights) in zip(self._seeds, self._best, strict=True)
        ]

    def models_now(self) -> list[TrainedModel]:
        """The present models, not the best ones."""
        return [self._model(self.trainee.export(i), seed, {}) for i, seed in enumerate(self._seeds)]

    def _model(self, weights: dict[str, Array], seed: int, figures: dict[str, Any]) -> TrainedModel:
        return TrainedModel(
            kind=self._kind, scaling=self.scaling, weights=weights, seed=seed, figures=figures, **self._origin
        )

    def _block(self, count: int, arrays: list[torch.Tensor]) -> float:
        """`count` iterations; their mean loss per model."""
        options = self._options
        nu, command, wind = arrays
        starts = torch.from_numpy(self.windows.starts)
        past = torch.arange(-self.windows.history, options.window)[:, None]
        ahead = torch.arange(options.window)[:, None]
        drawn = []
        for seed in self._seeds:
            for member in range(options.members):
                rng = np.random.default_rng([seed, member, self._iteration])
                drawn.append(self.windows.draw(rng, count, options.batch, options.moving_share, options.resting_share))
        picks = np.stack(drawn, axis=1)
        total = 0.0
        for i in range(count):
            share = 0.5 * (1.0 + math.cos(math.pi * (self._iteration + i) / options.iterations))
            begin = starts[torch.from_numpy(picks[i])]
            rows = begin[:, None, :]
            batch = Batch(
                x0=nu[begin],
                command=command[rows + past],
                wind=wind[rows + ahead],
                target=nu[rows + ahead + 1],
            )
            error = self.trainee.predict(batch) - batch.target
            # Summed over the models, which have no weight in common but a map that members of one model share.
            loss = rollout_loss(error, options.robust).sum()
            cost = loss + options.weight_decay * self._distance() + self._wrong_slopes(batch, self._iteration + i)
            cost = cost + self._rest_error(self._iteration + i)
            cost.backward()  # type: ignore[no-untyped-call]
            self._adam.step(options.last_rate + (options.rate - options.last_rate) * share)
            total += loss.item()
        return total / (count * len(self._seeds) * options.members)

    def _wrong_slopes(self, batch: Batch, iteration: int) -> torch.Tensor | float:
        """Penalty of slopes that no motor has, at the batch's states and winds and at random commands."""
        if not isinstance(self.trainee, NnsemTrainee) or self._options.monotone <= 0.0:
            return 0.0
        level = np.random.default_rng(iteration).uniform(-1.0, 1.0, (*batch.x0.shape[:2], 2))
        command = torch.from_numpy(level)
        return self._options.monotone * self.trainee.wrong_slopes(batch.x0, command, batch.wind[:, 0])

    def _rest_error(self, iteration: int) -> torch.Tensor | float:
        """Penalty of rates at rest that are not SD's wind load: their mean square, over the bound of the check.

        The rates are those of one step with the motors off, in winds that are drawn anew for each iteration.
        """
        if self._loads is None:
            return 0.0
        options, centre, half = self._options, self.scaling.centre, self.scaling.half
        rng = np.random.default_rng([iteration, REST_STREAM])
        toward, reach = rng.uniform(-np.pi, np.pi, options.batch), rng.uniform(0.0, 1.0, options.batch)
        wind = half[5:] * reach[:, None] * np.column_stack([np.cos(toward), np.sin(toward)])
        true = load_rates(self._loads, wind)
        weight = half[:3] / self._dt_s / np.maximum(SHARE * np.abs(true), LEAST)
        models = len(self._seeds) * options.members
        still, off = -centre[:3] / half[:3], -centre[3:5] / half[3:5]

        def alike(rows: Array) -> torch.Tensor:
            return torch.from_numpy(rows).expand(models, *rows.shape)

        x0 = alike(np.tile(still, (options.batch, 1)))
        batch = Batch(
            x0=x0,
            command=alike(np.tile(off, (self.windows.history + 1, options.batch, 1))),
            wind=alike(((wind - centre[5:]) / half[5:])[None]),
            target=alike((still + true * self._dt_s / half[:3])[None]),
        )
        error = (self.trainee.predict(batch) - batch.target) * torch.from_numpy(weight)
        return options.rest_weight * error.square().mean((1, 2, 3)).sum()

    def _distance(self) -> torch.Tensor:
        """Regularisation: the sum of squared distances of the weights from their anchors."""
        total = torch.zeros((), dtype=torch.float64)
        for name, anchor in self._anchors.items():
            total = total + (self._learned[name] - anchor).square().sum()
        return total

    def _validate(self) -> float:
        """Keep each model that is better than before, or every model if there are no validation data.

        Returns the mean of the present errors.
        """
        values = []
        for i in range(len(self._seeds)):
            weights = self.trainee.export(i)
            value = self._validation_error(weights)
            values.append(value)
            if value < self._best[i][0] or self._options.validation_fraction <= 0.0:
                self._best[i] = (value, self._iteration, weights)
        return float(np.mean(values))

    def _validation_error(self, weights: dict[str, Array]) -> float:
        """Mean absolute error of long rollouts over half the range; infinite where it is not finite."""
        model = self._model(weights, 0, {}).dynamics()
        total, count = 0.0, 0
        every = max(1, round(VALIDATION_EVERY_S / self._dt_s))
        for segment in self._validation:
            steps = min(len(segment.t_s) - 1, round(VALIDATION_S / self._dt_s))
            starts = spaced_starts(segment, steps, every)
            path = open_loop(model, segment, starts, steps, self._dt_s)
            error = np.abs(path - measured(segment, starts, steps))[:, 1:] / self.scaling.half[:3]
            total += float(error.sum())
            count += error.size
        value = total / count
        return value if math.isfinite(value) else math.inf

    def _snapshot(self) -> Checkpoint:
        arrays = {f"p.{name}": value.detach().numpy() for name, value in self._learned.items()}
        for name in self._learned:
            arrays |= {f"m.{name}": self._adam.first[name].numpy(), f"v.{name}": self._adam.second[name].numpy()}
        for i, (error, at, weights) in enumerate(self._best):
            arrays[f"best.{i}"] = np.array([error, at])
            arrays |= {f"best.{i}.{name}": weight for name, weight in weights.items()}
        return Checkpoint(key=self._key, iteration=self._iteration, curve=self._curve, arrays=arrays)

    def _restore(self, saved: Checkpoint) -> None:
        self._iteration, self._curve = saved.iteration, saved.curve
        for name, value in self._learned.items():
            with torch.no_grad():
                value.copy_(torch.from_numpy(saved.arrays[f"p.{name}"]))
        first, second = (
            {name: torch.from_numpy(saved.arrays[f"{mean}.{name}"].copy()) for name in self._learned} for mean in "mv"
        )
        self._adam.restore(saved.iteration, first, second)
        for i, (_, _, weights) in enumerate(self._best):
            error, at = saved.arrays[f"best.{i}"].tolist()
            self._best[i] = (error, int(at), {name: saved.arrays[f"best.{i}.{name}"] for name in weights})


def _trainee(
    kind: str, train: Dataset, seeds: Sequence[int], options: FitOptions, history: int, scaling: Scaling
) -> Trainee:
    rngs = [np.random.default_rng([seed, member]) for seed in seeds for member in range(options.members)]
    if kind == "lagnet":
        skip = skip_of_sd(fit_sd(train, window=options.window)[0], scaling) if options.from_sd else None
        return LagNetTrainee(
            rngs, options.hidden, train.dt_s, history, options.members, "map" in options.frozen, skip, options.still
        )
    if options.members != 1:
        raise ModelError(f"only lagnet averages networks, not {kind}")
    if kind == "nnsem":
        base = _kept(options.grow, scaling) if options.grow else None
        return NnsemTrainee(rngs, options.hidden, train.dt_s, options.paired, options.still, base)
    from asvhil.train.ode import KnodeTrainee, NodeTrainee  # torchdiffeq is not needed by the others

    if kind == "node":
        return NodeTrainee(rngs, options.hidden, train.dt_s, options.still)
    prior, _ = fit_sd(train, window=options.window)
    rates = FittedSd(prior.tolist(), train.dt_s)
    each = [rates.derivative(part.nu, part.command, part.wind) for part in train.segments]
    spread = np.concatenate(each).std(axis=0) + 1e-9
    return KnodeTrainee(rngs, options.hidden, train.dt_s, scaling, prior, spread, options.still)


def _kept(file: str, scaling: Scaling) -> tuple[Array, Array, Array]:
    """(w1 (7, H), b1 (1, H), w2 (H, 3)) of the network of a file, for inputs and rates of another scaling."""
    model = read_model(file)
    if model.kind != "nnsem":
        raise ModelError(f"{file}: --grow takes a model of kind nnsem, not {model.kind}")
    w, own = model.weights, model.scaling
    w1 = w["w1"] * scaling.half / own.half
    b1 = w["b1"] + (w["w1"] / own.half) @ (scaling.centre - own.centre)
    return w1.T.copy(), b1[None], (w["w2"] * (own.half[:3] / scaling.half[:3])[:, None]).T.copy()


def _loads(train: Dataset) -> Array:
    """SD's wind parameters by the data; ModelError where there are too few drifts."""
    loads = wind_loads(train)
    if loads is None:
        raise ModelError(
            f"train: --rest-weight needs spans of {LOAD_S:.0f} s and more with the motors off, as `asvhil collect`"
            " drives them"
        )
    return loads


def rollout_loss(error: torch.Tensor, robust: float) -> torch.Tensor:
    """The loss (N,) of scaled rollout errors (N, m, B, 3): their mean square, or Cauchy's loss with robust = c.

    That is the mean over the windows of c^2 log(1 + e^2 / c^2), e^2 being a window's mean square: nearly e^2 below
    c, while a window far above it, whose motion the commands do not explain, has little weight.
    """
    square = error * error
    if robust <= 0.0:
        return square.mean((1, 2, 3))
    return robust**2 * torch.log1p(square.mean((1, 3)) / robust**2).mean(1)


def _anchors(learned: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Values that weights are regularised towards: zero for layers, the start for skip terms and the coupling."""
    anchors = {}
    for name, value in learned.items():
        if name in ("w1", "w2"):
            anchors[name] = torch.zeros_like(value)
        elif name in ("skip", "g_w1", "g_w2"):
            anchors[name] = value.detach().clone()
    return anchors


def held_out(dataset: Dataset, fraction: float) -> tuple[Dataset, tuple[Segment, ...]]:
    """The training part, and the segments for validation: the end of each; the training part itself for no fraction."""
    if fraction <= 0.0:
        return dataset, dataset.segments
    train, validation = split(dataset, fraction)
    return train, validation.segments


def _key(kind: str, dataset: Dataset, seeds: Sequence[int], options: FitOptions) -> str:
    """The identity of a training: its data, options and seeds."""
    digest = hashlib.sha256()
    digest.update(json.dumps([kind, list(seeds), dataclasses.asdict(options), dataset.dt_s]).encode())
    for segment in dataset.segments:
        for array in (segment.nu, segment.command, segment.wind):
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
