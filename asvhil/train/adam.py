"""Adam, by torch's own function of it: its class loads torch's compiler, which takes two seconds and is not used."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import torch
from torch.optim.adam import adam

BETAS, EPSILON = (0.9, 0.999), 1e-8


class Adam:
    """Steps down the gradients of named weights (Kingma and Ba 2015, algorithm 1).

    `first` and `second` are the running means of the gradients and of their squares, by name, in the weights' shapes.
    """

    def __init__(self, weights: Mapping[str, torch.Tensor]) -> None:
        self._weights = weights
        self.first = {name: torch.zeros_like(value, requires_grad=False) for name, value in weights.items()}
        self.second = {name: torch.zeros_like(value, requires_grad=False) for name, value in weights.items()}
        self._steps = [torch.tensor(0.0) for _ in weights]

    def restore(self, steps: int, first: Mapping[str, torch.Tensor], second: Mapping[str, torch.Tensor]) -> None:
        """Go on from where another was."""
        self.first, self.second = dict(first), dict(second)
        self._steps = [torch.tensor(float(steps)) for _ in self._weights]

    def step(self, rate: float) -> None:
        """Move the weights by their gradients, which are then forgotten; all of them have one."""
        with torch.no_grad():
            adam(
                list(self._weights.values()),
                [cast(torch.Tensor, value.grad) for value in self._weights.values()],
                list(self.first.values()),
                list(self.second.values()),
                [],
                self._steps,
                fused=True,
                amsgrad=False,
                beta1=BETAS[0],
                beta2=BETAS[1],
                lr=rate,
                weight_decay=0.0,
                eps=EPSILON,
                maximize=False,
            )
        for value in self._weights.values():
            value.grad = None
