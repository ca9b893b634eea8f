"""The watch over the battery: what is told of it, and whether a hold is to end for it."""

from __future__ import annotations

from asvhil.config import BatteryConfig
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.types import FrontseatStatus, Note

SUBJECT = "battery"


class BatteryWatch:
    """`step` in each tick with the autopilot's status. What is low stays so until it has been well for as long."""

    def __init__(self, config: BatteryConfig) -> None:
        self._config = config
        self._low: Explanation | None = None
        self._turned_ns: int | None = None  # since when the readings have said otherwise

    def step(self, t_ns: int, status: FrontseatStatus | None) -> None:
        """Take in what the autopilot says."""
        found = None if status is None else self._reading(status)
        if (found is None) == (self._low is None):
            self._turned_ns = None
            return
        if self._turned_ns is None:
            self._turned_ns = t_ns
        if (t_ns - self._turned_ns) * 1e-9 >= self._config.lasts_s:
            self._low, self._turned_ns = found, None

    @property
    def fault(self) -> Explanation | None:
        """Why a hold is to end, and none to begin, where the config asks for that."""
        return self._low if self._config.on_low == "release" else None

    @property
    def notes(self) -> tuple[Note, ...]:
        """That it is low."""
        return () if self._low is None else (Note(subject=SUBJECT, text=describe(self._low), ok=False),)

    def _reading(self, status: FrontseatStatus) -> Explanation | None:
        """What is low or wrong; None where nothing is, or nothing is told."""
        config = self._config
        readings = (
            (status.battery_percent, config.low_percent, "{:.0f} %"),
            (status.battery_v, config.low_v, "{:.1f} V"),
        )
        for value, least, form in readings:
            if value is not None and least is not None and value < least:
                return explain(Reason.BATTERY_LOW, reading=form.format(value), limit=form.format(least))
        if status.battery_complaint:
            return explain(Reason.BATTERY_COMPLAINT, complaint=status.battery_complaint)
        return None
