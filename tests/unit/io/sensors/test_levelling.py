"""Gravity out of a specific force, and into it."""

import math

import pytest

from asvhil.geo import GRAVITY_MPS2
from asvhil.io.sensors.levelling import FRESH_NS, Level, tilted

ANGLES = [(0.1, 0.0), (0.0, -0.2), (0.15, 0.1), (-0.3, 0.25)]


@pytest.mark.parametrize(("roll_rad", "pitch_rad"), ANGLES)
def test_what_a_tilted_sensor_shows_is_levelled_again(roll_rad: float, pitch_rad: float) -> None:
    level = Level()
    level.note(0, roll_rad, pitch_rad)
    shown = tilted(0.3, -0.2, roll_rad, pitch_rad)
    assert math.hypot(*shown[:2]) > 0.5, "gravity shows in it"
    assert level.force(0, *shown) == pytest.approx((0.3, -0.2))


def test_signs_are_those_of_the_boats_axes() -> None:
    assert tilted(0.0, 0.0, 0.0, 0.1)[0] > 0.0, (
        "bow up: the sensor is held up by the stern, as in an acceleration ahead"
    )
    assert tilted(0.0, 0.0, 0.1, 0.0)[1] < 0.0, "starboard down"
    assert tilted(0.0, 0.0, 0.0, 0.0) == (0.0, 0.0, -GRAVITY_MPS2)


def test_on_an_even_keel_the_numbers_stay_the_same_to_the_last_bit() -> None:
    level = Level()
    level.note(0, 0.0, 0.0)
    assert level.force(0, 0.1 + 0.2, -0.7, -GRAVITY_MPS2) == (0.1 + 0.2, -0.7)


def test_without_a_tilt_or_without_z_it_is_left_as_it_is() -> None:
    level = Level()
    assert level.force(0, 1.0, 0.5, -9.8) == (1.0, 0.5)
    level.note(0, math.nan, 0.1)
    assert level.force(0, 1.0, 0.5, -9.8) == (1.0, 0.5)
    level.note(0, 0.1, 0.1)
    assert level.force(0, 1.0, 0.5, 0.0) == (1.0, 0.5), "a bridge that leaves z out"


def test_a_list_stays_one_when_the_tilt_is_told_no_more() -> None:
    level = Level()
    for tick in range(1200):  # a list of 0.1 rad, and waves about it
        level.note(tick * 50_000_000, 0.1 + 0.05 * math.sin(0.1 * tick), 0.0)
    late_ns = 1199 * 50_000_000 + FRESH_NS + 1
    shown = tilted(0.0, 0.0, 0.1, 0.0)
    assert level.force(late_ns, *shown) == pytest.approx((0.0, 0.0), abs=0.05)
