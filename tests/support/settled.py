"""How well a boat in lockstep keeps its station once it has settled."""

import math

import numpy as np

from asvhil.geo import LocalFrame, wrap_rad
from asvhil.simplant.lockstep import Lockstep

NO_BIAS = "plant.sensors.gnss.slow_bias_m=0"


def settled(loop: Lockstep, seconds: float, from_s: float) -> tuple[float, float, float]:
    """Mean distance (m), mean and std of the heading error (deg), of the truth against the configured station."""
    station = loop.config.supervisor.station
    assert station is not None
    n_m, e_m = LocalFrame(lat_deg=loop.config.plant.origin_lat_deg, lon_deg=loop.config.plant.origin_lon_deg).to_ned(
        station.lat_deg, station.lon_deg
    )
    distance, heading = [], []
    for tick in range(round(seconds * 20)):
        loop.tick()
        if tick / 20 >= from_s:
            truth = loop.plant.truth
            distance.append(math.hypot(truth.n_m - n_m, truth.e_m - e_m))
            heading.append(math.degrees(wrap_rad(truth.psi_rad - math.radians(station.heading_deg))))
    return float(np.mean(distance)), float(np.mean(heading)), float(np.std(heading))
