"""What breaks on the simulated boat, and when: spans of time from the config, told apart by kind."""

from __future__ import annotations

import math
from collections.abc import Iterable

from asvhil.config import FaultConfig
from asvhil.simplant.vessel import NO_SIGNAL_US

FOREVER_NS = 2**63
HEALTHY: frozenset[str] = frozenset()


class Faults:
    """The kinds of fault that are present at a time; times count from power-on, ends are not part of a span."""

    def __init__(self, faults: Iterable[FaultConfig], start_ns: int) -> None:
        self._spans = tuple(
            (start_ns + round(1e9 * fault.from_s), start_ns + _ns(fault.to_s), fault.kind) for fault in faults
        )
        self._now = HEALTHY
        self._next_ns = -FOREVER_NS if self._spans else FOREVER_NS

    def at(self, t_ns: int) -> frozenset[str]:
        """The kinds that are present; time never runs back. Cheap between the edges, for it is asked at each step."""
        if t_ns >= self._next_ns:
            self._now = frozenset(kind for first_ns, end_ns, kind in self._spans if first_ns <= t_ns < end_ns)
            edges = (edge_ns for first_ns, end_ns, _ in self._spans for edge_ns in (first_ns, end_ns))
            self._next_ns = min((edge_ns for edge_ns in edges if edge_ns > t_ns), default=FOREVER_NS)
        return self._now


def motor_signals_us(outputs_us: tuple[int, int], faults: frozenset[str]) -> tuple[int, int]:
    """The pulse widths (port, starboard) that reach the motors: none where a motor is dead."""
    if not faults:
        return outputs_us
    port_us, starboard_us = outputs_us
    return (
        NO_SIGNAL_US if "port-motor" in faults else port_us,
        NO_SIGNAL_US if "starboard-motor" in faults else starboard_us,
    )


def _ns(seconds: float) -> int:
    return FOREVER_NS if math.isinf(seconds) else round(1e9 * seconds)
