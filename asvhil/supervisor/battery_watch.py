"""The watch over the battery: what is told of it, and whether a hold is to end for it."""

from __future__ import annotations

from asvhil.config import BatteryConfig
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.types import FrontseatStatus, Note

SUBJECT = "battery"
TOLD_EVERY_NS = 60_000_000_000  # another figure of what is low: operators are told of each
SOON_NS = 10_000_000_000  # another complaint


class BatteryWatch:
    """`step` in each tick with the autopilot's status.

    What is low stays so until it has been well for as long; a charge that is not told any more is not well.
    """

    def __init__(self, config: BatteryConfig) -> None:
        self._config = config
        self._low: Explanation | None = None
        self._turned_ns: int | None = None  # since when the readings have said otherwise
        self._told_ns = 0
        self._were_low: tuple[bool, ...] = (False, False)  # which of the readings

    def step(self, t_ns: int, status: FrontseatStatus | None) -> None:
        """Take in what the autopilot says."""
        found = None if status is None else self._worst(status)
        if found is None and self._low is not None and self._is_missing(status):
            found = self._low
        if found is not None and self._low is not None:
            self._keep_up(t_ns, found)
        if (found is None) == (self._low is None):
            self._turned_ns = None
            return
        if self._turned_ns is None:
            self._turned_ns = t_ns
        if (t_ns - self._turned_ns) * 1e-9 >= self._config.lasts_s:
            self._low, self._turned_ns, self._told_ns = found, None, t_ns

    @property
    def fault(self) -> Explanation | None:
        """Why a hold is to end, and none to begin, where the config asks for that."""
        return self._low if self._config.on_low == "release" else None

    @property
    def notes(self) -> tuple[Note, ...]:
        """That it is low."""
        return () if self._low is None else (Note(subject=SUBJECT, text=describe(self._low), ok=False),)

    def _worst(self, status: FrontseatStatus) -> Explanation | None:
        """What is wrong or low; None where nothing is, or nothing is told.

        What the autopilot finds wrong comes first: a battery on fire may be full.
        """
        limits = self._config.low_percent, self._config.low_v
        low = _is_low(status.battery_percent, limits[0]), _is_low(status.battery_v, limits[1])
        if low == (False, False) and not status.battery_complaint:
            return None
        readings = _readings(status)
        if any(low):
            self._were_low = low
        told = [
            (form.format(value), form.format(least))
            for (value, form), least, is_low in zip(readings, limits, low, strict=True)
            if is_low
        ]
        if status.battery_complaint:
            words = "; ".join([status.battery_complaint, *(reading for reading, _ in told)])
            return explain(Reason.BATTERY_COMPLAINT, complaint=words)
        return explain(Reason.BATTERY_LOW, reading=told[0][0], limit=told[0][1]) if told else None

    def _is_missing(self, status: FrontseatStatus | None) -> bool:
        """Whether a reading that was low is not told any more."""
        if status is None:
            return True
        readings = _readings(status)
        missing = any(was and value is None for was, (value, _) in zip(self._were_low, readings, strict=True))
        if not missing:
            self._were_low = (False, False)
        return missing

    def _keep_up(self, t_ns: int, found: Explanation) -> None:
        """Keep the words up with what is read: another complaint at once, another figure seldom."""
        assert self._low is not None
        is_other = found.reason is not self._low.reason and found.reason is Reason.BATTERY_COMPLAINT
        soon = t_ns - self._told_ns < (SOON_NS if found.reason is Reason.BATTERY_COMPLAINT else TOLD_EVERY_NS)
        if found != self._low and (is_other or not soon):
            self._low, self._told_ns = found, t_ns


def _is_low(value: float | None, least: float | None) -> bool:
    return value is not None and least is not None and value < least


def _readings(status: FrontseatStatus) -> tuple[tuple[float | None, str], tuple[float | None, str]]:
    """Charge and voltage, each with its form in words."""
    return (status.battery_percent, "{:.0f} %"), (status.battery_v, "{:.1f} V")
