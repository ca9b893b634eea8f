"""A motor of the simulated boat as its builder has wired it: its output, its sense and its neutral."""

from __future__ import annotations

from collections.abc import Sequence

from asvhil.config import MotorOutputConfig, PwmConfig


class WiredMotor:
    """On one output, whatever the autopilot makes of that output later.

    Its speed controller has `vehicle.pwm`'s pulses for full ahead and astern, exchanged where the motor is reversed,
    and a neutral of its own. All of the simulated boat counts in the pulses of a plain motor.
    """

    def __init__(self, pwm: PwmConfig, output: int, *, neutral_us: float, reversed: bool) -> None:
        self.output = output
        self._reversed = reversed
        self._neutral_us = neutral_us
        self._above_us, self._below_us = max(pwm.ahead_us - neutral_us, 1.0), max(neutral_us - pwm.astern_us, 1.0)
        self._plain_neutral_us = pwm.neutral_us
        self._plain_above_us, self._plain_below_us = pwm.ahead_us - pwm.neutral_us, pwm.neutral_us - pwm.astern_us

    @classmethod
    def of_config(cls, pwm: PwmConfig, config: MotorOutputConfig, output: int) -> WiredMotor:
        """As the config of the boat says."""
        neutral_us = pwm.neutral_us if config.neutral_us is None else config.neutral_us
        return cls(pwm, output, neutral_us=neutral_us, reversed=bool(config.reversed))

    def plain_us(self, servo_us: Sequence[int]) -> int:
        """What a motor that is not reversed, with `vehicle.pwm`'s neutral, would get to do the same; 0: no signal."""
        pulse_us = servo_us[self.output - 1]
        if pulse_us == 0:
            return 0
        offset_us = pulse_us - self._neutral_us
        share = offset_us / (self._above_us if offset_us > 0.0 else self._below_us)
        if self._reversed:
            share = -share
        return round(self._plain_neutral_us + share * (self._plain_above_us if share > 0.0 else self._plain_below_us))


def wired_motors(pwm: PwmConfig) -> tuple[WiredMotor, WiredMotor]:
    """Port and starboard, of a boat that is wired as its config says."""
    port, starboard = pwm.outputs
    return WiredMotor.of_config(pwm, pwm.port, port), WiredMotor.of_config(pwm, pwm.starboard, starboard)
