"""The local plane against a geodesic library, and rotations by hand."""

import math

import pytest
from geographiclib.geodesic import Geodesic
from hypothesis import given
from hypothesis import strategies as st

from asvhil.geo import LocalFrame, body_to_ned, ned_to_body, wrap_2pi, wrap_rad


@given(lat=st.floats(-70, 70), lon=st.floats(-180, 180), distance=st.floats(0.1, 2000), bearing=st.floats(-180, 180))
def test_local_plane_agrees_with_the_geodesic(lat: float, lon: float, distance: float, bearing: float) -> None:
    there = Geodesic.WGS84.Direct(lat, lon, bearing, distance)
    n, e = LocalFrame(lat_deg=lat, lon_deg=lon).to_ned(there["lat2"], there["lon2"])
    # The plane ignores the convergence of meridians: distance^2 tan(lat) / 2R, 0.9 m at 2 km and 70 degrees.
    allowed = 0.002 + 0.6 * distance**2 * (1 + abs(math.tan(math.radians(lat)))) / 6.37e6
    assert (
        math.hypot(n - distance * math.cos(math.radians(bearing)), e - distance * math.sin(math.radians(bearing)))
        < allowed
    )


@given(lat=st.floats(-80, 80), lon=st.floats(-180, 179.999), n=st.floats(-5000, 5000), e=st.floats(-5000, 5000))
def test_there_and_back(lat: float, lon: float, n: float, e: float) -> None:
    frame = LocalFrame(lat_deg=lat, lon_deg=lon)
    assert frame.to_ned(*frame.to_geodetic(n, e)) == pytest.approx((n, e), abs=1e-6)


def test_the_antimeridian_is_crossed_the_short_way() -> None:
    n, e = LocalFrame(lat_deg=0.0, lon_deg=179.9999).to_ned(0.0, -179.9999)
    assert n == 0.0 and e == pytest.approx(22.26, abs=0.01)


@pytest.mark.parametrize(
    ("angle", "wrapped"), [(0.0, 0.0), (math.pi, -math.pi), (-math.pi, -math.pi), (7.0, 7.0 - 2 * math.pi)]
)
def test_wrap(angle: float, wrapped: float) -> None:
    assert wrap_rad(angle) == pytest.approx(wrapped)


@given(st.floats(-1e6, 1e6))
def test_wraps_stay_in_range(angle: float) -> None:
    assert -math.pi <= wrap_rad(angle) < math.pi
    assert 0.0 <= wrap_2pi(angle) < 2 * math.pi
    assert math.cos(wrap_rad(angle)) == pytest.approx(math.cos(angle), abs=1e-6)


def test_rotations_by_hand() -> None:
    assert body_to_ned(math.pi / 2, 1.0, 0.0) == pytest.approx((0.0, 1.0))  # heading east, forward is east
    assert body_to_ned(math.pi / 2, 0.0, 1.0) == pytest.approx((-1.0, 0.0))  # and starboard is south
    assert ned_to_body(0.3, *body_to_ned(0.3, 2.0, -1.0)) == pytest.approx((2.0, -1.0))
