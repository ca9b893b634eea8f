"""The parameter protocol from the vehicle's side: lists, single values and settings, all as 32-bit floats. Sans-IO."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from asvhil.io.mavlink.frames import dialect
from asvhil.types import EVERYONE, Address, ParameterChange

LIST, READ, SET = (
    dialect.MAVLINK_MSG_ID_PARAM_REQUEST_LIST,
    dialect.MAVLINK_MSG_ID_PARAM_REQUEST_READ,
    dialect.MAVLINK_MSG_ID_PARAM_SET,
)
MESSAGES = frozenset({LIST, READ, SET})
AT_ONCE = 5  # values for each tick: a list must not stand in front of an override on a slow line
WAITING_MAX = 2000


class ParameterServer:
    """Who asked for what, and the answers; values are the caller's. Unknown names and indices get no answer."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self._index = {name: number for number, name in enumerate(self.names)}
        self._waiting: deque[tuple[Address, str]] = deque()

    def receive(self, t_ns: int, address: Address, m: Any) -> ParameterChange | None:
        """Take in one of MESSAGES. Returns what it asks to set, if anything."""
        match m.get_msgId():
            case number if number == LIST:
                for name in self.names:
                    self._ask(address, name)
            case number if number == READ:
                by_index = self.names[m.param_index] if 0 <= m.param_index < len(self.names) else ""
                self._ask(address, m.param_id if m.param_index == -1 else by_index)
            case _ if m.param_id in self._index:
                return ParameterChange(t_ns=t_ns, name=m.param_id, value=float(m.param_value))
        return None

    def tell(self, name: str) -> None:
        """Send a value to everyone, as after it was set or refused."""
        self._ask(EVERYONE, name)

    def data_to_send(self, value_of: Callable[[str], float]) -> list[tuple[Address, Any]]:
        """PARAM_VALUE messages of this tick, each with where it goes."""
        due = []
        for _ in range(min(AT_ONCE, len(self._waiting))):
            address, name = self._waiting.popleft()
            value = value_of(name)
            message = dialect.MAVLink_param_value_message(
                name.encode("ascii"),
                value if math.isfinite(value) else math.nan,
                dialect.MAV_PARAM_TYPE_REAL32,
                len(self.names),
                self._index[name],
            )
            due.append((address, message))
        return due

    def _ask(self, address: Address, name: str) -> None:
        if name in self._index and (address, name) not in self._waiting and len(self._waiting) < WAITING_MAX:
            self._waiting.append((address, name))
