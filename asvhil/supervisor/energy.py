"""The energy of the boat: Wh of a hold, mean power, hours left. Sans-IO.

The power of each tick counts until the next one. It is what the autopilot measures, voltage times current, or else what
the power curve gives for the pulses of both motors, with the rest of the boat.
"""

from __future__ import annotations

from collections.abc import Callable

from asvhil.config import PowerConfig
from asvhil.types import EnergyUse, FrontseatStatus

MEAN_S = 180.0  # time constant of the mean power
LEAST_S = 10.0  # of known power, before there is a mean
STALE_NS = 5_000_000_000  # what the autopilot told so long ago says nothing of now
BLIND_S = 60.0  # of unknown power, after which a sum of energy is no longer told
MEASURED, CURVE = "measured", "curve"


class _Sum:
    """Energy (Wh) since its begin; None before any power was known, and where too much of it was not."""

    def __init__(self) -> None:
        self._joule: float | None = None
        self._blind_s = 0.0

    def add(self, elapsed_s: float, power_w: float | None) -> None:
        if power_w is not None:
            self._joule = (self._joule or 0.0) + power_w * elapsed_s
        elif self._joule is not None:
            self._blind_s += elapsed_s

    @property
    def wh(self) -> float | None:
        return None if self._joule is None or self._blind_s > BLIND_S else self._joule / 3600.0


class EnergyWatch:
    """`step` in each tick. `command_of` gives the command in [-1, 1] that a pulse width (us) of a motor means.

    The mean power begins anew with each hold and after it: the way that a boat is driven there says nothing of it.
    """

    def __init__(self, power: PowerConfig, command_of: Callable[[int], float]) -> None:
        self._power = power
        self._command_of = command_of
        self._t_ns: int | None = None
        self._power_w: float | None = None  # from the last tick on
        self._by = ""
        self._since_start = _Sum()
        self._before_wh = 0.0  # what had been used before, by what the autopilot counts
        self._of_hold: _Sum | None = None
        self._curve: tuple[tuple[int, int], float | None] | None = None  # the last pulses with the power for them
        self._forget()

    def _forget(self) -> None:
        self._mean_w = self._weight_s = self._known_s = 0.0

    def step(
        self, t_ns: int, status: FrontseatStatus | None, pulses_us: tuple[int, int] | None, *, held: bool
    ) -> EnergyUse:
        """What is known at the end of a tick, which sent these pulses to the motors (None: they are not ours)."""
        self._count(0.0 if self._t_ns is None else (t_ns - self._t_ns) * 1e-9)
        self._t_ns = t_ns
        if held is (self._of_hold is None):
            self._of_hold = _Sum() if held else None
            self._forget()
        self._power_w, self._by = self._drawn(t_ns, status, pulses_us)
        used_wh = self._used_wh(status)
        mean_w = self._mean_w if self._known_s >= LEAST_S else None
        return EnergyUse(
            hold_wh=None if self._of_hold is None else self._of_hold.wh,
            power_w=self._power_w,
            mean_w=mean_w,
            hours_left=self._hours_left(status, mean_w, used_wh),
            by=self._by,
        )

    def _count(self, elapsed_s: float) -> None:
        """Until now the power was that of the last tick."""
        power_w = self._power_w
        self._since_start.add(elapsed_s, power_w)
        if self._of_hold is not None:
            self._of_hold.add(elapsed_s, power_w)
        if power_w is None or elapsed_s <= 0.0:
            return
        self._known_s += elapsed_s
        self._weight_s = max(0.0, 1.0 - elapsed_s / MEAN_S) * self._weight_s + elapsed_s
        self._mean_w += elapsed_s / self._weight_s * (power_w - self._mean_w)

    def _drawn(
        self, t_ns: int, status: FrontseatStatus | None, pulses_us: tuple[int, int] | None
    ) -> tuple[float | None, str]:
        """Power (W) from now on, and by what it is known; None where it is not."""
        if status is not None:
            measured_w = _measured_w(t_ns, status)
            if measured_w is not None:
                return measured_w, MEASURED
            if pulses_us is None and t_ns - status.outputs_ns < STALE_NS:
                pulses_us = status.motors_us  # somebody else's
        if pulses_us is None:
            return None, ""
        if self._curve is None or self._curve[0] != pulses_us:
            commands = self._command_of(pulses_us[0]), self._command_of(pulses_us[1])
            self._curve = pulses_us, self._power.drawn_w(commands)
        power_w = self._curve[1]
        return power_w, "" if power_w is None else CURVE

    def _used_wh(self, status: FrontseatStatus | None) -> float | None:
        """Since the autopilot's start, where it counts; else since ours. An autopilot that reboots counts from 0."""
        told_wh = None if status is None or status.batteries is None else status.batteries.used_wh
        since_wh = self._since_start.wh
        if told_wh is not None:
            self._before_wh = max(self._before_wh, told_wh - (since_wh or 0.0))
            since_wh = since_wh or 0.0
        return None if since_wh is None else since_wh + self._before_wh

    def _hours_left(self, status: FrontseatStatus | None, mean_w: float | None, used_wh: float | None) -> float | None:
        """By the charge that the autopilot tells, or by what a full battery has given."""
        capacity_wh = self._power.capacity_wh
        if capacity_wh is None or mean_w is None or mean_w <= 0.0:  # it is charged by as much, or more
            return None
        percent = None if status is None else status.battery_percent
        if percent is not None:
            return 0.01 * percent * capacity_wh / mean_w
        return None if used_wh is None else max(0.0, capacity_wh - used_wh) / mean_w


def _measured_w(t_ns: int, status: FrontseatStatus) -> float | None:
    """What the autopilot measures, of all its batteries; by SYS_STATUS where that tells of no less than all."""
    told = status.batteries
    if told is not None and t_ns - told.t_ns < STALE_NS:
        return told.power_w
    volts, amperes = status.battery_v, status.battery_a
    alone = told is None or told.number == 1
    if not alone or volts is None or amperes is None or t_ns - status.battery_ns >= STALE_NS:
        return None
    return volts * amperes
