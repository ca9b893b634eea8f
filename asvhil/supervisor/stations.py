"""Where a station is in the local plane: what commands and the config say in degrees, and how far off it may be."""

from __future__ import annotations

import math

from asvhil.config import StationConfig
from asvhil.geo import LocalFrame
from asvhil.types import Estimate, HoldCommand, Station

MAX_STATION_DISTANCE_M = 2000.0  # the local plane is good to a few centimetres within it


def station_of_config(at: StationConfig, frame: LocalFrame) -> Station:
    """The station that the config names."""
    n_m, e_m = frame.to_ned(at.lat_deg, at.lon_deg)
    return Station(n_m=n_m, e_m=e_m, psi_rad=math.radians(at.heading_deg))


def station_of_command(
    command: HoldCommand, otherwise: Estimate | Station, estimate: Estimate, frame: LocalFrame
) -> Station | str:
    """The station that is asked for, `otherwise` where nothing is said of it; or the reason why it is out of reach."""
    n_m, e_m = otherwise.n_m, otherwise.e_m
    if command.lat_deg is not None and command.lon_deg is not None:
        n_m, e_m = frame.to_ned(command.lat_deg, command.lon_deg)
    psi_rad = otherwise.psi_rad if command.psi_rad is None else command.psi_rad
    distance_m = math.hypot(n_m - estimate.n_m, e_m - estimate.e_m)
    if not distance_m <= MAX_STATION_DISTANCE_M:
        return f"station is {distance_m / 1000.0:.1f} km away, 2 km at most"
    return Station(n_m=n_m, e_m=e_m, psi_rad=psi_rad)
