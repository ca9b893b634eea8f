"""The earth's magnetic field against another program's figures for the same model (pygeomag 1.1 on WMM2025)."""

import pytest

from asvhil.simplant.boat.earth_field import earth_field_gauss

NT = 1e-5


@pytest.mark.parametrize(
    ("lat_deg", "lon_deg", "field_nt"),
    [
        (40.4237, -86.9212, (20024.57, -1584.35, 47999.69)),
        (-33.86, 151.21, (24024.25, 5461.10, -51383.04)),
        (60.0, 10.0, (15063.36, 1218.52, 49278.65)),
        (0.0, 0.0, (27433.52, -1866.82, -15999.75)),
        (79.0, -150.0, (4095.57, 596.41, 57327.52)),
    ],
)
def test_against_another_program(lat_deg: float, lon_deg: float, field_nt: tuple[float, float, float]) -> None:
    assert earth_field_gauss(lat_deg, lon_deg, 2026.0) == pytest.approx([part * NT for part in field_nt], abs=0.02 * NT)


def test_the_field_changes_with_the_years_and_the_poles_are_finite() -> None:
    assert earth_field_gauss(40.0, -87.0, 2025.0) != earth_field_gauss(40.0, -87.0, 2029.0)
    for lat_deg in (-90.0, 90.0):
        assert 0.5 < abs(earth_field_gauss(lat_deg, 0.0, 2026.0)[2]) < 0.7
