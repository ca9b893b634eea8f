"""Which source each quantity is taken from now: the preferred one that is heard, with fail-over and a calm return."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from asvhil.config import Quantity, SourceConfig
from asvhil.types import Attitude, BowWind, GnssFix, Imu, Measurement, TrueWind, UtcTime, WindSample, record

NS_PER_S = 1_000_000_000


@record
class Switch:
    """One quantity has changed its source; `before` is empty where there was none."""

    quantity: Quantity
    before: str
    after: str


class Choice:
    """The sources of one quantity in order of preference, and the one in use.

    A source is alive while its last valid value is no older than its time-out. The one in use is kept until it is no
    longer alive (then the best of those that are takes over at once), or until a preferred one has been alive without
    a break for the return time.
    """

    def __init__(self, sources: tuple[SourceConfig, ...], return_after_s: float) -> None:
        self._names = [source.name for source in sources]
        self._timeouts_ns = [round(source.timeout_s * NS_PER_S) for source in sources]
        self._return_ns = round(return_after_s * NS_PER_S)
        self._heard_ns: list[int | None] = [None] * len(sources)
        self._alive_since_ns = [0] * len(sources)
        self._using: int | None = None

    @property
    def alone(self) -> bool:
        """Whether there is nothing to choose."""
        return len(self._names) == 1

    def offer(self, t_ns: int, name: str) -> bool:
        """A valid value has come from a source: whether it is the one in use."""
        if name not in self._names:
            return False
        number = self._names.index(name)
        if not self._alive(number, t_ns):
            self._alive_since_ns[number] = t_ns
        self._heard_ns[number] = t_ns
        self._choose(t_ns)
        return self._using == number

    def current(self, t_ns: int) -> str:
        """The name of the source in use, empty while none is alive."""
        self._choose(t_ns)
        return "" if self._using is None or not self._alive(self._using, t_ns) else self._names[self._using]

    def _alive(self, number: int, t_ns: int) -> bool:
        heard_ns = self._heard_ns[number]
        return heard_ns is not None and t_ns - heard_ns <= self._timeouts_ns[number]

    def _choose(self, t_ns: int) -> None:
        using = self._using
        lost = using is None or not self._alive(using, t_ns)
        for number in range(len(self._names) if using is None or lost else using):
            if self._alive(number, t_ns) and (lost or t_ns - self._alive_since_ns[number] >= self._return_ns):
                self._using = number
                return


class SourceSelector:
    """Every measurement passes here: parts of it whose source is not the one in use are taken out.

    A pure function of the measurements and of the times in them. What passes whole is the same object as came in.
    """

    def __init__(self, sources: Mapping[Quantity, tuple[SourceConfig, ...]], return_after_s: float) -> None:
        self._choices = {quantity: Choice(list_, return_after_s) for quantity, list_ in sources.items()}
        self._shown: dict[Quantity, str] = dict.fromkeys(self._choices, "")
        self._places = {
            (quantity, source.name): (round(source.delay_s * NS_PER_S), source.arm_m)
            for quantity, list_ in sources.items()
            for source in list_
            if source.delay_s or any(source.arm_m)
        }

    def select(self, link: str, message: str, m: Measurement) -> list[Measurement]:
        """What is left of a measurement from a message of a link; what is no sensor's passes."""
        name = f"{link}.{message}"
        match m:
            case GnssFix():
                return self._fix(name, m)
            case Attitude():
                return self._attitude(name, m)
            case Imu():
                return self._imu(name, m)
            case WindSample() | BowWind() | TrueWind():
                return [self._placed("wind", name, m)] if self._offer("wind", m.t_ns, name) else []
            case UtcTime():
                return []
            case _:
                return [m]

    def current(self, t_ns: int) -> tuple[tuple[str, str], ...]:
        """The source in use for each quantity, empty where none is heard."""
        return tuple((quantity, choice.current(t_ns)) for quantity, choice in self._choices.items())

    def switches(self, t_ns: int) -> list[Switch]:
        """What has changed since the last call, for quantities that have a choice."""
        changed = []
        for quantity, choice in self._choices.items():
            name = choice.current(t_ns)
            if not choice.alone and name != self._shown[quantity]:
                changed.append(Switch(quantity=quantity, before=self._shown[quantity], after=name))
                self._shown[quantity] = name
        return changed

    def _offer(self, quantity: Quantity, t_ns: int, name: str, *values: float) -> bool:
        """Whether these values, if they are numbers, are those in use."""
        return all(math.isfinite(value) for value in values) and self._choices[quantity].offer(t_ns, name)

    def _placed(self, quantity: Quantity, name: str, m: Measurement) -> Measurement:
        """A measurement at the time and the place at which it holds."""
        place = self._places.get((quantity, name))
        if place is None:
            return m
        delay_ns, arm_m = place
        changes: dict[str, Any] = {"t_ns": m.t_ns - delay_ns}
        if isinstance(m, GnssFix | Imu):
            changes["arm_m"] = arm_m
        return dataclasses.replace(m, **changes)

    def _fix(self, name: str, m: GnssFix) -> list[Measurement]:
        position = self._offer("position", m.t_ns, name, m.lat_deg, m.lon_deg)
        velocity = self._offer("velocity", m.t_ns, name, m.vn_mps, m.ve_mps)
        if not (position or velocity):
            return []
        if not position and math.isfinite(m.lat_deg):
            m = dataclasses.replace(m, lat_deg=math.nan, lon_deg=math.nan)
        if not velocity and math.isfinite(m.vn_mps):
            m = dataclasses.replace(m, vn_mps=math.nan, ve_mps=math.nan)
        return [self._placed("position" if position else "velocity", name, m)]

    def _attitude(self, name: str, m: Attitude) -> list[Measurement]:
        heading = self._offer("heading", m.t_ns, name, m.psi_rad)
        rate = self._offer("yaw_rate", m.t_ns, name, m.r_radps)
        if not (heading or rate):
            return []
        if not heading and math.isfinite(m.psi_rad):
            m = dataclasses.replace(m, psi_rad=math.nan)
        if not rate and math.isfinite(m.r_radps):
            m = dataclasses.replace(m, r_radps=math.nan)
        return [self._placed("heading" if heading else "yaw_rate", name, m)]

    def _imu(self, name: str, m: Imu) -> list[Measurement]:
        """Specific force as it is; a yaw rate that is in use goes on as an attitude without heading."""
        found: list[Measurement] = []
        if self._offer("yaw_rate", m.t_ns, name, m.r_radps):
            rate = Attitude(t_ns=m.t_ns, psi_rad=math.nan, r_radps=m.r_radps)
            found.append(self._placed("yaw_rate", name, rate))
        if self._offer("acceleration", m.t_ns, name, m.ax_mps2, m.ay_mps2):
            found.append(self._placed("acceleration", name, m))
        return found
