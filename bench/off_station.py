"""How far the simulated boat really is from its station."""

from __future__ import annotations

import math

from asvhil.geo import LocalFrame, wrap_rad
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Station


def off_station(loop: Lockstep, station: Station, frame: LocalFrame) -> tuple[float, float]:
    """Distance (m) and heading error (deg, -180..180) of the true boat; the station is in `frame`, the backseat's."""
    truth = loop.plant.truth
    n_m, e_m = loop.plant.origin.to_ned(*frame.to_geodetic(station.n_m, station.e_m))
    off_rad = wrap_rad(truth.psi_rad - station.psi_rad)
    return math.hypot(truth.n_m - n_m, truth.e_m - e_m), math.degrees(off_rad)
