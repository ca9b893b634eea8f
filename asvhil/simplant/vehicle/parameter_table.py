"""Parameters of a simulated autopilot by name and index, and their PARAM_VALUE messages."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.errors import ConfigError

INT8 = dialect.MAV_PARAM_TYPE_INT8
INT16 = dialect.MAV_PARAM_TYPE_INT16
INT32 = dialect.MAV_PARAM_TYPE_INT32
REAL32 = dialect.MAV_PARAM_TYPE_REAL32
NO_INDEX = 65535  # of a PARAM_VALUE that tells of a change

Row = tuple[str, float, int, tuple[float, float] | None]  # name, value, MAV_PARAM_TYPE, range; None: stands as it is


class ParameterTable(dict[str, float]):
    """Values by name, each within its range: read as a dict, which a loop does some thirty times, changed by `set`.

    Raises ConfigError where `given` names one that `what` does not have.
    """

    def __init__(self, what: str, rows: Sequence[Row], given: Mapping[str, float]) -> None:
        self._rows = {name: (kind, limits) for name, _, kind, limits in rows}
        super().__init__({name: float(value) for name, value, _, _ in rows})
        self.names = tuple(self._rows)
        for name, value in given.items():
            if name not in self._rows:
                raise ConfigError(f"key plant.frontseat.parameters: the {what} has no {name}")
            self._put(name, value)

    def find(self, name: str, index: int) -> str | None:
        """The name of a parameter given by index, or by name where the index is -1; None where there is none."""
        if index == -1:
            return name if name in self._rows else None
        return self.names[index] if 0 <= index < len(self.names) else None

    def set(self, name: str, field: float) -> bool:
        """Set a parameter from the field of a PARAM_SET; False where there is none of that name. Never raises."""
        row = self._rows.get(name)
        if row is None:
            return False
        self._put(name, self._value_in(field, row[0]))
        return True

    def message(self, name: str, *, changed: bool = False) -> Any:
        """PARAM_VALUE of a parameter; that of a change has no index."""
        kind, _ = self._rows[name]
        index = NO_INDEX if changed else self.names.index(name)
        field = self._field_of(self[name], kind)
        return dialect.MAVLink_param_value_message(name.encode(), field, kind, len(self.names), index)

    def _put(self, name: str, value: float) -> None:
        kind, limits = self._rows[name]
        if limits is not None and math.isfinite(value):
            inside = min(limits[1], max(limits[0], value))
            self[name] = inside if kind == REAL32 else float(round(inside))

    def _value_in(self, field: float, kind: int) -> float:
        """The value of a message's float field."""
        return field

    def _field_of(self, value: float, kind: int) -> float:
        """The float field of a message for a value."""
        return value
