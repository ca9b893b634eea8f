"""What the motors may be told, as the MPC knows it; `PulseLimiter` enforces the same last before sending."""

from __future__ import annotations

import math

from asvhil.config import PwmConfig
from asvhil.types import record


@record
class MotorLimits:
    """Limits of a motor command in [-1, 1].

    `rate_per_s`: how fast it may grow away from neutral, in commands (1: full) per second. `command_max`: its largest
    magnitude. `reversal_pause_s`: the time at neutral before it changes its sign.
    """

    rate_per_s: float = math.inf
    command_max: float = 1.0
    reversal_pause_s: float = 0.0

    @classmethod
    def of_pwm(cls, config: PwmConfig) -> MotorLimits:
        """The limits of a config; the rate is that of the side with the longer span of pulses, which is slower."""
        span_us = max(config.ahead_us - config.neutral_us, config.neutral_us - config.astern_us)
        return cls(
            rate_per_s=config.slew_us_per_s / span_us,
            command_max=config.command_max,
            reversal_pause_s=config.reversal_pause_s,
        )


UNLIMITED = MotorLimits()
