"""The trainable form of each kind of model: N models at once, in scaled units, on torch tensors (float64).

Each has `parameters` by name, predicts the scaled velocities of a batch of windows, and exports model number i as the
arrays that `asvhil.dynamics.weights` builds the run-time model from.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from asvhil.dynamics.arrays import Array
from asvhil.train.rollout import N_PRODUCTS, N_STATE, euler_rollout
from asvhil.train.windows import MIRROR_NU, MIRROR_WIND
from asvhil.types import record

N_INPUT = 7  # u, v, r, port, starboard, w_u, w_v
INPUT_IN_MIRROR = [0, 1, 2, 4, 3, 5, 6]
MIRROR_INPUT = np.concatenate([MIRROR_NU, [1.0, 1.0], MIRROR_WIND])
# Whether surge rate and yaw rate's rate rise (1) or fall as port and starboard commands rise.
COMMAND_SIGNS = torch.tensor([[1.0, 1.0], [1.0, -1.0]], dtype=torch.float64)
BLIND_TO_COMMANDS = torch.tensor([1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0], dtype=torch.float64)
MAP_UNITS = 8
STRAIGHT, LEAN, BENT = -4.0, -1.0, 2.0  # of the slope before softplus: nearly linear, little curved, curved
MAP_CELLS = 400  # of the table that the map is read from in training
N_SKIP_STATE, N_SKIP = N_PRODUCTS, 16


@record
class Batch:
    """Scaled windows of N models, B each. Commands begin `history` rows before the initial state."""

    x0: Tensor  # (N, B, 3)
    command: Tensor  # (N, history + m, B, 2)
    wind: Tensor  # (N, m, B, 2)
    target: Tensor  # (N, m, B, 3)


class Trainee(Protocol):
    """N models under training."""

    parameters: dict[str, Tensor]
    history: int

    def predict(self, batch: Batch) -> Tensor:
        """Scaled velocities (N, m, B, 3) after each step."""

    def export(self, number: int) -> dict[str, Array]:
        """Weights of one model, scaling excepted."""


def parameter(values: Array) -> Tensor:
    """A leaf tensor with gradients."""
    return torch.tensor(values, dtype=torch.float64, requires_grad=True)


def initial_network(rngs: list[np.random.Generator], inputs: int, hidden: int, outputs: int) -> dict[str, Tensor]:
    """Glorot's uniform law for the first layer, a tenth of it for the second, one generator a model."""
    first, second = np.sqrt(6.0 / (inputs + hidden)), 0.1 * np.sqrt(6.0 / (hidden + outputs))
    return {
        "w1": parameter(np.stack([rng.uniform(-first, first, (inputs, hidden)) for rng in rngs])),
        "b1": parameter(np.stack([rng.uniform(-0.5, 0.5, (1, hidden)) for rng in rngs])),
        "w2": parameter(np.stack([rng.uniform(-second, second, (hidden, outputs)) for rng in rngs])),
        "b2": parameter(np.zeros((len(rngs), 1, outputs))),
    }


def without_bias(parameters: dict[str, Tensor]) -> dict[str, Tensor]:
    """The parameters of `initial_network` that are left where the output bias follows from them (`still_bias`)."""
    return {name: value for name, value in parameters.items() if name != "b2"}


def still_bias(b1: Tensor, w2: Tensor) -> Tensor:
    """The output bias (N, 1, outputs) with which the output is zero where all scaled inputs are.

    Scaled about zero, that is a boat at rest in still air with its motors off.
    """
    return -torch.tanh(b1) @ w2


def exported_network(parameters: dict[str, Tensor], number: int) -> dict[str, Array]:
    """(w1 (hidden, inputs), b1, w2 (outputs, hidden), b2) of one model."""
    with torch.no_grad():
        return {
            "w1": parameters["w1"][number].T.numpy().copy(),
            "b1": parameters["b1"][number, 0].numpy().copy(),
            "w2": parameters["w2"][number].T.numpy().copy(),
            "b2": parameters["b2"][number, 0].numpy().copy(),
        }


def with_twins(half: dict[str, Tensor]) -> dict[str, Tensor]:
    """A mirror-symmetric network, from half of its neurons: mirrored inputs give mirrored rates. Scaled about zero."""
    w1, w2 = half["w1"], half["w2"]
    inputs, outputs = torch.tensor(MIRROR_INPUT)[:, None], torch.tensor(MIRROR_NU)
    return {
        "w1": torch.cat([w1, inputs * w1[:, INPUT_IN_MIRROR]], 2),
        "b1": torch.cat([half["b1"], half["b1"]], 2),
        "w2": torch.cat([w2, w2 * outputs], 1),
        "b2": half["b2"] * (0.5 * (1.0 + outputs)),
    }


