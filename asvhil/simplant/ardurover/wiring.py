"""A motor of the simulated boat as its builder has wired it: its output, its sense and its neutral."""

from __future__ import annotations

from collections.abc import Sequence

from asvhil.config import PwmConfig
from asvhil.simplant.ardurover.parameters import Parameters


class WiredMotor:
    """On the output that has its function when the boat is built; it goes ahead when that output's throttle does.

    Its speed controller has the output's neutral, and `vehicle.pwm`'s pulses for full ahead and astern: a motor whose
    output is reversed goes ahead by short pulses.
    """

    def __init__(self, parameters: Parameters, pwm: PwmConfig, function: int, default: int) -> None:
        """`default`: the output where none has the function."""
        functions = parameters.functions
        self.output = functions.index(function) + 1 if function in functions else default
        self._pwm = pwm
        self._reversed = parameters[f"SERVO{self.output}_REVERSED"] != 0.0
        self._neutral_us = parameters[f"SERVO{self.output}_TRIM"]

    def plain_us(self, servo_us: Sequence[int]) -> int:
        """What a motor that is not reversed, with `vehicle.pwm`'s neutral, would get to do the same; 0: no signal."""
        pulse_us, pwm = servo_us[self.output - 1], self._pwm
        if pulse_us == 0:
            return 0
        above_us, below_us = pwm.ahead_us - self._neutral_us, self._neutral_us - pwm.astern_us
        offset_us = pulse_us - self._neutral_us
        share = offset_us / above_us if offset_us > 0.0 else offset_us / below_us
        if self._reversed:
            share = -share
        span_us = pwm.ahead_us - pwm.neutral_us if share > 0.0 else pwm.neutral_us - pwm.astern_us
        return round(pwm.neutral_us + share * span_us)
