"""The daemon's parameters on the link: names, units, bounds, and the controller's settings behind them.

A change is an operator's frame like any other, so a replay makes it again. It takes effect in the running controller:
what is here are parameters of its problem, and nothing is built anew. It does not outlive the daemon.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

from pydantic import ValidationError

from asvhil.config import ControllerConfig
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.types import record

NAME_MAX = 16


@runtime_checkable
class Tunable(Protocol):
    """A controller that takes other weights and radii while it runs."""

    def retune(self, config: ControllerConfig) -> None:
        """Use these from the next step on; what its problem was built from stays."""
        ...


@record
class Row:
    """One parameter: its place in the controller's config, and the bounds and size of its unit on the link there."""

    name: str
    path: tuple[str, ...]
    least: float
    most: float
    scale: float = 1.0


DEGREE = math.pi / 180.0
_SETS = (("NEAR", "near"), ("ALONG", "along"), ("FAR", "far"), ("POSN", "position_only"))
_WEIGHTS = (
    ("POS", "position", 1e4),
    ("SIDE", "sideways", 1.0),
    ("HDG", "heading", 1e5),
    ("VEL", "velocity", 1e4),
    ("SLEW", "slew", 1e4),
    ("TERM", "terminal_position_s", 1e4),
)
_MPC = (
    *(
        Row(name=f"W_{short}_{what}", path=("mpc", section, field), least=0.0, most=most)
        for short, section in _SETS
        for what, field, most in _WEIGHTS
    ),
    Row(name="MPC_NEAR_R", path=("mpc", "near_radius_m"), least=0.5, most=100.0),
    Row(name="MPC_FAR_R", path=("mpc", "far_radius_m"), least=1.0, most=200.0),
    Row(name="MPC_TRIM_T", path=("mpc", "trim_time_s"), least=1.0, most=1e4),
    Row(name="MPC_TRIM_MAX", path=("mpc", "trim_max_rad"), least=0.0, most=30.0, scale=DEGREE),
)
_PROCEDURE = (
    Row(name="PROC_R_S", path=("procedure", "r_s_m"), least=1.0, most=500.0),
    Row(name="PROC_R_D", path=("procedure", "r_d_m"), least=1.0, most=500.0),
    Row(name="PROC_R_H", path=("procedure", "r_h_m"), least=0.5, most=500.0),
    Row(name="PROC_DWELL", path=("procedure", "dwell_s"), least=0.0, most=600.0),
    Row(name="PROC_SPEED", path=("procedure", "speed_mps"), least=0.1, most=10.0),
    Row(name="PROC_HAND_SPD", path=("procedure", "handover_speed_mps"), least=0.1, most=10.0),
    Row(name="PROC_LOOKAHEAD", path=("procedure", "lookahead_m"), least=1.0, most=100.0),
)
_LOITER = (
    Row(name="LOIT_RADIUS", path=("loiter", "radius_m"), least=0.1, most=100.0),
    Row(name="LOIT_SPEED_MAX", path=("loiter", "speed_max_mps"), least=0.1, most=10.0),
)


class Tunables:
    """What the controller in use can be told while it runs: name to value, in the units of the link."""

    def __init__(self, config: ControllerConfig, controller: object) -> None:
        self._config = config
        self._controller = controller if isinstance(controller, Tunable) else None
        self._rows = {row.name: row for row in self._rows_of(config)} if self._controller is not None else {}

    @staticmethod
    def _rows_of(config: ControllerConfig) -> Sequence[Row]:
        rows: list[Row] = []
        if config.name.endswith("-mpc"):
            rows += _MPC
        if config.name == "loiter":
            rows += _LOITER
        if config.procedure.enabled and config.name != "manoeuvres":
            rows += _PROCEDURE
        return rows

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._rows)

    def __contains__(self, name: str) -> bool:
        return name in self._rows

    def value(self, name: str) -> float:
        """The value in use."""
        row = self._rows[name]
        at: Any = self._config
        for key in row.path:
            at = getattr(at, key)
        return float(at) / row.scale

    def set(self, name: str, value: float) -> Explanation | None:
        """Use another value from now on. Returns None, or why not."""
        row = self._rows[name]
        assert self._controller is not None
        if not row.least <= value <= row.most:  # a NaN is not
            return explain(Reason.PARAMETER_OUT_OF_RANGE, name=name, range=f"{row.least:g} to {row.most:g}")
        tree = self._config.model_dump()
        at = tree
        for key in row.path[:-1]:
            at = at[key]
        at[row.path[-1]] = value * row.scale
        try:
            config = ControllerConfig.model_validate(tree)
        except ValidationError as error:
            rule = error.errors()[0]["msg"].removeprefix("Value error, ")
            return explain(Reason.PARAMETER_CONFLICT, name=name, rule=rule)
        self._config = config
        self._controller.retune(config)
        return None
