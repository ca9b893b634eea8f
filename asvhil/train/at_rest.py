"""A model where a station is kept: the rates of a boat at rest with its motors off, in still air and in wind. No torch.

Rollouts over manoeuvres hardly see this state, in which a controller that keeps a station spends its time.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from asvhil.config import VesselConfig
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.protocol import Dynamics
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.types import record

SPEEDS_MPS = (1.0, 3.0, 6.0, 10.0)
SIDES = {  # where the wind comes from, as the direction that the air moves toward in body axes (deg from the bow)
    "bow": 180.0,
    "starboard bow": -135.0,
    "starboard": -90.0,
    "starboard quarter": -45.0,
    "stern": 0.0,
    "port quarter": 45.0,
    "port": 90.0,
    "port bow": 135.0,
}
SQUARE = ("bow", "starboard", "stern", "port")  # the winds that the bounds hold for
LEAST = np.array([0.01, 0.01, 0.003])  # m/s^2, m/s^2, rad/s^2: an error of a rate that no controller feels
SHARE = 0.15  # of the true rate, where that is more
FALL_MPS2 = 2e-3  # of the load along the wind as the wind rises: less than the load of 1 m/s
COMMANDS = np.linspace(-1.0, 1.0, 41)


@record
class Load:
    """The rates (u_dot, v_dot, r_dot) of one wind, and by the reference; `error` over the bound, 1 being just right."""

    side: str
    speed_mps: float
    rates: tuple[float, float, float]
    reference: tuple[float, float, float] | None
    error: float | None

    @property
    def right(self) -> bool:
        """Whether its error is within the bound; so is one without a reference."""
        return self.error is None or self.error <= 1.0


@record
class AtRest:
    """The check of one model. `still`: its rates in still air."""

    still: tuple[float, float, float]
    loads: tuple[Load, ...]
    fall_mps2: float
    thrust_dip_mps2: float

    @property
    def stays(self) -> bool:
        """Whether a boat at rest in still air stays there, within the bounds."""
        return bool((np.abs(self.still) <= LEAST).all())

    @property
    def rising(self) -> bool:
        """Whether more wind is nowhere less load."""
        return self.fall_mps2 <= FALL_MPS2

    @property
    def worst(self) -> Load | None:
        """The wind with the largest error of those on bow, beams and stern; None without a reference."""
        known = [load for load in self.loads if load.error is not None and load.side in SQUARE]
        return max(known, key=lambda load: load.error or 0.0, default=None)

    @property
    def right(self) -> bool:
        """Whether all that can be checked is within its bounds."""
        return self.stays and self.rising and (self.worst is None or self.worst.right)

    def verdict(self) -> str:
        """The check in one line."""
        u, v, r = self.still
        words = [f"still air {u:.4f} {v:.4f} m/s2, {r:.4f} rad/s2{'' if self.stays else ' (wrong)'}"]
        if self.worst is not None:
            words.append(
                f"worst of the winds on bow, beams and stern {self.worst.speed_mps:g} m/s on the {self.worst.side}: "
                f"{self.worst.error:.2f} of the bound{'' if self.worst.right else ' (wrong)'}"
            )
        words.append("load rises with the wind" if self.rising else f"load falls by {self.fall_mps2:.4f} m/s2 (wrong)")
        words.append(f"thrust dip {self.thrust_dip_mps2:.4f} m/s2")
        return "at rest: " + "; ".join(words)

    def figures(self) -> dict[str, Any]:
        """All of it for JSON."""
        return {
            "still_air": _rounded(self.still),
            "stays": self.stays,
            "rising": self.rising,
            "right": self.right,
            "fall_mps2": round(self.fall_mps2, 6),
            "thrust_dip_mps2": round(self.thrust_dip_mps2, 6),
            "winds": [
                {
                    "from": load.side,
                    "speed_mps": load.speed_mps,
                    "rates": _rounded(load.rates),
                    "reference": None if load.reference is None else _rounded(load.reference),
                    "error": None if load.error is None else round(load.error, 3),
                }
                for load in self.loads
            ],
        }


def at_rest(model: Dynamics, half_wind: Array, vessel: VesselConfig | None = None) -> AtRest:
    """The check of a model whose training winds reach `half_wind` (2, m/s); beside the equations of a vessel.

    Winds on the sides of SIDES by SPEEDS_MPS. The fall of the load is looked for within the winds that were trained,
    as nothing is known of the others.
    """
    reference = None if vessel is None else SimplifiedDynamics(vessel)
    loads = []
    for side in SIDES:
        for speed_mps in SPEEDS_MPS:
            rates = rates_at_rest(model, wind_of(side, speed_mps))
            true = None if reference is None else rates_at_rest(reference, wind_of(side, speed_mps))
            error = None if true is None else float((np.abs(rates - true) / bound(true)).max())
            loads.append(
                Load(
                    side=side,
                    speed_mps=speed_mps,
                    rates=_triple(rates),
                    reference=None if true is None else _triple(true),
                    error=error,
                )
            )
    return AtRest(
        still=_triple(rates_at_rest(model, np.zeros(2))),
        loads=tuple(loads),
        fall_mps2=load_fall(model, half_wind),
        thrust_dip_mps2=thrust_dip(model, half_wind),
    )


def bound(true: Array) -> Array:
    """The largest error (3) that is right beside true rates."""
    limit: Array = np.maximum(SHARE * np.abs(true), LEAST)
    return limit


def wind_of(side: str, speed_mps: float) -> Array:
    """The true wind in body axes (2, m/s) that comes from a side."""
    toward = math.radians(SIDES[side])
    return speed_mps * np.array([math.cos(toward), math.sin(toward)])


def rates_at_rest(model: Dynamics, wind: Array, command: tuple[float, float] = (0.0, 0.0)) -> Array:
    """(u_dot, v_dot, r_dot) of a boat at rest whose motors have followed a command, in a wind (2, m/s)."""
    a = np.array(model.input_of_command(command))
    rates: Array = np.asarray(model.derivative(np.concatenate([np.zeros(3), a[: model.n_motor]]), a, wind))[:3]
    return rates


def load_fall(model: Dynamics, half_wind: Array) -> float:
    """The largest decrease (m/s^2) of the load along the wind as it rises from 0, on bow, beams and stern."""
    worst = 0.0
    for side in SQUARE:
        toward = wind_of(side, 1.0)
        reach = min(float(np.abs(toward) @ half_wind), SPEEDS_MPS[-1])
        along = [rates_at_rest(model, speed * toward)[:2] @ toward for speed in np.linspace(0.0, reach, 21)]
        worst = max(worst, _fall(along))
    return worst


def thrust_dip(model: Dynamics, half_wind: Array) -> float:
    """The largest decrease (m/s^2) of the surge acceleration of a boat at rest, as both commands rise from -1 to 1.

    The worst of still air and of half the trained range of wind from four sides.
    """
    u, v = (0.5 * half_wind).tolist()
    winds = ((0.0, 0.0), (u, 0.0), (-u, 0.0), (0.0, v), (0.0, -v))
    return max(_fall([rates_at_rest(model, np.array(wind), (c, c))[0] for c in COMMANDS.tolist()]) for wind in winds)


def _fall(values: list[Any]) -> float:
    return float((np.maximum.accumulate(values) - values).max())


def _triple(values: Array) -> tuple[float, float, float]:
    u, v, r = values.tolist()
    return u, v, r


def _rounded(values: tuple[float, float, float]) -> list[float]:
    return [round(value, 6) for value in values]
