"""Motors of the simulated boat that fall short of their thrust curve: unequal, slow to reverse, on a tired battery."""

from __future__ import annotations

import math

from asvhil.config import PlantMotorsConfig

LEAST_SHARE = 0.2  # of the thrust that a drained battery leaves


class ImperfectMotors:
    """Steady thrusts of the curve to those that the motors are driven to, step by step."""

    __slots__ = ("_age_s", "_config", "_dead_s", "_full_n", "_shares", "_turn")

    def __init__(self, config: PlantMotorsConfig, full_n: float) -> None:
        """`full_n` is the thrust of one motor at full ahead by the curve (N)."""
        self._config, self._full_n = config, full_n
        self._shares = config.port_thrust, config.starboard_thrust
        self._turn = [0.0, 0.0]  # the way that each motor last turned
        self._dead_s = [0.0, 0.0]  # time that is left until it turns the other way
        self._age_s = 0.0

    def demands_n(
        self, steady_n: tuple[float, float], thrusts_n: tuple[float, float], step_s: float
    ) -> tuple[float, float]:
        """What (port, starboard) strive for over the next step, at their present thrusts."""
        self._age_s += step_s
        config = self._config
        load = min(1.0, 0.5 * (abs(thrusts_n[0]) + abs(thrusts_n[1])) / self._full_n)
        left = 1.0 - config.sag_at_full_thrust * load - config.sag_per_hour * self._age_s / 3600.0
        left = max(left, LEAST_SHARE)
        port, starboard = (
            left * share * self._turning(side, thrust_n, step_s)
            for side, (share, thrust_n) in enumerate(zip(self._shares, steady_n, strict=True))
        )
        return port, starboard

    def _turning(self, side: int, thrust_n: float, step_s: float) -> float:
        """Nothing while a motor waits to turn the other way. At neutral it keeps the way that it last turned."""
        if thrust_n == 0.0:
            self._dead_s[side] = max(0.0, self._dead_s[side] - step_s)
            return 0.0
        way = math.copysign(1.0, thrust_n)
        if way == -self._turn[side]:
            self._dead_s[side] = self._config.reversal_dead_time_s
        self._turn[side] = way
        if self._dead_s[side] <= 0.0:
            return thrust_n
        self._dead_s[side] -= step_s
        return 0.0
