"""Surge force and yaw moment to the thrusts of two fixed motors, and these to commands by the known thrust curve."""

from __future__ import annotations

from asvhil.dynamics.rigid_body import ThrustCurve
from asvhil.types import record


@record
class Allocation:
    """Result of an allocation: commands in [-1, 1], thrusts (N), and the surge force and yaw moment that they produce.

    `saturated`: the force or the moment is not the one that was asked for.
    """

    command: tuple[float, float]  # port, starboard
    thrust_n: tuple[float, float]
    surge_n: float
    yaw_nm: float
    saturated: bool


class Allocator:
    """Splits (X, N) over two motors at arms of +-`arm_m`: X = T_p + T_s, N = arm (T_p - T_s).

    If both cannot be reached, the yaw moment has priority: the difference of the thrusts is kept as far as the range of
    the motors allows, and the sum is moved to the nearest value that leaves both motors within their bounds.
    """

    def __init__(self, curve: ThrustCurve, arm_m: float) -> None:
        self._curve, self._arm_m = curve, arm_m

    def allocate(self, surge_n: float, yaw_nm: float) -> Allocation:
        """Commands for a surge force (N) and a yaw moment (N m), both finite."""
        low_n, high_n = self._curve.astern_n, self._curve.ahead_n
        reach_n = 0.5 * (high_n - low_n)
        half_n = min(max(0.5 * yaw_nm / self._arm_m, -reach_n), reach_n)
        mean_n = min(max(0.5 * surge_n, low_n + abs(half_n)), high_n - abs(half_n))
        port_n, starboard_n = mean_n + half_n, mean_n - half_n
        got_surge_n, got_yaw_nm = 2.0 * mean_n, 2.0 * half_n * self._arm_m
        return Allocation(
            command=(self._curve.command(port_n), self._curve.command(starboard_n)),
            thrust_n=(port_n, starboard_n),
            surge_n=got_surge_n,
            yaw_nm=got_yaw_nm,
            saturated=abs(got_surge_n - surge_n) > 1e-6 or abs(got_yaw_nm - yaw_nm) > 1e-6,
        )
