"""Motor commands to pulse widths, with the limits that are applied last before sending."""

from __future__ import annotations

import math
from typing import Protocol

from asvhil.config import PwmConfig


def pulse_of_command(config: PwmConfig, command: float) -> int:
    """Pulse width (us) of a command; out of [-command_max, command_max] it is clamped, NaN is neutral."""
    if not math.isfinite(command):
        return config.neutral_us
    span_us = config.ahead_us - config.neutral_us if command > 0.0 else config.neutral_us - config.astern_us
    # Clamped before the product: a huge command overflows to infinity, which has no integer.
    most = config.command_max
    pulse = round(config.neutral_us + span_us * min(max(command, -most), most))
    return min(max(pulse, config.astern_us), config.ahead_us)


def command_of_pulse(config: PwmConfig, pulse_us: int) -> float:
    """Command in [-1, 1] that a pulse width means; 0 us (no signal) is neutral."""
    if pulse_us == 0:
        return 0.0
    offset_us = pulse_us - config.neutral_us
    span_us = config.ahead_us - config.neutral_us if offset_us > 0 else config.neutral_us - config.astern_us
    return min(max(offset_us / span_us, -1.0), 1.0)


class Limiter(Protocol):
    """What makes the pulses of both motors of a command."""

    def reset(self) -> None:
        """Note that the motors are released."""
        ...

    def neutral(self) -> tuple[int, int]:
        """Neutral for both motors (us), at once."""
        ...

    def step(self, t_ns: int, command: tuple[float, float]) -> tuple[int, int]:
        """Pulse widths (us; port, starboard) for a command in [-1, 1]."""
        ...


class PulseLimiter:
    """Limits range and slew rate of both motors, and has each pause before it turns the other way.

    Changes towards neutral are never slowed down.
    """

    def __init__(self, config: PwmConfig) -> None:
        self._config = config
        self._last_us = self._wanted_us = (config.neutral_us, config.neutral_us)
        self._command = (0.0, 0.0)  # that `_wanted_us` are the pulses of
        self._t_ns: int | None = None
        self._spare_us = 0.0  # less than a microsecond of change that a tick before left over
        self._pauses = _ReversalPause(config), _ReversalPause(config)

    def reset(self) -> None:
        """Start from neutral at the next step, after the motors were released."""
        self._last_us = (self._config.neutral_us, self._config.neutral_us)
        self._t_ns, self._spare_us = None, 0.0
        for pause in self._pauses:
            pause.stop()

    def neutral(self) -> tuple[int, int]:
        """Neutral for both motors (us), at once."""
        self.reset()
        return self._last_us

    def step(self, t_ns: int, command: tuple[float, float]) -> tuple[int, int]:
        """Pulse widths (port, starboard) for a command, moved from the last ones no faster than the slew rate."""
        reach_us = self._reach_us(t_ns)
        if command != self._command:  # a command holds for several ticks
            port, starboard = command
            self._wanted_us = pulse_of_command(self._config, port), pulse_of_command(self._config, starboard)
            self._command = command
        (port_us, starboard_us), (port_pause, starboard_pause) = self._last_us, self._pauses
        self._last_us = (
            port_pause.step(t_ns, self._approach(port_us, self._wanted_us[0], reach_us)),
            starboard_pause.step(t_ns, self._approach(starboard_us, self._wanted_us[1], reach_us)),
        )
        return self._last_us

    def _reach_us(self, t_ns: int) -> int:
        """How far a pulse may move in this tick: whole microseconds, whose rate over many ticks is the slew rate."""
        if self._t_ns is None:
            self._t_ns = t_ns
            return 1  # from now on it is known how long a tick takes
        elapsed_s = min((t_ns - self._t_ns) * 1e-9, 1.0)
        may_us = self._config.slew_us_per_s * elapsed_s + self._spare_us
        reach_us = math.floor(may_us + 1e-6)  # 400 is as much as 399.9999999
        self._t_ns, self._spare_us = t_ns, max(0.0, may_us - reach_us)
        return reach_us

    def _approach(self, last_us: int, wanted_us: int, reach_us: int) -> int:
        neutral_us = self._config.neutral_us
        wanted, last = wanted_us - neutral_us, last_us - neutral_us
        if wanted * last >= 0 and abs(wanted) <= abs(last):
            return wanted_us  # towards neutral
        start_us = neutral_us if wanted * last < 0 else last_us
        return min(max(wanted_us, start_us - reach_us), start_us + reach_us)


class _ReversalPause:
    """Keeps one motor at neutral for `reversal_pause_s` before it turns the other way."""

    def __init__(self, config: PwmConfig) -> None:
        self._neutral_us, self._pause_ns = config.neutral_us, round(config.reversal_pause_s * 1e9)
        self._side = 0  # to which it turned last: 1 ahead, -1 astern, 0 not yet
        self._stopped_ns: int | None = None

    def stop(self) -> None:
        """Note that it has been told to stop at a time that is not known: the pause counts from the next step."""
        self._stopped_ns = None

    def step(self, t_ns: int, pulse_us: int) -> int:
        """The pulse, or neutral as long as it would turn the motor the other way too soon."""
        side = (pulse_us > self._neutral_us) - (pulse_us < self._neutral_us)
        if side == 0 or side == -self._side:
            if self._stopped_ns is None:
                self._stopped_ns = t_ns
            if side == 0 or t_ns - self._stopped_ns < self._pause_ns:
                return self._neutral_us
        self._side, self._stopped_ns = side, None
        return pulse_us
