"""Training of NODE and KNODE: an ODE solver forwards, its adjoint backwards (Chen et al. 2018)."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor
from torchdiffeq import odeint_adjoint

from asvhil.dynamics.arrays import Array
from asvhil.dynamics.fitted_sd import FittedSd
from asvhil.dynamics.nnsem import Scaling, TanhNetwork
from asvhil.train.models import N_INPUT, Batch, exported_network, initial_network, still_bias, without_bias
from asvhil.train.rollout import N_STATE

IDENTITY_SLOPE = 0.3  # of the coupling's first units, which start as the sum of prior and network


class _Field(torch.nn.Module):
    """The rate of the scaled velocities over samples (not seconds), under held commands and winds."""

    def __init__(self, trainee: NodeTrainee, batch: Batch) -> None:
        super().__init__()
        self._trainee = trainee
        self._held = torch.cat([batch.command, batch.wind], -1)

    def forward(self, t: Tensor, x: Tensor) -> Tensor:
        # The solver is told to evaluate just inside of a step's ends, so the floor is the step that t lies in.
        k = min(max(int(t.item() // 1), 0), self._held.shape[1] - 1)
        return self._trainee.rate(x, self._held[:, k])


class NodeTrainee:
    """The network of NNSEM under the explicit midpoint rule, as at run time, trained by the adjoint method.

    With `still` a boat at rest in still air stays there, whatever the weights.
    """

    history = 0

    def __init__(self, rngs: list[np.random.Generator], hidden: int, dt_s: float, still: bool = False) -> None:
        self._dt_s, self._still = dt_s, still
        self.parameters = self._trained(initial_network(rngs, N_INPUT, hidden, N_STATE))

    def rate(self, x: Tensor, held: Tensor) -> Tensor:
        """Scaled nu_dot times dt, of scaled velocities (N, B, 3) under scaled commands and winds (N, B, 4)."""
        rate: Tensor = self._dt_s * self._network("")(torch.cat([x, held], -1))
        return rate

    def predict(self, batch: Batch) -> Tensor:
        times = torch.arange(batch.target.shape[1] + 1, dtype=torch.float64)
        states: Tensor = odeint_adjoint(
            _Field(self, batch),
            batch.x0,
            times,
            method="midpoint",
            options={"perturb": True},
            adjoint_params=tuple(self.parameters.values()),
        )
        return states[1:].transpose(0, 1)

    def export(self, number: int) -> dict[str, Array]:
        return exported_network(self._weights(""), number)

    def _trained(self, network: dict[str, Tensor]) -> dict[str, Tensor]:
        return without_bias(network) if self._still else network

    def _weights(self, prefix: str) -> dict[str, Tensor]:
        """w1, b1, w2, b2 of the network whose parameters' names begin with a prefix."""
        weights = {name: self.parameters[prefix + name] for name in ("w1", "b1", "w2")}
        bias = still_bias(weights["b1"], weights["w2"]) if self._still else self.parameters[f"{prefix}b2"]
        return weights | {"b2": bias}

    def _network(self, prefix: str) -> TanhNetwork:
        w1, b1, w2, b2 = self._weights(prefix).values()
        return TanhNetwork(w1.mT, b1, w2.mT, b2)


class KnodeTrainee(NodeTrainee):
    """A prior model and a network, coupled by a second network, which is trained too."""

    def __init__(
        self,
        rngs: list[np.random.Generator],
        hidden: int,
        dt_s: float,
        scaling: Scaling,
        prior: Array,
        prior_scale: Array,
        still: bool = False,
    ) -> None:
        super().__init__(rngs, hidden, dt_s, still)
        self._prior = prior
        self._prior_scale = prior_scale
        self._model = FittedSd(prior.tolist(), dt_s)
        self._centre, self._half = torch.from_numpy(scaling.centre), torch.from_numpy(scaling.half)
        self._rate_scale = torch.from_numpy(prior_scale)
        coupling = initial_network(rngs, 2 * N_STATE, hidden, N_STATE)
        with torch.no_grad():
            self._start_as_sum(coupling, prior_scale / scaling.half[:3])
        self.parameters |= {f"g_{name}": value for name, value in self._trained(coupling).items()}

    def rate(self, x: Tensor, held: Tensor) -> Tensor:
        z = torch.cat([x, held], -1)
        units = z * self._half + self._centre
        prior = self._model.derivative(units[..., :3], units[..., 3:5], units[..., 5:]) / self._rate_scale
        rate: Tensor = self._dt_s * self._network("g_")(torch.cat([prior, self._network("")(z)], -1))
        return rate

    def export(self, number: int) -> dict[str, Array]:
        return (
            super().export(number)
            | {f"g_{name}": value for name, value in exported_network(self._weights("g_"), number).items()}
            | {"prior": self._prior, "prior_scale": self._prior_scale}
        )

    @staticmethod
    def _start_as_sum(coupling: dict[str, Tensor], gain: Array) -> None:
        """One nearly linear unit for each rate of the prior and of the network, which add up; the rest as drawn."""
        units = 2 * N_STATE
        coupling["w1"][:, :, :units] = IDENTITY_SLOPE * torch.eye(units, dtype=torch.float64)
        coupling["b1"][:, :, :units] = 0.0
        coupling["w2"][:, :units] = 0.0
        for i in range(N_STATE):
            coupling["w2"][:, i, i] = float(gain[i]) / IDENTITY_SLOPE
            coupling["w2"][:, N_STATE + i, i] = 1.0 / IDENTITY_SLOPE
