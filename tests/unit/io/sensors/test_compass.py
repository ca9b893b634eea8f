"""The deviation of a compass, and its inverse."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.config import load_config
from asvhil.config.estimator import STEEPEST_DEG
from asvhil.errors import ConfigError
from asvhil.geo import wrap_rad
from asvhil.io.sensors.compass import deviation_row, true_heading


def radians(*degrees: float) -> list[float]:
    return [math.radians(value) for value in degrees]


@pytest.mark.parametrize(("reading", "truth"), [(7.0, 0.0), (121.0, 120.0), (-181.0, -180.0)])
def test_by_hand(reading: float, truth: float) -> None:
    """A 3 and C 4: a boat to north reads 3 + 4 = 7, one to 120 reads 120 + 3 - 2, one to -180: -180 + 3 - 4."""
    assert math.degrees(true_heading(math.radians(reading), radians(3, 0, 4, 0, 0))) == pytest.approx(truth, abs=1e-9)


angles = st.floats(-math.pi, math.pi)


@given(angles, st.floats(-60.0, 60.0), angles, angles, st.floats(0.0, 1.0))
def test_every_deviation_that_the_config_takes_is_inverted(
    psi: float, a_deg: float, first: float, second: float, share: float
) -> None:
    """B and C of one amplitude, D and E of another: together as steep as may be."""
    one_deg, two_deg = share * STEEPEST_DEG, (1.0 - share) * STEEPEST_DEG / 2.0
    deviation = radians(
        a_deg,
        one_deg * math.cos(first),
        one_deg * math.sin(first),
        two_deg * math.cos(second),
        two_deg * math.sin(second),
    )
    reading = psi + sum(k * part for k, part in zip(deviation, deviation_row(psi), strict=True))
    assert abs(wrap_rad(true_heading(reading, deviation) - psi)) < 1e-9


def test_a_deviation_that_cannot_be_inverted_is_refused_in_one_line() -> None:
    with pytest.raises(ConfigError) as caught:
        load_config("sitl", ("estimator.ekf.compass.deviation_deg=[0, 40, 0, 10, 0]",))
    text = str(caught.value)
    assert "key estimator.ekf.compass: deviation_deg: sqrt(B^2 + C^2) + 2 sqrt(D^2 + E^2) is 60" in text
    assert "at most 50" in text and "\n" not in text
