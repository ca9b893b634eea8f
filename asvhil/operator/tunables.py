"""The daemon's parameters on the link: names, units, bounds, and the controller's settings behind them.

A change is an operator's frame like any other, so a replay makes it again. It takes effect in the running controller:
what is here are parameters of its problem, and nothing is built anew. It does not outlive the daemon.
"""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

from pydantic import ValidationError

from asvhil.config import ControllerConfig
from asvhil.config.registry import CONTROLLERS, OperatorParameter
from asvhil.supervisor.reasons import Explanation, Reason, explain


@runtime_checkable
class Tunable(Protocol):
    """A controller that takes other weights and radii while it runs."""

    def retune(self, config: ControllerConfig) -> None:
        """Use these from the next step on; what its problem was built from stays."""
        ...


_PROCEDURE = (
    OperatorParameter(name="PROC_R_S", path=("r_s_m",), least=1.0, most=500.0),
    OperatorParameter(name="PROC_R_D", path=("r_d_m",), least=1.0, most=500.0),
    OperatorParameter(name="PROC_R_H", path=("r_h_m",), least=0.5, most=500.0),
    OperatorParameter(name="PROC_DWELL", path=("dwell_s",), least=0.0, most=600.0),
    OperatorParameter(name="PROC_SPEED", path=("speed_mps",), least=0.1, most=10.0),
    OperatorParameter(name="PROC_HAND_SPD", path=("handover_speed_mps",), least=0.1, most=10.0),
    OperatorParameter(name="PROC_LOOKAHEAD", path=("lookahead_m",), least=1.0, most=100.0),
)


class Tunables:
    """What the controller in use can be told while it runs: name to value, in the units of the link."""

    def __init__(self, config: ControllerConfig, controller: object) -> None:
        self._config = config
        self._controller = controller if isinstance(controller, Tunable) else None
        rows = self._rows_of(config) if self._controller is not None else []
        self._rows = {row.name: (section, row) for section, row in rows if _is_set(config, section, row)}

    @staticmethod
    def _rows_of(config: ControllerConfig) -> list[tuple[str, OperatorParameter]]:
        """Parameters of the controller and of the procedure around it, with the sections that they are in."""
        kind = CONTROLLERS.find(config.name)
        rows = [(kind.settings_key, row) for row in kind.parameters]
        if kind.keeps_station and config.procedure.enabled:
            rows += [("procedure", row) for row in _PROCEDURE]
        return rows

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._rows)

    def __contains__(self, name: str) -> bool:
        return name in self._rows

    def value(self, name: str) -> float:
        """The value in use."""
        section, row = self._rows[name]
        at: Any = getattr(self._config, section)
        for key in row.path:
            at = getattr(at, key)
        return row.on_link(at)

    def set(self, name: str, value: float) -> Explanation | None:
        """Use another value from now on. Returns None, or why not."""
        section, row = self._rows[name]
        assert self._controller is not None
        if not row.allows(value):
            return explain(Reason.PARAMETER_OUT_OF_RANGE, name=name, range=row.range)
        tree = self._config.model_dump()
        at = tree[section]
        for key in row.path[:-1]:
            at = at[key]
        at[row.path[-1]] = row.from_link(value)
        try:
            config = ControllerConfig.model_validate(tree)
        except ValidationError as error:
            rule = error.errors()[0]["msg"].removeprefix("Value error, ")
            return explain(Reason.PARAMETER_CONFLICT, name=name, rule=rule)
        self._config = config
        self._controller.retune(config)
        return None


def _is_set(config: ControllerConfig, section: str, row: OperatorParameter) -> bool:
    """Whether the setting is there: a set of weights may be null, and then has none."""
    at: Any = getattr(config, section)
    for key in row.path[:-1]:
        at = getattr(at, key)
    return at is not None
