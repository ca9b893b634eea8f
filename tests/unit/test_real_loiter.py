"""How a recorded LOITER is scored: from where the mode was entered, and by the row's heading."""

import math

import pytest

from bench.real_loiter import figures


def test_distances_are_from_where_the_mode_was_entered_and_headings_from_north() -> None:
    # 400 s at rest 1 m north of the first place, after 10 s there, the bow 30 degrees to starboard of north.
    metre_deg = 1.0 / 111_050.0
    samples = [(5.0 + 0.2 * k, 40.0 + (metre_deg if k >= 50 else 0.0), -86.0, math.radians(30.0)) for k in range(2000)]
    found = figures(samples)
    assert found["distance_m"]["mean"] == pytest.approx(1.0, rel=0.002)
    assert found["distance_m"]["std"] == pytest.approx(0.0, abs=1e-6)
    assert found["heading_deg"]["mean"] == pytest.approx(30.0)
    assert found["penalty_score"] == pytest.approx(31.0, rel=0.002)
