"""Which telemetry message is due when: the stream rates of an ArduPilot vehicle and the rules for changing them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from pymavlink.dialects.v20 import ardupilotmega as dialect

DEFAULT_NS = 1_000_000_000
OFF = 0
FASTEST_OF_LOOP = 0.8


class Schedule:
    """Intervals by message id, evaluated only at loops of the vehicle; 0 = not streamed.

    Streams come at 1 Hz if not in `rates_hz`. `limited`: rates beyond 0.8 of the loop's are refused.
    """

    def __init__(
        self,
        streamed: Iterable[int],
        on_request: Iterable[int],
        loop_hz: float,
        t_ns: int,
        rates_hz: Mapping[int, float] | None = None,
        *,
        limited: bool = True,
    ) -> None:
        self._fastest_us = 1e6 / (FASTEST_OF_LOOP * loop_hz) if limited else 0.0
        self._default_ns = {msg_id: DEFAULT_NS for msg_id in streamed} | {msg_id: OFF for msg_id in on_request}
        self._default_ns |= {msg_id: round(1e9 / rate_hz) for msg_id, rate_hz in (rates_hz or {}).items()}
        self._interval_ns = dict(self._default_ns)
        self._due_ns = {msg_id: t_ns + interval for msg_id, interval in self._interval_ns.items() if interval}
        self._next_ns = 0
        if dialect.MAVLINK_MSG_ID_HEARTBEAT in self._due_ns:
            self._due_ns[dialect.MAVLINK_MSG_ID_HEARTBEAT] = t_ns

    def set_interval(self, t_ns: int, msg_id: int, interval_us: float) -> int:
        """MAV_RESULT of SET_MESSAGE_INTERVAL: 0 = default, negative = off; a refused rate leaves the old one."""
        if msg_id not in self._interval_ns or not math.isfinite(interval_us):
            return int(dialect.MAV_RESULT_DENIED)
        if interval_us == 0.0:
            interval_ns = self._default_ns[msg_id]
        elif interval_us < 0.0:
            interval_ns = OFF
        elif interval_us < self._fastest_us:
            return int(dialect.MAV_RESULT_DENIED)
        else:
            interval_ns = round(interval_us * 1000.0)
        self._interval_ns[msg_id] = interval_ns
        if interval_ns == OFF:
            self._due_ns.pop(msg_id, None)
        else:
            self._due_ns[msg_id] = t_ns + interval_ns
        self._next_ns = 0
        return int(dialect.MAV_RESULT_ACCEPTED)

    def set_rate(self, t_ns: int, msg_id: int, rate_hz: float) -> None:
        """The rule of REQUEST_DATA_STREAM: a rate too high is limited, none is refused."""
        self.set_interval(t_ns, msg_id, max(1e6 / rate_hz, self._fastest_us) if rate_hz > 0.0 else -1.0)

    def interval_us(self, msg_id: int) -> int | None:
        """The interval as MESSAGE_INTERVAL reports it: -1 = off; None for messages that do not exist here."""
        interval_ns = self._interval_ns.get(msg_id)
        return None if interval_ns is None else interval_ns // 1000 or -1

    def take_due(self, t_ns: int) -> list[int]:
        """The messages to send now; each is then due again one interval on."""
        if t_ns < self._next_ns:
            return []
        now = [msg_id for msg_id, due_ns in self._due_ns.items() if due_ns <= t_ns]
        for msg_id in now:
            interval_ns = self._interval_ns[msg_id]
            due_ns = self._due_ns[msg_id] + interval_ns
            self._due_ns[msg_id] = due_ns if due_ns > t_ns else t_ns + interval_ns
        self._next_ns = min(self._due_ns.values(), default=t_ns)
        return now
