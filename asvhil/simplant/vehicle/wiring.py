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
        self._pwm = pwm
        self._reversed = reversed
        self._neutral_us = neutral_us

    @classmethod
    def of_config(cls, pwm: PwmConfig, config: MotorOutputConfig, output: int) -> WiredMotor:
        """As the config of the boat says."""
        neutral_us = pwm.neutral_us if config.neutral_us is None else config.neutral_us
        return cls(pwm, output, neutral_us=neutral_us, reversed=bool(config.reversed))

    def plain_us(self, servo_us: Sequence[int]) -> int:
        """What a motor that is not reversed, with `vehicle.pwm`'s neutral, would get to do the same; 0: no signal."""
        pulse_us, pwm = servo_us[self.output - 1], self._pwm
        if pulse_us == 0:
            return 0
        above_us, below_us = (
            max(span_us, 1.0) for span_us in (pwm.ahead_us - self._neutral_us, self._neutral_us - pwm.astern_us)
        )
        offset_us = pulse_us - self._neutral_us
        share = offset_us / above_us if offset_us > 0.0 else offset_us / below_us
        if self._reversed:
            share = -share
        span_us = pwm.ahead_us - pwm.neutral_us if share > 0.0 else pwm.neutral_us - pwm.astern_us
        return round(pwm.neutral_us + share * span_us)


def wired_motors(pwm: PwmConfig) -> tuple[WiredMotor, WiredMotor]:
    """Port and starboard, of a boat that is wired as its config says."""
    port, starboard = pwm.outputs
    return WiredMotor.of_config(pwm, pwm.port, port), WiredMotor.of_config(pwm, pwm.starboard, starboard)
