"""Where a station is in the local plane: what commands and the config say in degrees, and how far off it may be."""

from __future__ import annotations

import math

from asvhil.config import StationConfig
from asvhil.geo import LocalFrame, body_to_ned, wrap_rad
from asvhil.supervisor.heading_policy import LEAST_CHANGE_RAD
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.types import Estimate, HoldCommand, MoveCommand, Station, changed

LEAP_M = 0.5  # from one sample to the next: less, and a station that moves has moved on its course
TURN_M = 0.05  # less, and the boat's origin goes round a point of it while the station's heading turns
MAX_STATION_DISTANCE_M = 2000.0  # the local plane is good to a few centimetres within it
# What sets how far off a station may be.
UNLESS_NAMED, BY_COMMAND = "unless the hold command names more", "by the hold command"


def station_of_config(at: StationConfig, frame: LocalFrame) -> Station:
    """The station that the config names."""
    n_m, e_m = frame.to_ned(at.lat_deg, at.lon_deg)
    return Station(n_m=n_m, e_m=e_m, psi_rad=math.radians(at.heading_deg))


def place_of_point(estimate: Estimate, point_m: tuple[float, float]) -> Estimate:
    """The estimate with the place of a point of the boat (forward, to starboard) for that of its origin."""
    if point_m == (0.0, 0.0):
        return estimate
    n_m, e_m = body_to_ned(estimate.psi_rad, *point_m)
    return changed(estimate, n_m=estimate.n_m + n_m, e_m=estimate.e_m + e_m)


def station_of_origin(station: Station, point_m: tuple[float, float]) -> Station:
    """The station of the boat's origin at which a point of the boat (forward, to starboard) is at a station."""
    if point_m == (0.0, 0.0):
        return station
    n_m, e_m = body_to_ned(station.psi_rad, *point_m)
    # The point is there at this heading alone, so that it may not be as light a matter as the weather's heading is.
    return changed(station, n_m=station.n_m - n_m, e_m=station.e_m - e_m, of_weather=False)


def station_of_point(station: Station, point_m: tuple[float, float]) -> Station:
    """The inverse of `station_of_origin`."""
    return station_of_origin(station, (-point_m[0], -point_m[1]))


def station_of_hold(command: HoldCommand, estimate: Estimate, frame: LocalFrame) -> Station:
    """The station that is asked for; what the command leaves open is as the boat is now."""
    n_m, e_m = estimate.n_m, estimate.e_m
    if command.lat_deg is not None and command.lon_deg is not None:
        n_m, e_m = frame.to_ned(command.lat_deg, command.lon_deg)
    return Station(n_m=n_m, e_m=e_m, psi_rad=estimate.psi_rad if command.psi_rad is None else command.psi_rad)


def station_of_move(command: MoveCommand, held: Station, frame: LocalFrame) -> Station:
    """The station that is held, moved as asked for."""
    n_m, e_m = held.n_m, held.e_m
    if command.lat_deg is not None or command.lon_deg is not None:
        lat_deg, lon_deg = frame.to_geodetic(n_m, e_m)
        lat_deg = lat_deg if command.lat_deg is None else command.lat_deg
        lon_deg = lon_deg if command.lon_deg is None else command.lon_deg
        n_m, e_m = frame.to_ned(lat_deg, lon_deg)
    return Station(
        n_m=n_m if command.n_m is None else command.n_m,
        e_m=e_m if command.e_m is None else command.e_m,
        psi_rad=held.psi_rad if command.psi_rad is None else command.psi_rad,
        of_weather=held.of_weather and command.psi_rad is None,
    )


def too_far(station: Station, estimate: Estimate, most_m: float, named_m: float = 0.0) -> Explanation | None:
    """Why a station is out of reach, or farther than it may be; None where neither.

    That is `most_m`, or as far as `named_m`, by which somebody has said how far off he means it to be; 0: nobody has.
    """
    distance_m = math.hypot(station.n_m - estimate.n_m, station.e_m - estimate.e_m)
    named = named_m > most_m  # a NaN is not
    limit = f"{named_m if named else most_m:.0f} m {BY_COMMAND if named else UNLESS_NAMED}"
    if not distance_m <= MAX_STATION_DISTANCE_M:
        limits = f"{MAX_STATION_DISTANCE_M / 1000.0:.0f} km at most" + ("" if named else f", and {limit}")
        return explain(Reason.STATION_TOO_FAR, distance_km=distance_m / 1000.0, limits=limits)
    if distance_m > (named_m if named else most_m):
        return explain(Reason.STATION_UNCONFIRMED, metres=distance_m, limit=limit)
    return None


def has_leapt(station: Station, before: Station) -> bool:
    """Whether a station is elsewhere than in the last tick, and has not just moved on its course or about its point."""
    if station is before:
        return False
    most_m = LEAP_M if station.moves or before.moves else TURN_M
    return math.hypot(station.n_m - before.n_m, station.e_m - before.e_m) > most_m


def is_another(station: Station, before: Station) -> bool:
    """Whether a station has been moved, or given another heading, and has not just turned a little with the weather or
    moved on its course.
    """
    return has_leapt(station, before) or is_turned(station, before)


def is_turned(station: Station, before: Station) -> bool:
    """Whether a station has been given another heading, by more than it turns with the weather in a sample."""
    return station is not before and abs(wrap_rad(station.psi_rad - before.psi_rad)) > LEAST_CHANGE_RAD
