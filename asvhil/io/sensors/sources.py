"""Which source each quantity is taken from now: the preferred one that is heard, with fail-over and a calm return."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from operator import attrgetter
from typing import Any, NamedTuple

from asvhil.config import Quantity, SourceConfig
from asvhil.types import (
    ApparentWind,
    BowWind,
    GroundVelocity,
    Heading,
    Measurement,
    Position,
    SpecificForce,
    TrueWind,
    YawRate,
    changed,
    record,
)

NS_PER_S = 1_000_000_000


class QuantityKind(NamedTuple):
    """The quantity that a record is a measurement of, its values, which must be finite, and the most that each can be
    of a boat: what a broken message says beyond that is no reading.
    """

    quantity: Quantity
    values: Callable[[Any], tuple[float, ...]]
    most: float = sys.float_info.max

    def is_valid(self, m: Measurement) -> bool:
        """Whether all values of a measurement can be."""
        for value in self.values(m):  # noqa: SIM110 - each measurement comes here, and a generator costs thrice as much
            if not abs(value) <= self.most:  # infinity and NaN too
                return False
        return True


KINDS: Mapping[type, QuantityKind] = {
    Position: QuantityKind("position", attrgetter("lat_deg", "lon_deg")),
    GroundVelocity: QuantityKind("velocity", attrgetter("vn_mps", "ve_mps"), most=100.0),
    Heading: QuantityKind("heading", lambda m: (m.psi_rad,)),
    YawRate: QuantityKind("yaw_rate", lambda m: (m.r_radps,), most=10.0),
    SpecificForce: QuantityKind("acceleration", attrgetter("ax_mps2", "ay_mps2"), most=200.0),
    ApparentWind: QuantityKind("wind", attrgetter("speed_mps", "from_rad"), most=200.0),
    BowWind: QuantityKind("wind", attrgetter("speed_mps", "from_rad"), most=200.0),
    TrueWind: QuantityKind("wind", attrgetter("vn_mps", "ve_mps"), most=200.0),
}


def quantity_of(m: Measurement) -> Quantity | None:
    """The quantity of which a measurement has a valid value; None for an invalid one, and for what is no sensor's."""
    kind = KINDS.get(type(m))
    return kind.quantity if kind is not None and kind.is_valid(m) else None


@record
class Switch:
    """One quantity has changed its source; `before` is empty where there was none."""

    quantity: Quantity
    before: str
    after: str


class SourceChoice:
    """The sources of one quantity in order of preference, and the one in use.

    A source is alive while its last valid value is no older than its time-out. The one in use is kept until it is no
    longer alive (then the best of those that are takes over at once), or until a preferred one has been alive without
    a break for the return time. At the start a preferred one has its time-out to be heard, and is used at once.
    """

    def __init__(self, sources: tuple[SourceConfig, ...], return_after_s: float) -> None:
        self._names = [source.name for source in sources]
        self._numbers = {name: number for number, name in enumerate(self._names)}
        self._timeouts_ns = [round(source.timeout_s * NS_PER_S) for source in sources]
        self._return_ns = round(return_after_s * NS_PER_S)
        self._until_ns: list[float] = [-math.inf] * len(sources)  # each is alive
        self._alive_since_ns = [0] * len(sources)
        self._using: int | None = None
        self._begun_ns: int | None = None  # when the first of all was heard

    @property
    def alone(self) -> bool:
        """Whether there is nothing to choose."""
        return len(self._names) == 1

    def offer(self, t_ns: int, name: str) -> bool:
        """A valid value has come from a source: whether it is the one in use."""
        number = self._numbers.get(name)
        if number is None:
            return False
        if t_ns > self._until_ns[number]:
            self._alive_since_ns[number] = t_ns
        self._until_ns[number] = t_ns + self._timeouts_ns[number]
        if self._begun_ns is None:
            self._begun_ns = t_ns
        if number == self._using == 0:  # the preferred one, as nearly always
            return True
        self._choose(t_ns)
        return self._using == number

    def current(self, t_ns: int) -> str:
        """The name of the source in use, empty while none is alive."""
        if self._using == 0 and t_ns <= self._until_ns[0]:  # the preferred one, as nearly always
            return self._names[0]
        self._choose(t_ns)
        return "" if self._using is None or t_ns > self._until_ns[self._using] else self._names[self._using]

    def _choose(self, t_ns: int) -> None:
        using = self._using
        lost = using is None or t_ns > self._until_ns[using]
        for number in range(len(self._names) if using is None or lost else using):
            if t_ns <= self._until_ns[number] and (lost or self._may_return(number, t_ns)):
                self._using = number
                return

    def _may_return(self, number: int, t_ns: int) -> bool:
        since_ns = self._alive_since_ns[number]
        never_failed = self._begun_ns is not None and since_ns - self._begun_ns <= self._timeouts_ns[number]
        return never_failed or t_ns - since_ns >= self._return_ns


class SourceSelector:
    """Every measurement passes here: those whose source is not the one in use are left out.

    A pure function of the measurements and of the times in them.
    """

    def __init__(self, sources: Mapping[Quantity, tuple[SourceConfig, ...]], return_after_s: float) -> None:
        self._choices = {quantity: SourceChoice(list_, return_after_s) for quantity, list_ in sources.items()}
        self._open = {quantity: choice for quantity, choice in self._choices.items() if not choice.alone}
        self._shown: dict[Quantity, str] = dict.fromkeys(self._open, "")
        self._places = {
            (quantity, source.name): (round(source.delay_s * NS_PER_S), source.arm_m)
            for quantity, list_ in sources.items()
            for source in list_
            if source.delay_s or any(source.arm_m)
        }

    def select(self, name: str, m: Measurement) -> Measurement | None:
        """A measurement of the source `name` (LINK.MESSAGE), at the time and the place at which it holds.

        None where another source is in use, or the value is not valid. The autopilot's status passes as it is.
        """
        kind = KINDS.get(type(m))
        if kind is None:
            return m
        quantity = kind.quantity
        if not kind.is_valid(m) or not self._choices[quantity].offer(m.t_ns, name):
            return None
        place = self._places.get((quantity, name)) if self._places else None
        return m if place is None else _placed(m, *place)

    def current(self, t_ns: int) -> tuple[tuple[str, str], ...]:
        """The source in use for each quantity, empty where none is heard."""
        return tuple([(quantity, choice.current(t_ns)) for quantity, choice in self._choices.items()])

    def switches(self, t_ns: int) -> list[Switch]:
        """What has changed since the last call, for quantities that have a choice."""
        changed = []
        for quantity, choice in self._open.items():
            name = choice.current(t_ns)
            if name != self._shown[quantity]:
                changed.append(Switch(quantity=quantity, before=self._shown[quantity], after=name))
                self._shown[quantity] = name
        return changed


def _placed(m: Measurement, delay_ns: int, arm_m: tuple[float, float]) -> Measurement:
    """A measurement at the time and the place at which it holds."""
    changes: dict[str, Any] = {"t_ns": m.t_ns - delay_ns}
    if isinstance(m, Position | GroundVelocity | SpecificForce):
        changes["arm_m"] = arm_m
    return changed(m, **changes)
