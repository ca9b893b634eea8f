"""What can be tuned of each controller: gains of the baselines, weights of the MPC, each with its range."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from asvhil.config import Config
from asvhil.config.registry import CONTROLLERS
from asvhil.types import record

# The sets that decide while a station is kept; `far` and `position_only` are for the way to it.
MPC_SETS = ("near", "along")
MPC_WEIGHTS = ("heading", "velocity", "slew", "terminal_position_s")
MPC_FACTOR = 4.0


@record
class Parameter:
    """One number to tune: its place (a config key, with `[i]` or `[i,j]` for parts of a tuple), start, and range.

    It is searched on a logarithmic scale between start / factor and start * factor.
    """

    key: str
    start: float
    factor: float = 4.0

    def value(self, share: float) -> float:
        """The value at a share of the range in [0, 1], to 4 digits; the start is at a half."""
        return float(f"{self.start * self.factor ** (2.0 * share - 1.0):.4g}")

    def share(self, value: float) -> float:
        return 0.5 + 0.5 * math.log(value / self.start) / math.log(self.factor)


def spaces(config: Config) -> dict[str, tuple[Parameter, ...]]:
    """The search space of each controller that has one, by `controller.name`.

    An MPC's is about the weights of the config; the position weights stay, since only ratios count, and a weight of 0
    has no place on a logarithmic scale.
    """
    found = {
        kind.name: tuple(
            Parameter(key=f"controller.{kind.settings_key}.{part.key}", start=part.start, factor=part.factor)
            for part in kind.search
        )
        for kind in CONTROLLERS
        if kind.search
    }
    weights = tuple(
        Parameter(key=f"controller.mpc.{which}.{weight}", start=value, factor=MPC_FACTOR)
        for which in MPC_SETS
        for weight in MPC_WEIGHTS
        if (value := float(getattr(getattr(config.controller.mpc, which), weight))) > 0.0
    )
    return found | {kind.name: weights for kind in CONTROLLERS if kind.solves and not kind.search}


def overrides_of(name: str, values: Mapping[str, float]) -> tuple[str, ...]:
    """The `KEY=VALUE` overrides of a config that set a controller and its tuned values."""
    plain: dict[str, Any] = {}
    for key, value in values.items():
        base, bracket, index = key.partition("[")
        if bracket:
            for part in index.rstrip("]").split(","):
                plain.setdefault(base, {})[int(part)] = value
        else:
            plain[key] = value
    return (
        f"controller.name={name}",
        *(
            f"{key}={[value[i] for i in sorted(value)] if isinstance(value, dict) else value}"
            for key, value in plain.items()
        ),
    )