class NnsemTrainee:
    """The paper's network: 7-12-3, tanh, forward Euler.

    With `paired` each neuron has a mirror image, port for starboard, and only half of them are trained. With `still`
    a boat at rest in still air stays there, whatever the weights. With a `base`, the scaled (w1, b1, w2) of another
    network, its neurons are kept as they are, and the trained ones do not see the commands.
    """

    history = 0

    def __init__(
        self,
        rngs: list[np.random.Generator],
        hidden: int,
        dt_s: float,
        paired: bool = False,
        still: bool = False,
        base: tuple[Array, Array, Array] | None = None,
    ) -> None:
        self._dt_s, self._paired, self._still = dt_s, paired, still
        self._base = None if base is None else [torch.tensor(part).expand(len(rngs), *part.shape) for part in base]
        network = initial_network(rngs, N_INPUT, hidden // 2 if paired else hidden, N_STATE)
        self.parameters = without_bias(network) if still else network

    def _weights(self) -> dict[str, Tensor]:
        weights = dict(self.parameters)
        if self._base is not None:
            weights["w1"] = weights["w1"] * BLIND_TO_COMMANDS[:, None]
        if self._still:
            weights["b2"] = torch.zeros((len(weights["w1"]), 1, N_STATE), dtype=torch.float64)
        if self._paired:
            weights = with_twins(weights)
        if self._base is not None:
            for name, kept, axis in zip(("w1", "b1", "w2"), self._base, (2, 2, 1), strict=True):
                weights[name] = torch.cat([kept, weights[name]], axis)
        if self._still:
            weights["b2"] = still_bias(weights["b1"], weights["w2"])
        return weights

    def predict(self, batch: Batch) -> Tensor:
        weights = self._weights()
        w1, b1, w2, b2 = (weights[name] for name in ("w1", "b1", "w2", "b2"))
        p = _affine(torch.cat([batch.command, batch.wind], -1), w1[:, N_STATE:], b1)
        q = (self._dt_s * b2)[:, None].expand(batch.target.shape)
        return euler_rollout(batch.x0, p, q, w1[:, :N_STATE], self._dt_s * w2, None)

    def wrong_slopes(self, x0: Tensor, command: Tensor, wind: Tensor) -> Tensor:
        """Mean slope of the surge and yaw rates by the commands against their signs, summed over the models; scaled.

        Of states (N, B, 3), commands and winds (N, B, 2).
        """
        weights = self._weights()
        w1, b1, w2 = (weights[name] for name in ("w1", "b1", "w2"))
        bend = 1.0 - torch.tanh(torch.cat([x0, command, wind], -1) @ w1 + b1).square()
        by_motor = w1[:, N_STATE : N_STATE + 2, None, :] * w2[:, :, ::2].mT[:, None]  # (N, motor, rate, hidden)
        slope = torch.einsum("nbh,nmrh->nbrm", bend, by_motor) * COMMAND_SIGNS
        return torch.relu(-slope).mean((1, 2, 3)).sum()

    def export(self, number: int) -> dict[str, Array]:
        return exported_network(self._weights(), number)


class LagNetTrainee:
    """Thrust map, motor lag, network and skip terms; `members` networks in a row share one map and one lag.

    The map starts curved, or nearly linear if it is frozen. With `skip` (16, 3) the skip terms
    start there rather than at zero, and the map with little curvature. With `still` a boat at rest in still air
    stays there, whatever the weights.
    """

    def __init__(
        self,
        rngs: list[np.random.Generator],
        hidden: int,
        dt_s: float,
        history: int,
        members: int,
        straight: bool = False,
        skip: Array | None = None,
        still: bool = False,
    ) -> None:
        slope = STRAIGHT if straight else BENT if skip is None else LEAN
        start = np.zeros((N_SKIP, N_STATE)) if skip is None else skip
        groups = len(rngs) // members
        self.history, self._dt_s, self._members = history, dt_s, members
        heads = rngs[::members]
        self._still = still
        network = initial_network(rngs, N_INPUT, hidden, N_STATE)
        self.parameters = without_bias(network) if still else network
        self.parameters |= {
            "skip": parameter(np.stack([start] * len(rngs))),
            "map_gain": parameter(np.zeros((groups, 1, MAP_UNITS))),
            "map_slope": parameter(np.full((groups, 1, MAP_UNITS), slope)),
            "map_centre": parameter(np.stack([_spread(rng) for rng in heads])),
            "lag": parameter(np.zeros((groups, 1, 1))),
            "direct": parameter(np.full((groups, 1, 1, 1), -1.0)),
        }

    def predict(self, batch: Batch) -> Tensor:
        value = self.parameters
        motor, change = self._motors(batch.command, batch.target.shape[1])
        direct = torch.sigmoid(value["direct"]).repeat_interleave(self._members, 0)
        driven = torch.cat([motor + direct * change, batch.wind], -1)
        w1, skip = value["w1"], value["skip"]
        p = _affine(driven, w1[:, N_STATE:], value["b1"])
        w_u, w_v = batch.wind[..., :1], batch.wind[..., 1:]
        terms = torch.cat([driven, batch.wind * batch.wind.abs(), w_u * w_v], -1)
        q = _affine(terms, self._dt_s * skip[:, N_SKIP_STATE:], self._dt_s * self._bias())
        return euler_rollout(
            batch.x0, p, q, w1[:, :N_STATE], self._dt_s * value["w2"], self._dt_s * skip[:, :N_SKIP_STATE]
        )

    def _bias(self) -> Tensor:
        value = self.parameters
        return still_bias(value["b1"], value["w2"]) if self._still else value["b2"]

    def lag_factor(self) -> Tensor:
        """dt / lag (groups, 1, 1): the share of the difference to its demand that a motor covers in one Euler step."""
        return torch.sigmoid(self.parameters["lag"])

    def _thrust(self, command: Tensor) -> Tensor:
        """The map of commands (N, K), each model by the map of its group; linear between the rows of a table."""
        value = self.parameters
        gain = torch.nn.functional.softplus(value["map_gain"]).mT
        slope, centre = torch.nn.functional.softplus(value["map_slope"]), value["map_centre"]
        grid = torch.linspace(-1.0, 1.0, MAP_CELLS + 1, dtype=torch.float64)[:, None]
        table = torch.tanh(slope * (grid - centre)) @ gain  # (groups, MAP_CELLS + 1, 1)
        low, high = table[:, MAP_CELLS // 2, None], table[:, -1, None]
        flat = ((table - low) / (high - low)).flatten()
        with torch.no_grad():
            at = (command + 1.0) * (MAP_CELLS / 2)
            cell = at.floor().clamp(0, MAP_CELLS - 1)
            part = (at - cell).flatten()
            first = (MAP_CELLS + 1) * (torch.arange(len(command)) // self._members)
            row = (cell.long() + first[:, None]).flatten()
        below = flat.index_select(0, row)
        thrust: Tensor = below + part * (flat.index_select(0, row + 1) - below)
        return thrust.view(command.shape)

    def _motors(self, command: Tensor, steps: int) -> tuple[Tensor, Tensor]:
        """Motor states (N, m, B, 2) at the start of each step, and the differences of their demands to them."""
        models, rows, batch, _ = command.shape
        demand = self._thrust(command.reshape(models, -1)).view(models, rows, 2 * batch)
        # The lag is linear: the states are a weighted sum of the demands so far, the first taken as held for ever.
        step_at = torch.arange(self.history, rows)[:, None]
        age = (step_at - 1 - torch.arange(rows)[None, :]).to(torch.float64)
        factor = self.lag_factor()
        weight = torch.where(age >= 0.0, (1.0 - factor) ** age.clamp(min=0.0), torch.zeros(()).double())
        weight = torch.cat([weight[..., :1], factor * weight[..., 1:]], -1).repeat_interleave(self._members, 0)
        motor = weight @ demand
        change = demand[:, self.history :] - motor
        return motor.view(models, steps, batch, 2), change.view(models, steps, batch, 2)

    def export(self, number: int) -> dict[str, Array]:
        """Group `number`; the mean of its members is one network with all their hidden units side by side."""
        first = number * self._members
        network = {**self.parameters, "b2": self._bias()}
        parts = [exported_network(network, first + i) for i in range(self._members)]
        with torch.no_grad():
            value = self.parameters
            softplus = torch.nn.functional.softplus
            return {
                "w1": np.concatenate([part["w1"] for part in parts]),
                "b1": np.concatenate([part["b1"] for part in parts]),
                "w2": np.concatenate([part["w2"] for part in parts], axis=1) / self._members,
                "b2": np.mean([part["b2"] for part in parts], axis=0),
                "skip": value["skip"][first : first + self._members].mean(0).T.numpy().copy(),
                "map_gain": softplus(value["map_gain"][number, 0]).numpy().copy(),
                "map_slope": softplus(value["map_slope"][number, 0]).numpy().copy(),
                "map_centre": value["map_centre"][number, 0].numpy().copy(),
                "lag_s": np.array(self._dt_s / self.lag_factor()[number].item()),
                "direct": np.array(torch.sigmoid(value["direct"][number]).item()),
            }


def _affine(rows: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """rows (N, m, B, I) through weight (N, I, J) and bias (N, 1, J): one product a model."""
    models, steps, batch, inputs = rows.shape
    return torch.baddbmm(bias, rows.reshape(models, -1, inputs), weight).view(models, steps, batch, -1)


def _spread(rng: np.random.Generator) -> Array:
    """Centres of the map's units (1, MAP_UNITS), spread over the commands with a small random offset."""
    return (np.linspace(-0.9, 0.9, MAP_UNITS) + rng.uniform(-0.05, 0.05, MAP_UNITS))[None]
