"""What can be tuned of each controller: gains of the baselines, weights of the MPC, each with its range."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Any

from asvhil.config import Config, MpcConfig
from asvhil.config.registry import CONTROLLERS
from asvhil.types import record

# The sets that decide while a station is kept; `far` and `position_only` are for the way to it.
MPC_SETS = ("near", "along")
MPC_WEIGHTS = ("heading", "velocity", "slew", "terminal_position_s")
MPC_FACTOR = 4.0
HORIZON = "last_step_s"  # stages grow linearly to it, so it sets the length of the horizon
HORIZON_FACTOR = 2.0
OF_THRUST = ("", "lagnet")  # kinds of models, "" the physics, whose input is thrust and which have motor states


@record
class Parameter:
    """One number to tune: its place (a config key, with `[i]` or `[i,j]` for parts of a tuple), start, and range.

    It is searched on a logarithmic scale. Between start / factor and start * factor the share goes from 0 to 1; a
    search may leave this range.
    """

    key: str
    start: float
    factor: float = 4.0

    def value(self, share: float) -> float:
        """The value at a share of the range, to 4 digits; the start is at a half."""
        return float(f"{self.start * self.factor ** (2.0 * share - 1.0):.4g}")

    def share(self, value: float) -> float:
        return 0.5 + 0.5 * math.log(value / self.start) / math.log(self.factor)


def spaces(config: Config) -> dict[str, tuple[Parameter, ...]]:
    """The search space of each controller that has one, by `controller.name`.

    It is about the values of the config, or about the start that the controller's kind names where that is 0, which has
    no place on a logarithmic scale. An MPC's has the weights that are not 0, the length of the horizon, and, by the
    kind of model, the slew weight of thrusts or the dead time; the position weights stay, since only ratios count.
    """
    found = {
        kind.name: tuple(
            Parameter(
                key=f"controller.{kind.settings_key}.{part.key}",
                start=_value(getattr(config.controller, kind.settings_key), part.key) or part.start,
                factor=part.factor,
            )
            for part in kind.search
        )
        for kind in CONTROLLERS
        if kind.search
    }
    return found | {
        kind.name: _of_mpc(config.controller.mpc, kind.model) for kind in CONTROLLERS if kind.solves and not kind.search
    }


def _value(section: Any, key: str) -> float:
    """The value at a place below a section; of several parts of a tuple that of the first."""
    path, bracket, parts = key.partition("[")
    value = functools.reduce(getattr, path.split("."), section)
    return float(value[int(parts.rstrip("]").split(",")[0])] if bracket else value)


def _of_mpc(mpc: MpcConfig, model: str) -> tuple[Parameter, ...]:
    factors = {f"{which}.{weight}": MPC_FACTOR for which in MPC_SETS for weight in MPC_WEIGHTS}
    factors[HORIZON] = HORIZON_FACTOR
    factors["thrust_slew" if model in OF_THRUST else "unmodelled_lag_s"] = MPC_FACTOR
    values = {key: _value(mpc, key) for key in factors}
    return tuple(
        Parameter(key=f"controller.mpc.{key}", start=value, factor=factors[key])
        for key, value in values.items()
        if value > 0.0
    )


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
