"""Geodetic coordinates to a local NED plane and back, angle wrapping, and rotations in the plane."""

from __future__ import annotations

import functools
import math

from asvhil.types import record

WGS84_A_M = 6378137.0
WGS84_E2 = 6.69437999014e-3
GRAVITY_MPS2 = 9.80665  # standard gravity
HALF_TURN, TURN = math.pi, 2.0 * math.pi


def wrap_rad(angle_rad: float) -> float:
    """The angle (rad) in [-pi, pi)."""
    return (angle_rad + HALF_TURN) % TURN - HALF_TURN


def wrap_2pi(angle_rad: float) -> float:
    """The angle (rad) in [0, 2 pi)."""
    wrapped = angle_rad % TURN
    return 0.0 if wrapped >= TURN else wrapped


def body_to_ned(psi_rad: float, x: float, y: float) -> tuple[float, float]:
    """A vector in body axes (forward, starboard) as (north, east): R(psi), Fossen (2011), eq. 2.65 in the plane."""
    c, s = math.cos(psi_rad), math.sin(psi_rad)
    return c * x - s * y, s * x + c * y


def ned_to_body(psi_rad: float, n: float, e: float) -> tuple[float, float]:
    """A vector (north, east) in body axes (forward, starboard): R(psi)^T, the inverse of `body_to_ned`."""
    c, s = math.cos(psi_rad), math.sin(psi_rad)
    return c * n + s * e, -s * n + c * e


def is_place(lat_deg: float, lon_deg: float) -> bool:
    """Whether latitude and longitude (degrees) are a position. 0, 0 is not: many receivers send it without a fix."""
    return abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0 and (lat_deg != 0.0 or lon_deg != 0.0)  # False for NaN


@functools.lru_cache(maxsize=8)  # a boat has one origin, or two with that of its simulation
def _metres_per_degree(lat_deg: float) -> tuple[float, float]:
    """Of latitude and of longitude, at a latitude."""
    s2 = math.sin(math.radians(lat_deg)) ** 2
    w = math.sqrt(1.0 - WGS84_E2 * s2)
    meridian_m = WGS84_A_M * (1.0 - WGS84_E2) / w**3
    prime_vertical_m = WGS84_A_M / w
    return math.radians(meridian_m), math.radians(prime_vertical_m * math.cos(math.radians(lat_deg)))


@record
class LocalFrame:
    """A plane tangent to the WGS 84 ellipsoid at an origin in degrees; within 2 km its error is a few centimetres.

    Degrees become metres by the radii of curvature in the meridian and in the prime vertical at the origin.
    """

    lat_deg: float
    lon_deg: float

    def to_ned(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """(north, east) in metres of a position in degrees, also across the antimeridian."""
        n_per_deg, e_per_deg = _metres_per_degree(self.lat_deg)
        dlon_deg = (lon_deg - self.lon_deg + 180.0) % 360.0 - 180.0
        return (lat_deg - self.lat_deg) * n_per_deg, dlon_deg * e_per_deg

    def to_geodetic(self, n_m: float, e_m: float) -> tuple[float, float]:
        """(latitude, longitude) in degrees of (north, east) in metres; the inverse of `to_ned`."""
        n_per_deg, e_per_deg = _metres_per_degree(self.lat_deg)
        lon_deg = self.lon_deg + e_m / e_per_deg
        return self.lat_deg + n_m / n_per_deg, (lon_deg + 180.0) % 360.0 - 180.0
