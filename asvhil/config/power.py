"""What the boat takes from its battery."""

from __future__ import annotations

from bisect import bisect_right
from itertools import pairwise

from pydantic import Field, model_validator

from asvhil.config.base import NonNegative, Positive, Section


class PowerConfig(Section):
    """What the boat takes from its battery: with it a hold tells its energy (Wh), and the hours that are left.

    Where the autopilot measures the batteries' current (BATTERY_STATUS, or SYS_STATUS), that counts and the curve does
    not; `power: {}` is then enough for the energy, and `capacity_wh` for the hours.
    """

    power_curve: tuple[tuple[float, float], ...] | None = Field(
        default=None,
        description=(
            "Electrical power of one motor: rows of [command in -1..1, power in W], commands rising, power never "
            "falling away from 0; interpolated linearly. null: only what the autopilot measures is known."
        ),
    )
    hotel_w: NonNegative = Field(
        default=0.0, description="What all but the motors takes from the same battery: computers, sensors, radios."
    )
    capacity_wh: Positive | None = Field(
        default=None,
        description=(
            "Usable energy of the full battery, of several in all. null: unknown, and the hours left are not told."
        ),
    )

    @model_validator(mode="after")
    def _check_curve(self) -> PowerConfig:
        if self.power_curve is None:
            return self
        commands = [row[0] for row in self.power_curve]
        if len(commands) < 2 or any(b <= a for a, b in pairwise(commands)):
            raise ValueError("power_curve needs at least 2 rows with rising commands")
        if not -1.0 <= commands[0] < 0.0 < commands[-1] <= 1.0:
            raise ValueError("power_curve must lie in commands -1..1 and reach both astern and ahead")
        if any(row[1] < 0.0 for row in self.power_curve):
            raise ValueError("power_curve: power must not be negative")
        ahead = [watts for command, watts in self.power_curve if command >= 0.0]
        astern = [watts for command, watts in reversed(self.power_curve) if command <= 0.0]
        if any(b < a for side in (ahead, astern) for a, b in pairwise(side)):
            raise ValueError("power_curve: power must not fall as the command goes away from 0, ahead or astern")
        return self

    def drawn_w(self, commands: tuple[float, float]) -> float | None:
        """Power of the boat (W) at both motors' commands in [-1, 1]; None without a curve."""
        if self.power_curve is None:
            return None
        port, starboard = commands
        return self.hotel_w + _interpolated(self.power_curve, port) + _interpolated(self.power_curve, starboard)


def _interpolated(curve: tuple[tuple[float, float], ...], command: float) -> float:
    """Constant beyond the ends of the curve."""
    i = bisect_right(curve, command, key=lambda row: row[0])
    if i == 0 or i == len(curve):
        return curve[max(i - 1, 0)][1]
    (x0, y0), (x1, y1) = curve[i - 1], curve[i]
    return y0 + (y1 - y0) * (command - x0) / (x1 - x0)
