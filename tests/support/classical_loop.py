"""A short closed loop of a controller against the simulated boat."""

import math

from asvhil.config import load_config
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Phase


def distance_after(name: str, seconds: float, *overrides: str) -> float:
    """The greatest distance (m) of the true boat from the station in the 5 s after a time, in 3 m/s from astern."""
    fixed = ("plant.sensors.gnss.slow_bias_m=0", "plant.weather.wind.speed_mps=3", "plant.weather.wind.toward_deg=0")
    loop = Lockstep(load_config("sitl", (f"controller.name={name}", *fixed, *overrides)))
    farthest_m = 0.0
    for tick in range(round((seconds + 5.0) * 20)):
        _, outputs = loop.tick()
        if tick >= seconds * 20:
            assert outputs.phase is Phase.HOLD
            farthest_m = max(farthest_m, math.hypot(loop.plant.truth.n_m, loop.plant.truth.e_m))
    return farthest_m
